#include "prepare/programs.h"

#include <fstream>

#include "base/error.h"
#include "base/process.h"

namespace traceflow::prepare {

void need_program(const std::string& program) {
  if (is_in_path(program)) return;
  throw InputError(program, "", "no such program on this machine", program + " in PATH",
                   "install it with `scripts/setup --prepare`");
}

std::string last_line(const std::filesystem::path& log) {
  std::ifstream file(log);
  std::string last, line;
  while (std::getline(file, line)) {
    if (line.find_first_not_of(" \t\r") != std::string::npos) last = line;
  }
  constexpr size_t longest = 300;
  return last.substr(0, longest);
}

void run_program(const std::vector<std::string>& words, const std::filesystem::path& log,
                 const std::atomic<bool>& stop) {
  const Descriptor file = open_log(log);
  Process process(
      words, {.output = file.number(), .error = file.number(), .environment = {"QT_QPA_PLATFORM=offscreen"}});
  if (process.wait(stop)) return;
  if (stop) throw Stopped{};
  const std::string name =
      words.size() > 1 && !words[1].starts_with('-') ? words[0] + " " + words[1] : words[0];
  throw InputError(name, "", "a failure: " + last_line(log), "a run to the end", "see " + log.string());
}

}  // namespace traceflow::prepare
