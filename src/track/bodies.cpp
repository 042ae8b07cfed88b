#include "track/bodies.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "math/activation.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "scene/neighbours.h"
#include "scene/rows.h"
#include "track/inflation.h"
#include "track/mask_parts.h"

namespace traceflow {

namespace {

// A part of a mask with fewer pixels or surfels is ignored: it is noise, or too small to be tracked.
constexpr int64_t least_pixels = 24;
constexpr int64_t least_surfels = 24;
constexpr int32_t most_bodies = 8;
// A share of the image width. Surfels up to this far beside a part of a mask belong to it.
constexpr double label_margin = 1.0 / 120;
// A surfel stays with its body if this share of the views that see it show it in the mask or at most
// mask_margin of the image width beside it.
constexpr double mask_margin = 1.0 / 80;
constexpr double share_in_masks = 0.9;
// A share of the image width. Images are compared by means over squares of this size to each side.
constexpr double unrest_half_window = 1.0 / 80;

// Connected parts of a mask.
struct Parts {
  Tensor<int32_t> label;  // H×W, index of the part that a pixel is in or beside, -1 for none
  std::vector<std::vector<int64_t>> pixels;  // of each part
};

// Extends the labels by one pixel.
void grow(Tensor<int32_t>& label) {
  const Tensor<int32_t> before = label;
  for (int64_t y = 0; y < label.dim(0); ++y) {
    for (int64_t x = 0; x < label.dim(1); ++x) {
      if (before(y, x) >= 0) continue;
      const auto take = [&](int64_t row, int64_t column) {
        if (row < 0 || column < 0 || row >= label.dim(0) || column >= label.dim(1)) return;
        label(y, x) = std::max(label(y, x), before(row, column));
      };
      take(y - 1, x);
      take(y + 1, x);
      take(y, x - 1);
      take(y, x + 1);
    }
  }
}

Parts parts_of(const Tensor<uint8_t>& mask) {
  const int64_t height = mask.dim(0), width = mask.dim(1);
  Parts parts{Tensor<int32_t>({height, width}), {}};
  parts.label.fill(-1);
  for (std::vector<int64_t>& part : mask_parts(mask)) {
    if (static_cast<int64_t>(part.size()) < least_pixels) continue;
    for (const int64_t pixel : part) parts.label[pixel] = static_cast<int32_t>(parts.pixels.size());
    parts.pixels.push_back(std::move(part));
  }
  const int64_t margin = std::max<int64_t>(1, std::llround(label_margin * static_cast<double>(width)));
  for (int64_t k = 0; k < margin; ++k) grow(parts.label);
  return parts;
}

// A point that projects into a part of a mask.
struct Candidate {
  int64_t row;
  Vec2<float> pixel;
  float z;
};

// The rows of points no farther behind the part's front than the part is wide. Farther points are visible
// beside it at other times. The front is the median of the nearest depths in a grid of cells.
std::vector<int64_t> within_thickness(const std::vector<Candidate>& candidates, int64_t area,
                                      const Camera<float>& camera) {
  constexpr float cells_across = 6;
  const float size = std::sqrt(static_cast<float>(area));
  std::map<std::pair<int, int>, float> nearest;
  for (const Candidate& c : candidates) {
    const std::pair cell(static_cast<int>(c.pixel.x * cells_across / size),
                         static_cast<int>(c.pixel.y * cells_across / size));
    const auto [found, is_new] = nearest.emplace(cell, c.z);
    if (!is_new) found->second = std::min(found->second, c.z);
  }
  if (nearest.empty()) return {};
  std::vector<float> front;
  front.reserve(nearest.size());
  for (const auto& [cell, z] : nearest) front.push_back(z);
  const auto middle = front.begin() + static_cast<std::ptrdiff_t>(front.size() / 2);
  std::nth_element(front.begin(), middle, front.end());
  const float farthest = *middle * (1 + size / camera.focal_x);
  std::vector<int64_t> rows;
  for (const Candidate& c : candidates) {
    if (c.z <= farthest) rows.push_back(c.row);
  }
  return rows;
}

// Whether at least half of a part's points are static. Then they lie on the background of a thing without
// points.
bool is_background(const Tensor<float>& position, const std::vector<int64_t>& part,
                   const Tensor<float>& standing) {
  if (part.empty() || standing.empty()) return false;
  Tensor<float> points({static_cast<int64_t>(part.size()), 3});
  for (size_t k = 0; k < part.size(); ++k)
    std::copy_n(position.row(part[k]), 3, points.row(static_cast<int64_t>(k)));
  const Neighbours nearest = nearest_of(standing, points, 1);
  int64_t stand = 0;
  for (const float distance2 : nearest.distance2.values()) stand += distance2 == 0 ? 1 : 0;
  return 2 * stand >= points.dim(0);
}

// Whether the front of a part's points is behind what is beside the part.
bool is_behind(std::vector<Candidate> points, const std::optional<float>& beside) {
  constexpr float farther = 1.08F;
  if (points.empty() || !beside) return false;
  const auto front = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 10);
  std::nth_element(points.begin(), front, points.end(),
                   [](const Candidate& a, const Candidate& b) { return a.z < b.z; });
  return front->z > farther * *beside;
}

// A part of a mask, and the rows of the points on the thing that it shows.
struct Thing {
  std::vector<int64_t> pixels;
  std::vector<int64_t> rows, made_up;  // points of the capture; invented points
  bool is_bare = false;                // the capture's points are too few or behind it
  std::optional<float> depth_beside;
};

// position: the capture's points, `points` rows, followed by invented points on things without points.
std::vector<Thing> things_in(const Capture& capture, const View& view, const Tensor<float>& position,
                             int64_t points) {
  const std::shared_ptr<const ViewImages> images = load_images(capture, view);
  Parts parts = parts_of(images->mask);
  std::vector<std::vector<Candidate>> candidates(parts.pixels.size());
  std::vector<Thing> things(parts.pixels.size());
  std::vector<int64_t> in_mask(parts.pixels.size());
  for (int64_t i = 0; i < position.dim(0); ++i) {
    const Vec3<float> point = load3<float>(position.row(i));
    if (!view.camera.sees(point)) continue;
    const Vec3<float> at = view.camera.point_in_camera(point);
    const Vec2<float> pixel = view.camera.project(at);
    const auto row = static_cast<int64_t>(pixel.y), column = static_cast<int64_t>(pixel.x);
    if (parts.label(row, column) < 0) continue;
    const auto part = static_cast<size_t>(parts.label(row, column));
    if (i >= points) {
      things[part].made_up.push_back(i);
      continue;
    }
    candidates[part].push_back({i, pixel, at.z});
    in_mask[part] += images->mask(row, column) != 0 ? 1 : 0;
  }
  for (size_t part = 0; part < things.size(); ++part) {
    Thing& thing = things[part];
    thing.pixels = std::move(parts.pixels[part]);
    thing.rows = within_thickness(candidates[part], static_cast<int64_t>(thing.pixels.size()), view.camera);
    thing.depth_beside = depth_beside(thing.pixels, images->mask, view.camera, position);
    if (is_background(position, thing.rows, capture.standing_points)) thing.rows.clear();
    thing.is_bare = thing.rows.empty() || in_mask[part] < least_surfels ||
                    is_behind(candidates[part], thing.depth_beside);
  }
  return things;
}

// The first view with a mask; null if there is none.
const View* earliest_with_mask(const Capture& capture) {
  const View* earliest = nullptr;
  for (const View& view : capture.train) {
    if (earliest != nullptr && view.time >= earliest->time) continue;
    if (!load_images(capture, view)->mask.empty()) earliest = &view;
  }
  return earliest;
}

Tensor<float> times_of(const std::vector<View>& views) {
  std::set<float> times;
  for (const View& view : views) times.insert(view.time);
  return tensor_of(std::vector<float>(times.begin(), times.end()));
}

Vec3<float> median_of(const Surfels& surfels, const std::vector<int64_t>& rows) {
  Vec3<float> median(0);
  std::vector<float> values(rows.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (size_t k = 0; k < rows.size(); ++k) values[k] = surfels.position(rows[k], axis);
    const auto half = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
    std::nth_element(values.begin(), half, values.end());
    median[axis] = *half;
  }
  return median;
}

// The mask, dilated by a square of `margin` pixels to each side.
Tensor<uint8_t> widened(const Tensor<uint8_t>& mask, int64_t margin) {
  const int64_t height = mask.dim(0), width = mask.dim(1);
  Tensor<uint8_t> along({height, width}), wide({height, width});
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      for (int64_t k = std::max<int64_t>(0, x - margin); k <= std::min(width - 1, x + margin); ++k)
        along(y, x) = static_cast<uint8_t>(along(y, x) | mask(y, k));
    }
  }
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t k = std::max<int64_t>(0, y - margin); k <= std::min(height - 1, y + margin); ++k) {
      for (int64_t x = 0; x < width; ++x) wide(y, x) = static_cast<uint8_t>(wide(y, x) | along(k, x));
    }
  }
  return wide;
}

