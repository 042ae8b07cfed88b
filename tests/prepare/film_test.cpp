#include "prepare/film.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <cstdlib>

#include "base/error.h"
#include "base/process.h"
#include "files/png.h"
#include "prepare/frames.h"
#include "prepare/picture_source.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

// What ffmpeg itself makes of films and photographs, where it is installed.
namespace traceflow::prepare {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;

class FilmTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!is_in_path("ffmpeg")) GTEST_SKIP() << "films need ffmpeg";
  }

  // A film or picture of this name by ffmpeg's own sources and filters: "red=s=64x48:r=30" and what follows.
  fs::path make(const std::string& name, const std::string& source,
                const std::vector<std::string>& more = {}) {
    std::vector<std::string> words{"ffmpeg", "-nostdin", "-loglevel", "error", "-f", "lavfi", "-i", source};
    words.insert(words.end(), more.begin(), more.end());
    words.push_back(folder_ / name);
    const Descriptor log = open_log(folder_ / "make.log");
    EXPECT_TRUE(Process(words, {.error = log.number()}).wait()) << bytes_of(folder_ / "make.log");
    return folder_ / name;
  }

  struct Decoded {
    std::vector<double> times;
    std::vector<Tensor<uint8_t>> pictures;
  };
  Decoded decode(const fs::path& path, int longest_side = 0) {
    Decoded decoded;
    decoded.times = decode_film({path, longest_side}, folder_ / "ffmpeg.log", never_,
                                [&](int64_t, Tensor<uint8_t>&& picture) {
                                  decoded.pictures.push_back(std::move(picture));
                                  return true;
                                });
    return decoded;
  }

  TempFolder folder_;
  const std::atomic<bool> never_ = false;
};

// A picture that is red on the left and blue on the right.
constexpr const char* red_and_blue =
    "color=red:s=32x48:r=10:d=1[a];color=blue:s=32x48:r=10:d=1[b];[a][b]hstack";

char colour_at(const Tensor<uint8_t>& picture, int64_t y, int64_t x) {
  if (picture(y, x, 0) > 150 && picture(y, x, 2) < 100) return 'r';
  return picture(y, x, 2) > 150 && picture(y, x, 0) < 100 ? 'b' : '?';
}

TEST_F(FilmTest, PicturesComeWithTheirTimesAndColours) {
  const Decoded film = decode(make("film.mkv", red_and_blue, {"-c:v", "ffv1"}));
  ASSERT_EQ(film.pictures.size(), 10U);
  EXPECT_EQ(film.pictures[3].shape(), (Shape{48, 64, 3}));
  EXPECT_EQ(colour_at(film.pictures[3], 20, 10), 'r');
  EXPECT_EQ(colour_at(film.pictures[3], 20, 50), 'b');
  for (size_t i = 0; i < film.times.size(); ++i)
    EXPECT_NEAR(film.times[i], 0.1 * static_cast<double>(i), 1e-9);
}

TEST_F(FilmTest, LargerPicturesAreScaledDownAndSmallerOnesLeft) {
  const fs::path film = make("film.mkv", red_and_blue, {"-c:v", "ffv1"});
  EXPECT_EQ(decode(film, 32).pictures.front().shape(), (Shape{24, 32, 3}));
  EXPECT_EQ(decode(film, 500).pictures.front().shape(), (Shape{48, 64, 3}));
}

TEST_F(FilmTest, PixelsThatAreNotSquareBecomeSo) {
  const fs::path film = make("film.mkv", red_and_blue, {"-vf", "setsar=2/1", "-c:v", "ffv1"});
  EXPECT_EQ(decode(film).pictures.front().shape(), (Shape{48, 128, 3}));
  EXPECT_EQ(decode(film, 64).pictures.front().shape(), (Shape{24, 64, 3}));
}

// Past a thousand seconds showinfo's own seconds have two digits after the point.
TEST_F(FilmTest, TimesAreExactLateInALongFilm) {
  const fs::path film =
      make("film.mkv", "color=red:s=32x32:r=30:d=1",
           {"-vf", "settb=1/90000,setpts=PTS+20000/TB", "-enc_time_base", "1/90000", "-c:v", "ffv1"});
  const Decoded decoded = decode(film);
  ASSERT_EQ(decoded.times.size(), 30U);
  for (size_t i = 1; i < decoded.times.size(); ++i)
    EXPECT_NEAR(decoded.times[i] - decoded.times[0], static_cast<double>(i) / 30, 0.0011);
}

TEST_F(FilmTest, TimesAreThePicturesOwnWhereTheRateChanges) {
  const fs::path film = make("film.mkv", "color=red:s=32x32:r=10:d=1",
                             {"-vf", "settb=1/1000,setpts='if(lt(N,5),N*100,500+(N-5)*400)'", "-fps_mode",
                              "passthrough", "-enc_time_base", "1/1000", "-c:v", "ffv1"});
  const std::vector<double> times = decode(film).times;
  ASSERT_EQ(times.size(), 10U);
  EXPECT_NEAR(times[4] - times[0], 0.4, 1e-6);
  EXPECT_NEAR(times[9] - times[5], 1.6, 1e-6);
}

