#include <fmt/format.h>

#include "capture/checks/checks.h"

namespace traceflow {

void check_pictures(const std::vector<ViewFacts>& facts, Findings& findings) {
  std::vector<std::string> broken, uniform;
  std::string reason;
  for (const ViewFacts& view : facts) {
    if (!view.broken.empty()) {
      if (broken.empty()) reason = view.broken;
      broken.push_back(view.view->id);
    } else if (view.is_uniform) {
      uniform.push_back(view.view->id);
    }
  }
  if (!broken.empty()) {
    findings
        .emplace_back(broken.size() == 1 ? reason
                                         : fmt::format("{}, and files of {} more views cannot be read",
                                                       reason, broken.size() - 1),
                      "unreadable")
        .views = broken;
  }
  if (!uniform.empty()) {
    findings
        .emplace_back(
            fmt::format("{} of the decoded views are of one colour ({})", uniform.size(), ids_text(uniform)),
            "one-colour")
        .views = uniform;
  }
}

}  // namespace traceflow