// Removes a mark while too few of the point's neighbours are marked. The surface of a separate object keeps
// its marks. Scattered marks disappear, and marks on part of a larger surface, such as a shadow, shrink from
// the edge.
void keep_things(const Tensor<float>& points, std::vector<char>& marked) {
  constexpr int neighbours = 16;
  constexpr double share = 0.6;
  if (points.dim(0) == 0) return;
  const Tensor<int32_t> nearest = nearest_neighbours(points, neighbours).index;
  for (bool changes = true; changes;) {
    changes = false;
    const std::vector<char> before = marked;
    for (int64_t i = 0; i < points.dim(0); ++i) {
      char& mark = marked[static_cast<size_t>(i)];
      if (mark == 0) continue;
      int around = 0;
      for (int k = 0; k < neighbours; ++k) {
        const int32_t other = nearest(i, k);
        around += other >= 0 ? before[static_cast<size_t>(other)] : 0;
      }
      if (around >= share * neighbours) continue;
      mark = 0;
      changes = true;
    }
  }
}

}  // namespace

void make_solid(const Motion& motion, Surfels& surfels) {
  constexpr float widest = 1.5F;  // medians
  // Relative to the initial width, which is the distance between neighbours. Two neighbours still cover 0.9
  // of the point half way between them.
  constexpr float share = 0.6F;
  std::vector<std::vector<float>> scales(static_cast<size_t>(motion.bodies()));
  for (int64_t i = 0; i < surfels.count(); ++i) {
    if (surfels.body[i] >= 0)
      scales[static_cast<size_t>(surfels.body[i])].push_back(
          std::max(surfels.log_scale(i, 0), surfels.log_scale(i, 1)));
  }
  std::vector<float> most;
  for (std::vector<float>& of_body : scales) {
    const auto middle = of_body.begin() + static_cast<std::ptrdiff_t>(of_body.size() / 2);
    std::nth_element(of_body.begin(), middle, of_body.end());
    most.push_back(of_body.empty() ? 0 : *middle + std::log(widest));
  }
  for (int64_t i = 0; i < surfels.count(); ++i) {
    if (surfels.body[i] < 0) continue;
    surfels.opacity_logit[i] = logit(solid_opacity);
    for (float* scale : {&surfels.log_scale(i, 0), &surfels.log_scale(i, 1)})
      *scale = std::log(share) + std::min(*scale, most[static_cast<size_t>(surfels.body[i])]);
  }
}

