#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace traceflow {

// problem: a mistake, or a loss of quality; notice: good to know.
enum class Severity { problem, notice };
constexpr std::array<std::string_view, 2> enum_names(Severity) { return {"problem", "notice"}; }

// A fact about a capture that its owner should know, from loading or inspection.
struct Finding {
  std::string text;  // one line; names at most three views
  std::string kind;  // docs/inspect.md lists them
  Severity severity = Severity::problem;
  std::vector<std::string> views;  // ids of all views concerned
  std::vector<std::string> files;  // paths of all files concerned, inside the capture
  std::optional<double> value,
      threshold;  // the measured value of the worst view, and the limit beyond which it is reported

  Finding(std::string words, std::string its_kind, Severity how_bad = Severity::problem)
      : text(std::move(words)), kind(std::move(its_kind)), severity(how_bad) {}
};

// "a, b, c and 4 more": names at most three.
std::string ids_text(const std::vector<std::string>& ids);

}  // namespace traceflow
