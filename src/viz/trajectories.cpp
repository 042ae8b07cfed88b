#include "viz/trajectories.h"

#include <algorithm>

#include "base/error.h"
#include "files/glb_writer.h"
#include "files/npy.h"
#include "viz/track_picture.h"

namespace traceflow::viz {

Trajectories follow_surfels(const Subject& subject, std::vector<Shot> shots,
                            const TrajectoryProgress& progress) {
  std::ranges::stable_sort(shots, [](const Shot& a, const Shot& b) { return *a.time < *b.time; });
  std::vector<float> times;
  times.reserve(shots.size());
  for (const Shot& shot : shots) times.push_back(*shot.time);
  std::vector<float> capture_times = times;
  capture_times.erase(std::unique(capture_times.begin(), capture_times.end()), capture_times.end());

  FrameRequest request = subject.request;
  request.specular = false;
  const TrackFollower follower(subject.scene, request, subject.render, std::move(capture_times));
  const int64_t count = follower.chosen().size();
  if (count == 0) {
    throw InputError("trajectories", "", "no surfel that moves", "at least one",
                     "lower --tracks-least-move, if something does");
  }
  const auto views = static_cast<int64_t>(shots.size());
  Trajectories result{tensor_of(times), Tensor<float>({views, count, 3}), Tensor<float>({views, count, 2}),
                      Tensor<float>({views, count}), follower.hues()};
  Renderer renderer(subject.render);
  for (int64_t t = 0; t < views; ++t) {
    const Shot& shot = shots[static_cast<size_t>(t)];
    request.camera = shot.camera;
    request.time = *shot.time;
    const Frame& frame = renderer.forward(subject.scene, request);
    const Tensor<float> position = follower.positions(subject.scene, request.time);
    const PointViewer viewer(frame);
    for (int64_t p = 0; p < count; ++p) {
      const Vec3<double> point = load3<double>(position.row(p));
      store3(&result.position(t, p, 0), subject.scene.normalisation.in_capture(point));
      const SeenPoint seen = viewer.see(point);
      // CoTracker's first pixel has its centre at 0.
      result.tracks(t, p, 0) = static_cast<float>(seen.place.x - 0.5);
      result.tracks(t, p, 1) = static_cast<float>(seen.place.y - 0.5);
      result.visibility(t, p) = seen.visible ? 1 : 0;
    }
    if (progress) progress(static_cast<size_t>(t + 1), shots.size());
  }
  return result;
}

void write_trajectories_npz(const std::filesystem::path& path, const Trajectories& trajectories) {
  write_npz(path, {{"tracks", &trajectories.tracks},
                   {"visibility", &trajectories.visibility},
                   {"position", &trajectories.position},
                   {"time", &trajectories.time}});
}

void write_trajectories_glb(const std::filesystem::path& path, const Trajectories& trajectories) {
  const int64_t views = trajectories.position.dim(0), count = trajectories.count();
  Tensor<float> vertices({views * count, 3}), colours({views * count, 3});
  Tensor<int32_t> lines({(views - 1) * count, 2});
  for (int64_t t = 0; t < views; ++t) {
    for (int64_t p = 0; p < count; ++p) {
      const int64_t vertex = t * count + p;
      store3(vertices.row(vertex), load3<float>(&trajectories.position(t, p, 0)));
      store3(colours.row(vertex), rainbow_colour(trajectories.hue[static_cast<size_t>(p)]));
      if (t == 0) continue;
      lines(vertex - count, 0) = static_cast<int32_t>(vertex - count);
      lines(vertex - count, 1) = static_cast<int32_t>(vertex);
    }
  }
  GlbWriter writer(vertices);
  writer.set_colours(colours);
  writer.write(path, GlbPrimitive::lines, lines);
}

}  // namespace traceflow::viz