Tensor<float> points_on_bare_things(const Capture& capture, const Tensor<float>& points) {
  constexpr int64_t most_points = 1500;  // per thing
  std::vector<float> made;
  if (const View* const first = earliest_with_mask(capture)) {
    const std::shared_ptr<const ViewImages> images = load_images(capture, *first);
    for (const Thing& thing : things_in(capture, *first, points, points.dim(0))) {
      if (!thing.is_bare) continue;
      Tensor<float> surface =
          at_depths(thing.pixels, images->mask, first->camera, images->depth_prior, points, most_points);
      if (surface.dim(0) < least_surfels && thing.depth_beside)
        surface = inflated(thing.pixels, first->camera, *thing.depth_beside, most_points);
      made.insert(made.end(), surface.values().begin(), surface.values().end());
    }
  }
  Tensor<float> result({static_cast<int64_t>(made.size()) / 3, 3});
  std::copy(made.begin(), made.end(), result.data());
  return result;
}

std::optional<Motion> find_bodies(const Capture& capture, int64_t points, Surfels& surfels) {
  const View* const first = earliest_with_mask(capture);
  if (first == nullptr) return std::nullopt;
  std::vector<std::vector<int64_t>> rows;
  for (Thing& thing : things_in(capture, *first, surfels.position, points)) {
    std::vector<int64_t>& chosen = thing.made_up.empty() ? thing.rows : thing.made_up;
    if (static_cast<int64_t>(chosen.size()) >= least_surfels) rows.push_back(std::move(chosen));
  }
  std::stable_sort(rows.begin(), rows.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  if (rows.size() > static_cast<size_t>(most_bodies)) rows.resize(static_cast<size_t>(most_bodies));
  if (rows.empty()) return std::nullopt;

  surfels.body.resize({surfels.count()});
  surfels.body.fill(-1);
  Tensor<float> centre({static_cast<int64_t>(rows.size()), 3});
  for (size_t b = 0; b < rows.size(); ++b) {
    for (const int64_t i : rows[b]) surfels.body[i] = static_cast<int32_t>(b);
    store3(centre.row(static_cast<int64_t>(b)), median_of(surfels, rows[b]));
  }
  return still_motion(centre, times_of(capture.train));
}

int64_t release_strays(const Capture& capture, const Motion& motion, float latest, Surfels& surfels) {
  const int64_t count = surfels.count();
  std::vector<int32_t> seen(static_cast<size_t>(count)), inside(static_cast<size_t>(count));
  for (const View& view : capture.train) {
    if (view.time > latest) continue;
    const std::shared_ptr<const ViewImages> images = load_images(capture, view);
    if (images->mask.empty()) continue;
    const Tensor<uint8_t> mask =
        widened(images->mask,
                std::max<int64_t>(1, std::llround(mask_margin * static_cast<double>(view.camera.width))));
    Surfels moved;
    moved.position = surfels.position;
    moved.rotation = surfels.rotation;
    moved.sh.reset({count, 1, 3});
    motion::move(motion, surfels.body, view.time, moved);
    parallel_for("bodies: look for strays", count, [&](int64_t i) {
      const Vec3<float> point = load3<float>(moved.position.row(i));
      if (surfels.body[i] < 0 || !view.camera.sees(point)) return;
      const Vec2<float> at = view.camera.project(view.camera.point_in_camera(point));
      ++seen[static_cast<size_t>(i)];
      inside[static_cast<size_t>(i)] += mask(static_cast<int64_t>(at.y), static_cast<int64_t>(at.x));
    });
  }
  int64_t released = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    int32_t& body = surfels.body[static_cast<int64_t>(i)];
    if (body < 0 || inside[i] >= share_in_masks * seen[i]) continue;
    body = -1;
    ++released;
  }
  return released;
}

