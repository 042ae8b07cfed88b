#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "prepare/options.h"

namespace traceflow::prepare {

// Runs each step once. A step's inputs, result text and duration are stored in STEP.json, its stamp, in the
// work folder. A step with a matching stamp is skipped.
class Steps {
 public:
  // found: gets one line per step. before: called before a step's work starts; if it throws, all stamps are
  // kept.
  Steps(
      std::filesystem::path folder, std::function<void(const std::string& line)> found,
      std::function<void()> before = [] {})
      : folder_(std::move(folder)), say_(std::move(found)), before_(std::move(before)) {}

  // Runs `work`, which returns its result text, unless this step and all before it are up to date and
  // `stands` finds the results in place. inputs: what the results depend on beyond the earlier steps. While
  // work runs, this step and all later ones have no stamp.
  void run(Step step, const nlohmann::json& inputs, const std::function<bool()>& stands,
           const std::function<std::string()>& work);

  // The step's last result text and its duration in seconds; null if the step is not up to date.
  nlohmann::json stamp(Step step) const;

 private:
  std::filesystem::path path_of(Step step) const;

  std::filesystem::path folder_;
  std::function<void(const std::string& line)> say_;
  std::function<void()> before_;
};

std::string step_name(Step step);

// A file as an input of a step: its path, size and modification time. For a folder, those of its images, the
// only files that are used.
nlohmann::json identity_of(const std::filesystem::path& path);

}  // namespace traceflow::prepare
