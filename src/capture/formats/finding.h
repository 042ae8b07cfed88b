#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace traceflow {

// problem: it will cost quality, or is a mistake; notice: worth knowing.
enum class Severity { problem, notice };
constexpr std::array<std::string_view, 2> enum_names(Severity) { return {"problem", "notice"}; }

// Something about a capture that its owner should know, said by who loads it or by who inspects it.
struct Finding {
  std::string text;  // one line, which names three views at most
  std::string kind;  // docs/inspect.md lists them
  Severity severity = Severity::problem;
  std::vector<std::string> views;  // ids of all that are concerned
  std::vector<std::string> files;  // likewise, paths inside the capture
  std::optional<double> value,
      threshold;  // what was measured, of the worst view, and from where on it is told

  Finding(std::string words, std::string its_kind, Severity how_bad = Severity::problem)
      : text(std::move(words)), kind(std::move(its_kind)), severity(how_bad) {}
};

// "a, b, c and 4 more": at most three are named.
std::string ids_text(const std::vector<std::string>& ids);

}  // namespace traceflow
