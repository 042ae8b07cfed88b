#include "serve/clients/history.h"

#include <algorithm>
#include <nlohmann/json.hpp>

namespace traceflow::serve {

namespace {

constexpr int64_t most_steps = 4000;

// The iteration of a step; -1 for another event, -2 for an invalid line.
int64_t step_of(const std::string& line) {
  const nlohmann::json json = nlohmann::json::parse(line, nullptr, false);
  if (!json.is_object() || !json.contains("event")) return -2;
  if (json["event"] != "step") return -1;
  const auto found = json.find("iteration");
  return found != json.end() && found->is_number_integer() ? found->get<int64_t>() : -2;
}

}  // namespace

void History::add(const std::string& line) {
  const int64_t step = step_of(line);
  if (step < -1 || (step >= 0 && step % stride_ != 0)) return;
  lines_.push_back({line, step});
  if (step < 0 || ++steps_ <= most_steps) return;
  stride_ *= 2;
  std::erase_if(lines_, [&](const Line& kept) { return kept.step >= 0 && kept.step % stride_ != 0; });
  steps_ = std::ranges::count_if(lines_, [](const Line& kept) { return kept.step >= 0; });
}

void History::clear() { *this = {}; }

std::vector<std::string> History::lines() const {
  std::vector<std::string> texts;
  texts.reserve(lines_.size());
  for (const Line& line : lines_) texts.push_back(line.text);
  return texts;
}

std::string events_text(const std::vector<std::string>& lines, bool reset) {
  std::string text = R"({"type":"events","events":[)";
  for (const std::string& line : lines) text += (&line == &lines.front() ? "" : ",") + line;
  return text + R"(],"reset":)" + (reset ? "true}" : "false}");
}

}  // namespace traceflow::serve
