#include "eval/figures_json.h"

namespace traceflow::eval {

namespace {

using Figures = nlohmann::ordered_json;

void put_motion(const MotionFigures& figures, Figures& json) {
  MotionFigures::visit(figures, [&](const char* name, const std::optional<double>& value) {
    json[name] = figure_json(value);
  });
}

Figures moment_json(const MotionMoment& m) {
  return {{"time", m.time},
          {"moved", m.moved},
          {"missed", m.missed},
          {"share", figure_json(m.share)},
          {"rotation_error_deg", m.rotation_error_deg},
          {"scale", m.scale},
          {"true_scale", m.true_scale}};
}

}  // namespace

nlohmann::ordered_json figure_json(const std::optional<double>& value) {
  return value ? Figures(*value) : Figures(nullptr);
}

nlohmann::ordered_json surfels_json(const Report& report) {
  return {{"main", report.main_surfels},
          {"environment", report.environment_surfels},
          {"per_masked_pixel", figure_json(report.surfels_per_masked_pixel)}};
}

void put_figures(const Metrics& metrics, nlohmann::ordered_json& json) {
  Metrics::visit(metrics, [&](const char* name, const std::optional<double>& value) {
    json[name] = figure_json(value);
  });
}

nlohmann::ordered_json motion_json(const std::optional<MotionReport>& motion) {
  if (!motion) return nullptr;
  Figures json = Figures::object();
  put_motion(motion->mean, json["mean"] = Figures::object());
  Figures& objects = json["objects"] = Figures::array();
  for (const ObjectMotion& o : motion->objects) {
    Figures entry = {{"object", o.object}, {"points", o.points}, {"followed_points", o.followed_points}};
    put_motion(o.figures, entry);
    Figures& curve = entry["curve"] = Figures::array();
    for (const MotionMoment& m : o.curve) curve.push_back(moment_json(m));
    objects.push_back(std::move(entry));
  }
  return json;
}

}  // namespace traceflow::eval
