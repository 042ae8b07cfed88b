#include "prepare/given_poses.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <glm/gtc/quaternion.hpp>
#include <iterator>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "files/png.h"
#include "prepare/depth_points.h"
#include "prepare/masks.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;

constexpr int64_t most_points = 30000, fewest_points = 100;
// Of all sampled depths. In synthetic captures 54 to 76 % agreed, and 1 to 4 % with cameras of other axes.
constexpr double least_agreeing = 0.02, doubtful = 0.2;
constexpr double largest_point_error = 2;       // pixels of a frame, as good_points accepts
constexpr double largest_error_share = 0.0025;  // of the longest side, for small frames

// Which frames' depth maps are used: as many as fit into a quarter of a gigabyte, evenly spread.
std::vector<int64_t> frames_with_depth(const PoseFile& file, int64_t count) {
  constexpr int64_t most_depths = int64_t{1} << 26;
  const int64_t used = std::min(count, std::max(fewest_frames, most_depths / (file.width() * file.height())));
  std::vector<int64_t> chosen;
  for (int64_t k = 0; k < used; ++k) chosen.push_back(k * count / used);
  return chosen;
}

// Without depth where the mask is white. scale: pixels of the mask for each of the depth map.
void remove_masked(const Tensor<uint8_t>& mask, const Vec2<double>& scale, Tensor<float>& depth) {
  const auto at = [](int64_t pixel, double pixels, int64_t end) {
    return std::min(static_cast<int64_t>((static_cast<double>(pixel) + 0.5) * pixels), end - 1);
  };
  for (int64_t y = 0; y < depth.dim(0); ++y) {
    for (int64_t x = 0; x < depth.dim(1); ++x) {
      if (mask(at(y, scale.y, mask.dim(0)), at(x, scale.x, mask.dim(1))) != 0) depth(y, x) = 0;
    }
  }
}

double share_agreeing(const AgreeingPoints& found) {
  return static_cast<double>(found.agreeing) / static_cast<double>(std::max<int64_t>(1, found.sampled));
}

struct Convention {
  const char* name;
  Camera<double> (*as_expected)(Camera<double>);
};
constexpr std::array<Convention, 2> other_conventions = {
    {{"camera axes x right, y up, z backward",
      [](Camera<double> camera) {
        for (int column = 0; column < 3; ++column)
          camera.camera_from_world[column] *= Vec3<double>(1, -1, -1);
        return camera;
      }},
     {"matrices from world to camera", [](Camera<double> camera) {
        camera.position = -(camera.camera_from_world * camera.position);
        camera.camera_from_world = glm::transpose(camera.camera_from_world);
        return camera;
      }}}};

// Throws InputError if the depths agree far better with cameras of another convention.
void refuse_other_conventions(const fs::path& path, double share, std::vector<DepthView> views,
                              double largest_error, const Work& work) {
  // Inverse matrices have agreed on 26 % of depths of a wrong unit.
  constexpr double convincing = 0.4, far_better = 2;
  std::vector<Camera<double>> cameras;
  cameras.reserve(views.size());
  for (const DepthView& view : views) cameras.push_back(view.camera);
  for (const Convention& other : other_conventions) {
    for (size_t i = 0; i < views.size(); ++i) views[i].camera = other.as_expected(cameras[i]);
    const double share_there = share_agreeing(agreeing_points(views, largest_error, most_points, work));
    if (share_there < std::max(convincing, far_better * share)) continue;
    throw InputError(
        path.string(), "cam_c2w",
        fmt::format("{}, with which three frames agree on {:.0f}% of the depths, instead of {:.0f}%",
                    other.name, 100 * share_there, 100 * share),
        "matrices from camera to world, camera axes x right, y down, z forward");
  }
}

std::string images_text(const Frames& frames, const std::vector<Camera<double>>& cameras,
                        const std::vector<std::string>& features) {
  std::string text = "# IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then X Y POINT3D_ID of each point\n";
  for (size_t i = 0; i < cameras.size(); ++i) {
    const glm::dquat q = glm::quat_cast(cameras[i].camera_from_world);
    const Vec3<double> t = -(cameras[i].camera_from_world * cameras[i].position);
    fmt::format_to(std::back_inserter(text), "{} {} {} {} {} {} {} {} 1 {}.png\n{}\n", i + 1, q.w, q.x, q.y,
                   q.z, t.x, t.y, t.z, frames.frames[i].id, features[i]);
  }
  return text;
}

