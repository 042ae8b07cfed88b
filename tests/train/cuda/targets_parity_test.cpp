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
        const ViewImages& found = on_device.of(capture, view, true);
        const ViewImages& expected = on_cpu.of(capture, view, true);
        expect_close_on_host(found.colour, expected.colour, 1e-7, "colour");
        expect_close_on_host(found.normal_prior, expected.normal_prior, 1e-6, "normal prior");
        EXPECT_EQ(list_of(found.mask.on(Device::cpu)), list_of(expected.mask));
      }
    }
  }
}

TEST_F(TargetsOnDevice, ShowWhatIsRenderedWhereNothingIsKnown) {
  ViewImages on_cpu;
  on_cpu.colour.reset({3, 5, 3});
  on_cpu.known.reset({3, 5});
  Tensor<float> rendered({3, 5, 3});
  for (int64_t i = 0; i < rendered.size(); ++i) {
    on_cpu.colour[i] = static_cast<float>(i);
    rendered[i] = static_cast<float>(-i);
  }
  for (int64_t i = 0; i < on_cpu.known.size(); ++i) on_cpu.known[i] = i % 3 == 0 ? 0 : 1;
  ViewImages on_device;
  on_device.colour = on_cpu.colour.on(Device::cuda);
  on_device.known = on_cpu.known.on(Device::cuda);
  take_unknown(rendered, on_cpu);
  take_unknown(rendered.on(Device::cuda), on_device);
  EXPECT_EQ(list_of(on_device.colour.on(Device::cpu)), list_of(on_cpu.colour));
  EXPECT_EQ(on_cpu.colour[9], -9);
  EXPECT_EQ(on_cpu.colour[12], 12);
}

}  // namespace
}  // namespace traceflow
