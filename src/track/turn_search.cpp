#include "track/turn_search.h"

#include <algorithm>

#include "math/rotation_group.h"

namespace traceflow {

namespace {

constexpr int steps_each_way = 4;
constexpr double spacing = 0.1, finest = 0.01;  // radians
constexpr double least_gain = 0.1;              // of the cost

void turn_at(int32_t body, int64_t key, const Vec3<double>& turn, Motion& motion) {
  float* const q = &motion.rotation(body, key, 0);
  const Vec4<double> turned = quaternion_product(quaternion_exp(turn), unit_quaternion(load4<double>(q)));
  for (int c = 0; c < 4; ++c) q[c] = static_cast<float>(turned[c]);
}

struct Turn {
  Vec3<double> turn{0};
  double cost = 0;
};

// Makes steps along the axes while the cost falls, and halves the step when it does not.
template <class Cost>
Turn refined(Turn best, const Mat3<double>& loose, const Cost& cost_of) {
  for (double step = spacing / 2; step > finest;) {
    bool better = false;
    for (int axis = 0; axis < 3; ++axis) {
      for (const double by : {step, -step}) {
        const Vec3<double> turn = best.turn + by * loose[axis];
        const double cost = cost_of(turn);
        if (!(cost < best.cost)) continue;
        best = {turn, cost};
        better = true;
      }
    }
    if (!better) step /= 2;
  }
  return best;
}

}  // namespace

std::optional<Vec3<double>> seek_turn(const Alignment& alignment, const Motion& motion, int32_t body,
                                      int64_t key, const LooseTurns& loose) {
  const Mat3<double>& turns = loose[static_cast<size_t>(body)];
  Motion turned = motion;
  const auto cost_of = [&](const Vec3<double>& turn) {
    std::copy_n(&motion.rotation(body, key, 0), 4, &turned.rotation(body, key, 0));
    turn_at(body, key, turn, turned);
    return align(alignment, turned, key, loose, nullptr);
  };
  const Turn here{Vec3<double>(0), cost_of(Vec3<double>(0))};
  Turn best = here;
  for (int x = -steps_each_way; x <= steps_each_way; ++x) {
    for (int y = -steps_each_way; y <= steps_each_way; ++y) {
      for (int z = -steps_each_way; z <= steps_each_way; ++z) {
        const Vec3<double> offset = spacing * Vec3<double>(x, y, z), turn = turns * offset;
        if (length(turn - offset) > 0.6 * spacing) continue;  // near others if few are loose
        const double cost = cost_of(turn);
        if (cost < best.cost) best = {turn, cost};
      }
    }
  }
  best = refined(best, turns, cost_of);
  const Turn near = refined(here, turns, cost_of);
  if (!(best.cost < (1 - least_gain) * near.cost)) best = near;
  const bool is_far = length(best.turn) > spacing;
  if (!is_far || !(best.cost < (1 - least_gain) * here.cost)) return std::nullopt;
  return best.turn;
}

void spread_turn(int32_t body, int64_t first, int64_t last, const Vec3<double>& turn, Motion& motion) {
  for (int64_t key = first + 1; key <= last; ++key) {
    const double share = static_cast<double>(key - first) / static_cast<double>(last - first);
    turn_at(body, key, share * turn, motion);
  }
}

}  // namespace traceflow
