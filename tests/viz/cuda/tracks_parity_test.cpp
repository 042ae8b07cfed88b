#include "viz/tracks.h"

#include "support/device.h"
#include "viz/moving_board.h"
#include "viz/track_picture.h"

namespace traceflow::viz {
namespace {

using namespace traceflow::testing;

using TracksOnDevice = OnDevice;

TEST_F(TracksOnDevice, ComeToTheHost) {
  MovingBoard f;
  const TrackFollower on_cpu = f.follower();
  const Tracks expected = on_cpu.at(f.scene, 0.6F);
  const Tensor<float> picture = track_picture(f.frame_at(0.6F), expected);

  f.scene.move_to(Device::cuda);
  const TrackFollower follower = f.follower();
  EXPECT_EQ(list_of(follower.chosen().on(Device::cpu)), list_of(on_cpu.chosen()));
  const Tracks found = follower.at(f.scene, 0.6F);
  EXPECT_EQ(found.hue, expected.hue);
  ASSERT_EQ(found.position.device(), Device::cpu);
  ASSERT_EQ(found.position.shape(), expected.position.shape());
  for (int64_t i = 0; i < found.position.size(); ++i)
    EXPECT_NEAR(found.position[i], expected.position[i], 1e-6F);
  Renderer renderer(f.options);
  const Tensor<float> drawn = track_picture(renderer.forward(f.scene, f.request), found);
  ASSERT_EQ(drawn.device(), Device::cpu);
  for (int64_t i = 0; i < drawn.size(); ++i) ASSERT_NEAR(drawn[i], picture[i], 1e-3F);
}

}  // namespace
}  // namespace traceflow::viz
