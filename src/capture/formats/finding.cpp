#include "capture/formats/finding.h"

#include <algorithm>

namespace traceflow {

std::string ids_text(const std::vector<std::string>& ids) {
  constexpr size_t named = 3;
  std::string text;
  for (size_t i = 0; i < std::min(named, ids.size()); ++i) text += (i == 0 ? "" : ", ") + ids[i];
  if (ids.size() > named) text += " and " + std::to_string(ids.size() - named) + " more";
  return text;
}

}  // namespace traceflow