Nodes place_nodes(const Motion& motion, const Surfels& surfels, int64_t each, int64_t every) {
  constexpr double radii = 0.6;  // relative to the distance between neighbours
  std::vector<int32_t> body;
  std::vector<float> centre, radius;
  for (int32_t b = 0; b < motion.bodies(); ++b) {
    std::vector<Vec3<double>> points, chosen;
    for (int64_t i = 0; i < surfels.count(); ++i) {
      if (surfels.body[i] == b && surfels.opacity_logit[i] > 0)
        points.push_back(load3<double>(surfels.position.row(i)));
    }
    if (points.empty()) continue;
    // Farthest-point sampling, starting at the centre.
    std::vector<double> off(points.size());
    const Vec3<double> of_body = load3<double>(motion.centre.row(b));
    for (size_t k = 0; k < points.size(); ++k) off[k] = -glm::length(points[k] - of_body);
    for (int64_t n = 0; n < each; ++n) {
      const auto next = static_cast<size_t>(std::max_element(off.begin(), off.end()) - off.begin());
      if (n > 0 && !(off[next] > 0)) break;
      chosen.push_back(points[next]);
      for (size_t k = 0; k < points.size(); ++k) {
        const double distance = glm::length(points[k] - points[next]);
        off[k] = n == 0 ? distance : std::min(off[k], distance);
      }
    }
    double spacing = 0;
    for (const Vec3<double>& p : chosen) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const Vec3<double>& q : chosen) {
        if (&p != &q) nearest = std::min(nearest, glm::length(p - q));
      }
      if (chosen.size() > 1) spacing += nearest / static_cast<double>(chosen.size());
    }
    if (!(spacing > 0)) continue;
    for (const Vec3<double>& p : chosen) {
      body.push_back(b);
      for (int c = 0; c < 3; ++c) centre.push_back(static_cast<float>(p[c]));
      radius.push_back(static_cast<float>(radii * spacing));
    }
  }
  std::vector<float> times;
  for (int64_t k = 0; k < motion.keys(); k += every) times.push_back(motion.time[k]);
  const auto n = static_cast<int64_t>(body.size()), l = static_cast<int64_t>(times.size());
  Nodes nodes{tensor_of(body),          tensor_of(times),         Tensor<float>({n, 3}),   tensor_of(radius),
              Tensor<float>({n, l, 3}), Tensor<float>({n, l, 3}), Tensor<float>({n, l, 3})};
  std::copy(centre.begin(), centre.end(), nodes.centre.data());
  for (int64_t i = 0; i < n * l; ++i) store3(&nodes.anchor[3 * i], nodes::place_of(nodes, motion, i / l, 0));
  return nodes;
}

