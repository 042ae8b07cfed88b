#include "prepare/programs.h"

#include <algorithm>
#include <fstream>

#include "base/error.h"
#include "base/process.h"

namespace traceflow::prepare {

namespace {

// The log's last bytes.
std::string end_of(const std::filesystem::path& log) {
  constexpr std::streamoff enough = 2048;
  std::ifstream file(log, std::ios::binary | std::ios::ate);
  if (!file) return "";
  const std::streamoff size = file.tellg();
  std::string end(static_cast<size_t>(std::min(enough, size)), '\0');
  file.seekg(size - static_cast<std::streamoff>(end.size()));
  file.read(end.data(), static_cast<std::streamsize>(end.size()));
  return end;
}

}  // namespace

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

void run_program(const std::vector<std::string>& words, const std::filesystem::path& log, const Work& work,
                 const ReadShare& read_share) {
  const Descriptor file = open_log(log);
  Process process(
      words, {.output = file.number(), .error = file.number(), .environment = {"QT_QPA_PLATFORM=offscreen"}});
  const auto look = [&] {
    if (const auto share = read_share(end_of(log))) work.tell(share->done, share->all);
  };
  if (process.wait(work.stop(), look)) return;
  work.check();
  const std::string name =
      words.size() > 1 && !words[1].starts_with('-') ? words[0] + " " + words[1] : words[0];
  throw InputError(name, "", "a failure: " + last_line(log), "a run to the end", "see " + log.string());
}

}  // namespace traceflow::prepare
