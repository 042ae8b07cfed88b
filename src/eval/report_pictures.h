#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "viz/picture.h"

namespace traceflow::eval {

// One view in a report: each picture is a JPEG as a data: URL, all of one size.
struct ReportPicture {
  std::string id;
  int64_t width = 0, height = 0;
  std::string photograph, rgb, difference, diffuse, specular, normal, depth;
};

// Whether item i of n is one of `wanted` evenly spaced ones.
bool among_spread(size_t i, size_t n, size_t wanted);

// Makes the pictures of a report within `budget` bytes of the page. Up to twelve views share it evenly. Each
// view has seven pictures of at most 1280 pixels a side, with the highest JPEG quality (92 down to 50) that
// fits its share. If quality 50 is still too large, the pictures are made smaller.
class ReportPictures {
 public:
  explicit ReportPictures(size_t views, size_t budget = 10'500'000);

  // Whether view i should be added.
  bool wants(size_t i) const { return among_spread(i, views_, shown_); }
  // photograph and its known pixels (H×W, may be empty): on the host; the frame is on any device.
  void add(const std::string& id, const Tensor<float>& photograph, const Frame& frame,
           const Tensor<uint8_t>& known = {});
  std::vector<ReportPicture> take() { return std::move(pictures_); }

 private:
  size_t views_, shown_, share_;
  viz::Painter painter_;
  std::vector<ReportPicture> pictures_;
};

}  // namespace traceflow::eval