Nodes nodes_of(const Nodes& nodes, const std::vector<bool>& bodies) {
  RowEdit edit;
  std::vector<int32_t> body;
  for (int64_t n = 0; n < nodes.count(); ++n) {
    if (!bodies[static_cast<size_t>(nodes.body[n])]) continue;
    edit.keep(n);
    body.push_back(nodes.body[n]);
  }
  if (edit.count() == 0) return {};
  const PlacedEdit kept(edit, Device::cpu);
  const auto rows = [&](const Tensor<float>& values) { return edited_rows(values, kept, false); };
  return {tensor_of(body),  nodes.time,        rows(nodes.centre), rows(nodes.radius),
          rows(nodes.turn), rows(nodes.shift), rows(nodes.anchor)};
}

void take_body(int32_t body, const Motion& from, const Nodes& nodes_from, Motion& motion, Nodes& nodes) {
  std::copy_n(from.rotation.row(body), 4 * motion.keys(), motion.rotation.row(body));
  std::copy_n(from.shift.row(body), 3 * motion.keys(), motion.shift.row(body));
  for (int64_t n = 0; n < nodes.count(); ++n) {
    if (nodes.body[n] != body) continue;
    std::copy_n(nodes_from.turn.row(n), 3 * nodes.times(), nodes.turn.row(n));
    std::copy_n(nodes_from.shift.row(n), 3 * nodes.times(), nodes.shift.row(n));
  }
}

