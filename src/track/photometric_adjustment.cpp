#include "track/photometric_adjustment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>

#include "base/parallel.h"
#include "math/rotation_group.h"
#include "track/body_surface.h"

namespace traceflow {

namespace {

constexpr int64_t pose_numbers = 6;
// Weights of the residuals of detail and normals, and the width of Huber's cost.
constexpr double detail_weight = 1.5, normal_weight = 1, robust_width = 0.05;
// Weights of the strain between neighbouring nodes, of their speed, and of displacements from the start:
// along the camera ray, where texture determines little, and in all directions. For residuals in radii or
// radians.
constexpr double strain = 100, haste = 0.1, node_depth = 10, node_stays = 1, pose_depth = 1000,
                 pose_stays = 10;
constexpr double damping_share = 1e-3;
constexpr int step_tries = 3;
constexpr double step_shortens = 0.4;
constexpr int steps_of_a_look = 3;  // then visibility is determined again

using Derivatives = PhotometricAdjustment::Derivatives;
using Equations = PhotometricAdjustment::Equations;

// Two views that are compared.
struct ViewPair {
  size_t later, earlier;
};

// Consecutive numbers of the equations, and their source: the numbers of a pair, times a share.
struct Segment {
  int64_t block, offset, from, size;
  double share;
};

double huber_cost(double residual) {
  const double size = std::abs(residual);
  return size < robust_width ? size * size / (2 * robust_width) : size - robust_width / 2;
}

double weight_of(size_t channel) { return channel < 3 ? detail_weight : normal_weight; }

Vec3<double> unit_vector(int axis) {
  Vec3<double> e(0);
  e[axis] = 1;
  return e;
}

}  // namespace

struct PhotometricAdjustment::State : BodyInFilm {
  std::vector<ViewPair> pairs;
  // The blocks of the equations. With nodes, each of their times has one block, with the nodes at that time
  // and the poses up to the next time. Without nodes each pose has one.
  std::vector<int64_t> block_of_key, first_key, block_sizes;
  int64_t half_bandwidth = 1;
  Motion start_motion;
  Nodes start_nodes;
  std::vector<Vec3<double>> pose_rays,
      node_rays;  // unit: per key in world axes; per node and time in the rest frame

  State(const Surfels& surfels, int32_t of_body, const raster::Options& drawing, Motion& moves, Nodes* bends)
      : BodyInFilm(surfels, of_body, drawing, moves, bends), start_motion(moves) {
    if (bends != nullptr) start_nodes = *bends;
    divide_into_blocks();
  }

  int64_t node_numbers() const { return pose_numbers * static_cast<int64_t>(nodes.size()); }
  void divide_into_blocks() {
    const int64_t keys = motion.keys();
    for (int64_t key = 0; key < keys; ++key) {
      int64_t block = key;
      if (bends()) block = motion::KeySpan<float>(all_nodes->time.data(), times(), motion.time[key]).from;
      while (static_cast<int64_t>(block_sizes.size()) <= block) {
        block_sizes.push_back(node_numbers());
        first_key.push_back(key);
      }
      block_of_key.push_back(block);
      block_sizes.back() += pose_numbers;
    }
    while (static_cast<int64_t>(block_sizes.size()) < times()) {
      block_sizes.push_back(node_numbers());
      first_key.push_back(keys);
    }
  }
  int64_t pose_offset(int64_t key) const {
    return node_numbers() + pose_numbers * (key - first_key[static_cast<size_t>(block_of(key))]);
  }
  int64_t block_of(int64_t key) const { return block_of_key[static_cast<size_t>(key)]; }

  void observe(FilmViews views) {
    BodyInFilm::observe(std::move(views));
    pair_views();
    find_rays();
  }

