#include "prepare/pose_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <optional>

#include "base/error.h"
#include "capture/lens/lens.h"
#include "capture/lens/resample.h"
#include "files/limits.h"
#include "files/png.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;

constexpr const char* megasam_files = "SCENE_sgd_cvd_hr.npz or SCENE_droid.npz of MegaSaM";

void require_shape(const NpyFile& array, const char* name, bool is_right, const char* expected) {
  if (is_right) return;
  throw InputError(array.path().string(), name, array.shape().to_string(), expected,
                   fmt::format("give {}", megasam_files));
}

Camera<double> lens_of(const fs::path& path, int64_t width, int64_t height) {
  const NpyFile array(path, "intrinsic");
  require_shape(array, "intrinsic", array.shape() == Shape{3, 3}, "3×3");
  const Tensor<float> k = array.read();
  const auto refuse = [&](const std::string& found, const std::string& expected) {
    throw InputError(path.string(), "intrinsic", found, expected,
                     "write it in pixels of the file's images, as MegaSaM does");
  };
  for (const float value : k.values()) {
    if (!std::isfinite(value)) refuse(fmt::format("{}", value), "finite numbers");
  }
  const double fx = k(0, 0), fy = k(1, 1), cx = k(0, 2), cy = k(1, 2);
  constexpr double no_skew = 1e-3;
  if (std::abs(k(0, 1)) > no_skew * std::abs(fx) || k(1, 0) != 0 || k(2, 0) != 0 || k(2, 1) != 0 ||
      k(2, 2) != 1)
    refuse("other entries than fx, fy, cx and cy", "[fx 0 cx; 0 fy cy; 0 0 1]");
  // Wider pinholes are rather intrinsics of unit images.
  constexpr double shortest = 0.1, longest = 100;
  const auto side = static_cast<double>(std::max(width, height));
  for (const double focal : {fx, fy}) {
    if (!(focal >= shortest * side && focal <= longest * side))
      refuse(fmt::format("a focal length of {:g}", focal),
             fmt::format("{:g} to {:g} pixels for images of {}×{}", shortest * side, longest * side, width,
                         height));
  }
  if (!(cx > 0 && cy > 0 && cx < static_cast<double>(width) && cy < static_cast<double>(height)))
    refuse(fmt::format("a principal point of ({:g}, {:g})", cx, cy),
           fmt::format("one inside images of {}×{}", width, height));
  Camera<double> lens;
  lens.width = static_cast<int>(width);
  lens.height = static_cast<int>(height);
  lens.focal_x = fx;
  lens.focal_y = fy;
  // MegaSaM projects to whole numbers at pixels' centres, here these are halves.
  lens.centre_x = cx + 0.5;
  lens.centre_y = cy + 0.5;
  return lens;
}

// The side that MegaSaM scaled a frame to before it cut to `side`, if its rule gives this. exact: by the
// rule, without rounding. The input's proportions may differ from the frames' by rounding, hence one pixel
// more or less.
std::optional<double> uncut_side(double exact, int64_t side) {
  constexpr double rounding = 1e-6;
  const auto whole = static_cast<int64_t>(exact + rounding);
  for (const int64_t scaled : {whole, whole + 1, whole - 1}) {
    if (scaled - scaled % 8 == side) return static_cast<double>(scaled);
  }
  return std::nullopt;
}

// Small, so that the file's resampling, compression and colours do not matter.
Tensor<float> thumbnail(const Tensor<float>& image, double width, double height) {
  constexpr int64_t columns = 32, rows = 24;
  return resample(image, {columns, rows, width / columns, height / rows});
}

// The correlation of the green channels; 1 if one is nearly uniform, which says nothing.
double likeness(const Tensor<float>& a, const Tensor<float>& b) {
  constexpr double flat = 1e-4;
  const int64_t count = a.dim(0) * a.dim(1);
  const auto n = static_cast<double>(count);
  double sum_a = 0, sum_b = 0, aa = 0, bb = 0, ab = 0;
  for (int64_t i = 0; i < count; ++i) {
    const double x = a[3 * i + 1], y = b[3 * i + 1];
    sum_a += x;
    sum_b += y;
    aa += x * x;
    bb += y * y;
    ab += x * y;
  }
  const double var_a = aa / n - sum_a * sum_a / n / n, var_b = bb / n - sum_b * sum_b / n / n;
  if (!(var_a > flat && var_b > flat)) return 1;
  return (ab / n - sum_a * sum_b / n / n) / std::sqrt(var_a * var_b);
}

}  // namespace

PoseFile::PoseFile(const fs::path& path)
    : cameras_(path, "cam_c2w"), images_(path, "images"), depths_(path, "depths") {
  const Shape cameras = cameras_.shape(), images = images_.shape(), depths = depths_.shape();
  require_shape(cameras_, "cam_c2w", cameras.rank() == 3 && cameras[1] == 4 && cameras[2] == 4, "T×4×4");
  require_shape(images_, "images",
                images.rank() == 4 && images[3] == 3 && images[0] == cameras[0] && images.elements() > 0,
                fmt::format("{}×H×W×3, one for each camera", cameras[0]).c_str());
  require_shape(depths_, "depths", depths == Shape{images[0], images[1], images[2]},
                fmt::format("{}×{}×{}, as images has", images[0], images[1], images[2]).c_str());
  require_shape(depths_, "depths", is_image_size(depths[2], depths[1]), image_size_limits);
  lens_ = lens_of(path, width(), height());
}

