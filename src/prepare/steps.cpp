#include "prepare/steps.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/utf8.h"
#include "files/json_document.h"
#include "prepare/picture_source.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

std::string seconds_text(double seconds) {
  const auto whole = std::llround(seconds);
  return whole < 60 ? fmt::format("{} s", whole) : fmt::format("{}:{:02} min", whole / 60, whole % 60);
}

}  // namespace

std::string step_name(Step step) { return std::string(enum_names(step)[static_cast<size_t>(step)]); }

fs::path Steps::path_of(Step step) const { return folder_ / (step_name(step) + ".json"); }

json Steps::stamp(Step step) const {
  if (!fs::is_regular_file(path_of(step))) return nullptr;
  try {
    const JsonFile file(path_of(step));
    if (!file.has("inputs") || !file.has("found") || !file.has("seconds")) return nullptr;
    (void)file["found"].text();
    (void)file["seconds"].number();
    return file.json();
  } catch (const InputError&) {
    return nullptr;  // an unreadable stamp means that the step runs again
  }
}

void Steps::run(Step step, const json& inputs, const std::function<bool()>& stands,
                const std::function<std::string()>& work) {
  const json done = stamp(step);
  if (!done.is_null() && done.at("inputs") == inputs && stands()) {
    say_(fmt::format("{:<10}{} (stands)", step_name(step), done.at("found").get<std::string>()));
    return;
  }
  before_();
  for (size_t later = enum_names(step).size(); later-- > static_cast<size_t>(step);) {
    fs::remove(path_of(static_cast<Step>(later)));
  }
  const auto begin = std::chrono::steady_clock::now();
  const std::string found = work();
  const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - begin;
  write_atomically(path_of(step),
                   json{{"inputs", inputs}, {"found", found}, {"seconds", taken.count()}}.dump(1) + "\n");
  say_(fmt::format("{:<10}{} ({})", step_name(step), found, seconds_text(taken.count())));
}

json identity_of(const fs::path& path) {
  const auto one = [](const fs::path& file) {
    return json{{"path", as_utf8(fs::absolute(file).lexically_normal().string())},
                {"bytes", fs::file_size(file)},
                {"changed", fs::last_write_time(file).time_since_epoch().count()}};
  };
  if (!fs::is_directory(path)) return one(path);
  std::vector<fs::path> files = pictures_in(path);
  std::ranges::sort(files);
  json all = json::array();
  for (const fs::path& file : files) all.push_back(one(file));
  return all;
}

}  // namespace traceflow::prepare
