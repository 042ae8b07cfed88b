#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>

#include "base/error.h"
#include "cli/arguments/option_arguments.h"
#include "cli/arguments/option_page.h"
#include "cli/arguments/option_toml.h"
#include "files/options_json.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "train/options.h"

namespace traceflow::cli {
namespace {

using ::testing::HasSubstr;

std::filesystem::path toml_file(const std::string& text) {
  static const TempFolder folder;
  auto path = folder / "options.toml";
  std::ofstream(path) << text;
  return path;
}

TrainOptions parsed(std::vector<std::string> arguments) {
  std::reverse(arguments.begin(), arguments.end());
  CLI::App verb;
  TrainOptions options;
  const OptionArguments given(verb, option_fields(options), {"capture"});
  verb.parse(arguments);
  given.apply(option_fields(options));
  return options;
}

std::string toml_refusal(const std::string& text) {
  TrainOptions options;
  const auto path = toml_file(text);
  std::string message = refusal_of([&] { options_from_toml(path, option_fields(options)); });
  const size_t at = message.find(path.string());
  return at == std::string::npos ? message : message.replace(at, path.string().size(), "FILE");
}

TEST(OptionToml, ReadsEveryKindOfValue) {
  TrainOptions options;
  options_from_toml(toml_file(R"(
iterations = 1_200
specular = "environment-map"
[loss]
normal = 0
ssim = 0.25
[render]
low_pass = false
background = [1, 0.5, 0.0]
[render.select]
probe_share = 0.5
)"),
                    option_fields(options));
  EXPECT_EQ(options.iterations, 1200);
  EXPECT_EQ(options.specular, Specular::environment_map);
  EXPECT_EQ(options.loss.normal, 0);
  EXPECT_EQ(options.loss.ssim, 0.25F);
  EXPECT_FALSE(options.render.low_pass);
  EXPECT_EQ(options.render.raster.background, Vec3<float>(1, 0.5F, 0));
  EXPECT_EQ(options.render.select.probe_share, 0.5F);
  EXPECT_EQ(options.seed, TrainOptions{}.seed);
}

TEST(OptionToml, RefusalsNameFileAndLine) {
  EXPECT_THAT(toml_refusal("iterations = 5\n[loss]\nnromal = 0\n"),
              HasSubstr("FILE:3: loss.nromal: found no option"));
  EXPECT_THAT(toml_refusal("iterations = 5\n[loss]\nnromal = 0\n"), HasSubstr("did you mean loss.normal?"));
  EXPECT_EQ(toml_refusal("\niterations = 1.5\n"), "FILE:2: iterations: found 1.5, expected a whole number");
  EXPECT_EQ(toml_refusal("iterations = 2000-01-01\n"),
            "FILE:1: iterations: found a value of type date, expected a whole number");
  EXPECT_EQ(toml_refusal("loss = 3\n").substr(0, 52), "FILE:1: loss: found a group of options, expected one");
  EXPECT_THAT(toml_refusal("a = 1\nb = \n"), HasSubstr("FILE:2"));
  EXPECT_THAT(refusal_of([] { options_from_toml("/nowhere.toml", {}); }), HasSubstr("/nowhere.toml"));
}

// The parser walks tables in tables by recursion, and asserts what a table's name begins with.
TEST(OptionToml, RefusesWhatItsParserCannotBear) {
  const auto repeated = [](const std::string& part, int times) {
    std::string text;
    for (int i = 0; i < times; ++i) text += part;
    return text;
  };
  EXPECT_EQ(toml_refusal("a = 1\n" + repeated("a.", 200000) + "a = 1\n"),
            "FILE:2: found more than 64 dots, expected options");
  EXPECT_EQ(toml_refusal("a = " + repeated("[\n", 1000)),
            "FILE:65: found more than 64 open brackets, expected options");
  EXPECT_THAT(toml_refusal("iterations = 1\n[:]\n"), HasSubstr("FILE:2: found Error while parsing key"));
  EXPECT_THAT(toml_refusal(std::string("[[\0a]]\n", 7)), HasSubstr("FILE:1: found Error"));
  EXPECT_EQ(toml_refusal(repeated("# words\n", 200000)),
            "FILE: found 1600000 bytes, expected a TOML file of options, of at most 1048576");
  EXPECT_EQ(toml_refusal("\xc3\xa9 = 1\n"),
            "FILE:1: found a letter beyond ASCII, expected such letters in double quotes");
  EXPECT_EQ(toml_refusal("output = '\xc3\xa9'\n"),
            "FILE:1: found a letter beyond ASCII, expected such letters in double quotes");
  EXPECT_EQ(toml_refusal("output = \"\\\xc3\xa9\"\n"),
            "FILE:1: found a letter beyond ASCII, expected such letters in double quotes");
  EXPECT_EQ(toml_refusal("iterations = 1\n# \xc3\n"),
            "FILE:2: found bytes that are not UTF-8, expected text in UTF-8");
  EXPECT_THAT(toml_refusal("specular = \"\xc3\xa9\"\n"), HasSubstr("specular: found \xc3\xa9, expected"));
  // Looking for the end of what is no value, it would meet the letter outside a string.
  EXPECT_THAT(toml_refusal("a = +b\"\xcf\x92\"\n"), HasSubstr("FILE:1: found Error"));
  EXPECT_EQ(toml_refusal("a = \"\"\"\n"),
            "FILE:1: found three quotes, expected strings that end in their line");
  EXPECT_EQ(toml_refusal("\xef\xbb\xbf# " + repeated("a sentence\xe2\x80\xa6. ", 80) +
                         "\n"
                         "specular = 'none'  # [[[ \xc3\xa9\n"),
            "accepted");
}

TEST(OptionArguments, FlagsReachFieldsOutsideGroupsAndInPromotedOnes) {
  const TrainOptions options = parsed({"--save-every", "77", "--specular", "none", "--downscale", "4",
                                       "--set", "loss.normal=0", "--set", "rates.position=1e-3"});
  EXPECT_EQ(options.save_every, 77);
  EXPECT_EQ(options.specular, Specular::none);
  EXPECT_EQ(options.capture.downscale, 4);
  EXPECT_EQ(options.loss.normal, 0);
  EXPECT_EQ(options.rates.position, 1e-3F);
}

TEST(OptionArguments, TheFileComesFirstThenSetThenFlags) {
  const std::string file = toml_file("iterations = 1\nseed = 1\nsave_every = 1\n").string();
  const TrainOptions options =
      parsed({"--iterations", "3", "--set", "iterations=2", "--set", "seed=2", "--config", file});
  EXPECT_EQ(options.iterations, 3);
  EXPECT_EQ(options.seed, 2);
  EXPECT_EQ(options.save_every, 1);
}

TEST(OptionArguments, RefusalsNameTheFlag) {
  EXPECT_EQ(refusal_of([] {
              parsed({"--iterations", "many"});
            }),
            "--iterations: iterations: found many, expected a whole number");
  EXPECT_THAT(refusal_of([] { parsed({"--set", "los.normal=1"}); }), HasSubstr("did you mean loss.normal?"));
  EXPECT_THAT(refusal_of([] { parsed({"--set", "loss.normal"}); }), HasSubstr("expected an assignment"));
}

struct Switch {
  bool fine_detail = true;
  template <class Visitor>
  void visit(Visitor& v) {
    v.field("fine_detail", fine_detail, "", "Detail.");
  }
};

TEST(OptionArguments, BooleansHaveTwoFlags) {
  const auto parsed_switch = [](const std::string& argument) {
    CLI::App verb;
    Switch options;
    const OptionArguments given(verb, option_fields(options));
    verb.parse(std::vector<std::string>{argument});
    given.apply(option_fields(options));
    return options.fine_detail;
  };
  EXPECT_FALSE(parsed_switch("--no-fine-detail"));
  EXPECT_FALSE(parsed_switch("--fine-detail=false"));
  EXPECT_TRUE(parsed_switch("--fine-detail"));
}

TEST(TrainOptions, EveryPresetSurvivesACheckpoint) {
  for (const char* name : {"paper", "cpu", "demo"}) {
    TrainOptions there = preset(name);
    TrainOptions back;
    options_from_json(options_to_json(there), option_fields(back), "test");
    const auto wanted = option_fields(there);
    const auto got = option_fields(back);
    for (size_t i = 0; i < wanted.size(); ++i)
      EXPECT_EQ(got[i].get(), wanted[i].get()) << name << wanted[i].path;
  }
}

TEST(TrainOptions, EveryOptionHasHelpAndAPathOfItsOwn) {
  TrainOptions options;
  std::set<std::string> paths;
  for (const OptionField& field : option_fields(options)) {
    EXPECT_TRUE(paths.insert(field.path).second) << field.path;
    EXPECT_THAT(field.help, testing::EndsWith(".")) << field.path;
    EXPECT_EQ(field.help.find('|'), std::string::npos) << field.path;
  }
}

TEST(OptionPage, DocsHoldWhatTheProgramPrints) {
  std::ifstream file(TRACEFLOW_SOURCE_FOLDER "/docs/options.md");
  std::ostringstream text;
  text << file.rdbuf();
  EXPECT_EQ(text.str(), option_page()) << "run: build/release/traceflow --help-options > docs/options.md";
}

// The number of a section that a text begins with, such as 3.2; empty where it begins with none.
std::string section_at(std::string_view text) {
  std::string number(text.substr(0, text.find_first_not_of("0123456789.")));
  while (number.ends_with('.')) number.pop_back();
  return number;
}

// Code and messages cite sections of docs/method.md as `method §3.2`.
TEST(MethodPage, HasEverySectionThatIsCited) {
  constexpr std::string_view sign = "§";
  const std::filesystem::path folder = TRACEFLOW_SOURCE_FOLDER;
  std::set<std::string> sections;
  std::ifstream page(folder / "docs/method.md");
  for (std::string line; std::getline(page, line);) {
    if (line.starts_with("#") || line.starts_with("**"))
      sections.insert(section_at(line.substr(line.find_first_not_of("#* "))));
  }
  size_t cited = 0;
  for (const char* const part : {"src", "tests", "bench"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder / part)) {
      std::ifstream file(entry.path());
      std::ostringstream bytes;
      bytes << file.rdbuf();
      const std::string text = bytes.str();
      for (size_t at = text.find(sign); at != std::string::npos; at = text.find(sign, at + 1)) {
        const std::string number = section_at(std::string_view(text).substr(at + sign.size()));
        if (number.empty()) continue;
        EXPECT_TRUE(sections.contains(number)) << entry.path() << " cites section " << number;
        ++cited;
      }
    }
  }
  EXPECT_GT(cited, 100U);
}

}  // namespace
}  // namespace traceflow::cli
