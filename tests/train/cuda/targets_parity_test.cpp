#include "support/device.h"
#include "train/small_run.h"

namespace traceflow {
namespace {

using namespace traceflow::testing;

using TargetsOnDevice = OnDevice;

// With room for all photographs, for one, and for none.
TEST_F(TargetsOnDevice, AreThePhotographsThatTheCpuSees) {
  const Capture capture = load_capture(capture_folder(), {});
  const int64_t one = load_pixels(capture, capture.train.at(0))->bytes();
  Targets on_cpu(Device::cpu, 0);
  for (const int64_t room : {100 * one, one, int64_t{0}}) {
    Targets on_device(Device::cuda, room);
    for (int round = 0; round < 2; ++round) {
      for (const View& view : capture.train) {
        const ViewImages& found = on_device.of(capture, view);
        const ViewImages& expected = on_cpu.of(capture, view);
        expect_close_on_host(found.colour, expected.colour, 1e-7, "colour");
        expect_close_on_host(found.normal_prior, expected.normal_prior, 1e-6, "normal prior");
        EXPECT_EQ(list_of(found.mask.on(Device::cpu)), list_of(expected.mask));
      }
    }
  }
}

}  // namespace
}  // namespace traceflow