  // Pairs each view with that of the nearest camera at each of some earlier keys.
  void pair_views() {
    constexpr std::array<int64_t, 4> keys_apart = {1, 3, 9, 27};
    pairs.clear();
    half_bandwidth = 1;
    for (size_t later = 0; later < in_views.size(); ++later) {
      const FilmView& view = *in_views[later].view;
      for (const int64_t apart : keys_apart) {
        std::optional<size_t> nearest;
        const auto away = [&](size_t other) {
          return distance(in_views[other].view->drawn.position, view.drawn.position);
        };
        for (size_t k = 0; k < later; ++k) {
          if (in_views[k].view->key == view.key - apart && (!nearest || away(k) < away(*nearest)))
            nearest = k;
        }
        if (!nearest) continue;
        pairs.push_back({later, *nearest});
        half_bandwidth =
            std::max(half_bandwidth, block_of(view.key) + 1 - block_of(in_views[*nearest].view->key));
      }
    }
    half_bandwidth = std::min<int64_t>(half_bandwidth, static_cast<int64_t>(block_sizes.size()) - 1);
  }

  void find_rays() {
    pose_rays.assign(static_cast<size_t>(motion.keys()), Vec3<double>(0));
    for (const BodyInView& in_view : in_views) {
      const int64_t key = in_view.view->key;
      pose_rays[static_cast<size_t>(key)] =
          normalize(load3<double>(motion.centre.row(body)) + load3<double>(&motion.shift(body, key, 0)) -
                    Vec3<double>(in_view.view->drawn.position));
    }
    node_rays.assign(nodes.size() * static_cast<size_t>(times()), Vec3<double>(0));
    for (int64_t time = 0; time < times() && !in_views.empty(); ++time) {
      const auto away = [&](const BodyInView& in_view) {
        return std::abs(motion.time[in_view.view->key] - all_nodes->time[time]);
      };
      const BodyInView& in_view =
          *std::min_element(in_views.begin(), in_views.end(),
                            [&](const BodyInView& a, const BodyInView& b) { return away(a) < away(b); });
      const Mat3<double> rotation = rotations_at(motion, in_view.view->key)[static_cast<size_t>(body)];
      const Vec3<double> pivot = load3<double>(motion.centre.row(body));
      for (size_t n = 0; n < nodes.size(); ++n) {
        const Vec3<double> arm =
            load3<double>(all_nodes->centre.row(nodes[n])) + load3<double>(shift(n, time)) - pivot;
        const Vec3<double> at =
            pivot + rotation * arm + load3<double>(&motion.shift(body, in_view.view->key, 0));
        node_rays[static_cast<size_t>(time) * nodes.size() + n] =
            transpose(rotation) * normalize(at - Vec3<double>(in_view.view->drawn.position));
      }
    }
  }

  double pair_cost(const ViewPair& pair) const {
    const BodyInView &later = in_views[pair.later], &earlier = in_views[pair.earlier];
    double cost = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      if (later.in_front[i] == 0 || earlier.in_front[i] == 0) continue;
      const ShownPoint &a = later.shown[i], &b = earlier.shown[i];
      if (!a.is_shown || !b.is_shown) {
        cost += robust_width / 2;  // hiding a point must not cost less than a difference
        continue;
      }
      const size_t count = a.has_normal && b.has_normal ? film_channels : 3;
      for (size_t c = 0; c < count; ++c) cost += huber_cost(weight_of(c) * (a.value[c] - b.value[c]));
    }
    return cost;
  }

  double texture_cost() {
    show(false);
    double cost = 0;
    for (const ViewPair& pair : pairs) cost += pair_cost(pair);
    return cost;
  }

  double compared_points() const {
    int64_t count = 0;
    for (const ViewPair& pair : pairs) {
      for (size_t i = 0; i < points.size(); ++i)
        count += in_views[pair.later].in_front[i] != 0 && in_views[pair.earlier].in_front[i] != 0 ? 1 : 0;
    }
    return static_cast<double>(count);
  }