// As a telephone held upright writes it: the pictures lie, and the track's matrix turns them.
TEST_F(FilmTest, AFilmThatIsToBeTurnedIs) {
  const fs::path film = make("film.mp4", red_and_blue, {"-c:v", "mpeg4", "-q:v", "2"});
  std::string bytes = bytes_of(film);
  const size_t matrix = bytes.find("tkhd") + 44;
  ASSERT_LT(matrix + 36, bytes.size());
  const std::array<uint32_t, 9> quarter_turn{0, 0x10000, 0, 0xffff0000, 0, 0, 48U << 16, 0, 0x40000000};
  for (size_t i = 0; i < quarter_turn.size(); ++i) {
    for (size_t byte = 0; byte < 4; ++byte)
      bytes[matrix + 4 * i + byte] = static_cast<char>(quarter_turn[i] >> (24 - 8 * byte));
  }
  write_bytes(film, bytes);
  const Tensor<uint8_t> picture = decode(film).pictures.front();
  ASSERT_EQ(picture.shape(), (Shape{64, 48, 3}));
  EXPECT_EQ(colour_at(picture, 10, 24), 'r');
  EXPECT_EQ(colour_at(picture, 54, 24), 'b');
}

// Orientation 6 of EXIF: to be turned a quarter to the right.
TEST_F(FilmTest, APhotographThatIsToBeTurnedIs) {
  const fs::path photo =
      make("photo.jpg", red_and_blue, {"-frames:v", "1", "-q:v", "2", "-pix_fmt", "yuvj444p"});
  const std::string turned(
      "\xff\xe1\x00\x22"
      "Exif\0\0MM\0\x2a\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x06\0\0\0\0\0\0",
      36);
  std::string bytes = bytes_of(photo);
  write_bytes(photo, bytes.insert(2, turned));
  const Tensor<uint8_t> picture = decode_picture({photo}, folder_ / "ffmpeg.log", never_);
  ASSERT_EQ(picture.shape(), (Shape{64, 48, 3}));
  EXPECT_EQ(colour_at(picture, 10, 24), 'r');
  EXPECT_EQ(colour_at(picture, 54, 24), 'b');
}

TEST_F(FilmTest, WhatIsNoFilmIsRefusedInFfmpegsWords) {
  write_bytes(folder_ / "film.mp4", "not a film");
  EXPECT_THAT(
      refusal_of([&] { decode(folder_ / "film.mp4"); }),
      testing::AllOf(HasSubstr("film.mp4: found what ffmpeg cannot read"), HasSubstr("Invalid data")));
}

TEST_F(FilmTest, AFoldersPicturesAreTakenInTheOrderOfTheirNames) {
  make("p%d.png", "color=red:s=32x32:r=12:d=1", {"-start_number", "1"});
  PrepareOptions options;
  const Frames frames =
      take_frames(folder_.path(), options, folder_ / "frames", folder_ / "ffmpeg.log", never_);
  ASSERT_EQ(frames.frames.size(), 12U);
  EXPECT_EQ(frames.frames[9].source, "p10.png");
  EXPECT_EQ(frames.frames[9].time, 9);
  EXPECT_FALSE(frames.frames[9].is_of_film());
  EXPECT_EQ(read_png_size(folder_ / "frames/000009.png").width, 32);
  make("p10.png", "color=red:s=32x40:r=12", {"-frames:v", "1", "-y"});
  EXPECT_THAT(refusal_of([&] {
                take_frames(folder_.path(), options, folder_ / "frames", folder_ / "ffmpeg.log", never_);
              }),
              HasSubstr("p10.png: size: found 32×40, expected 32×32 as the first"));
}

// ffmpeg would take p%d.png for the first of p0.png, p1.png and so on.
TEST_F(FilmTest, APictureWhoseNameIsAPatternIsTakenForItself) {
  const fs::path stills = folder_ / "stills";
  fs::create_directory(stills);
  fs::rename(make("red.png", "color=red:s=32x32", {"-frames:v", "1"}), stills / "p%d.png");
  fs::rename(make("blue.png", "color=blue:s=32x32", {"-frames:v", "1"}), stills / "p1.png");
  const PictureSource source(stills, 0, folder_ / "ffmpeg.log", never_);
  const std::vector<std::string> names = source.names();
  ASSERT_THAT(names, testing::UnorderedElementsAre("p%d.png", "p1.png"));
  std::vector<char> colours;
  source.take_all(false, [&](int64_t place, Tensor<uint8_t>&& picture) {
    EXPECT_EQ(colour_at(picture, 16, 16), names[static_cast<size_t>(place)] == "p%d.png" ? 'r' : 'b');
    colours.push_back(colour_at(picture, 16, 16));
  });
  EXPECT_THAT(colours, testing::UnorderedElementsAre('r', 'b'));
}

TEST_F(FilmTest, OfASourceThePicturesThatAreAskedForAreTaken) {
  const fs::path film = make("film.mkv", red_and_blue, {"-c:v", "ffv1"});
  const PictureSource source(film, 0, folder_ / "ffmpeg.log", never_);
  EXPECT_EQ(source.count(), 10);
  std::vector<int64_t> places;
  source.take_some(true, {2, 3, 7}, [&](int64_t place, Tensor<uint8_t>&& picture) {
    places.push_back(place);
    EXPECT_EQ(picture.shape(), (Shape{48, 64, 1}));
  });
  EXPECT_THAT(places, ElementsAre(0, 1, 2));
  EXPECT_THROW(source.take_some(true, {2, 10}, [](int64_t, Tensor<uint8_t>&&) {}), InputError);
}

}  // namespace
}  // namespace traceflow::prepare
