#include "viz/capture_picture/view_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "base/error.h"
#include "base/parallel.h"
#include "capture/pixels.h"
#include "viz/picture.h"

namespace traceflow::viz {

namespace {

constexpr int64_t columns = 6;
constexpr size_t most_tiles = 24, most_marked = 8;
constexpr int64_t cell_width = (picture_width - (columns - 1) * picture_gap) / columns;
constexpr int64_t tallest_cell = 2 * cell_width;
constexpr int64_t line_height = letter_height + 3;
constexpr int64_t caption_height = 2 * line_height + 3;

struct Tile {
  const View* view;
  bool is_test;
};

std::vector<Tile> all_tiles(const Capture& capture) {
  std::vector<Tile> tiles;
  for (const View& view : capture.train) tiles.push_back({&view, false});
  for (const View& view : capture.test) tiles.push_back({&view, true});
  std::ranges::stable_sort(tiles, [](const Tile& a, const Tile& b) { return a.view->time < b.view->time; });
  return tiles;
}

// Adds up to `count` evenly spaced tiles among those for which `wanted` holds.
template <class F>
void choose(const std::vector<Tile>& tiles, size_t count, F&& wanted, std::set<size_t>& places) {
  std::vector<size_t> candidates;
  for (size_t i = 0; i < tiles.size(); ++i) {
    if (wanted(tiles[i])) candidates.push_back(i);
  }
  const size_t taken = std::min(count, candidates.size());
  for (size_t i = 0; i < taken; ++i)
    places.insert(candidates[taken > 1 ? i * (candidates.size() - 1) / (taken - 1) : 0]);
}

std::vector<Tile> choose_tiles(const Capture& capture, const Marks& marks) {
  const std::vector<Tile> all = all_tiles(capture);
  const auto is_marked = [&](const Tile& tile) { return marks.contains(tile.view->id); };
  std::set<size_t> places;
  choose(all, most_marked, is_marked, places);
  choose(
      all, most_tiles - places.size(), [&](const Tile& tile) { return !is_marked(tile); }, places);
  std::vector<Tile> tiles;
  tiles.reserve(places.size());
  for (const size_t place : places) tiles.push_back(all[place]);
  return tiles;
}

// The mask's pixels with a neighbour outside it, on the grid of the thumbnail.
void outline(const Tensor<uint8_t>& mask, Tensor<uint8_t>& picture) {
  const int64_t height = picture.dim(0), width = picture.dim(1);
  const auto is_on = [&](int64_t y, int64_t x) {
    if (y < 0 || x < 0 || y >= height || x >= width) return true;
    return mask((2 * y + 1) * mask.dim(0) / (2 * height), (2 * x + 1) * mask.dim(1) / (2 * width)) != 0;
  };
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      const bool is_edge =
          is_on(y, x) && !(is_on(y - 1, x) && is_on(y + 1, x) && is_on(y, x - 1) && is_on(y, x + 1));
      if (is_edge) fill_box({x, y}, {1, 1}, mask_ink, picture);
    }
  }
}

// Replaces a view that cannot be decoded.
Tensor<uint8_t> blank(const View& view) {
  const int64_t height = cell_width * view.camera.height / std::max(1, view.camera.width);
  Tensor<uint8_t> picture(Shape{std::clamp(height, 2 * line_height, tallest_cell), cell_width, 3});
  write_text("cannot be read", {8, 8}, alarm_ink, picture);
  return picture;
}

// The view's image within cell_width × tallest_cell pixels.
Tensor<uint8_t> thumbnail(const Capture& capture, const View& view) {
  try {
    const auto pixels = load_pixels(capture, view);
    Tensor<uint8_t> small = shrink(pixels->colour, cell_width, tallest_cell);
    if (!pixels->mask.empty()) outline(pixels->mask, small);
    return small;
  } catch (const InputError&) {
    return blank(view);
  }
}

// Cuts the start of a long text, since the end says more.
std::string cut(const std::string& text, size_t longest) {
  return text.size() <= longest ? text : ".." + text.substr(text.size() - longest + 2);
}

void caption(const Tile& tile, const Marks& marks, const Pixel& at, Tensor<uint8_t>& picture) {
  const auto mark = marks.find(tile.view->id);
  const Ink& ink = mark == marks.end() ? text_ink : alarm_ink;
  write_text(cut(tile.view->id, cell_width / letter_width), at, ink, picture);
  fill_box({at.x, at.y + line_height}, {letter_height, letter_height}, time_ink(tile.view->time), picture);
  const std::string text = fmt::format("{:.3f}{}{}", tile.view->time, tile.is_test ? " test" : "",
                                       mark == marks.end() ? "" : " " + mark->second);
  write_text(text.substr(0, cell_width / letter_width - 2), {at.x + 2 * letter_width, at.y + line_height},
             ink, picture);
}

}  // namespace

Tensor<uint8_t> view_tiles(const Capture& capture, const Marks& marks) {
  const std::vector<Tile> tiles = choose_tiles(capture, marks);
  std::vector<Tensor<uint8_t>> small(tiles.size());
  parallel_for(
      "show: thumbnails", static_cast<int64_t>(tiles.size()),
      [&](int64_t n) {
        const auto i = static_cast<size_t>(n);
        small[i] = thumbnail(capture, *tiles[i].view);
      },
      1);
  int64_t cell_height = 1;
  for (const Tensor<uint8_t>& image : small) cell_height = std::max(cell_height, image.dim(0));
  const int64_t row_height = cell_height + 4 + caption_height + picture_gap;
  const int64_t rows = (static_cast<int64_t>(tiles.size()) + columns - 1) / columns;
  Tensor<uint8_t> picture(Shape{rows * row_height, picture_width, 3});
  fill_box({0, 0}, {picture.dim(1), picture.dim(0)}, paper, picture);
  for (size_t i = 0; i < tiles.size(); ++i) {
    const auto place = static_cast<int64_t>(i);
    const Pixel at{place % columns * (cell_width + picture_gap), place / columns * row_height};
    paste(small[i], at, picture);
    if (marks.contains(tiles[i].view->id))
      draw_box(at, {small[i].dim(1), small[i].dim(0)}, 3, alarm_ink, picture);
    caption(tiles[i], marks, {at.x, at.y + cell_height + 4}, picture);
  }
  return picture;
}

}  // namespace traceflow::viz
