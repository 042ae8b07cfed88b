#include "capture/motion_truth.h"

#include <fmt/format.h>

#include <cmath>

#include "base/error.h"
#include "capture/image_cache.h"
#include "files/npy.h"

namespace traceflow {

namespace {

Tensor<float> read_points(const TreeFile& file) {
  const NpyFile array(file.open());
  const Shape& shape = array.shape();
  if (shape.rank() != 3 || shape[2] != 3 || shape[0] < 2 || shape[1] < 1) {
    throw InputError(file.name(), "shape", shape.to_string(),
                     "T×N×3: N points, one at least, at T times, two at least");
  }
  Tensor<float> points = array.read();
  for (int64_t i = 0; i < points.size(); ++i) {
    if (std::isfinite(points[i])) continue;
    throw InputError(file.name(), fmt::format("time {}, point {}", i / (3 * shape[1]), i / 3 % shape[1]),
                     fmt::format("{}", points[i]), "finite coordinates");
  }
  return points;
}

Tensor<int32_t> read_objects(const TreeFile& file, int64_t points) {
  const NpyFile array(file.open());
  if (array.shape() != Shape{points}) {
    throw InputError(file.name(), "shape", array.shape().to_string(),
                     fmt::format("one number for each of the {} points of points.npy", points));
  }
  // Arrays are read in single precision, which holds integers exactly up to here.
  constexpr float largest = 1 << 24;
  const Tensor<float> read = array.read();
  Tensor<int32_t> object({points});
  for (int64_t i = 0; i < points; ++i) {
    if (!(std::abs(read[i]) < largest) || std::trunc(read[i]) != read[i]) {
      throw InputError(file.name(), fmt::format("point {}", i), fmt::format("{}", read[i]),
                       "the whole number of an object, below 2²⁴");
    }
    object[i] = static_cast<int32_t>(read[i]);
  }
  return object;
}

}  // namespace

std::optional<MotionTruth> load_motion_truth(const Capture& capture) {
  const CaptureSource& source = capture.images->capture();
  if (!source.motion_points && !source.motion_objects) return std::nullopt;
  for (const auto& [file, name] :
       {std::pair(&source.motion_points, "points.npy"), std::pair(&source.motion_objects, "object.npy")}) {
    if (*file) continue;
    throw InputError((capture.folder / "truth/motion" / name).string(), "", "no such file",
                     "points.npy and object.npy, both or neither",
                     "add it, or take truth/motion out of the capture");
  }
  MotionTruth truth;
  truth.points = read_points(source.motion_points);
  truth.object = read_objects(source.motion_objects, truth.count());
  return truth;
}

}  // namespace traceflow
