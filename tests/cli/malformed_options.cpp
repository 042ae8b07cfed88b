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
  return {"Settings and flags",
          {in_settings("not TOML", "iterations =\n", ""),
           in_settings("text that is not UTF-8", "specular = \"\xff\"\n", ""),
           in_settings("an option that comes twice", "iterations = 1\niterations = 2\n", ""),
           in_settings("an option that there is not", "iterations = 1\n[loss]\nnromal = 1\n", ""),
           in_settings("a number for a group", "loss = 1\n", ""),
           in_settings("half an iteration", "iterations = 1.5\n", ""),
           in_settings("a date for a number", "iterations = 2000-01-01\n", ""),
           in_settings("a number that is none", "[loss]\nnormal = nan\n", ""),
           in_settings("a number that is too large", "seed = 1\niterations = 9223372036854775807\n", ""),
           in_settings("tables in tables without end", std::string(100000, '['), ""),
           in_settings("an option out of its range", "[capture]\ndownscale = 0\n", ""),
           in_flags("no such file of settings", {"--config", "nowhere.toml"}, ""),
           in_flags("an assignment without a value", {"--set", "loss.normal"}, ""),
           in_flags("an assignment to a name that there is not", {"--set", "los.normal=1"}, ""),
           in_flags("a choice that there is not", {"--set", "specular=mirrors"}, ""),
           in_flags("two numbers for three", {"--set", "render.background=0,1"}, ""),
           in_flags("words for a number", {"--iterations", "many"}, ""),
           in_flags("a preset that there is not", {"--preset", "gpu"}, ""),
           in_flags("a flag that there is not", {"--no-such-flag"}, "")}};
}

}  // namespace traceflow::cli
