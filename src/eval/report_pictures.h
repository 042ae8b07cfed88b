#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "viz/picture.h"

namespace traceflow::eval {

// One view in a report: each picture a data: address of a JPEG, all of one size.
struct ReportPicture {
  std::string id;
  int64_t width = 0, height = 0;
  std::string photograph, rgb, difference, diffuse, specular, normal, depth;
};

// Whether item i of n is among `wanted` that are spread evenly over them.
bool among_spread(size_t i, size_t n, size_t wanted);

// Makes the pictures of a report, in `budget` bytes of page at most: twelve views, or all where there are
// fewer, share it evenly. Each view's seven pictures are at most 1280 pixels a side and as good (quality 92
// down to 50) as its share holds; only what is still too large then gets smaller.
class ReportPictures {
 public:
  explicit ReportPictures(size_t views, size_t budget = 10'500'000);

  // Whether view i of all is to be added.
  bool wants(size_t i) const { return among_spread(i, views_, shown_); }
  // photograph, and what of it is known (H×W, may be empty): on the host; the frame is on any device.
  void add(const std::string& id, const Tensor<float>& photograph, const Frame& frame,
           const Tensor<uint8_t>& known = {});
  std::vector<ReportPicture> take() { return std::move(pictures_); }

 private:
  size_t views_, shown_, share_;
  viz::Painter painter_;
  std::vector<ReportPicture> pictures_;
};

}  // namespace traceflow::eval
