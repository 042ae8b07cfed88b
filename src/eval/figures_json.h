#pragma once

#include <nlohmann/json.hpp>

#include "eval/report.h"

// Figures as metrics.json and the report's page have them: one that cannot be had is null.
namespace traceflow::eval {

// The value, or null.
nlohmann::ordered_json figure_json(const std::optional<double>& value);

// {"main", "environment", "per_masked_pixel"}.
nlohmann::ordered_json surfels_json(const Report& report);

// Adds every figure by its name. json: an object, not null. A null that [] turns into an object is left
// broken by nlohmann-json where there is no memory.
void put_figures(const Metrics& metrics, nlohmann::ordered_json& json);

// {"mean", "objects"}; null where the capture has no truth of the motion.
nlohmann::ordered_json motion_json(const std::optional<MotionReport>& motion);

}  // namespace traceflow::eval
