#include "train/schedule.h"

#include <gtest/gtest.h>

namespace traceflow {
namespace {

TrainOptions paper() { return preset("paper"); }

TEST(Schedule, HasThePaperPhases) {
  const Schedule s(paper());
  EXPECT_EQ(s.phase(0), Phase::diffuse);
  EXPECT_EQ(s.phase(8999), Phase::diffuse);
  EXPECT_EQ(s.phase(9000), Phase::specular);
  EXPECT_EQ(s.phase(14999), Phase::specular);
  EXPECT_EQ(s.phase(15000), Phase::joint);
  EXPECT_FALSE(s.deforms_main(2999));
  EXPECT_TRUE(s.deforms_main(3000));
  EXPECT_FALSE(s.uses_normal_losses(5999));
  EXPECT_TRUE(s.uses_normal_losses(6000));
}

TEST(Schedule, ShorterRunsScaleEveryMarkInProportion) {
  TrainOptions options = paper();
  options.iterations = 600;
  const Schedule s(options);
  const Schedule full(paper());
  for (int i = 0; i < 600; ++i) {
    EXPECT_EQ(s.phase(i), full.phase(100 * i)) << i;
    EXPECT_EQ(s.deforms_main(i), full.deforms_main(100 * i)) << i;
    EXPECT_EQ(s.uses_normal_losses(i), full.uses_normal_losses(100 * i)) << i;
    EXPECT_EQ(s.sh_degree_main(i), full.sh_degree_main(100 * i)) << i;
    EXPECT_DOUBLE_EQ(s.time_jitter(i), full.time_jitter(100 * i)) << i;
    EXPECT_NEAR(s.position_rate(i), full.position_rate(100 * i), 1e-12) << i;
  }
}

TEST(Schedule, TimesAreReachedInProportion) {
  TrainOptions o;
  o.schedule.first_times = 0.1F;
  o.schedule.all_times_from = 33000;
  const Schedule schedule(o);
  EXPECT_FLOAT_EQ(static_cast<float>(schedule.seen_times(0)), 0.1F);
  EXPECT_FLOAT_EQ(static_cast<float>(schedule.seen_times(3000)), 0.1F);
  EXPECT_FLOAT_EQ(static_cast<float>(schedule.seen_times(18000)), 0.55F);
  EXPECT_EQ(schedule.seen_times(33000), 1);
  EXPECT_EQ(Schedule(TrainOptions{}).seen_times(0), 1) << "the paper trains on all times from the start";
}

TEST(Schedule, ThePerceptualTermIsLateAndOffWithoutAWeight) {
  TrainOptions options = paper();
  EXPECT_FALSE(Schedule(options).uses_lpips(59999));
  options.loss.lpips = 0.1F;
  options.iterations = 600;
  EXPECT_FALSE(Schedule(options).uses_lpips(449));
  EXPECT_TRUE(Schedule(options).uses_lpips(450));
}

TEST(Schedule, PhaseTwoFreezesTheMainSurfelsButTheirTint) {
  const Trainable t = Schedule(paper()).trainable(10000);
  EXPECT_FALSE(t.main);
  EXPECT_FALSE(t.main_field);
  EXPECT_TRUE(t.tint);
  EXPECT_TRUE(t.environment);
  EXPECT_TRUE(t.environment_field);
}

TEST(Schedule, PhaseThreeTrainsEverything) {
  const Trainable t = Schedule(paper()).trainable(20000);
  EXPECT_TRUE(t.main && t.main_field && t.tint && t.environment && t.environment_field);
}

TEST(Schedule, WithoutReflectionsEveryIterationIsDiffuse) {
  TrainOptions options = paper();
  options.specular = Specular::none;
  const Schedule s(options);
  for (int i = 0; i < options.iterations; i += 500) EXPECT_EQ(s.phase(i), Phase::diffuse);
  EXPECT_TRUE(s.trainable(40000).main);
}

TEST(Schedule, SwitchedOffFieldsNeverTrain) {
  TrainOptions options = paper();
  options.deform.main = options.deform.environment = false;
  const Schedule s(options);
  for (int i = 0; i < options.iterations; i += 500) {
    EXPECT_FALSE(s.deforms_main(i));
    EXPECT_FALSE(s.trainable(i).main_field);
    EXPECT_FALSE(s.trainable(i).environment_field);
  }
}

TEST(Schedule, DensityControlRunsAsTheMethodSays) {
  const Schedule s(paper());
  EXPECT_FALSE(s.densifies_main(400));
  EXPECT_TRUE(s.densifies_main(500));
  EXPECT_FALSE(s.densifies_main(550));
  EXPECT_TRUE(s.densifies_main(600));
  EXPECT_FALSE(s.densifies_main(10000)) << "frozen in phase 2";
  EXPECT_FALSE(s.densifies_environment(8500));
  EXPECT_TRUE(s.densifies_environment(9500));
  EXPECT_TRUE(s.resets_main_opacity(3000));
  EXPECT_FALSE(s.resets_main_opacity(3100));
}

TEST(Options, EveryPresetIsValid) {
  for (const char* name : {"paper", "cpu", "demo"}) EXPECT_NO_THROW(preset(name).validate()) << name;
  EXPECT_THROW(preset("gpu"), InputError);
}

TEST(Options, NonsenseIsRefusedByName) {
  TrainOptions options = paper();
  options.schedule.length = 0;
  try {
    options.validate();
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("schedule.length"), std::string::npos) << error.what();
  }
}

}  // namespace
}  // namespace traceflow
