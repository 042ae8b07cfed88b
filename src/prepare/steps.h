#pragma once

#include <array>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "prepare/options.h"

namespace traceflow::prepare {

// Steps that are done once. What a step was done with, what it found and how long it took are kept in
// STEP.json, its stamp, in the work folder; a step whose stamp tells the same again is skipped.
class Steps {
 public:
  // found: gets one line per step.
  // before: called when a step's work is about to begin; what it throws leaves all stamps.
  Steps(
      std::filesystem::path folder, std::function<void(const std::string& line)> found,
      std::function<void()> before = [] {})
      : folder_(std::move(folder)), say_(std::move(found)), before_(std::move(before)) {}

  // Does `work`, which tells what it found, unless this step and all before it stand and `stands` finds the
  // results in their place. inputs: what the results depend on, beyond the steps before. From the moment when
  // work begins until it is done, neither this step nor any after it has a stamp.
  void run(Step step, const nlohmann::json& inputs, const std::function<bool()>& stands,
           const std::function<std::string()>& work);

  // What the step found when it was last done, and its seconds; null where it does not stand.
  nlohmann::json stamp(Step step) const;

 private:
  std::filesystem::path path_of(Step step) const;

  std::filesystem::path folder_;
  std::function<void(const std::string& line)> say_;
  std::function<void()> before_;
};

std::string step_name(Step step);

// A file as an input of a step: its path, size and time of change; of a folder, those of its pictures, as
// nothing else in it is looked at.
nlohmann::json identity_of(const std::filesystem::path& path);

}  // namespace traceflow::prepare
