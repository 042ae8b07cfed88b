#include "viz/video.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdlib>
#include <thread>

#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow::viz {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

// Begins the film at once, under the name that it is given last, and has it whole at the end of its input.
constexpr const char* fake_ffmpeg = R"sh(#!/bin/sh
for film; do :; done
printf half > "$film"
cat > /dev/null
[ ! -e "${0%/*}/fails" ] || exit 1
printf whole > "$film"
)sh";

class VideoTest : public testing::Test {
 protected:
  // NOLINTBEGIN(concurrency-mt-unsafe): one thread reads and writes the environment
  VideoTest() : path_(std::getenv("PATH")) {
    write_bytes(programs_ / "ffmpeg", fake_ffmpeg);
    fs::permissions(programs_ / "ffmpeg", fs::perms::owner_all);
    ::setenv("PATH", (programs_.path().string() + ":" + path_).c_str(), 1);
    write_bytes(film_, "old");
  }
  ~VideoTest() override { ::setenv("PATH", path_.c_str(), 1); }
  // NOLINTEND(concurrency-mt-unsafe)

  // A film to which ffmpeg has begun to write.
  void begin(Video& video) const {
    video.add(Tensor<uint8_t>(Shape{2, 2, 3}));
    for (int i = 0; i < 10'000 && bytes_of(partial_) != "half"; ++i)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  void expect_alone(const std::string& bytes) const {
    EXPECT_EQ(bytes_of(film_), bytes);
    EXPECT_EQ(std::distance(fs::directory_iterator(folder_.path()), fs::directory_iterator()), 1);
  }

  TempFolder folder_, programs_;
  fs::path film_ = folder_ / "film.mp4";
  fs::path partial_ = folder_ / "film.mp4.partial.mp4";

 private:
  std::string path_;
};

TEST_F(VideoTest, TakesTheOldOnesPlaceWhenItIsWhole) {
  Video video(film_, 30);
  begin(video);
  EXPECT_EQ(bytes_of(film_), "old");
  video.finish();
  expect_alone("whole");
}

TEST_F(VideoTest, OneThatIsNotFinishedLeavesTheOldOne) {
  {
    Video video(film_, 30);
    begin(video);
  }
  expect_alone("old");
}

TEST_F(VideoTest, OneThatFfmpegCannotWriteLeavesTheOldOne) {
  write_bytes(programs_ / "fails", "");
  {
    Video video(film_, 30);
    begin(video);
    EXPECT_THAT(refusal_of([&] { video.finish(); }), HasSubstr("film.mp4: ffmpeg: found an error"));
  }
  expect_alone("old");
}

TEST_F(VideoTest, TwoAtOnceAreNotMixed) {
  Video first(film_, 30), second(film_, 30);
  begin(first);
  EXPECT_THAT(refusal_of([&] {
                second.add(Tensor<uint8_t>(Shape{2, 2, 3}));
              }),
              HasSubstr("film.mp4: found another program that writes it"));
  first.finish();
  expect_alone("whole");
}

}  // namespace
}  // namespace traceflow::viz
