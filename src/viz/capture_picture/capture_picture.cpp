#include "viz/capture_picture/capture_picture.h"

#include "viz/capture_picture/camera_map.h"
#include "viz/capture_picture/view_tiles.h"

namespace traceflow::viz {

namespace {

constexpr Pixel map_size{(picture_width - picture_gap) / 2, 460};
constexpr int64_t legend_height = 26;

// A finding about many views does not mark any of them. For several findings about one view the first is
// shown, except that "apart" takes precedence, since the maps depend on it.
Marks marks_of(const Capture& capture, const std::vector<Finding>& findings) {
  const size_t few = 1 + (capture.train.size() + capture.test.size()) / 4;
  Marks marks;
  for (const Finding& finding : findings) {
    if (finding.views.size() > few) continue;
    for (const std::string& id : finding.views) {
      const auto [mark, is_new] = marks.emplace(id, finding.kind);
      if (!is_new && finding.kind == apart_kind) mark->second = finding.kind;
    }
  }
  return marks;
}

void draw_legend(int64_t top, Tensor<uint8_t>& picture) {
  int64_t left = 8;
  const auto words = [&](const std::string& text) {
    write_text(text, {left, top + 8}, text_ink, picture);
    left += static_cast<int64_t>(text.size()) * letter_width + 10;
  };
  words("time 0");
  constexpr int64_t bar = 120;
  for (int64_t x = 0; x < bar; ++x) {
    const float time = static_cast<float>(x) / static_cast<float>(bar);
    fill_box({left + x, top + 8}, {1, letter_height}, time_ink(time), picture);
  }
  left += bar + 10;
  words("1");
  left += 20;
  draw_box({left, top + 8}, {10, 10}, 1, test_ink, picture);
  left += 20;
  words("test view");
  left += 20;
  draw_ring({static_cast<double>(left) + 8, static_cast<double>(top) + 13}, 6.5, 8.5, alarm_ink, picture);
  left += 26;
  words("named by a finding");
  left += 20;
  draw_box({left, top + 8}, {10, 10}, 2, mask_ink, picture);
  left += 20;
  words("mask");
  left += 20;
  words("lengths in scene units");
}

}  // namespace

Tensor<uint8_t> capture_picture(const Capture& capture, const std::vector<Finding>& findings) {
  const Marks marks = marks_of(capture, findings);
  const Tensor<uint8_t> tiles = view_tiles(capture, marks);
  const MapViews views = map_views(capture);
  Tensor<uint8_t> picture(Shape{tiles.dim(0) + map_size.y + legend_height, picture_width, 3});
  fill_box({0, 0}, {picture.dim(1), picture.dim(0)}, paper, picture);
  paste(tiles, {0, 0}, picture);
  const int64_t top = tiles.dim(0);
  paste(camera_map(capture, marks, views.top, "from above", map_size), {0, top}, picture);
  paste(camera_map(capture, marks, views.side, "from the side", map_size), {map_size.x + picture_gap, top},
        picture);
  draw_legend(top + map_size.y, picture);
  return picture;
}

}  // namespace traceflow::viz