void write_model(const fs::path& folder, const Frames& frames, const std::vector<Camera<double>>& cameras,
                 const Camera<double>& lens, const std::vector<DepthPoint>& points) {
  std::vector<std::string> features(frames.frames.size());
  std::vector<int64_t> count(frames.frames.size());
  std::string list = "# POINT3D_ID X Y Z R G B ERROR, then IMAGE_ID POINT2D_IDX of each image\n";
  for (size_t i = 0; i < points.size(); ++i) {
    const DepthPoint& point = points[i];
    // Grey, since nothing reads the colours.
    fmt::format_to(std::back_inserter(list), "{} {} {} {} 128 128 128 {}", i + 1, point.position.x,
                   point.position.y, point.position.z, point.error);
    for (const DepthPoint::Sighting& sighting : point.seen) {
      const auto image = static_cast<size_t>(sighting.view);
      fmt::format_to(std::back_inserter(list), " {} {}", image + 1, count[image]++);
      fmt::format_to(std::back_inserter(features[image]), "{:.2f} {:.2f} {} ", sighting.at.x, sighting.at.y,
                     i + 1);
    }
    list += '\n';
  }
  fs::create_directories(folder);
  write_atomically(folder / "cameras.txt",
                   fmt::format("1 PINHOLE {} {} {} {} {} {}\n", lens.width, lens.height, lens.focal_x,
                               lens.focal_y, lens.centre_x, lens.centre_y));
  write_atomically(folder / "images.txt", images_text(frames, cameras, features));
  write_atomically(folder / "points3D.txt", list);
}

}  // namespace

std::string use_given_poses(const PoseFile& file, const Frames& frames, const fs::path& masks,
                            const PoseFolder& folder, const Work& work) {
  const std::vector<int64_t> matched = file.match(frames);
  const Frame& frame = frames.frames.front();
  const Vec2<double> scale =
      file.frame_pixels(static_cast<double>(frame.width), static_cast<double>(frame.height));
  std::vector<Camera<double>> cameras;
  cameras.reserve(matched.size());
  for (const int64_t index : matched) cameras.push_back(file.camera(index));

  // Read the depths of what does not move.
  const std::vector<int64_t> used = frames_with_depth(file, static_cast<int64_t>(matched.size()));
  std::vector<DepthView> views;
  for (const int64_t i : used) {
    work.check();
    const auto k = static_cast<size_t>(i);
    views.push_back({cameras[k], file.depth(matched[k])});
    const fs::path mask = masks / (frames.frames[k].id + ".png");
    if (fs::exists(mask)) remove_masked(as_mask(read_png(mask)), scale, views.back().depth);
    work.tell(static_cast<int64_t>(views.size()), static_cast<int64_t>(used.size()));
  }

  // Find points that several of them agree on.
  const double largest_error =
      std::min(largest_point_error / std::max(scale.x, scale.y),
               largest_error_share * static_cast<double>(std::max(file.width(), file.height())));
  AgreeingPoints found = agreeing_points(views, largest_error, most_points, work);
  const auto count = static_cast<int64_t>(found.points.size());
  const double share = share_agreeing(found);
  if (share < doubtful) refuse_other_conventions(file.path(), share, std::move(views), largest_error, work);
  if (count < fewest_points || share < least_agreeing) {
    throw InputError(
        file.path().string(), "depths",
        fmt::format("{} of {} sampled pixels where three frames agree", found.agreeing, found.sampled),
        fmt::format("at least {} and {:g}%", fewest_points, 100 * least_agreeing),
        "see that depths and positions have one unit, and that the camera moves sideways");
  }

  // Convert them to pixels of the frames.
  for (DepthPoint& point : found.points) {
    point.error *= std::max(scale.x, scale.y);
    for (DepthPoint::Sighting& sighting : point.seen)
      sighting = {used[static_cast<size_t>(sighting.view)], sighting.at * scale};
  }
  Camera<double> lens = cameras.front();
  lens.width = static_cast<int>(frame.width);
  lens.height = static_cast<int>(frame.height);
  lens.focal_x *= scale.x;
  lens.focal_y *= scale.y;
  lens.centre_x *= scale.x;
  lens.centre_y *= scale.y;

  const std::string name = "0";
  fs::remove_all(folder.models());
  write_model(folder.models() / name, frames, cameras, lens, found.points);
  write_atomically(folder.chosen(), name);
  return fmt::format(
      "{} cameras of {}, {} points (three frames agree on {:.0f}% of its depths), "
      "reprojection error {:.2f} px, focal length of {:.0f} px for {}×{}",
      cameras.size(), file.path().filename().string(), count, 100 * share,
      mean_error(read_chosen_model(folder)), lens.focal_x, lens.width, lens.height);
}

}  // namespace traceflow::prepare