  // The derivatives of one channel in one view: by the nodes that move the point, and by the pose. by_point:
  // in the rest frame; by_turn: of the deformed frame.
  template <class F>
  void for_numbers(const FilmPoint& point, const BodyInView& in_view, const ShownPoint& shown,
                   const Vec3<double>& by_point, const Vec3<double>& by_turn, F&& f) const {
    const Vec3<double> in_body = shown.bend * by_point;
    for (const NodeWeight& of : point.nodes) {
      const auto n = static_cast<size_t>(of.node);
      const NodeInView& node = in_view.nodes[n];
      const Vec3<double> force = of.weight * in_body;
      const Vec3<double> torque =
          cross(node.rotation * (point.rest - node.rest), force) + of.weight * by_turn;
      f(pose_numbers * of.node, torque, node_radius(n) * force);
    }
    const Vec3<double> in_world = in_view.rotation * in_body;
    f(node_numbers(), cross(shown.arm, in_world) + in_view.rotation * by_turn, radius * in_world);
  }

  // A pair has the numbers of nodes and pose in the later view, followed by those in the earlier one.
  int64_t view_numbers() const { return node_numbers() + pose_numbers; }

  void add_pair(const ViewPair& pair, Derivatives derivatives, Eigen::MatrixXd& a, Eigen::VectorXd& b) const {
    a.setZero(2 * view_numbers(), 2 * view_numbers());
    b.setZero(2 * view_numbers());
    const BodyInView &later = in_views[pair.later], &earlier = in_views[pair.earlier];
    std::array<int64_t, 2 * pose_numbers*(most_nodes + 1)> at{};
    std::array<double, 2 * pose_numbers*(most_nodes + 1)> row{};
    for (size_t i = 0; i < points.size(); ++i) {
      const std::array<const ShownPoint*, 2> shown = {&later.shown[i], &earlier.shown[i]};
      if (!shown[0]->is_shown || !shown[1]->is_shown) continue;
      const size_t count = shown[0]->has_normal && shown[1]->has_normal ? film_channels : 3;
      for (size_t c = 0; c < count; ++c) {
        const double residual = weight_of(c) * (shown[0]->value[c] - shown[1]->value[c]);
        const double share = 1 / std::max(robust_width, std::abs(residual));
        const Vec3<double> mean = 0.5 * (shown[0]->by_point[c] + shown[1]->by_point[c]);
        size_t k = 0;
        for (size_t view = 0; view < 2; ++view) {
          const ShownPoint& in = *shown[view];
          const double sign = view == 0 ? weight_of(c) : -weight_of(c);
          Vec3<double> by_point = in.by_point[c];
          // Motion out of the surface is parallax, which differs between the views.
          if (derivatives == Derivatives::mean)
            by_point = mean + dot(by_point - mean, points[i].normal) * points[i].normal;
          const Vec3<double> by_turn = c < 3 ? Vec3<double>(0) : in.by_turn[c - 3];
          for_numbers(points[i], view == 0 ? later : earlier, in, sign * by_point, sign * by_turn,
                      [&](int64_t first, const Vec3<double>& by_omega, const Vec3<double>& by_shift) {
                        for (int d = 0; d < 3; ++d, ++k) {
                          at[k] = static_cast<int64_t>(view) * view_numbers() + first + d;
                          row[k] = by_omega[d];
                          at[k + 3] = at[k] + 3;
                          row[k + 3] = by_shift[d];
                        }
                        k += 3;
                      });
        }
        for (size_t p = 0; p < k; ++p) {
          const double weighted = share * row[p];
          for (size_t q = 0; q < k; ++q) a(at[q], at[p]) += weighted * row[q];
          b[at[p]] -= weighted * residual;
        }
      }
    }
  }

  std::array<Segment, 3> parts_of(const BodyInView& in_view, int64_t from) const {
    const int64_t count = node_numbers(), key = in_view.view->key;
    return {Segment{in_view.span.from, 0, from, count, 1 - in_view.span.share},
            Segment{in_view.span.to, 0, from, count, in_view.span.share},
            Segment{block_of(key), pose_offset(key), from + count, pose_numbers, 1}};
  }

