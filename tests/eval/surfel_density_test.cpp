#include "eval/surfel_density.h"

#include <gtest/gtest.h>

namespace traceflow::eval {
namespace {

// Four columns of pixels, half of which the mask covers, before a wall at z = 2: of the surfels in the mask
// those count that stand in the wall or before it.
TEST(SurfelDensity, CountsWhatShowsInTheMask) {
  Frame frame;
  frame.camera.width = frame.camera.height = 4;
  frame.camera.focal_x = frame.camera.focal_y = 4;
  frame.camera.centre_x = frame.camera.centre_y = 2;
  frame.raster.depth.reset({4, 4});
  frame.raster.depth.fill(2);
  Tensor<uint8_t> mask({4, 4});
  mask.fill(0);
  for (int y = 0; y < 4; ++y) mask(y, 0) = mask(y, 1) = 1;
  const std::array<std::array<float, 3>, 8> places = {{{-0.25F, 0, 2},         // in the wall
                                                       {-0.25F, 0.2F, 2.03F},  // its thickness
                                                       {-0.25F, 0, 1},         // before it
                                                       {-0.25F, 0, 2.1F},      // behind it
                                                       {0.25F, 0, 2},          // beside the mask
                                                       {-2, 0, 2},             // outside the picture
                                                       {-0.25F, 0, -2},        // behind the camera
                                                       {-0.75F, 0.9F, 2}}};    // in a corner
  frame.main.position.reset({8, 3});
  for (int64_t i = 0; i < 8; ++i)
    std::copy_n(places[static_cast<size_t>(i)].data(), 3, frame.main.position.row(i));
  EXPECT_EQ(surfels_in_mask(frame, mask), 4);
}

}  // namespace
}  // namespace traceflow::eval