void anchor_nodes(const Motion& motion, int32_t body, Nodes& nodes) {
  for (int64_t n = 0; n < nodes.count(); ++n) {
    if (nodes.body[n] != body) continue;
    for (int64_t k = 0; k < nodes.times(); ++k)
      store3(&nodes.anchor(n, k, 0), nodes::place_of(nodes, motion, n, k));
  }
}

namespace {

// The positions of surfels at a time.
Tensor<float> positions_at(float time, const Motion& motion, const Surfels& surfels) {
  Surfels moved;
  moved.position = surfels.position;
  moved.rotation = surfels.rotation;
  moved.sh.reset({surfels.count(), 1, 3});
  motion::move(motion, surfels.body, time, moved);
  return std::move(moved.position);
}

struct Sphere {
  Vec3<float> centre;
  float radius;  // above 0
};
// The sphere of a body's opaque surfels, which are at `position`; the world's origin and 1 if it has none.
Sphere sphere_around(const Tensor<float>& position, const Surfels& surfels, int32_t body) {
  Vec3<double> sum(0);
  double squares = 0, count = 0;
  for (int64_t i = 0; i < surfels.count(); ++i) {
    if (surfels.body[i] != body || surfels.opacity_logit[i] < 0) continue;
    const Vec3<double> point = load3<double>(position.row(i));
    sum += point;
    squares += dot(point, point);
    ++count;
  }
  if (count == 0) return {Vec3<float>(0), 1};
  const Vec3<double> centroid = sum / count;
  const double radius = std::sqrt(std::max(0.0, squares / count - dot(centroid, centroid)));
  return {Vec3<float>(centroid), radius > 0 ? static_cast<float>(radius) : 1.0F};
}

}  // namespace

void carry_lighting(const Motion& motion, const Surfels& surfels, Lighting& lighting) {
  for (int64_t key = 0; key < lighting.times(); ++key) {
    const Tensor<float> position = positions_at(lighting.time[key], motion, surfels);
    for (int64_t b = 0; b < lighting.bodies(); ++b) {
      const Sphere sphere = sphere_around(position, surfels, static_cast<int32_t>(b));
      store3(&lighting.centre(b, key, 0), sphere.centre);
      if (key == 0) lighting.radius[b] = sphere.radius;
    }
  }
}

Lighting lighting_around(const Motion& motion, const Surfels& surfels, int64_t cells, int64_t every,
                         bool on_bodies) {
  constexpr float margin = 0.4F;
  std::vector<float> times;
  for (int64_t k = 0; k < motion.keys(); k += every) times.push_back(motion.time[k]);
  Vec3<float> low(std::numeric_limits<float>::infinity()), high(-low);
  for (const float time : times) {
    const Tensor<float> position = positions_at(time, motion, surfels);
    for (int64_t i = 0; i < surfels.count(); ++i) {
      if (surfels.body[i] < 0 || surfels.opacity_logit[i] < 0) continue;
      const Vec3<float> point = load3<float>(position.row(i));
      low = min(low, point);
      high = max(high, point);
    }
  }
  Vec3<float> size = high - low;
  float longest = std::max({size.x, size.y, size.z});
  if (!(longest > 0)) {  // no body has opaque surfels
    low = Vec3<float>(0);
    high = size = Vec3<float>(1);
    longest = 1;
  }
  low -= Vec3<float>(margin * longest);
  high += Vec3<float>(margin * longest);
  const float cell = longest * (1 + 2 * margin) / static_cast<float>(cells);
  const auto points = [&](float length) {
    return std::max<int64_t>(3, 1 + static_cast<int64_t>(std::lround(length / cell)));
  };
  Lighting lighting;
  lighting.box.reset({2, 3});
  store3(lighting.box.row(0), low);
  store3(lighting.box.row(1), high);
  lighting.time = tensor_of(times);
  lighting.brightness.reset(
      {lighting.times(), points(high.z - low.z), points(high.y - low.y), points(high.x - low.x)});
  if (!on_bodies) return lighting;
  lighting.centre.reset({motion.bodies(), lighting.times(), 3});
  lighting.radius.reset({motion.bodies()});
  lighting.body_brightness.reset({motion.bodies(), lighting.times(), 4});
  carry_lighting(motion, surfels, lighting);
  return lighting;
}