  void scatter(const ViewPair& pair, const Eigen::MatrixXd& a, const Eigen::VectorXd& b,
               Equations& to) const {
    const std::array<Segment, 3> later = parts_of(in_views[pair.later], 0),
                                 earlier = parts_of(in_views[pair.earlier], view_numbers());
    std::array<Segment, 6> parts{};
    std::copy(later.begin(), later.end(), parts.begin());
    std::copy(earlier.begin(), earlier.end(), parts.begin() + 3);
    for (const Segment& p : parts) {
      if (p.share == 0 || p.size == 0) continue;
      to.b.segment(to.a.first(p.block) + p.offset, p.size) += p.share * b.segment(p.from, p.size);
      for (const Segment& q : parts) {
        if (q.share == 0 || q.size == 0 || q.block > p.block) continue;
        to.a.at(p.block, q.block).block(p.offset, q.offset, p.size, q.size) +=
            p.share * q.share * a.block(p.from, q.from, p.size, q.size);
      }
    }
  }

  Equations equations(Derivatives derivatives) {
    constexpr size_t at_once = 16;
    Equations to{BandMatrix(block_sizes, half_bandwidth), {}};
    to.b.setZero(to.a.size());
    show(true);
    std::array<Eigen::MatrixXd, at_once> a;
    std::array<Eigen::VectorXd, at_once> b;
    for (size_t first = 0; first < pairs.size(); first += at_once) {
      const size_t count = std::min(at_once, pairs.size() - first);
      parallel_for(
          "adjust: pairs", static_cast<int64_t>(count),
          [&](int64_t i) {
            const auto k = static_cast<size_t>(i);
            add_pair(pairs[first + k], derivatives, a[k], b[k]);
          },
          1);
      for (size_t k = 0; k < count; ++k) scatter(pairs[first + k], a[k], b[k], to);
    }
    shape_cost(&to);
    return to;
  }

  // The derivative of a residual by a number of the equations.
  struct Derivative {
    int64_t block, offset;
    double by;
  };
  template <size_t count>
  static double add(const std::array<Derivative, count>& row, double residual, double share, Equations* to) {
    for (size_t p = 0; to != nullptr && p < count; ++p) {
      to->b[to->a.first(row[p].block) + row[p].offset] -= share * row[p].by * residual;
      for (size_t q = 0; q < count; ++q) {
        if (row[q].block <= row[p].block)
          to->a.at(row[p].block, row[q].block)(row[p].offset, row[q].offset) += share * row[p].by * row[q].by;
      }
    }
    return share * residual * residual / 2;
  }

  double shape_cost(Equations* to) const {
    double cost = 0;
    for (int64_t time = 0; time < times(); ++time) {
      for (size_t n = 0; n < nodes.size(); ++n)
        cost += strain_cost(n, time, to) + haste_cost(n, time, to) + node_cost(n, time, to);
    }
    for (int64_t key = 1; key < motion.keys(); ++key) cost += pose_cost(key, to);
    return cost;
  }

  // As in nodes::resist.
  double strain_cost(size_t n, int64_t time, Equations* to) const {
    const Vec3<double> rest = load3<double>(all_nodes->centre.row(nodes[n]));
    const Mat3<double> rotation = rotation_from_quaternion(quaternion_exp(load3<double>(turn(n, time))));
    const double r = node_radius(n);
    std::vector<double> touch(nodes.size());
    double all = 0;
    for (size_t m = 0; m < nodes.size(); ++m) {
      const Vec3<double> away = (load3<double>(all_nodes->centre.row(nodes[m])) - rest) / r;
      if (m != n) all += touch[m] = std::exp(-dot(away, away) / 8);
    }
    double cost = 0;
    for (size_t m = 0; m < nodes.size(); ++m) {
      constexpr double least = 1e-4;  // of all
      if (m == n || !(touch[m] > least * all)) continue;
      const Vec3<double> other = load3<double>(all_nodes->centre.row(nodes[m]));
      const Vec3<double> carried = rotation * (other - rest);
      const Vec3<double> off =
          carried + rest + load3<double>(shift(n, time)) - other - load3<double>(shift(m, time));
      const int64_t first = pose_numbers * static_cast<int64_t>(n),
                    its = pose_numbers * static_cast<int64_t>(m);
      for (int c = 0; c < 3; ++c) {
        const Vec3<double> by_turn = cross(carried, unit_vector(c));
        cost += add<5>({Derivative{time, first, by_turn.x}, Derivative{time, first + 1, by_turn.y},
                        Derivative{time, first + 2, by_turn.z}, Derivative{time, first + 3 + c, r},
                        Derivative{time, its + 3 + c, -node_radius(m)}},
                       off[c], strain * touch[m] / all / (r * r), to);
      }
    }
    return cost;
  }

