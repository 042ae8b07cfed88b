#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <sstream>

#include "base/option_fields.h"
#include "capture/synth/synth.h"
#include "cli/program_call.h"
#include "cli/terminal/error_boundary.h"
#include "ops/trace/trace.h"
#include "prepare/attach_priors.h"
#include "prepare/options.h"
#include "support/file_bytes.h"
#include "train/options.h"

namespace traceflow::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

using Values = std::map<std::string, std::string>;  // by flag

std::string help_of(const std::string& verb) { return run_with({verb, "--help"}).out; }

std::string flag_of(const OptionField& field) {
  std::string flag = "--" + field.name();
  std::replace(flag.begin(), flag.end(), '_', '-');
  return flag;
}

template <class Options>
Values defaults_of(Options options) {
  Values values;
  for (const OptionField& field : option_fields(options)) values[flag_of(field)] = option_text(field.get());
  return values;
}

// Blanks and backticks around the parts left out.
std::vector<std::string> split(const std::string& text, char by) {
  std::vector<std::string> parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, by);) {
    const size_t first = part.find_first_not_of(" `"), last = part.find_last_not_of(" `");
    parts.push_back(first == std::string::npos ? "" : part.substr(first, last + 1 - first));
  }
  return parts;
}

// The flags of a page's table, with the second column: "| `--width`, `--height` | 240, 135 | …".
Values table_of(const std::string& page) {
  std::istringstream lines(bytes_of(std::string(TRACEFLOW_SOURCE_FOLDER "/docs/") + page));
  Values values;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("| `--")) continue;
    const std::vector<std::string> cells = split(line.substr(1), '|');
    const std::vector<std::string> flags = split(cells.at(0), ','), second = split(cells.at(1), ',');
    for (size_t i = 0; i < flags.size(); ++i) values[flags[i]] = i < second.size() ? second[i] : "";
  }
  return values;
}

// Of an option whose lines in the help are looked for, its own.
std::string entry_of(const std::string& help, const std::string& flag) {
  const size_t at = help.find("  " + flag + " ");
  return at == std::string::npos ? "" : help.substr(at, help.find("\n  -", at) - at);
}

TEST(Help, MarksWhatIsRequired) {
  for (const auto& [verb, option] :
       std::vector<std::pair<std::string, std::string>>{{"train", "-o,--output RUN REQUIRED"},
                                                        {"inspect", "-d,--data CAPTURE REQUIRED"},
                                                        {"prepare", "-o,--output CAPTURE REQUIRED"},
                                                        {"prepare", "INPUT TEXT REQUIRED"},
                                                        {"attach-priors", "-d,--data CAPTURE REQUIRED"},
                                                        {"trace", "--rays TEXT REQUIRED"},
                                                        {"export", "-o,--output TEXT REQUIRED"}}) {
    EXPECT_THAT(help_of(verb), HasSubstr("  " + option)) << verb;
  }
  EXPECT_THAT(entry_of(help_of("train"), "-d,--data"), Not(HasSubstr("REQUIRED")));
}

TEST(Help, ShowsWhatIsTakenElseAndItsUnit) {
  const auto expect_defaults = [](const std::string& verb, std::vector<OptionField> fields) {
    const std::string help = help_of(verb);
    for (const OptionField& field : fields) {
      const std::string value = option_text(field.get());
      const std::string entry = entry_of(help, field.kind == OptionKind::boolean
                                                   ? flag_of(field) + ",--no-" + flag_of(field).substr(2)
                                                   : flag_of(field));
      EXPECT_NE(entry, "") << verb << ": " << field.path;
      if (value.empty()) {
        EXPECT_THAT(entry, Not(HasSubstr("["))) << verb << ": " << field.path;
      } else {
        const std::string unit = field.unit.empty() ? "" : " " + field.unit;
        EXPECT_THAT(entry, HasSubstr(" [" + value + unit + "]")) << verb << ": " << field.path;
      }
    }
  };
  prepare::PrepareOptions prepare;
  prepare::AttachOptions attach;
  SynthOptions synth;
  trace::Options trace;
  trace.t_min = 0;  // as the verb has it
  CaptureOptions capture = preset("paper").capture;
  expect_defaults("prepare", option_fields(prepare));
  expect_defaults("attach-priors", option_fields(attach));
  expect_defaults("synth", option_fields(synth));
  expect_defaults("trace", option_fields(trace));
  expect_defaults("train", option_fields(capture));
  EXPECT_THAT(entry_of(help_of("train"), "--preset NAME"), HasSubstr("[paper]"));
  EXPECT_THAT(entry_of(help_of("train"), "-i,--iterations N"), HasSubstr("[60000 iterations]"));
  EXPECT_THAT(entry_of(help_of("eval"), "--sheet-width"), HasSubstr("[240]"));
}

TEST(Help, OfSetSpeaksOfTheVerbsOwnOptions) {
  for (const auto& [verb, words] :
       Values{{"prepare", "Any of these, as in frames=150;"},
              {"attach-priors", "Any of these, as in mask_white=automatic;"},
              {"synth", "Any of these, as in scene=balls;"},
              {"trace", "Any of these, as in t_min=0;"},
              {"render",
               "Any of these and select.min_alpha, select.min_tint, "
               "select.probe_share, as in select.min_alpha="},
              {"train", "Any option that `traceflow --help-options` lists, as in "},
              {"inspect", "Any option that `traceflow --help-options` lists"}}) {
    EXPECT_THAT(entry_of(help_of(verb), "--set"), HasSubstr(words)) << verb;
  }
}

TEST(Help, IsWhereAWrongNameIsAnsweredWith) {
  const auto answer = [](std::vector<std::string> command) {
    command.insert(command.end(), {"--set", "loss.normal=0"});
    return run_with(command).err;
  };
  EXPECT_THAT(answer({"prepare", "film.mp4", "-o", "x"}),
              HasSubstr("expected one that `traceflow prepare --help` lists"));
  EXPECT_THAT(answer({"attach-priors", "-d", "x"}),
              HasSubstr("expected one that `traceflow attach-priors --help` lists"));
  EXPECT_THAT(answer({"synth", "x"}), HasSubstr("expected one that `traceflow synth --help` lists"));
  EXPECT_THAT(answer({"trace", "x.ply", "--rays", "x", "-o", "x"}),
              HasSubstr("expected one that `traceflow trace --help` lists"));
  EXPECT_THAT(run_with({"train", "-o", "x", "--set", "los=0"}).err,
              HasSubstr("expected one that `traceflow --help-options` lists"));
}

TEST(Help, SaysWhereAZipArchiveIsTaken) {
  for (const char* verb : {"train", "eval", "report", "render", "view", "inspect"})
    EXPECT_THAT(entry_of(help_of(verb), "-d,--data"), HasSubstr("a folder or a zip archive")) << verb;
}

TEST(Help, AndThePagesTablesAgree) {
  EXPECT_EQ(table_of("prepare.md"), defaults_of(prepare::PrepareOptions{}));
  EXPECT_EQ(table_of("synth.md"), defaults_of(SynthOptions{}));
  std::set<std::string> named, there;
  for (const auto& [flag, meaning] : table_of("attach-priors.md")) named.insert(flag);
  for (const auto& [flag, value] : defaults_of(prepare::AttachOptions{})) there.insert(flag);
  EXPECT_EQ(named, there);
}

}  // namespace
}  // namespace traceflow::cli