void Unrest::look(const Surfels& main, const View& view, const ViewImages& images,
                  const Tensor<float>& colour, const Tensor<float>& alpha, const Tensor<float>& depth) {
  constexpr float behind = 1.04F;
  const auto n = static_cast<size_t>(main.count());
  sum.resize(n);
  count.resize(n);
  const int64_t height = view.camera.height, width = view.camera.width;
  const int64_t half_window =
      std::max<int64_t>(1, std::llround(unrest_half_window * static_cast<double>(width)));
  parallel_for("bodies: look for unrest", main.count(), [&](int64_t i) {
    const Vec3<float> point = load3<float>(main.position.row(i));
    if (main.body[i] >= 0 || !view.camera.sees(point)) return;
    const Vec3<float> in_camera = view.camera.point_in_camera(point);
    const Vec2<float> at = view.camera.project(in_camera);
    const auto row = static_cast<int64_t>(at.y), column = static_cast<int64_t>(at.x);
    if (in_camera.z * alpha(row, column) > behind * depth(row, column)) return;
    Vec3<double> off(0);
    double pixels = 0;
    for (int64_t y = std::max<int64_t>(0, row - half_window); y <= std::min(height - 1, row + half_window);
         ++y) {
      for (int64_t x = std::max<int64_t>(0, column - half_window);
           x <= std::min(width - 1, column + half_window); ++x) {
        if (!images.mask.empty() && images.mask(y, x) != 0) return;
        if (!images.known.empty() && images.known(y, x) == 0) return;
        off += load3<double>(&colour(y, x, 0)) - load3<double>(&images.colour(y, x, 0));
        ++pixels;
      }
    }
    const Vec3<double> size = abs(off) / pixels;
    const double most = std::max({size.x, size.y, size.z});
    sum[static_cast<size_t>(i)] += most * most;
    ++count[static_cast<size_t>(i)];
  });
}

int64_t mark_still(const Unrest& unrest, Surfels& surfels) {
  constexpr double medians = 3, least = 0.1;
  std::vector<double> off(unrest.sum.size()), seen;
  for (size_t i = 0; i < off.size(); ++i) {
    if (unrest.count[i] == 0) continue;
    off[i] = std::sqrt(unrest.sum[i] / unrest.count[i]);
    seen.push_back(off[i]);
  }
  if (seen.empty()) return 0;
  const auto middle = seen.begin() + static_cast<std::ptrdiff_t>(seen.size() / 2);
  std::nth_element(seen.begin(), middle, seen.end());
  const double most = std::max(least, medians * *middle);

  std::vector<int64_t> rows;
  for (int64_t i = 0; i < surfels.count(); ++i) {
    if (surfels.body[i] < 0) rows.push_back(i);
  }
  Tensor<float> points({static_cast<int64_t>(rows.size()), 3});
  std::vector<char> moves(rows.size());
  for (size_t k = 0; k < rows.size(); ++k) {
    store3(points.row(static_cast<int64_t>(k)), load3<float>(surfels.position.row(rows[k])));
    moves[k] = off[static_cast<size_t>(rows[k])] > most ? 1 : 0;
  }
  keep_things(points, moves);
  int64_t still = 0;
  for (size_t k = 0; k < rows.size(); ++k) {
    if (moves[k] != 0) continue;
    surfels.body[rows[k]] = motionless;
    ++still;
  }
  return still;
}

}  // namespace traceflow