Camera<double> PoseFile::camera(int64_t i) const {
  constexpr double tolerance = 0.01;
  const Tensor<float> m = cameras_.slice(i);
  const auto refuse = [&](const std::string& found) {
    throw InputError(path().string(), fmt::format("cam_c2w[{}]", i), found,
                     "a rotation and a position, with [0 0 0 1] below",
                     "write camera-to-world matrices as MegaSaM does");
  };
  for (const float value : m.values()) {
    if (!std::isfinite(value)) refuse(fmt::format("{}", value));
  }
  if (m(3, 0) != 0 || m(3, 1) != 0 || m(3, 2) != 0 || m(3, 3) != 1)
    refuse(fmt::format("the last row [{} {} {} {}]", m(3, 0), m(3, 1), m(3, 2), m(3, 3)));
  Mat3<double> turn;  // world from camera
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) turn[column][row] = m(row, column);
  }
  const Mat3<double> product = glm::transpose(turn) * turn;
  double worst = 0;
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) worst = std::max(worst, std::abs(product[a][b] - (a == b ? 1 : 0)));
  }
  if (!(worst <= tolerance)) refuse("a matrix that scales or shears");
  if (determinant(turn) < 0) refuse("a matrix that mirrors");
  Camera<double> camera = lens_;
  camera.camera_from_world = glm::mat3_cast(glm::normalize(glm::conjugate(glm::quat_cast(turn))));
  camera.position = {m(0, 3), m(1, 3), m(2, 3)};
  return camera;
}

std::vector<int64_t> PoseFile::match(const Frames& frames) const {
  const auto chosen = static_cast<int64_t>(frames.frames.size());
  const int64_t of_source = frames.source_frames.front();
  if (count() != chosen && count() != of_source) {
    throw InputError(path().string(), "cam_c2w", fmt::format("{} cameras", count()),
                     fmt::format("one for each of {} frames, or of the {} pictures they were taken from",
                                 chosen, of_source),
                     "run MegaSaM on the frames that --until frames writes");
  }
  std::vector<int64_t> matched;
  for (const Frame& frame : frames.frames)
    matched.push_back(count() == of_source ? frame.index : static_cast<int64_t>(matched.size()));
  return matched;
}

Vec2<double> PoseFile::frame_pixels(double frame_width, double frame_height) const {
  constexpr double area = 384.0 * 512.0;
  const double scale = std::sqrt(area / (frame_width * frame_height));
  const std::optional<double> uncut_width = uncut_side(scale * frame_width, width()),
                              uncut_height = uncut_side(scale * frame_height, height());
  if (uncut_width && uncut_height) return {frame_width / *uncut_width, frame_height / *uncut_height};
  const auto own_width = static_cast<double>(width()), own_height = static_cast<double>(height());
  if (!same_proportions(own_width, own_height, frame_width, frame_height)) {
    throw InputError(path().string(), "images", fmt::format("{}×{}", width(), height()),
                     fmt::format("the proportions of {}×{}", frame_width, frame_height),
                     "run MegaSaM on the frames that --until frames writes");
  }
  return {frame_width / own_width, frame_height / own_height};
}

void require_fit(const PoseFile& file, const Frames& frames, const fs::path& pictures) {
  constexpr int64_t most_compared = 8;
  constexpr double least_likeness = 0.8;
  const std::vector<int64_t> matched = file.match(frames);
  const Frame& first = frames.frames.front();
  const Vec2<double> scale =
      file.frame_pixels(static_cast<double>(first.width), static_cast<double>(first.height));
  const auto width = static_cast<double>(file.width()), height = static_cast<double>(file.height());
  const auto count = static_cast<int64_t>(matched.size()), compared = std::min(most_compared, count);
  for (int64_t k = 0; k < compared; ++k) {
    const auto i = static_cast<size_t>(k * count / compared);
    const Frame& frame = frames.frames[i];
    const Tensor<float> mine =
        thumbnail(from_8bit(read_png(pictures / (frame.id + ".png"))), width * scale.x, height * scale.y);
    Tensor<float> theirs = file.image(matched[i]);
    for (float& value : theirs.values()) value /= 255;
    const double found = likeness(mine, thumbnail(theirs, width, height));
    if (found >= least_likeness) continue;
    throw InputError(file.path().string(), fmt::format("images[{}]", matched[i]),
                     fmt::format("a picture unlike frame {} (correlation {:.2f})", frame.id, found),
                     fmt::format("the same picture (at least {:g})", least_likeness),
                     "run MegaSaM on the frames that --until frames writes");
  }
}

}  // namespace traceflow::prepare
