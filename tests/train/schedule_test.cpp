#include "train/schedule.h"

#include <gtest/gtest.h>

#include <cmath>

#include <functional>
#include <vector>
#include "track/tracker.h"

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
  EXPECT_NEAR(schedule.latest_time(0, 0, 1), 0.1, 1e-6);
  EXPECT_NEAR(schedule.latest_time(3000, 0, 1), 0.1, 1e-6);
  EXPECT_NEAR(schedule.latest_time(18000, 0, 1), 0.55, 1e-6);
  EXPECT_NEAR(schedule.latest_time(18000, 0.2, 0.8), 0.53, 1e-6);
  EXPECT_EQ(schedule.latest_time(33000, 0, 1), 1);
  EXPECT_EQ(Schedule(TrainOptions{}).latest_time(0, 0, 1), 1)
      << "the paper trains on all times from the start";
}

TEST(Schedule, TheLastTimeIsReachedWhateverTheFirstIs) {
  const Schedule paper_schedule(paper()), short_schedule(preset("cpu"));
  for (int photographs = 2; photographs < 400; ++photographs) {
    const float first = 1.0F / static_cast<float>(photographs);
    const int last_iteration = preset("cpu").iterations - 1;
    EXPECT_GE(paper_schedule.latest_time(0, first, 1.0F), 1.0F) << first;
    EXPECT_GE(short_schedule.latest_time(last_iteration, first, 1.0F), 1.0F) << first;
  }
}

TEST(Schedule, DepthPriorsFadeLinearlyOverTheirShareOfTheRun) {
  TrainOptions options = paper();
  options.iterations = options.schedule.length / 100;
  options.loss.depth_prior_until = 20000;
  const Schedule schedule(options);
  EXPECT_EQ(schedule.depth_prior_share(0), 1);
  EXPECT_DOUBLE_EQ(schedule.depth_prior_share(50), 0.75);
  EXPECT_EQ(schedule.depth_prior_share(200), 0);
  EXPECT_EQ(schedule.depth_prior_share(options.iterations), 0);
}

TEST(Schedule, ThePerceptualTermIsLateAndOffWithoutAWeight) {
  TrainOptions options = paper();
  EXPECT_FALSE(Schedule(options).uses_lpips(59999));
  options.loss.lpips = 0.1F;
  options.iterations = 600;
  EXPECT_FALSE(Schedule(options).uses_lpips(449));
  EXPECT_TRUE(Schedule(options).uses_lpips(450));
}

TEST(Schedule, PixelsHaveSeveralSamplesTowardsTheEnd) {
  TrainOptions options = paper();
  options.iterations = 600;
  options.schedule.samples_from = 45000;
  EXPECT_EQ(Schedule(options).samples(599), 1);
  options.render.samples = 3;
  EXPECT_EQ(Schedule(options).samples(449), 1);
  EXPECT_EQ(Schedule(options).samples(450), 3);
  EXPECT_EQ(picture_render(options, 450).samples, 1) << "no photograph has been seen with more";
  EXPECT_EQ(picture_render(options, 451).samples, 3);
}

TEST(Schedule, TheTrackerDrawsSurfelsAsWideAsTheyAreTrained) {
  TrainOptions options = preset("cpu");
  options.iterations = 600;
  options.schedule.samples_from = 45000;
  options.render.samples = 2;
  const auto low_pass_at = [&](int iteration) {
    return raster_for_tracking(Schedule(options).render(iteration), 1).low_pass;
  };
  EXPECT_EQ(low_pass_at(449), 1);
  EXPECT_EQ(low_pass_at(450), 0.5);
  options.render.low_pass = false;
  EXPECT_EQ(low_pass_at(449), 0);
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
  EXPECT_FALSE(s.main_density(400).densifies);
  EXPECT_TRUE(s.main_density(500).densifies);
  EXPECT_FALSE(s.main_density(550).densifies);
  EXPECT_TRUE(s.main_density(600).densifies);
  EXPECT_FALSE(s.main_density(10000).densifies) << "frozen in phase 2";
  EXPECT_FALSE(s.environment_density(8500).densifies);
  EXPECT_FALSE(s.environment_density(9000).densifies) << "it has not trained yet";
  EXPECT_TRUE(s.environment_density(9500).densifies);
  EXPECT_FALSE(s.main_density(3000).prunes_large) << "as 2DGS: after the first reset of opacities";
  EXPECT_TRUE(s.main_density(3100).prunes_large);
  EXPECT_TRUE(s.main_density(3000).resets_opacity);
  EXPECT_FALSE(s.main_density(3100).resets_opacity);
}

// Whatever the run's length: the optimiser needs its iterations to bring an opacity back from a reset.
TEST(Schedule, PosesAreSolvedAgainAtAQuarterOfARunAndNoLaterThanAfterTwoThousand) {
  const auto solved = [](int iterations, int rounds, int followed) {
    TrainOptions options = preset("cpu");
    options.iterations = iterations;
    options.deform.track.rounds = rounds;
    const Schedule schedule(options);
    std::vector<int> at;
    for (int i = followed; i < iterations; ++i) {
      if (schedule.solves_poses_again(i, followed)) at.push_back(i);
    }
    return at;
  };
  EXPECT_EQ(solved(2500, 4, 300), (std::vector<int>{625, 1250, 1875}));
  EXPECT_EQ(solved(2500, 4, 600), (std::vector<int>{1250, 1875}));
  EXPECT_EQ(solved(8000, 4, 600), (std::vector<int>{2000, 4000, 6000}));
  const std::vector<int> often = solved(60000, 4, 600);
  ASSERT_EQ(often.size(), 29U);
  EXPECT_EQ(often.front(), 2000);
  EXPECT_EQ(often.back(), 58000);
  EXPECT_TRUE(solved(8000, 0, 600).empty());
}

