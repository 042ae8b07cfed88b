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

// What the views of a film show of the points of a body (track/photometric_adjustment.h).
namespace traceflow {

// A view of the film as adjustment compares it with others.
struct FilmView {
  int64_t key = 0;      // of the motion
  Camera<float> drawn;  // of the picture that tells what is in front
  DetailPhoto photo;
  DetailPhoto normals;  // the prior's, in world, where the mask is set; empty without
};

// Ascending by key.
using FilmViews = std::shared_ptr<const std::vector<FilmView>>;

inline constexpr size_t film_channels = 6;  // detail and normal
inline constexpr size_t most_nodes = 4;     // that move a point: those of the largest weights

// A node that moves a point: its place among those of the body, and its weight.
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
  Vec3<double> arm{0};  // from the body's pivot, in world
  std::array<double, film_channels> value{};
  std::array<Vec3<double>, film_channels> by_point{};  // in the frame at rest
  std::array<Vec3<double>, 3> by_turn{};               // of the normal, by a turn of the bent frame
};

// Where the body is in a view, and what that shows of it.
struct BodyInView {
  const FilmView* view = nullptr;
  motion::KeySpan<float> span{nullptr, 0, 0};  // of the nodes' times
  std::vector<NodeInView> nodes;
  Mat3<double> rotation{1};
  std::vector<uint8_t> in_front;  // of each point
  std::vector<ShownPoint> shown;
};

// A body, its points and the views. On the CPU.
struct BodyInFilm {
  const Surfels& main;
  int32_t body;
  raster::Options options;
  Motion& motion;
  Nodes* all_nodes;            // of all bodies; null where the body is rigid
  double radius = 1;           // root mean square of its surfels' distances from its pivot
  std::vector<int64_t> nodes;  // of the body
  std::vector<FilmPoint> points;
  FilmViews film;
  std::vector<BodyInView> looks;

  // At most 1,000 points: opaque surfels, evenly drawn.
  BodyInFilm(const Surfels& surfels, int32_t of_body, const raster::Options& drawing, Motion& moves,
             Nodes* bends);

  bool bends() const { return !nodes.empty(); }
  int64_t times() const { return bends() ? all_nodes->times() : 0; }
  double node_radius(size_t n) const { return all_nodes->radius[nodes[n]]; }
  float* turn(size_t n, int64_t time) const { return &all_nodes->turn(nodes[n], time, 0); }
  float* shift(size_t n, int64_t time) const { return &all_nodes->shift(nodes[n], time, 0); }

  // Takes views instead of those it had.
  void observe(FilmViews views);
  // By pictures of all bodies where they stand.
  void find_what_is_in_front();
  // What each view shows where the body stands.
  void show(bool with_derivatives);
  // Where the body's pivot is at the time of a view.
  Vec3<double> pivot(const BodyInView& look) const;

 private:
  void choose_points();
  void find_nodes(FilmPoint& point) const;
  void pose(BodyInView& look) const;
  static Vec3<double> bent(const FilmPoint& point, const BodyInView& look);
  static Mat3<double> bend_of(const FilmPoint& point, const BodyInView& look);
  Vec3<double> arm(const FilmPoint& point, const BodyInView& look) const;
  void find_what_is_in_front(const raster::Output& picture, BodyInView& look) const;
  void show(BodyInView& look, bool with_derivatives) const;
  // Three channels at a point, and how they change with it; false where the picture does not show it.
  bool show(const BodyInView& look, const DetailPhoto& photo, size_t first, bool with_derivatives,
            ShownPoint& shown) const;
  // The normal, as it would be at rest, and its derivatives.
  static void take_to_rest(const BodyInView& look, bool with_derivatives, ShownPoint& shown);
};

}  // namespace traceflow
