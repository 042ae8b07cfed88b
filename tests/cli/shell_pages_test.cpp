#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <memory>
#include <regex>
#include <sstream>

#include "cli/program_call.h"
#include "cli/terminal/error_boundary.h"
#include "support/temp_folder.h"

namespace traceflow::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const std::vector<std::string> all_verbs = {"attach-priors", "eval",   "export", "inspect",
                                            "prepare",       "render", "report", "synth",
                                            "trace",         "train",  "view"};

std::string output_of(const std::vector<std::string>& words) {
  const Outcome o = run_with(words);
  EXPECT_EQ(o.code, exit_done) << o.err;
  return o.out;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// "--output" and the like in the first column of a help page.
std::vector<std::string> flags_in_help(const std::vector<std::string>& words) {
  const std::regex flag("--[a-z][a-z-]*");
  std::vector<std::string> flags;
  for (const std::string& line : lines_of(output_of(words))) {
    if (!line.starts_with("  -")) continue;
    const std::string names = line.substr(2, line.find(' ', 2) - 2);
    for (std::sregex_iterator i(names.begin(), names.end(), flag), end; i != end; ++i)
      flags.push_back(i->str());
  }
  return flags;
}

// What bash offers for the last of these words.
class Bash {
 public:
  Bash() {
    std::ofstream(folder_ / "completion") << output_of({"--completion", "bash"});
    std::ofstream(folder_ / "ask") << "source \"${BASH_SOURCE[0]%/*}/completion\"\n"
                                      "COMP_WORDS=(traceflow \"$@\")\nCOMP_CWORD=$#\n_traceflow\n"
                                      "[ ${#COMPREPLY[@]} = 0 ] || printf '%s\\n' \"${COMPREPLY[@]}\"\n";
  }
  std::vector<std::string> offers(const std::vector<std::string>& words) const {
    std::string command = "bash " + (folder_ / "ask").string();
    for (const std::string& word : words) command += " '" + word + "'";
    const std::unique_ptr<FILE, int (*)(FILE*)> pipe(popen(command.c_str(), "r"), pclose);
    std::string text;
    for (int c = fgetc(pipe.get()); c != EOF; c = fgetc(pipe.get())) text += static_cast<char>(c);
    return lines_of(text);
  }

 private:
  TempFolder folder_;
};

TEST(Completion, OffersVerbsFlagsChoicesAndNamesOfOptions) {
  const Bash bash;
  EXPECT_THAT(bash.offers({"re"}), ElementsAre("render", "report"));
  EXPECT_EQ(bash.offers({""}), all_verbs);
  EXPECT_THAT(bash.offers({"--threads", "2", "tr"}), ElementsAre("trace", "train"));
  EXPECT_THAT(bash.offers({"render", "run", "--form"}), ElementsAre("--format"));
  EXPECT_THAT(bash.offers({"render", "run", "--format", ""}), ElementsAre("png", "npy"));
  EXPECT_THAT(bash.offers({"export", "run", "--format", "s"}), ElementsAre("spz", "sog"));
  EXPECT_THAT(bash.offers({"render", "run", "--sort", ""}), ElementsAre("centre", "hit"));
  EXPECT_THAT(bash.offers({"render", "run", "--no-low"}), ElementsAre("--no-low-pass"));
  EXPECT_THAT(bash.offers({"train", "--preset", "c"}), ElementsAre("cpu"));
  EXPECT_THAT(bash.offers({"train", "--set", "density.max_s"}), ElementsAre("density.max_surfels="));
  EXPECT_THAT(bash.offers({"train", "--instructions", "avx"}), ElementsAre("avx2", "avx512"));
}

TEST(Completion, LeavesPathsToTheShell) {
  const Bash bash;
  EXPECT_THAT(bash.offers({"train", "-d", ""}), IsEmpty());
  EXPECT_THAT(bash.offers({"train", "--output", ""}), IsEmpty());
  EXPECT_THAT(bash.offers({"render", ""}), IsEmpty());
}

TEST(Completion, HasEveryFlagOfEveryVerbInEveryShell) {
  const std::string zsh = output_of({"--completion", "zsh"}), fish = output_of({"--completion", "fish"});
  const Bash bash;
  for (const std::string& verb : all_verbs) {
    const std::vector<std::string> offered = bash.offers({verb, "--"});
    const size_t begin = zsh.find("\n        " + verb + ")\n");
    ASSERT_NE(begin, std::string::npos) << verb;
    const std::string in_zsh = zsh.substr(begin, zsh.find(";;", begin) - begin);
    for (const std::string& flag : flags_in_help({verb, "--help"})) {
      EXPECT_THAT(offered, testing::Contains(flag)) << verb;
      EXPECT_TRUE(std::regex_search(in_zsh, std::regex("[ {,]" + flag + "['},]"))) << verb << flag;
      EXPECT_TRUE(flag == "--help" ||
                  std::regex_search(
                      fish, std::regex("from " + verb + "'( -[sl] [a-z-]+)* -l " + flag.substr(2) + " ")))
          << verb << flag;
    }
  }
}

TEST(Completion, NamesTheShellsItKnows) {
  const Outcome o = run_with({"--completion", "tcsh"});
  EXPECT_EQ(o.code, exit_input);
  EXPECT_THAT(o.err, HasSubstr("{bash,zsh,fish}"));
}

// The text that man(1) prints, without its layout.
std::string plain_text(std::string page) {
  page = std::regex_replace(page, std::regex("\\\\f[BR]|\\\\&"), "");
  page = std::regex_replace(page, std::regex("\\\\-"), "-");
  return std::regex_replace(page, std::regex("\\\\e"), "\\");
}

TEST(Manual, HasTheTextOfTheHelp) {
  for (const std::string& verb : all_verbs) {
    const std::string page = plain_text(output_of({"--man", verb}));
    EXPECT_THAT(page, HasSubstr("traceflow-" + verb + " - ")) << verb;
    for (const std::string& line : lines_of(output_of({verb, "--help"}))) {
      if (!line.starts_with("  ")) continue;
      const size_t text = line.find_first_not_of(' ', 30);
      if (text != std::string::npos && line[29] == ' ') {
        EXPECT_THAT(page, HasSubstr(line.substr(text))) << verb;
      }
    }
    for (const std::string& flag : flags_in_help({verb, "--help"}))
      EXPECT_THAT(page, HasSubstr(flag)) << verb;
  }
}

TEST(Manual, OfTheProgramListsTheVerbsAndExitCodes) {
  const std::string page = plain_text(output_of({"--man", "traceflow"}));
  for (const std::string& verb : all_verbs) EXPECT_THAT(page, HasSubstr("\n" + verb + "\n"));
  EXPECT_THAT(page, HasSubstr("\n130\nstopped by Ctrl-C"));
}

TEST(Manual, OfNoSubcommandIsRefused) {
  const Outcome o = run_with({"--man", "trian"});
  EXPECT_EQ(o.code, exit_input);
  EXPECT_THAT(o.err, HasSubstr("found trian, expected one of traceflow, attach-priors, "));
}

}  // namespace
}  // namespace traceflow::cli
