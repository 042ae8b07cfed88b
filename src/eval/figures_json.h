#pragma once

#include <nlohmann/json.hpp>

#include "eval/report.h"

// Metrics as JSON, for metrics.json and the report's page. An unavailable metric is null.
namespace traceflow::eval {

// The value, or null.
nlohmann::ordered_json figure_json(const std::optional<double>& value);

// {"main", "environment", "per_masked_pixel"}.
nlohmann::ordered_json surfels_json(const Report& report);

// Adds every metric by its name. json: an object, not null. When nlohmann-json's [] turns a null into an
// object and memory runs out, it leaves the value broken.
void put_figures(const Metrics& metrics, nlohmann::ordered_json& json);

// {"mean", "objects"}; null if the capture has no true motion.
nlohmann::ordered_json motion_json(const std::optional<MotionReport>& motion);

}  // namespace traceflow::eval
