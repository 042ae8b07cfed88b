#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>

#include "cli/malformed_cases.h"
#include "cli/program_call.h"
#include "cli/terminal/error_boundary.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"

namespace traceflow::cli {
namespace {

namespace fs = std::filesystem;

std::vector<MalformedKind> all_kinds() {
  return {malformed_json(),   malformed_colmap(),   malformed_transforms(), malformed_camera_lists(),
          malformed_arrays(), malformed_plys(),     malformed_spzs(),       malformed_checkpoints(),
          malformed_images(), malformed_archives(), malformed_options(),    malformed_folders()};
}

// A folder that the program is run in.
class Workplace {
 public:
  explicit Workplace(const MalformedCase& wrong) : before_(fs::current_path()) {
    Files files = good_files();
    wrong.spoil(files);
    for (const auto& [name, bytes] : files) {
      fs::create_directories((folder_ / name).parent_path());
      write_bytes(folder_ / name, bytes);
    }
    if (wrong.arrange) wrong.arrange(folder_.path());
    fs::current_path(folder_.path());
  }
  ~Workplace() { fs::current_path(before_); }
  Workplace(const Workplace&) = delete;
  Workplace& operator=(const Workplace&) = delete;

  // What lies there: bytes by path; of what are no files, the path.
  Files content() const {
    Files found;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(folder_.path())) {
      std::error_code error;
      found[entry.path().string()] = entry.is_regular_file(error) ? bytes_of(entry.path()) : "";
    }
    return found;
  }
  // The folder's own name left out.
  std::string without_folder(std::string text) const {
    const std::string name = folder_.path().string() + "/";
    for (size_t at = text.find(name); at != std::string::npos; at = text.find(name, at))
      text.erase(at, name.size());
    return text;
  }

 private:
  TempFolder folder_;
  fs::path before_;
};

TEST(Malformed, InputIsOneLineThatNamesWhatIsWrongAndNothingIsWritten) {
  for (const MalformedKind& kind : all_kinds()) {
    for (const MalformedCase& wrong : kind.cases) {
      SCOPED_TRACE(kind.title + ": " + wrong.what);
      const Workplace workplace(wrong);
      const Files before = workplace.content();
      const Outcome outcome = run_with(wrong.command);
      EXPECT_EQ(outcome.code, exit_input);
      EXPECT_EQ(outcome.out, "");
      EXPECT_EQ(workplace.without_folder(outcome.err), "traceflow: " + wrong.line + "\n");
      EXPECT_EQ(std::count(outcome.err.begin(), outcome.err.end(), '\n'), 1);
      EXPECT_TRUE(workplace.content() == before) << "something was written";
    }
  }
}

// Without what is spoilt, all of it runs: else a case could be about something else.
TEST(Malformed, WhatIsSpoiltWasGood) {
  const Workplace workplace({"", {}, [](Files&) {}, ""});
  for (const std::vector<std::string>& command : std::vector<std::vector<std::string>>{
           {"inspect", "-d", "capture"},
           {"inspect", "-d", "colmap"},
           {"inspect", "-d", "transforms"},
           {"trace", "scene.ply", "--rays", "rays.npy", "-o", "out"},
           {"render", "scene.ply", "--cameras", "cameras.json", "-o", "pictures"},
           {"export", "run", "-o", "exported"}}) {
    EXPECT_EQ(run_with(command).code, exit_done) << command[0];
  }
}

// A cell of a table in markdown.
std::string cell(std::string text) {
  for (size_t at = text.find('|'); at != std::string::npos; at = text.find('|', at + 2))
    text.insert(at, "\\");
  return text;
}

std::string page() {
  size_t count = 0;
  std::string tables;
  for (const MalformedKind& kind : all_kinds()) {
    tables += "\n## " + kind.title + "\n\n| input | message |\n|---|---|\n";
    for (const MalformedCase& wrong : kind.cases)
      tables += "| " + wrong.what + " | `" + cell(wrong.line) + "` |\n";
    count += kind.cases.size();
  }
  return "# Input that cannot be used\n\nWritten by `tests/cli/malformed_test.cpp`; do not edit.\n\n"
         "Bad input ends the program with exit code 2 and one line after `traceflow: `. The line names the "
         "file and the\nfield, what was found and what was expected. Nothing has been written. The tests "
         "compare "
         "these " +
         std::to_string(count) + " lines\nexactly. [Fuzzing](testing.md#fuzzing) covers arbitrary bytes.\n" +
         tables;
}

TEST(Malformed, ThePageIsOfTheseCases) {
  const fs::path path = TRACEFLOW_SOURCE_FOLDER "/docs/malformed.md";
  // NOLINTNEXTLINE(concurrency-mt-unsafe): nobody writes there
  if (std::getenv("TRACEFLOW_WRITE_PAGES") != nullptr) std::ofstream(path) << page();
  EXPECT_EQ(bytes_of(path), page())
      << "run: TRACEFLOW_WRITE_PAGES=1 build/release/test_cli --gtest_filter=Malformed.ThePage*";
}

}  // namespace
}  // namespace traceflow::cli