  double haste_cost(size_t n, int64_t time, Equations* to) const {
    if (time + 1 == times()) return 0;
    const double span = static_cast<double>(all_nodes->time[time + 1]) - all_nodes->time[time];
    const double share = haste / (span * span);
    const int64_t first = pose_numbers * static_cast<int64_t>(n);
    const Vec3<double> turned = load3<double>(turn(n, time + 1)) - load3<double>(turn(n, time));
    const Vec3<double> shifted =
        (load3<double>(shift(n, time + 1)) - load3<double>(shift(n, time))) / node_radius(n);
    double cost = 0;
    for (int c = 0; c < 3; ++c) {
      cost +=
          add<2>({Derivative{time + 1, first + c, 1}, Derivative{time, first + c, -1}}, turned[c], share, to);
      cost += add<2>({Derivative{time + 1, first + 3 + c, 1}, Derivative{time, first + 3 + c, -1}},
                     shifted[c], share, to);
    }
    return cost;
  }

  double node_cost(size_t n, int64_t time, Equations* to) const {
    const int64_t first = pose_numbers * static_cast<int64_t>(n);
    const Vec3<double> turned =
        load3<double>(turn(n, time)) - load3<double>(&start_nodes.turn(nodes[n], time, 0));
    const Vec3<double> shifted =
        (load3<double>(shift(n, time)) - load3<double>(&start_nodes.shift(nodes[n], time, 0))) /
        node_radius(n);
    double cost = 0;
    for (int c = 0; c < 3; ++c) {
      cost += add<1>({Derivative{time, first + c, 1}}, turned[c], node_stays, to);
      cost += add<1>({Derivative{time, first + 3 + c, 1}}, shifted[c], node_stays, to);
    }
    const Vec3<double>& ray = node_rays[static_cast<size_t>(time) * nodes.size() + n];
    return cost + add<3>({Derivative{time, first + 3, ray.x}, Derivative{time, first + 4, ray.y},
                          Derivative{time, first + 5, ray.z}},
                         dot(ray, shifted), node_depth, to);
  }

  double pose_cost(int64_t key, Equations* to) const {
    const Vec4<double> from = unit_quaternion(load4<double>(&start_motion.rotation(body, key, 0)));
    const Vec4<double> now = unit_quaternion(load4<double>(&motion.rotation(body, key, 0)));
    const Vec3<double> turned = quaternion_log(quaternion_product(now, quaternion_conjugate(from)));
    const Vec3<double> shifted =
        (load3<double>(&motion.shift(body, key, 0)) - load3<double>(&start_motion.shift(body, key, 0))) /
        radius;
    const int64_t block = block_of(key), first = pose_offset(key);
    double cost = 0;
    for (int c = 0; c < 3; ++c) {
      cost += add<1>({Derivative{block, first + c, 1}}, turned[c], pose_stays, to);
      cost += add<1>({Derivative{block, first + 3 + c, 1}}, shifted[c], pose_stays, to);
    }
    const Vec3<double>& ray = pose_rays[static_cast<size_t>(key)];
    return cost + add<3>({Derivative{block, first + 3, ray.x}, Derivative{block, first + 4, ray.y},
                          Derivative{block, first + 5, ray.z}},
                         dot(ray, shifted), pose_depth, to);
  }

