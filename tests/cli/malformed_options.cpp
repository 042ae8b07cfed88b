#include "cli/malformed_cases.h"

namespace traceflow::cli {

namespace {

const std::string settings = "options.toml";

std::vector<std::string> train(const std::vector<std::string>& more) {
  std::vector<std::string> command = {"train", "-d", "capture", "-o", "new"};
  command.insert(command.end(), more.begin(), more.end());
  return command;
}

MalformedCase in_settings(const std::string& what, const std::string& text, const std::string& line) {
  return {what, train({"--config", settings}), put(settings, text), line};
}

MalformedCase in_flags(const std::string& what, const std::vector<std::string>& flags,
                       const std::string& line) {
  return {what, train(flags), [](Files&) {}, line};
}

}  // namespace

MalformedKind malformed_options() {
  return {
      "Settings and flags",
      {in_settings("not TOML", "iterations =\n",
                   "options.toml:1: found Error while parsing key-value pair: expected value, saw '\\n', "
                   "expected TOML"),
       in_settings("text that is not UTF-8", "specular = \"\xff\"\n",
                   "options.toml:1: found bytes that are not UTF-8, expected text in UTF-8"),
       in_settings("an option set twice", "iterations = 1\niterations = 2\n",
                   "options.toml:2: found Error while parsing key-value pair: cannot redefine existing "
                   "integer 'iterations', expected TOML"),
       in_settings("an unknown option", "iterations = 1\n[loss]\nnromal = 1\n",
                   "options.toml:3: loss.nromal: found no option of this name, expected one that `traceflow "
                   "--help-options` lists; did you mean loss.normal?"),
       in_settings("a number for a group", "loss = 1\n",
                   "options.toml:1: loss: found a group of options, expected one option, such as loss.ssim"),
       in_settings("a fraction of an iteration", "iterations = 1.5\n",
                   "options.toml:1: iterations: found 1.5, expected a whole number"),
       in_settings("a date for a number", "iterations = 2000-01-01\n",
                   "options.toml:1: iterations: found a value of type date, expected a whole number"),
       in_settings("NaN", "[loss]\nnormal = nan\n",
                   "options.toml:2: loss.normal: found nan, expected a number"),
       in_settings("a number out of range", "seed = 1\niterations = 9223372036854775807\n",
                   "options.toml:2: iterations: found 9223372036854775807, expected a whole number"),
       in_settings("tables nested too deep", std::string(100000, '['),
                   "options.toml:1: found more than 64 open brackets, expected options"),
       in_settings("an option out of range", "[capture]\ndownscale = 0\n",
                   "option: downscale: found 0, expected 1 to 64"),
       in_flags("a missing options file", {"--config", "nowhere.toml"},
                "nowhere.toml: found No such file or directory, expected a readable file"),
       in_flags("an assignment without a value", {"--set", "loss.normal"},
                "--set: found loss.normal, expected an assignment, PATH=VALUE"),
       in_flags("an assignment to an unknown option", {"--set", "los.normal=1"},
                "--set: los.normal: found no option of this name, expected one that `traceflow "
                "--help-options` lists; did you mean loss.normal?"),
       in_flags("an unknown choice", {"--set", "specular=mirrors"},
                "--set: specular: found mirrors, expected none, environment-gaussians, environment-map"),
       in_flags("two numbers for three", {"--set", "render.background=0,1"},
                "--set: render.background: found 0,1, expected three numbers such as 0,0.5,1"),
       in_flags("a string for a number", {"--iterations", "many"},
                "--iterations: iterations: found many, expected a whole number"),
       in_flags("an unknown preset", {"--preset", "gpu"},
                "option: preset: found gpu, expected paper, cpu or demo"),
       in_flags("an unknown flag", {"--no-such-flag"},
                "The following argument was not expected: --no-such-flag; see `traceflow train --help`")}};
}

}  // namespace traceflow::cli
