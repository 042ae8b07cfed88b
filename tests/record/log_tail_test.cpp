#include "record/log_tail.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <fstream>

#include "record/event_log.h"
#include "record/log_lines.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

using testing::log_line;
using testing::start_line;

std::string loss_line(int64_t iteration, double loss = 0) {
  events::Step step;
  step.iteration = iteration;
  step.loss = loss;
  return log_line(step);
}

// A log, one who follows it, and what that one knows.
struct Followed {
  void write(const std::string& text, std::ios::openmode mode = std::ios::app) {
    std::ofstream(path, mode | std::ios::binary) << text;
  }
  // "new step 1, step 2": what came, "new" where it was all anew.
  std::string next() {
    const LogTail::News news = tail.next();
    if (news.anew) known.clear();
    std::string text = news.anew ? "new" : "";
    for (const LoggedEvent& e : news.events) {
      known.push_back(e.line);
      text += (text.empty() ? "" : " ") + e.kind + " " + std::to_string(e.iteration);
    }
    return text;
  }

  TempFolder folder;
  std::filesystem::path path = folder / "log.jsonl";
  LogTail tail{path};
  std::vector<std::string> known;
};

TEST(LogTail, TellsWhatCameSince) {
  Followed log;
  EXPECT_EQ(log.next(), "");
  log.write(start_line(0) + loss_line(1));
  EXPECT_EQ(log.next(), "new started 0 step 1");
  EXPECT_EQ(log.next(), "");
  log.write(loss_line(2) + loss_line(3));
  EXPECT_EQ(log.next(), "step 2 step 3");
}

TEST(LogTail, ALineIsToldWhenItIsWhole) {
  Followed log;
  const std::string line = loss_line(2);
  log.write(loss_line(1) + line.substr(0, 20));
  EXPECT_EQ(log.next(), "new step 1");
  log.write(line.substr(20, line.size() - 21));
  EXPECT_EQ(log.next(), "") << "all but its end is there";
  log.write("\n");
  EXPECT_EQ(log.next(), "step 2");
}

TEST(LogTail, AResumedRunIsToldAnew) {
  Followed log;
  log.write(start_line(0) + loss_line(1) + loss_line(2) + loss_line(3));
  log.next();
  log.write(start_line(2) + loss_line(3));
  EXPECT_EQ(log.next(), "new started 0 step 1 step 2 started 2 step 3");
  log.write(loss_line(4));
  EXPECT_EQ(log.next(), "step 4");
  // Its start is damaged: the steps tell.
  log.write("{\"event\":\"star\n" + loss_line(4, 0.5));
  EXPECT_EQ(log.next(), "new started 0 step 1 step 2 started 2 step 3 step 4");
}

TEST(LogTail, AnotherFileIsToldAnew) {
  Followed log;
  log.write(loss_line(1) + loss_line(2) + loss_line(3));
  log.next();
  log.write(loss_line(1), std::ios::trunc);
  EXPECT_EQ(log.next(), "new step 1") << "shorter";
  log.write(loss_line(1, 0.25) + loss_line(2), std::ios::trunc);
  EXPECT_EQ(log.next(), "new step 1 step 2") << "longer, and no continuation";
  log.write("", std::ios::trunc);
  EXPECT_EQ(log.next(), "new") << "empty";
}

TEST(LogTail, AFileThatWasAwayGoesOn) {
  Followed log;
  log.write(loss_line(1));
  log.next();
  std::filesystem::rename(log.path, log.folder / "away");
  EXPECT_EQ(log.next(), "");
  std::filesystem::rename(log.folder / "away", log.path);
  log.write(loss_line(2));
  EXPECT_EQ(log.next(), "step 2");
}

TEST(LogTail, DamagedLinesAreLeftOut) {
  Followed log;
  log.write(loss_line(1));
  log.next();
  log.write("\n[]\n\xff\n" + std::string(2000, '[') + "\n" + loss_line(2));
  EXPECT_EQ(log.next(), "step 2");
}

TEST(LogTail, ALineThatIsTooLongIsPassedOver) {
  Followed log;
  log.write(loss_line(1) + std::string(size_t{2} << 20, '['));
  EXPECT_EQ(log.next(), "new step 1");
  log.write(std::string(size_t{1} << 20, '[') + "\n" + loss_line(2));
  EXPECT_EQ(log.next(), "step 2");
  log.write(loss_line(3));
  EXPECT_EQ(log.next(), "step 3");
}

// A hole: it takes no room on the disk.
TEST(LogTail, ALogWithoutEndIsReadToALimit) {
  Followed log;
  log.write(loss_line(1));
  std::filesystem::resize_file(log.path, uintmax_t{100} << 30);
  EXPECT_EQ(log.next(), "new step 1");
  log.write("\n" + loss_line(2));
  EXPECT_EQ(log.next(), "");
}

// In whatever pieces a log is written and read, at its end as much is known as of the whole file.
RC_GTEST_PROP(LogTail, knows_what_read_log_knows, ()) {
  std::string text = start_line(0);
  int64_t at = 0;
  for (int session = *rc::gen::inRange(0, 4); session >= 0; --session) {
    const int64_t stop = at + *rc::gen::inRange(0, 12);
    for (int64_t i = at + 1; i <= stop; ++i) text += loss_line(i, static_cast<double>(session));
    at = *rc::gen::inRange<int64_t>(at, stop + 1);
    if (session > 0) text += start_line(at);
  }
  Followed log;
  for (size_t done = 0; done < text.size();) {
    const auto piece = static_cast<size_t>(*rc::gen::inRange(1, 2000));
    log.write(text.substr(done, piece));
    done += piece;
    log.next();
  }
  RC_ASSERT(log.known == lines_of(read_log(log.path)));
}

}  // namespace
}  // namespace traceflow