  double cost() { return texture_cost() + shape_cost(nullptr); }

  // Fixes the first key.
  void hold_first(Equations& to) const {
    constexpr double stiff = 1e12;
    auto diagonal = to.a.at(0, 0).diagonal();
    diagonal.head(node_numbers()).array() += stiff;
    diagonal.segment(pose_offset(0), pose_numbers).array() += stiff;
  }

  void take(const Eigen::VectorXd& step, double share) {
    std::vector<int64_t> first(1, 0);
    for (const int64_t size : block_sizes) first.push_back(first.back() + size);
    const auto at = [&](int64_t block, int64_t offset) {
      const int64_t k = first[static_cast<size_t>(block)] + offset;
      return share * Vec3<double>(step[k], step[k + 1], step[k + 2]);
    };
    for (int64_t key = 1; key < motion.keys(); ++key) {
      float* const rotation = &motion.rotation(body, key, 0);
      const int64_t block = block_of(key), offset = pose_offset(key);
      const Vec4<double> turned =
          quaternion_product(quaternion_exp(at(block, offset)), unit_quaternion(load4<double>(rotation)));
      for (int c = 0; c < 4; ++c) rotation[c] = static_cast<float>(turned[c]);
      add3(&motion.shift(body, key, 0), radius * at(block, offset + 3));
    }
    for (int64_t time = 1; time < times(); ++time) {
      for (size_t n = 0; n < nodes.size(); ++n) {
        const int64_t offset = pose_numbers * static_cast<int64_t>(n);
        const Vec4<double> turned = quaternion_product(quaternion_exp(at(time, offset)),
                                                       quaternion_exp(load3<double>(turn(n, time))));
        store3(turn(n, time), quaternion_log(turned));
        add3(shift(n, time), node_radius(n) * at(time, offset + 3));
      }
    }
  }

  bool step() {
    const double before = cost();
    Equations to = equations(Derivatives::mean);
    hold_first(to);
    to.a.damp(1 + damping_share);
    to.a.solve(to.b);
    const Motion old_motion = motion;
    const std::optional<Nodes> old_nodes = bends() ? std::optional(*all_nodes) : std::nullopt;
    double share = 1;
    for (int attempt = 0; attempt < step_tries; ++attempt, share *= step_shortens) {
      take(to.b, share);
      if (cost() < before) return true;
      motion = old_motion;
      if (old_nodes) *all_nodes = *old_nodes;
    }
    return false;
  }
};

PhotometricAdjustment::PhotometricAdjustment(const Surfels& main, int32_t body,
                                             const raster::Options& options, Motion& motion, Nodes* nodes)
    : state_(std::make_unique<State>(main, body, options, motion, nodes)) {}
PhotometricAdjustment::~PhotometricAdjustment() = default;
PhotometricAdjustment::PhotometricAdjustment(PhotometricAdjustment&&) noexcept = default;

void PhotometricAdjustment::observe(FilmViews views) { state_->observe(std::move(views)); }

void PhotometricAdjustment::solve(int steps) {
  for (int k = 0; k < steps && !state_->pairs.empty(); ++k) {
    if (k > 0 && k % steps_of_a_look == 0) state_->find_what_is_in_front();
    if (!state_->step()) return;
  }
}

double PhotometricAdjustment::mean_texture_cost() {
  return state_->texture_cost() / std::max(1.0, state_->compared_points());
}
PhotometricAdjustment::Equations PhotometricAdjustment::equations(Derivatives derivatives) {
  return state_->equations(derivatives);
}
double PhotometricAdjustment::cost() { return state_->cost(); }
void PhotometricAdjustment::take(const Eigen::VectorXd& step) { state_->take(step, 1); }

}  // namespace traceflow
