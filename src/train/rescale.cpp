#include "train/rescale.h"

#include <algorithm>
#include <cmath>

namespace traceflow {

std::optional<std::vector<Vec3<double>>> positions_of_single_cameras(const Capture& capture,
                                                                     const Motion& motion) {
  std::vector<Vec3<double>> eyes;
  for (const float time : motion.time.values()) {
    const auto is_meant = [&](const View& view) { return view.time == time; };
    if (std::count_if(capture.train.begin(), capture.train.end(), is_meant) != 1) return std::nullopt;
    const auto view = std::find_if(capture.train.begin(), capture.train.end(), is_meant);
    eyes.emplace_back(view->camera.position);
  }
  return eyes;
}

void rescale_bodies(const std::vector<double>& ratio, const std::vector<Vec3<double>>& eyes, Surfels& main,
                    Motion& motion) {
  const auto towards = [](const Vec3<double>& from, const Vec3<double>& to, double by) {
    return to + (from - to) / by;
  };
  for (int64_t i = 0; i < main.count(); ++i) {
    const int32_t body = main.body[i];
    if (body < 0) continue;
    const double by = ratio[static_cast<size_t>(body)];
    float* const position = main.position.row(i);
    store3(position, towards(load3<double>(position), load3<double>(motion.centre.row(body)), by));
    for (int64_t axis = 0; axis < 2; ++axis) main.log_scale(i, axis) -= static_cast<float>(std::log(by));
  }
  for (int64_t b = 0; b < motion.bodies(); ++b) {
    const Vec3<double> centre = load3<double>(motion.centre.row(b));
    for (int64_t key = 1; key < motion.keys(); ++key) {
      float* const shift = &motion.shift(b, key, 0);
      const Vec3<double> at = centre + load3<double>(shift);
      store3(shift, towards(at, eyes[static_cast<size_t>(key)], ratio[static_cast<size_t>(b)]) - centre);
    }
  }
}

}  // namespace traceflow