TEST(Schedule, PosesLearnNoLongerForALongerRun) {
  TrainOptions options = preset("cpu");
  const double start = options.rates.motion, end = options.rates.motion_end;
  for (const int iterations : {1000, 8000}) {
    options.iterations = iterations;
    const Schedule s(options);
    EXPECT_NEAR(s.motion_rate(0), start, 1e-9);
    EXPECT_NEAR(s.motion_rate(iterations / 2), std::sqrt(start * end), 1e-9);
    EXPECT_NEAR(s.motion_rate(iterations), end, 1e-9);
  }
  const Schedule usual(options);
  options.iterations = 60000;
  const Schedule longer(options);
  double turned = 0;
  for (int i = 0; i < 60000; ++i) turned += longer.motion_rate(i);
  for (int i = 0; i <= 8000; ++i) EXPECT_EQ(longer.motion_rate(i), usual.motion_rate(i)) << i;
  // The integral of a decay without end.
  EXPECT_NEAR(turned, 8000 * start / std::log(start / end), 0.001 * turned);
}

TEST(Schedule, OpacitiesHaveTimeToRecoverBeforeTheFaintGo) {
  for (const int iterations : {1200, 6000, 10000, 20000, 25000, 40000, 50000, 60000, 90000}) {
    TrainOptions options = paper();
    options.iterations = iterations;
    const Schedule s(options);
    int reset_main = 0, reset_environment = 0, prunings = 0;
    for (int i = 1; i < iterations; ++i) {
      const DensityStep main = s.main_density(i), environment = s.environment_density(i);
      if (main.densifies && main.prunes_faint) {
        ++prunings;
        EXPECT_TRUE(reset_main == 0 || i - reset_main >= 100) << iterations << " " << i;
      }
      if (environment.densifies && environment.prunes_faint) {
        ++prunings;
        EXPECT_TRUE(reset_environment == 0 || i - reset_environment >= 500) << iterations << " " << i;
      }
      if (iterations == 60000) {
        EXPECT_TRUE(!main.densifies || main.prunes_faint) << i;
        EXPECT_TRUE(!environment.densifies || environment.prunes_faint) << i;
      }
      if (main.resets_opacity) reset_main = i;
      if (environment.resets_opacity) reset_environment = i;
    }
    EXPECT_GT(prunings, 50) << iterations;
    EXPECT_EQ(reset_main > 0, iterations >= 4000) << iterations;
    EXPECT_EQ(reset_environment > 0, iterations >= 20000) << iterations;
  }
}

TEST(Options, EveryPresetIsValid) {
  for (const char* name : {"paper", "cpu", "demo"}) EXPECT_NO_THROW(preset(name).validate()) << name;
  EXPECT_THROW(preset("gpu"), InputError);
}

TEST(Options, NonsenseIsRefusedByName) {
  const auto expect_refused = [](const std::string& name, const std::function<void(TrainOptions&)>& spoil) {
    TrainOptions options = paper();
    spoil(options);
    try {
      options.validate();
      FAIL() << name << " accepted";
    } catch (const InputError& error) {
      EXPECT_NE(std::string(error.what()).find(name), std::string::npos) << error.what();
    }
  };
  expect_refused("schedule.length", [](TrainOptions& o) { o.schedule.length = 0; });
  expect_refused("density.prune_opacity", [](TrainOptions& o) { o.density.prune_opacity = 1; });
  expect_refused("density.prune_above", [](TrainOptions& o) { o.density.prune_above = 0; });
  expect_refused("density.longest_needle", [](TrainOptions& o) { o.density.longest_needle = -1; });
  expect_refused("density.longest_unseen", [](TrainOptions& o) { o.density.longest_unseen = -1; });
  expect_refused("environment_density.longest_unseen",
                 [](TrainOptions& o) { o.environment_density.longest_unseen = 0.1F; });
  expect_refused("environment_density.prune_above_cloud",
                 [](TrainOptions& o) { o.environment_density.prune_above_cloud = -1; });
  expect_refused("loss.rigidity_strain", [](TrainOptions& o) { o.loss.rigidity_strain = 1e-12F; });
  expect_refused("loss.depth_prior", [](TrainOptions& o) { o.loss.depth_prior = -1; });
  expect_refused("loss.depth_prior_until", [](TrainOptions& o) { o.loss.depth_prior_until = 0; });
  expect_refused("loss.normal_prior_on_mirrors",
                 [](TrainOptions& o) { o.loss.normal_prior_on_mirrors = -1; });
  expect_refused("memory_budget", [](TrainOptions& o) { o.memory_budget = int64_t{1} << 43; });
}

}  // namespace
}  // namespace traceflow
