#include "base/profile.h"

#include <algorithm>
#include <atomic>
#include <cstring>
#include <mutex>
#include <new>

#include "base/parallel.h"

namespace traceflow::profile {

namespace {

std::atomic<bool> enabled{false};
std::mutex mutex;
std::vector<Entry> table;

}  // namespace

Scope::Scope(const char* name) : name_(nullptr) {
  if (!is_on() || in_parallel_loop()) return;
  name_ = name;
  start_ = std::chrono::steady_clock::now();
}

Scope::~Scope() {
  if (!name_) return;
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  const std::lock_guard lock(mutex);
  auto entry = std::find_if(table.begin(), table.end(), [&](const Entry& e) { return e.name == name_; });
  try {
    if (entry == table.end()) entry = table.insert(table.end(), Entry{name_, 0, 0});
  } catch (const std::bad_alloc&) {
    return;  // not counted; the scope may end because of this lack of memory
  }
  entry->calls += 1;
  entry->seconds += seconds;
}

void enable(bool on) { enabled = on; }
bool is_on() { return enabled.load(std::memory_order_relaxed); }

std::vector<Entry> entries() {
  const std::lock_guard lock(mutex);
  return table;
}

void clear() {
  const std::lock_guard lock(mutex);
  table.clear();
}

}  // namespace traceflow::profile
