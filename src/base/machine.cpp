#include "base/machine.h"

#include <sys/utsname.h>
#include <unistd.h>

#include <charconv>
#include <fstream>
#include <iterator>
#include <thread>

#include "base/device_memory.h"

namespace traceflow {

namespace {

std::string text_of(const char* path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view blank = " \t\r";
  const size_t first = text.find_first_not_of(blank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(blank) + 1 - first);
}

// The text after the colon of the first line "key : value"; empty if there is none.
std::string_view value_of(std::string_view text, std::string_view key) {
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    const size_t colon = line.find(':');
    if (colon != std::string_view::npos && trimmed(line.substr(0, colon)) == key)
      return trimmed(line.substr(colon + 1));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
  }
  return {};
}

// The number at the beginning of the text, or 0.
int64_t number_at_start(std::string_view text) {
  int64_t number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return std::max<int64_t>(0, number);
}

}  // namespace

std::string processor_name(std::string_view cpuinfo) {
  for (const char* key : {"model name", "Model", "cpu model", "cpu"}) {
    if (const std::string_view name = value_of(cpuinfo, key); !name.empty()) return std::string(name);
  }
  return {};
}

int64_t total_memory(std::string_view meminfo) {
  return number_at_start(value_of(meminfo, "MemTotal")) << 10;
}

int64_t resident_memory(std::string_view statm, int64_t page_bytes) {
  const size_t blank = statm.find(' ');
  return blank == std::string_view::npos ? 0 : number_at_start(statm.substr(blank + 1)) * page_bytes;
}

Machine this_machine(Device device) {
  Machine machine;
  machine.processor = processor_name(text_of("/proc/cpuinfo"));
  machine.threads = static_cast<int>(std::thread::hardware_concurrency());
  machine.memory_bytes = total_memory(text_of("/proc/meminfo"));
  utsname system{};
  if (::uname(&system) == 0) {
    machine.system = std::string(system.sysname) + " " + system.release + " " + system.machine;
    if (machine.processor.empty()) machine.processor = system.machine;
  }
  if (device == Device::cuda) machine.gpu = cuda::facts().name;
  return machine;
}

int64_t memory_available() {
  const int64_t kibibytes = number_at_start(value_of(text_of("/proc/meminfo"), "MemAvailable"));
  return kibibytes > 0 ? kibibytes << 10 : int64_t{1} << 60;
}

int64_t memory_in_use(Device device) {
  if (device == Device::cuda) return static_cast<int64_t>(memory::device_bytes());
  return resident_memory(text_of("/proc/self/statm"), ::sysconf(_SC_PAGESIZE));
}

}  // namespace traceflow
