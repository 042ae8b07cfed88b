#include "prepare/motion/moving_mask.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <utility>

#include "base/parallel.h"
#include "base/robust.h"

namespace traceflow::prepare {

namespace {

constexpr int spacing = 8;           // pixels between tracks, and the side of the cells that count votes
constexpr int half_window = 3;       // a track votes in cells up to this far
constexpr double least_voice = 0.3;  // total weight of votes below which a cell is unknown
constexpr int64_t smallest_share = 300, margin_share = 120;
constexpr std::array<int64_t, 4> neighbours{-2, -1, 1, 2};  // in steps
constexpr std::array<int64_t, 4> steps{1, 2, 4, 8};         // images
constexpr double enough_motion = 12;                        // pixels between compared images

// Cells: 1 moving, −1 static, 0 unknown.
Tensor<float> votes_of(const Motion& motion, int64_t rows, int64_t columns) {
  Tensor<float> moving({rows, columns}), heard({rows, columns});
  const double limit = limit_of(motion);
  for (const Track& t : motion.tracks) {
    const bool moves = motion.still.distance(t) > limit;
    const auto row = static_cast<int64_t>(t.from.y / spacing),
               column = static_cast<int64_t>(t.from.x / spacing);
    for (int64_t y = std::max<int64_t>(0, row - half_window); y <= std::min(rows - 1, row + half_window);
         ++y) {
      for (int64_t x = std::max<int64_t>(0, column - half_window);
           x <= std::min(columns - 1, column + half_window); ++x) {
        const auto apart = static_cast<double>((y - row) * (y - row) + (x - column) * (x - column));
        const auto weight = static_cast<float>(std::exp(-apart / 2));
        heard(y, x) += weight;
        if (moves) moving(y, x) += weight;
      }
    }
  }
  for (int64_t i = 0; i < heard.size(); ++i) {
    moving[i] = heard[i] < least_voice ? 0.0F : moving[i] > 0.5F * heard[i] ? 1.0F : -1.0F;
  }
  return moving;
}

// Removes connected parts (cells that share a side) of fewer than `least` cells.
void drop_small_parts(Tensor<uint8_t>& cells, int64_t least) {
  const int64_t rows = cells.dim(0), columns = cells.dim(1);
  Tensor<uint8_t> seen({rows, columns});
  for (int64_t start = 0; start < cells.size(); ++start) {
    if (cells[start] == 0 || seen[start] != 0) continue;
    std::vector<int64_t> part{start};
    seen[start] = 1;
    for (size_t k = 0; k < part.size(); ++k) {
      const int64_t y = part[k] / columns, x = part[k] % columns;
      const auto visit = [&](int64_t j, int64_t i) {
        if (j < 0 || i < 0 || j >= rows || i >= columns || cells(j, i) == 0 || seen(j, i) != 0) return;
        seen(j, i) = 1;
        part.push_back(j * columns + i);
      };
      visit(y - 1, x);
      visit(y + 1, x);
      visit(y, x - 1);
      visit(y, x + 1);
    }
    if (static_cast<int64_t>(part.size()) >= least) continue;
    for (const int64_t i : part) cells[i] = 0;
  }
}

// 1 for pixels within `margin` of a cell.
Tensor<uint8_t> spread_to_pixels(const Tensor<uint8_t>& cells, const Shape& shape, int64_t margin) {
  Tensor<uint8_t> mask({shape[0], shape[1]});
  for (int64_t row = 0; row < cells.dim(0); ++row) {
    for (int64_t column = 0; column < cells.dim(1); ++column) {
      if (cells(row, column) == 0) continue;
      const int64_t left = std::max<int64_t>(0, column * spacing - margin);
      const int64_t right = std::min(shape[1], (column + 1) * spacing + margin);
      const int64_t bottom = std::min(shape[0], (row + 1) * spacing + margin);
      for (int64_t y = std::max<int64_t>(0, row * spacing - margin); y < bottom; ++y) {
        std::fill(&mask(y, left), &mask(y, left) + std::max<int64_t>(0, right - left), uint8_t{1});
      }
    }
  }
  return mask;
}

Tensor<float> as_float(const Tensor<uint8_t>& picture) {
  Tensor<float> grey({picture.dim(0), picture.dim(1)});
  for (int64_t i = 0; i < grey.size(); ++i) grey[i] = static_cast<float>(picture[i]);
  return grey;
}

using PictureOf = std::function<Tensor<uint8_t>(int64_t i)>;

// The number of images between which there is enough motion: the median over three places of the video.
int64_t choose_step(int64_t count, const PictureOf& picture) {
  std::vector<double> needed;
  for (const int64_t quarter : {1, 2, 3}) {
    const int64_t i = quarter * (count - 1) / 4;
    const Pyramid here = make_pyramid(as_float(picture(i)));
    const std::vector<Vec2<double>> corners = find_corners(here, 2 * spacing);
    int64_t needed_here = steps.front();
    for (const int64_t step : steps) {
      if (step > steps.front() && 2 * step >= count) break;
      needed_here = step;
      std::vector<double> lengths;
      const int64_t j = i + step < count ? i + step : i - step;
      if (j < 0) break;
      for (const Track& t : track(here, make_pyramid(as_float(picture(j))), corners))
        lengths.push_back(length(t.to - t.from));
      if (median(std::move(lengths)) >= enough_motion) break;
    }
    needed.push_back(static_cast<double>(needed_here));
  }
  return static_cast<int64_t>(median(std::move(needed)));
}

}  // namespace

Tensor<uint8_t> moving_mask(const Shape& shape, const std::vector<Motion>& motions) {
  const int64_t rows = (shape[0] + spacing - 1) / spacing, columns = (shape[1] + spacing - 1) / spacing;
  Tensor<float> balance({rows, columns});
  for (const Motion& motion : motions) {
    const Tensor<float> votes = votes_of(motion, rows, columns);
    for (int64_t i = 0; i < balance.size(); ++i) balance[i] += votes[i];
  }
  Tensor<uint8_t> cells({rows, columns});
  for (int64_t i = 0; i < cells.size(); ++i) cells[i] = balance[i] > 0 ? 1 : 0;
  drop_small_parts(cells, std::max<int64_t>(2, rows * columns / smallest_share));
  return spread_to_pixels(cells, shape, std::max(shape[0], shape[1]) / margin_share);
}

std::vector<Tensor<uint8_t>> moving_masks(
    int64_t count, const std::function<Tensor<uint8_t>(int64_t i)>& picture,
    const std::function<std::optional<TwoView>(int64_t i, int64_t j)>& still, const Work& work) {
  std::vector<Tensor<uint8_t>> masks(static_cast<size_t>(count));
  const int64_t step = count > 1 ? choose_step(count, picture) : 1;
  std::atomic<int64_t> done = 0;
  parallel_for(
      "moving masks", count,
      [&](int64_t i) {
        work.check();
        const Pyramid here = make_pyramid(as_float(picture(i)));
        const std::vector<Vec2<double>> corners = find_corners(here, spacing);
        std::vector<Motion> motions;
        for (size_t n = 0; n < neighbours.size(); ++n) {
          const int64_t j = i + step * neighbours[n];
          if (j < 0 || j >= count) continue;
          const Pyramid there = make_pyramid(as_float(picture(j)));
          Motion motion{track(here, there, corners), {}};
          auto ground = still(i, j);
          const uint64_t seed = static_cast<uint64_t>(i) * neighbours.size() + n;
          if (!ground) ground = fit_two_view(motion.tracks, stillness, seed);
          if (!ground) continue;
          motion.still = *ground;
          look_again(motion, here, there);
          motions.push_back(std::move(motion));
        }
        masks[static_cast<size_t>(i)] = moving_mask({here.height(), here.width()}, motions);
        work.tell(++done, count);
      },
      1);
  return masks;
}

}  // namespace traceflow::prepare
