#include <array>
#include <set>

#include "base/profile.h"
#include "emulation/device.h"
#include "support/device.h"
#include "train/small_run.h"

namespace traceflow {
namespace {

class TrainerOnDevice : public traceflow::testing::OnDevice {
 protected:
  void TearDown() override {
    cuda::set_deterministic(false);
    memory::set_device_budget(std::numeric_limits<size_t>::max());
  }
};

struct Curve {
  std::vector<double> loss, l1;
};

Curve train(Trainer& trainer, int iterations) {
  Curve curve;
  for (int i = 0; i < iterations; ++i) {
    const LossValues terms = trainer.step();
    curve.loss.push_back(terms.total);
    curve.l1.push_back(terms["l1"]);
  }
  return curve;
}

double mean_of(const std::vector<double>& curve, size_t begin, size_t end) {
  double sum = 0;
  for (size_t i = begin; i < end; ++i) sum += curve[i];
  return sum / static_cast<double>(end - begin);
}

// Adam divides by the root of the second moment, so that a gradient near zero turns rounding into a step of
// full length: two runs part slowly and then stay as far from each other as two seeds of one run. First
// iterations are compared one by one; all of them by means over 20, each of which sees every view several
// times.
TEST_F(TrainerOnDevice, TwoHundredIterationsFollowTheCpusCurve) {
  TrainOptions options = small_run(200);
  options.schedule.length = 200;
  options.schedule.deform_from = 10;
  options.schedule.normal_from = 20;
  options.schedule.specular_from = 40;
  options.schedule.joint_from = 60;
  Trainer on_cpu = make_trainer(options, "curve_cpu"),
          on_cuda = make_trainer(options, "curve_cuda", Device::cuda);
  const Curve expected = train(on_cpu, 200), found = train(on_cuda, 200);
  for (size_t i = 0; i < 10; ++i) EXPECT_NEAR(found.loss[i], expected.loss[i], 1e-3 * expected.loss[i]) << i;
  for (const auto curve : {&Curve::loss, &Curve::l1}) {
    for (size_t i = 0; i < 200; i += 20) {
      const double mean = mean_of(expected.*curve, i, i + 20);
      EXPECT_NEAR(mean_of(found.*curve, i, i + 20), mean, 0.05 * mean) << "from " << i;
    }
  }
  // More terms join the loss on the way; the photographs' own falls.
  EXPECT_LT(mean_of(found.l1, 180, 200), 0.9 * mean_of(found.l1, 0, 20));
  EXPECT_NEAR(static_cast<double>(on_cuda.scene().main.count()),
              static_cast<double>(on_cpu.scene().main.count()),
              0.1 * static_cast<double>(on_cpu.scene().main.count()));
}

TEST_F(TrainerOnDevice, SumsInAFixedOrderGiveTheSameBytesAlsoWhenInterrupted) {
  cuda::set_deterministic(true);
  const TrainOptions options = small_run(26);
  Trainer whole = make_trainer(options, "whole_cuda", Device::cuda);
  EXPECT_EQ(whole.run(never).ending, events::Ending::completed);

  Trainer first = make_trainer(options, "parts_cuda", Device::cuda);
  std::atomic<bool> stop{false};
  first.stream().listen([&](const events::Event& event) {
    const auto* step = std::get_if<events::Step>(&event);
    if (step != nullptr && step->iteration == 15) stop = true;
  });
  EXPECT_EQ(first.run(stop).ending, events::Ending::interrupted);
  const fs::path run = fs::path(::testing::TempDir()) / ("parts_cuda_" + std::to_string(::getpid()));
  Trainer second(options, load_capture(capture_folder(), options.capture), run, Device::cuda);
  second.resume();
  EXPECT_EQ(second.run(never).ending, events::Ending::completed);
  EXPECT_EQ(scene_bytes(second.scene()), scene_bytes(whole.scene()));
}

TEST_F(TrainerOnDevice, ARunGoesOnOnTheOtherDevice) {
  const TrainOptions options = small_run(24);
  for (const Device from : {Device::cpu, Device::cuda}) {
    const Device to = from == Device::cpu ? Device::cuda : Device::cpu;
    Trainer first = make_trainer(options, "moves", from);
    std::atomic<bool> stop{false};
    first.stream().listen([&](const events::Event& event) {
      const auto* step = std::get_if<events::Step>(&event);
      if (step != nullptr && step->iteration == 18) stop = true;
    });
    first.run(stop);
    const fs::path run = fs::path(::testing::TempDir()) / ("moves_" + std::to_string(::getpid()));
    Trainer second(options, load_capture(capture_folder(), options.capture), run, to);
    second.resume();
    EXPECT_EQ(scene_bytes(second.scene()), scene_bytes(first.scene()));
    EXPECT_EQ(second.scene().device(), to);
    EXPECT_EQ(second.run(never).ending, events::Ending::completed);
  }
}

// The budget ends at another point of an iteration each time; wherever that is, what was learnt is saved, and
// a run with more memory goes on from there.
TEST_F(TrainerOnDevice, RunningOutOfMemoryEndsInASavedState) {
  const TrainOptions options = small_run(20);
  for (const size_t more : {size_t{0}, size_t{20000}, size_t{60000}, size_t{120000}}) {
    Trainer trainer = make_trainer(options, "memory", Device::cuda);
    trainer.stream().listen([&](const events::Event& event) {
      const auto* step = std::get_if<events::Step>(&event);
      if (step != nullptr && step->iteration == 9) memory::set_device_budget(memory::device_bytes() + more);
    });
    const events::Finished end = trainer.run(never);
    ASSERT_EQ(end.ending, events::Ending::out_of_memory) << more;
    EXPECT_EQ(end.reason.find("out of device memory"), 0U) << end.reason;
    EXPECT_GE(end.iteration, 9);
    memory::set_device_budget(std::numeric_limits<size_t>::max());
    const fs::path run = fs::path(::testing::TempDir()) / ("memory_" + std::to_string(::getpid()));
    Trainer resumed(options, load_capture(capture_folder(), options.capture), run, Device::cuda);
    resumed.resume();
    EXPECT_EQ(resumed.iteration(), end.iteration);
    EXPECT_EQ(scene_bytes(resumed.scene()), scene_bytes(trainer.scene()));
    EXPECT_EQ(resumed.run(never).ending, events::Ending::completed);
  }
}

// The driver takes memory too when it starts a kernel, and then the optimiser may be half through. Wherever
// that is, what is on the disk is whole: a resumed run ends in the bytes of one that was never stopped. On a
// device nothing can be made to fail so, and nothing is tried.
TEST_F(TrainerOnDevice, RunningOutOfMemoryForAKernelLeavesAStateThatIsWhole) {
  if (emulation::refuse_launches == nullptr) return;
  cuda::set_deterministic(true);
  TrainOptions options = small_run(14);
  // Density control that finds no memory is left out, and the run goes on differently.
  options.density.until = options.environment_density.until = 0;
  constexpr int reached = 9;
  const fs::path run = fs::path(::testing::TempDir()) / ("kernels_" + std::to_string(::getpid()));
  const auto load = [&] { return load_capture(capture_folder(), options.capture); };
  Trainer whole = make_trainer(options, "whole_kernels", Device::cuda);
  std::array<int64_t, 2> at{};  // kernels after so many iterations, and one more
  whole.stream().listen([&](const events::Event& event) {
    const auto* step = std::get_if<events::Step>(&event);
    if (step == nullptr) return;
    if (step->iteration == reached) at[0] = emulation::launches();
    if (step->iteration == reached + 1) at[1] = emulation::launches();
  });
  EXPECT_EQ(whole.run(never).ending, events::Ending::completed);
  const int64_t kernels = at[1] - at[0];
  ASSERT_GT(kernels, 20);

  std::set<int64_t> resumed_from;
  // Few of all, and each of the last, where the scene changes.
  for (int64_t k = 0; k < kernels; k = k < kernels - 6 ? std::min(k + 24, kernels - 6) : k + 1) {
    SCOPED_TRACE(k);
    Trainer trainer = make_trainer(options, "kernels", Device::cuda);
    trainer.stream().listen([&](const events::Event& event) {
      const auto* step = std::get_if<events::Step>(&event);
      if (step == nullptr) return;
      if (step->iteration == reached - 2) trainer.save();
      if (step->iteration == reached) emulation::refuse_launches(k, 2);
    });
    const events::Finished end = trainer.run(never);
    emulation::refuse_launches(0, 0);
    ASSERT_EQ(end.ending, events::Ending::out_of_memory);
    EXPECT_EQ(end.reason.find("out of device memory"), 0U) << end.reason;
    Trainer resumed(options, load(), run, Device::cuda);
    resumed.resume();
    EXPECT_EQ(end.reason.find("not saved") != std::string::npos, resumed.iteration() == reached - 2)
        << end.reason;
    resumed_from.insert(resumed.iteration());
    EXPECT_EQ(resumed.run(never).ending, events::Ending::completed);
    EXPECT_TRUE(scene_bytes(resumed.scene()) == scene_bytes(whole.scene())) << end.reason;
  }
  EXPECT_TRUE(resumed_from.contains(reached - 2)) << "no kernel of a change was refused";
  EXPECT_TRUE(resumed_from.contains(reached)) << "no other kernel was refused";
}

// Between two density controls, and once every view has been seen.
TEST_F(TrainerOnDevice, AnIterationInItsStrideAsksForNoMemory) {
  TrainOptions options = small_run(40);
  options.density.until = options.environment_density.until = 0;
  Trainer trainer = make_trainer(options, "stride", Device::cuda);
  for (int i = 0; i < 22; ++i) trainer.step();
  const int64_t before = memory::device_allocations();
  for (int i = 0; i < 3; ++i) trainer.step();
  EXPECT_EQ(memory::device_allocations(), before);
}

// Each costs the host a few microseconds, and what it reads stops the device. With the paper's depth of
// networks and its losses, all of them at work, and with roughness.
TEST_F(TrainerOnDevice, AnIterationIsFewKernelsAndFewerReads) {
  TrainOptions options = small_run(40);
  options.density.until = options.environment_density.until = 0;
  options.loss = preset("paper").loss;
  for (NetworkOptions* network : {&options.deform.network, &options.deform.environment_network}) {
    *network = preset("paper").deform.network;
    network->width = 16;
  }
  Trainer trainer = make_trainer(options, "few", Device::cuda);
  for (int i = 0; i < 22; ++i) trainer.step();
  profile::clear();
  profile::enable(true);
  trainer.step();
  profile::enable(false);
  int64_t reads = 0, products = 0, others = 0;
  for (const profile::Entry& entry : profile::entries()) {
    // Where the library of products has no such epilogues, these stand in for them.
    if (entry.name == "field: bias and ReLU" || entry.name == "field: ReLU backward") continue;
    (entry.name == "device: read by the host" ? reads
     : entry.name == "matrix product"         ? products
                                              : others) += entry.calls;
  }
  EXPECT_EQ(reads, 6);
  EXPECT_EQ(products,
            52);  // 8 layers and the heads, forward and twice backward, less 2 by the inputs; two sets
  EXPECT_LE(others, 130);
}

TEST_F(TrainerOnDevice, TheForecastCoversWhatARunTakes) {
  const TrainOptions options = small_run(24);
  const size_t before = memory::device_bytes();
  int64_t forecast = 0;
  size_t most = 0;
  Trainer trainer = make_trainer(options, "forecast", Device::cuda);
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* started = std::get_if<events::Started>(&event)) forecast = started->forecast_bytes;
    most = std::max(most, memory::device_bytes());
  });
  EXPECT_EQ(trainer.run(never).ending, events::Ending::completed);
  EXPECT_GT(most, before);
  EXPECT_LE(static_cast<int64_t>(most - before), forecast);
}

}  // namespace
}  // namespace traceflow
