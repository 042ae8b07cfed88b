#include "track/body_in_film.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/parallel.h"
#include "math/rotation_group.h"
#include "ops/deform/deform.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "track/bodies.h"
#include "track/body_surface.h"

namespace traceflow {

BodyInFilm::BodyInFilm(const Surfels& surfels, int32_t of_body, const raster::Options& drawing, Motion& moves,
                       Nodes* bends)
    : main(surfels), body(of_body), options(drawing), motion(moves), all_nodes(bends) {
  for (int64_t n = 0; all_nodes != nullptr && n < all_nodes->count(); ++n) {
    if (all_nodes->body[n] == body) nodes.push_back(n);
  }
  choose_points();
}

void BodyInFilm::observe(FilmViews views) {
  film = std::move(views);
  in_views.clear();
  for (const FilmView& view : *film) {
    BodyInView in_view;
    in_view.view = &view;
    if (bends())
      in_view.span = motion::KeySpan<float>(all_nodes->time.data(), times(), motion.time[view.key]);
    in_views.push_back(std::move(in_view));
  }
  find_what_is_in_front();
}

void BodyInFilm::choose_points() {
  constexpr size_t most_points = 1000;
  std::vector<int64_t> opaque;
  double square = 0;
  for (int64_t i = 0; i < main.count(); ++i) {
    if (main.body[i] != body || !(main.opacity_logit[i] > 0)) continue;
    const Vec3<double> arm = load3<double>(main.position.row(i)) - load3<double>(motion.centre.row(body));
    square += dot(arm, arm);
    opaque.push_back(i);
  }
  if (square > 0) radius = std::sqrt(square / static_cast<double>(opaque.size()));
  const size_t every = (opaque.size() + most_points - 1) / most_points;
  for (size_t i = 0; i < opaque.size(); i += every) {
    const int64_t surfel = opaque[i];
    const Vec4<double> rotation = unit_quaternion(load4<double>(main.rotation.row(surfel)));
    FilmPoint point{load3<double>(main.position.row(surfel)), rotation_from_quaternion(rotation)[2], {}};
    find_nodes(point);
    points.push_back(std::move(point));
  }
}

void BodyInFilm::find_nodes(FilmPoint& point) const {
  for (size_t n = 0; n < nodes.size(); ++n) {
    const Vec3<double> arm = (point.rest - load3<double>(all_nodes->centre.row(nodes[n]))) / node_radius(n);
    point.nodes.push_back({static_cast<int64_t>(n), -dot(arm, arm) / 2});
  }
  std::stable_sort(point.nodes.begin(), point.nodes.end(),
                   [](const NodeWeight& a, const NodeWeight& b) { return a.weight > b.weight; });
  if (point.nodes.size() > most_nodes) point.nodes.resize(most_nodes);
  double sum = 0;
  const double largest = point.nodes.empty() ? 0 : point.nodes.front().weight;
  for (NodeWeight& of : point.nodes) sum += of.weight = std::exp(of.weight - largest);
  for (NodeWeight& of : point.nodes) of.weight /= sum;
}

void BodyInFilm::pose(BodyInView& in_view) const {
  in_view.rotation = rotations_at(motion, in_view.view->key)[static_cast<size_t>(body)];
  in_view.nodes.clear();
  for (size_t n = 0; n < nodes.size(); ++n) {
    const auto at = [&](const Tensor<float>& values) {
      const Vec3<double> from = load3<double>(&values(nodes[n], in_view.span.from, 0));
      return from + in_view.span.share * (load3<double>(&values(nodes[n], in_view.span.to, 0)) - from);
    };
    const Vec3<double> turned = at(all_nodes->turn);
    in_view.nodes.push_back({rotation_from_quaternion(quaternion_exp(turned)),
                             load3<double>(all_nodes->centre.row(nodes[n])), at(all_nodes->shift), turned});
  }
}

Vec3<double> BodyInFilm::bent(const FilmPoint& point, const BodyInView& in_view) {
  if (point.nodes.empty()) return point.rest;
  Vec3<double> sum(0);
  for (const NodeWeight& of : point.nodes) {
    const NodeInView& node = in_view.nodes[static_cast<size_t>(of.node)];
    sum += of.weight * (node.rotation * (point.rest - node.rest) + node.rest + node.shift);
  }
  return sum;
}
Mat3<double> BodyInFilm::bend_of(const FilmPoint& point, const BodyInView& in_view) {
  Vec3<double> sum(0);
  for (const NodeWeight& of : point.nodes)
    sum += of.weight * in_view.nodes[static_cast<size_t>(of.node)].turn;
  return rotation_from_quaternion(quaternion_exp(sum));
}
Vec3<double> BodyInFilm::arm(const FilmPoint& point, const BodyInView& in_view) const {
  return in_view.rotation * (bent(point, in_view) - load3<double>(motion.centre.row(body)));
}
Vec3<double> BodyInFilm::pivot(const BodyInView& in_view) const {
  return load3<double>(motion.centre.row(body)) + load3<double>(&motion.shift(body, in_view.view->key, 0));
}

void BodyInFilm::find_what_is_in_front() {
  for (BodyInView& in_view : in_views) {
    pose(in_view);
    PosedSurfels posed;
    const float time = motion.time[in_view.view->key];
    deform::forward(main, nullptr, time, {}, 0, field::Precision::fp32, posed, nullptr);
    if (all_nodes != nullptr) nodes::forward(*all_nodes, main.body, time, {}, posed, *nodes::make_saved());
    motion::forward(motion, main.body, time, {}, posed, *motion::make_saved());
    for (int64_t i = 0; i < main.count(); ++i) posed.opacity[i] = main.body[i] < 0 ? 0 : solid_opacity;
    raster::Output picture;
    raster::forward(posed, in_view.view->drawn, options, picture, nullptr);
    find_what_is_in_front(picture, in_view);
  }
}

void BodyInFilm::find_what_is_in_front(const raster::Output& picture, BodyInView& in_view) const {
  constexpr float known = 0.7F;         // share of a pixel that bodies must cover
  constexpr double behind = 0.1;        // radii
  constexpr double least_cosine = 0.3;  // between the surface and the ray to it
  const Camera<double> camera = convert<double>(in_view.view->drawn);
  in_view.in_front.assign(points.size(), 0);
  for (size_t i = 0; i < points.size(); ++i) {
    const Vec3<double> at = pivot(in_view) + arm(points[i], in_view);
    const Vec3<double> in_camera = camera.point_in_camera(at), ray = at - camera.position;
    const Vec3<double> normal = in_view.rotation * (bend_of(points[i], in_view) * points[i].normal);
    if (!(in_camera.z > 0) || std::abs(dot(normal, ray)) < least_cosine * length(ray)) continue;
    const Vec2<double> pixel = camera.project(in_camera);
    const auto column = static_cast<int64_t>(std::floor(pixel.x)),
               row = static_cast<int64_t>(std::floor(pixel.y));
    if (column < 0 || row < 0 || column >= camera.width || row >= camera.height) continue;
    const int64_t k = row * camera.width + column;
    in_view.in_front[i] =
        picture.alpha[k] >= known && in_camera.z < picture.depth[k] + behind * radius ? 1 : 0;
  }
}

void BodyInFilm::show(bool with_derivatives) {
  parallel_for(
      "adjust: show", static_cast<int64_t>(in_views.size()),
      [&](int64_t k) { show(in_views[static_cast<size_t>(k)], with_derivatives); }, 1);
}

void BodyInFilm::show(BodyInView& in_view, bool with_derivatives) const {
  pose(in_view);
  in_view.shown.assign(points.size(), {});
  for (size_t i = 0; i < points.size(); ++i) {
    if (in_view.in_front[i] == 0) continue;
    ShownPoint& shown = in_view.shown[i];
    shown.arm = arm(points[i], in_view);
    shown.bend = bend_of(points[i], in_view);
    shown.is_shown = show(in_view, in_view.view->photo, 0, with_derivatives, shown);
    if (!shown.is_shown || in_view.view->normals.detail.empty()) continue;
    shown.has_normal = show(in_view, in_view.view->normals, 3, with_derivatives, shown);
    if (shown.has_normal) take_to_rest(in_view, with_derivatives, shown);
  }
}

bool BodyInFilm::show(const BodyInView& in_view, const DetailPhoto& photo, size_t first,
                      bool with_derivatives, ShownPoint& shown) const {
  const Camera<double> camera = convert<double>(photo.camera);
  const Vec3<double> in_camera = camera.point_in_camera(pivot(in_view) + shown.arm);
  if (!(in_camera.z > 0)) return false;
  const Vec2<double> pixel = camera.project(in_camera);
  const std::optional<PhotoSample> there = sample_at(photo, pixel.x, pixel.y);
  if (!there) return false;
  const auto [x_by, y_by] = pixel_by_point(camera, in_camera);
  const Mat3<double> to_rest = transpose(in_view.rotation * shown.bend);
  for (size_t c = 0; c < 3; ++c) {
    const int axis = static_cast<int>(c);
    shown.value[first + c] = there->value[axis];
    if (with_derivatives)
      shown.by_point[first + c] = to_rest * (there->by_x[axis] * x_by + there->by_y[axis] * y_by);
  }
  return true;
}

void BodyInFilm::take_to_rest(const BodyInView& in_view, bool with_derivatives, ShownPoint& shown) {
  const Vec3<double> in_body =
      transpose(in_view.rotation) * Vec3<double>(shown.value[3], shown.value[4], shown.value[5]);
  const Vec3<double> at_rest = transpose(shown.bend) * in_body;
  const std::array<Vec3<double>, 3> by_point = {shown.by_point[3], shown.by_point[4], shown.by_point[5]};
  const Mat3<double> to_rest = transpose(in_view.rotation * shown.bend);
  for (int c = 0; c < 3; ++c) {
    const auto k = static_cast<size_t>(c);
    shown.value[3 + k] = at_rest[c];
    if (!with_derivatives) continue;
    shown.by_point[3 + k] =
        to_rest[0][c] * by_point[0] + to_rest[1][c] * by_point[1] + to_rest[2][c] * by_point[2];
    shown.by_turn[k] = cross(shown.bend[c], in_body);
  }
}

}  // namespace traceflow
