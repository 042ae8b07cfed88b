#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "ops/motion/key_span.h"
#include "ops/raster/raster.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"
#include "track/photo_alignment.h"

// What the views of a video show of the points of a body (track/photometric_adjustment.h).
namespace traceflow {

// A view of the video, as the adjustment compares it with others.
struct FilmView {
  int64_t key = 0;      // of the motion
  Camera<float> drawn;  // of the render that determines visibility
  DetailPhoto photo;
  DetailPhoto normals;  // of the prior, in world axes, where the mask is set; empty without priors
};

// Ascending by key.
using FilmViews = std::shared_ptr<const std::vector<FilmView>>;

inline constexpr size_t film_channels = 6;  // detail and normal
inline constexpr size_t most_nodes = 4;     // that move a point: those with the largest weights

// A node that moves a point: its index among the body's nodes, and its weight.
struct NodeWeight {
  int64_t node = 0;
  double weight = 0;
};

// A point of the body's surface at rest.
struct FilmPoint {
  Vec3<double> rest, normal;
  std::vector<NodeWeight> nodes;
};

// A node at the time of a view.
struct NodeInView {
  Mat3<double> rotation;
  Vec3<double> rest, shift, turn;
};

// What a view shows of a point.
struct ShownPoint {
  bool is_shown = false, has_normal = false;
  Mat3<double> bend{1};
  Vec3<double> arm{0};  // from the body's pivot, in world axes
  std::array<double, film_channels> value{};
  std::array<Vec3<double>, film_channels> by_point{};  // by the position in the rest frame
  std::array<Vec3<double>, 3> by_turn{};               // of the normal, by a rotation of the deformed frame
};

// The pose of the body in a view, and what the view shows of it.
struct BodyInView {
  const FilmView* view = nullptr;
  motion::KeySpan<float> span{nullptr, 0, 0};  // of the nodes' times
  std::vector<NodeInView> nodes;
  Mat3<double> rotation{1};
  std::vector<uint8_t> in_front;  // visibility of each point
  std::vector<ShownPoint> shown;
};

// A body, its points and the views. On the CPU.
struct BodyInFilm {
  const Surfels& main;
  int32_t body;
  raster::Options options;
  Motion& motion;
  Nodes* all_nodes;            // of all bodies; null if the body is rigid
  double radius = 1;           // root mean square distance of its surfels from its centre
  std::vector<int64_t> nodes;  // of the body
  std::vector<FilmPoint> points;
  FilmViews film;
  std::vector<BodyInView> in_views;

  // Selects at most 1,000 points: opaque surfels, evenly spaced by index.
  BodyInFilm(const Surfels& surfels, int32_t of_body, const raster::Options& drawing, Motion& moves,
             Nodes* bends);

  bool bends() const { return !nodes.empty(); }
  int64_t times() const { return bends() ? all_nodes->times() : 0; }
  double node_radius(size_t n) const { return all_nodes->radius[nodes[n]]; }
  float* turn(size_t n, int64_t time) const { return &all_nodes->turn(nodes[n], time, 0); }
  float* shift(size_t n, int64_t time) const { return &all_nodes->shift(nodes[n], time, 0); }

  // Replaces the views.
  void observe(FilmViews views);
  // Determines visible points from renders of all bodies at their current poses.
  void find_what_is_in_front();
  // Samples all views at the current pose of the body.
  void show(bool with_derivatives);
  // The position of the body's pivot at the time of a view.
  Vec3<double> pivot(const BodyInView& in_view) const;

 private:
  void choose_points();
  void find_nodes(FilmPoint& point) const;
  void pose(BodyInView& in_view) const;
  static Vec3<double> bent(const FilmPoint& point, const BodyInView& in_view);
  static Mat3<double> bend_of(const FilmPoint& point, const BodyInView& in_view);
  Vec3<double> arm(const FilmPoint& point, const BodyInView& in_view) const;
  void find_what_is_in_front(const raster::Output& picture, BodyInView& in_view) const;
  void show(BodyInView& in_view, bool with_derivatives) const;
  // Three channels at a point, and their derivatives by its position; false if the image does not show it.
  bool show(const BodyInView& in_view, const DetailPhoto& photo, size_t first, bool with_derivatives,
            ShownPoint& shown) const;
  // Rotates the normal and its derivatives back to the body at rest.
  static void take_to_rest(const BodyInView& in_view, bool with_derivatives, ShownPoint& shown);
};

}  // namespace traceflow
