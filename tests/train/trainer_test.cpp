#include "train/trainer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <map>
#include <thread>

#include "base/machine.h"
#include "base/parallel.h"
#include "support/narrow_lpips.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "train/density.h"
#include "train/initialise.h"
#include "train/small_run.h"

namespace traceflow {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

TEST(Trainer, LearnsTheCapture) {
  TrainOptions options = small_run(300);
  options.specular = Specular::none;
  Trainer trainer = make_trainer(options, "learns");
  const double before = trainer.step().psnr.value();
  const events::Finished end = trainer.run(never);
  EXPECT_EQ(end.ending, events::Ending::completed);
  EXPECT_GT(end.psnr, before + 1.5) << "from " << before;
}

// What view culling allows for: nothing before anything moved, then as far as the field moved a surfel.
TEST(Trainer, CullingLearnsHowFarTheFieldMoves) {
  TrainOptions options = small_run(12);
  options.deform.kind = "network";  // from the first iterations on
  Trainer trainer = make_trainer(options, "reach");
  EXPECT_EQ(trainer.scene().main_max_displacement[0], 0);
  for (int i = 0; i < 10; ++i) trainer.step();
  EXPECT_GT(trainer.scene().main_max_displacement[0], 0);
}

TEST(Trainer, PhasesAndDensityControlAreToldAndTheCapsHold) {
  Trainer trainer = make_trainer(small_run(40), "events");
  std::vector<std::string> phases;
  int64_t grown = 0;
  int64_t largest_main = 0;
  int64_t largest_environment = 0;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* phase = std::get_if<events::PhaseEntered>(&event)) phases.push_back(phase->phase);
    if (const auto* change = std::get_if<events::DensityChanged>(&event))
      grown += change->cloned + change->split;
    if (const auto* step = std::get_if<events::Step>(&event)) {
      largest_main = std::max(largest_main, step->surfels.main);
      largest_environment = std::max(largest_environment, step->surfels.environment);
    }
  });
  EXPECT_EQ(trainer.run(never).ending, events::Ending::completed);
  EXPECT_EQ(phases, (std::vector<std::string>{"diffuse", "specular", "joint"}));
  EXPECT_GT(grown, 0);
  EXPECT_LE(largest_main, 330);
  EXPECT_LE(largest_environment, 260);
}

TEST(Trainer, RoughnessTrainsWithTheTint) {
  Trainer trainer = make_trainer(small_run(40), "roughness");
  const auto range = [&] {
    const auto [low, high] = std::ranges::minmax(trainer.scene().main.roughness_logit.values());
    return high - low;
  };
  while (trainer.iteration() < 10) trainer.step();
  EXPECT_EQ(range(), 0) << "nothing is mirrored in the diffuse phase";
  while (trainer.iteration() < 14) trainer.step();
  EXPECT_GT(range(), 0.01F);
}

// Steps are measured without turning the profile on for anybody else, and every iteration is in one account.
TEST(Trainer, TellsWhereTheTimeWentPhaseByPhase) {
  for (const bool profiled : {false, true}) {
    profile::enable(profiled);
    TrainOptions options = small_run(40);
    options.save_every = 15;
    Trainer trainer = make_trainer(options, "measured");
    std::vector<std::string> told;
    int64_t iterations = 0;
    double inside = 0, training = 0;
    trainer.stream().listen([&](const events::Event& event) {
      EXPECT_EQ(profile::is_on(), profiled);
      if (std::holds_alternative<events::Saved>(event)) told.emplace_back("saved");
      if (const auto* phase = std::get_if<events::PhaseEntered>(&event)) told.push_back(phase->phase);
      if (const auto* end = std::get_if<events::Finished>(&event)) training = end->seconds;
      const auto* measured = std::get_if<events::Measured>(&event);
      if (measured == nullptr) return;
      told.push_back("measured " + measured->phase + " " + std::to_string(measured->iteration));
      iterations += measured->iterations;
      EXPECT_EQ(iterations, measured->iteration);
      for (const profile::Entry& step : measured->steps) {
        inside += step.seconds;
      }
    });
    trainer.run(never);
    profile::enable(false);
    EXPECT_EQ(told,
              (std::vector<std::string>{"diffuse", "measured diffuse 10", "specular", "measured specular 15",
                                        "saved", "measured specular 16", "joint", "measured joint 30",
                                        "saved", "measured joint 40", "saved"}));
    EXPECT_GT(inside, 0);
    EXPECT_LE(inside, training);
  }
}

// A listener that waits, as a viewer does while training is paused, costs no training time.
TEST(Trainer, TheTimeOfListenersIsNotTraining) {
  Trainer trainer = make_trainer(small_run(40), "listeners");
  std::chrono::duration<double> waited{0};
  double rate = 0;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* step = std::get_if<events::Step>(&event)) {
      rate = step->rate;
      EXPECT_GT(step->memory_bytes, 1 << 20);
    }
    if (std::holds_alternative<events::DensityChanged>(event) ||
        std::holds_alternative<events::Saved>(event)) {
      const auto start = std::chrono::steady_clock::now();
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      waited += std::chrono::steady_clock::now() - start;
    }
  });
  const auto start = std::chrono::steady_clock::now();
  const events::Finished end = trainer.run(never);
  const std::chrono::duration<double> whole = std::chrono::steady_clock::now() - start;
  EXPECT_GT(waited.count(), 0.5);
  EXPECT_LE(end.seconds, whole.count() - waited.count());
  EXPECT_GT(rate, 0);
}

TEST(Trainer, SameSeedGivesTheSameBytesAtAnyThreadCount) {
  std::string bytes[2];
  for (int threads = 1; threads <= 2; ++threads) {
    set_threads(threads);
    Trainer trainer = make_trainer(small_run(40), "threads");
    trainer.run(never);
    bytes[threads - 1] = scene_bytes(trainer.scene());
  }
  set_threads(0);
  EXPECT_EQ(bytes[0], bytes[1]);
}

TEST(Trainer, AnotherSeedGivesOtherBytes) {
  TrainOptions options = small_run(12);
  Trainer first = make_trainer(options, "seed1");
  first.run(never);
  options.seed = 2;
  Trainer second = make_trainer(options, "seed2");
  second.run(never);
  EXPECT_NE(scene_bytes(first.scene()), scene_bytes(second.scene()));
}

// With a network that moves surfels, with bodies, the second of whose times is entered after 9 iterations,
// with bodies that bend from the last time on, and with cameras that are refined and a far part of the
// environment.
class ResumedTrainer : public ::testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Kinds, ResumedTrainer, ::testing::Values("network", "nodes", "bend", "cameras"));

TEST_P(ResumedTrainer, EndsInTheBytesOfAnUninterruptedOne) {
  TrainOptions options = small_run(40);
  const bool bends = std::string(GetParam()) == "bend";
  const bool refines = std::string(GetParam()) == "cameras";
  options.deform.kind = bends || refines ? "nodes" : GetParam();
  options.rates.camera = refines ? 1e-4F : 0;
  options.initial.far_size = refines ? 4 : 0;
  options.deform.bend.misfit = 0;
  options.deform.track.new_surface = true;
  options.deform.bend.nodes = bends ? 5 : 0;
  options.deform.track.map_each = bends ? 1 : 4;  // the last time is reached
  Trainer whole = make_trainer(options, "whole");
  EXPECT_EQ(whole.scene().main_motion.has_value(), options.deform.kind == "nodes");
  int64_t added = 0;
  whole.stream().listen([&](const events::Event& event) {
    if (const auto* change = std::get_if<events::DensityChanged>(&event)) added += change->added;
  });
  whole.run(never);
  EXPECT_EQ(whole.scene().main_nodes.has_value(), bends);
  EXPECT_EQ(whole.scene().lighting.has_value(), whole.scene().main_motion.has_value());
  EXPECT_EQ(added > 0, whole.scene().main_motion.has_value());

  // Interrupt once in each phase.
  const fs::path run = fs::path(::testing::TempDir()) / ("resumed_" + std::to_string(::getpid()));
  fs::remove_all(run);
  for (const int pause : {7, 13, 29, 40}) {
    Trainer part(options, load_capture(capture_folder(), options.capture), run);
    if (fs::exists(run)) part.resume();
    std::atomic<bool> stop{false};
    part.stream().listen([&](const events::Event& event) {
      const auto* step = std::get_if<events::Step>(&event);
      if (step && step->iteration == pause) stop = true;
    });
    part.run(stop);
    EXPECT_EQ(part.iteration(), pause);
    if (pause == 40) {
      EXPECT_EQ(scene_bytes(part.scene()), scene_bytes(whole.scene()));
    }
  }
}

// Without normal priors nothing is known of how stiffly bodies are held.
TEST(Trainer, BodiesWithoutNormalPriorsAreResumedToo) {
  const fs::path bare = fs::path(::testing::TempDir()) / ("no_normals_" + std::to_string(::getpid()));
  fs::copy(capture_folder(), bare, fs::copy_options::recursive);
  fs::remove_all(bare / "normal");
  TrainOptions options = small_run(40);
  options.deform.kind = "nodes";
  Capture capture = load_capture(bare, options.capture);
  ASSERT_FALSE(capture.has_normal_priors);
  Trainer whole(options, std::move(capture), bare / "whole");
  ASSERT_TRUE(whole.scene().main_motion.has_value());
  whole.run(never);
  for (const int pause : {13, 40}) {
    Trainer part(options, load_capture(bare, options.capture), bare / "parts");
    if (pause == 40) part.resume();
    std::atomic<bool> stop{false};
    part.stream().listen([&](const events::Event& event) {
      const auto* step = std::get_if<events::Step>(&event);
      if (step && step->iteration == pause) stop = true;
    });
    part.run(stop);
    if (pause == 40) {
      EXPECT_EQ(scene_bytes(part.scene()), scene_bytes(whole.scene()));
    }
  }
}

TEST(Trainer, TheCheckpointBeforeTheLastIsKeptAndServesWhenTheLastIsDamaged) {
  TrainOptions options = small_run(12);
  options.save_every = 5;
  Trainer trainer = make_trainer(options, "kept");
  fs::path run;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* saved = std::get_if<events::Saved>(&event)) run = saved->path.parent_path();
  });
  trainer.run(never);
  const RunFolder folder{run};
  ASSERT_TRUE(fs::exists(folder.previous_checkpoint()));
  std::ofstream(folder.checkpoint(), std::ios::trunc) << "damaged";
  std::string note;
  EXPECT_EQ(read_checkpoint(folder, note).metadata.at("iteration"), "10");
  EXPECT_FALSE(note.empty());
}

TEST(Trainer, ResumingWithAnotherCaptureIsRefused) {
  TrainOptions options = small_run(3);
  Trainer trainer = make_trainer(options, "mismatch");
  trainer.run(never);
  const fs::path run = fs::path(::testing::TempDir()) / ("mismatch_" + std::to_string(::getpid()));
  const auto refusal_with = [&](const std::function<void(Capture&)>& change) {
    Capture other = load_capture(capture_folder(), options.capture);
    change(other);
    Trainer resumed(options, std::move(other), run);
    return refusal_of([&] { resumed.resume(); });
  };
  EXPECT_EQ(refusal_with([](Capture&) {}), "accepted");
  EXPECT_THAT(refusal_with([](Capture& c) { c.train.pop_back(); }), HasSubstr(capture_folder().string()));
  EXPECT_THAT(refusal_with([](Capture& c) { c.train[0].camera.position.x += 0.01F; }),
              AllOf(HasSubstr("--data: found "), HasSubstr("other names, times or poses")));
}

// Writes an entry into the metadata of a run's checkpoint.
void rewrite(const fs::path& run, const std::map<std::string, std::string>& entries) {
  Safetensors file = Safetensors::read(RunFolder{run}.checkpoint());
  for (const auto& [key, value] : entries) file.metadata.at(key) = value;
  file.write(RunFolder{run}.checkpoint());
}

TEST(Trainer, AResumedRunKeepsItsCapsUnlessItIsGivenABudget) {
  const auto with_cap = [](int surfels) {
    TrainOptions options = small_run(20);
    options.density.max_surfels = surfels;
    Trainer trainer = make_trainer(options, "capped");
    trainer.run(never);
    return scene_bytes(trainer.scene());
  };
  const std::string few = with_cap(310), many = with_cap(330);
  ASSERT_TRUE(few != many);
  const fs::path run = fs::path(::testing::TempDir()) / ("begun_small_" + std::to_string(::getpid()));
  for (const bool budget : {false, true}) {
    TrainOptions options = small_run(20);
    Trainer first = make_trainer(options, "begun_small");
    std::atomic<bool> stop{false};
    first.stream().listen([&](const events::Event& event) {
      const auto* step = std::get_if<events::Step>(&event);
      stop = step != nullptr && step->iteration == 1;
    });
    first.run(stop);
    rewrite(run, {{"cap_main", "310"}});  // as where less memory was free
    if (budget) options.memory_budget = 1 << 20;
    for (const int pause : {6, 20}) {
      Trainer resumed(options, load_capture(capture_folder(), options.capture), run);
      resumed.resume();
      resumed.stream().listen([&](const events::Event& event) {
        const auto* step = std::get_if<events::Step>(&event);
        stop = step != nullptr && step->iteration == pause;
      });
      stop = false;
      resumed.run(stop);
      if (pause == 20) {
        EXPECT_TRUE(scene_bytes(resumed.scene()) == (budget ? many : few));
      }
    }
  }
}

TEST(Trainer, ResumingSaysWhatMakesTheEndAnother) {
  TrainOptions options = small_run(6);
  options.density.max_surfels = 2'000'000'000;
  make_trainer(options, "told").run(never);
  const fs::path run = fs::path(::testing::TempDir()) / ("told_" + std::to_string(::getpid()));
  const auto said = [&] {
    Trainer resumed(options, load_capture(capture_folder(), options.capture), run);
    std::string text;
    resumed.stream().listen([&](const events::Event& event) {
      if (const auto* warning = std::get_if<events::Warning>(&event)) text += warning->text + "\n";
    });
    resumed.resume();
    return text;
  };
  EXPECT_EQ(said(), "");
  rewrite(run, {{"arithmetic", "the CPU with pencils"}, {"program_version", "0.0.9"}});
  EXPECT_THAT(said(), AllOf(HasSubstr("the CPU with pencils and goes on on the CPU with "),
                            HasSubstr("other bytes"), HasSubstr("by version 0.0.9")));
  // More than any machine has.
  rewrite(run, {{"cap_main", "2000000000"}});
  EXPECT_THAT(said(), AllOf(HasSubstr(" MiB, as when it began"), HasSubstr("--memory-budget")));
}

TEST(Trainer, ARefusedResumeLeavesADamagedCheckpointWhereItIs) {
  TrainOptions options = small_run(6);
  options.save_every = 3;
  make_trainer(options, "untouched").run(never);
  const RunFolder run{fs::path(::testing::TempDir()) / ("untouched_" + std::to_string(::getpid()))};
  std::ofstream(run.checkpoint(), std::ios::trunc) << "damaged";
  Capture other = load_capture(capture_folder(), options.capture);
  other.train.pop_back();
  EXPECT_THROW(Trainer(options, std::move(other), run.folder).resume(), InputError);
  EXPECT_EQ(bytes_of(run.checkpoint()), "damaged");
  Trainer(options, load_capture(capture_folder(), options.capture), run.folder).resume();
  EXPECT_EQ(bytes_of(run.damaged_checkpoint()), "damaged");
}

TEST(Trainer, NeighbourEdgesThatDoNotFitTheSurfelsAreRefused) {
  TrainOptions options = small_run(6);
  options.deform.kind = "network";  // whose neighbours are known from the first iterations on
  Trainer trainer = make_trainer(options, "neighbour_edges");
  trainer.run(never);
  const RunFolder run{fs::path(::testing::TempDir()) / ("neighbour_edges_" + std::to_string(::getpid()))};
  const Safetensors sound = Safetensors::read(run.checkpoint());
  const Tensor<int32_t> index = sound.tensor<int32_t>("bonds/index");
  ASSERT_GT(index.size(), 0);
  const auto resume_with = [&](const Tensor<int32_t>& bonds) {
    Safetensors file = sound;
    file.add("bonds/index", bonds);
    file.write(run.checkpoint());
    Trainer(options, load_capture(capture_folder(), options.capture), run.folder).resume();
  };
  EXPECT_NO_THROW(resume_with(index));
  Tensor<int32_t> bonds = index;
  bonds[3] = static_cast<int32_t>(index.dim(0));  // no such surfel
  EXPECT_THROW(resume_with(bonds), InputError);
  bonds[3] = -2;
  EXPECT_THROW(resume_with(bonds), InputError);
  bonds = index;
  bonds.resize({index.dim(0) - 1, index.dim(1)});
  EXPECT_THROW(resume_with(bonds), InputError);
}

TEST(Trainer, EveryAblationAndPeerOfTheMethodTrains) {
  for (const Specular specular :
       {Specular::none, Specular::environment_gaussians, Specular::environment_map}) {
    for (const bool deform : {false, true}) {
      TrainOptions options = small_run(24);
      options.specular = specular;
      options.deform.main = options.deform.environment = deform;
      options.loss.normal = options.loss.normal_prior = deform ? 0.05F : 0;
      options.loss.distortion = deform ? 0 : 10;
      Trainer trainer = make_trainer(options, "ablation");
      EXPECT_EQ(trainer.run(never).ending, events::Ending::completed);
      EXPECT_EQ(trainer.scene().main_field.has_value(), deform);
    }
  }
}

TEST(Trainer, SamplesAreTakenFromTheirIterationOn) {
  TrainOptions options = small_run(40);
  options.schedule.samples_from = 30;
  const auto losses = [&](int samples) {
    options.render.samples = samples;
    Trainer trainer = make_trainer(options, "samples");
    std::vector<double> found;
    while (trainer.iteration() <= 30) found.push_back(trainer.step().total);
    return found;
  };
  const std::vector<double> one = losses(1), four = losses(2);
  for (size_t i = 0; i < 30; ++i) EXPECT_EQ(one[i], four[i]) << i;
  EXPECT_NE(one[30], four[30]);
}

TEST(Trainer, ThePerceptualTermIsToldFromWhereItStarts) {
  const TempFolder folder;
  testing::lpips_file(testing::narrow_lpips_weights(2)).write(folder / "weights");
  TrainOptions options = small_run(12);
  options.loss.lpips = 0.1F;
  options.loss.lpips_from = 30;  // of 40
  options.loss.lpips_weights = (folder / "weights").string();
  Trainer trainer = make_trainer(options, "perceptual");
  std::vector<int64_t> told;
  trainer.stream().listen([&](const events::Event& event) {
    const auto* step = std::get_if<events::Step>(&event);
    if (step == nullptr) return;
    for (const events::Term& term : step->terms) {
      if (term.name == "lpips" && term.value > 0) told.push_back(step->iteration);
    }
  });
  EXPECT_EQ(trainer.run(never).ending, events::Ending::completed);
  EXPECT_EQ(told, (std::vector<int64_t>{10, 11, 12}));
}

TEST(Trainer, ACheckpointNamesTheWeightsByTheirWholePath) {
  const TempFolder folder;
  testing::lpips_file(testing::narrow_lpips_weights(2)).write(folder / "weights");
  TrainOptions options = small_run(2);
  options.loss.lpips = 0.1F;
  options.loss.lpips_weights = fs::relative(folder / "weights").string();
  Trainer trainer = make_trainer(options, "weights");
  EXPECT_EQ(fs::canonical(trainer.options().loss.lpips_weights), fs::canonical(folder / "weights"));
  EXPECT_TRUE(fs::path(trainer.options().loss.lpips_weights).is_absolute());
}

// What starts uniformly in its box is coarse: a bound that is meant for what photographs show would take
// nearly all of it before it has trained, the less a camera moves the sooner.
TEST(Trainer, SurroundingsOutliveTheirFirstDensityControl) {
  const Capture capture = load_capture(capture_folder(), {});
  for (const char* name : {"paper", "cpu", "demo"}) {
    const TrainOptions options = preset(name);
    Random random(1);
    Scene scene = initial_scene(capture, options, random).scene;
    const int64_t began = scene.environment.count();
    SurfelMoments moments;
    moments.reset_like(scene.environment);
    DensityControl control("environment", options.environment_density, began);
    const float radius = half_diagonal(scene.environment.position);
    const DensityLimits limits{{0.01F * radius, radius}, options.environment_density.max_surfels};
    control.update(scene.environment, moments, limits, random);
    EXPECT_GT(scene.environment.count(), 0.99 * static_cast<double>(began)) << name;
  }
}

TEST(Trainer, TellsWhereNoViewSeesAnyPoint) {
  Capture capture = load_capture(capture_folder(), {});
  // Beyond every camera's back.
  for (int64_t i = 0; i < capture.points.dim(0); ++i) {
    const Camera<float>& camera = capture.train.front().camera;
    store3(capture.points.row(i), camera.position + Vec3<float>(0, 0, -50) * camera.camera_from_world);
    for (const View& view : capture.train) {
      if (!view.camera.sees(load3<float>(capture.points.row(i)))) continue;
      FAIL() << "a point that should not be seen is";
    }
  }
  const int64_t points = capture.points.dim(0);
  const fs::path run = fs::path(::testing::TempDir()) / ("unseen_" + std::to_string(::getpid()));
  fs::remove_all(run);
  Trainer trainer(small_run(1), std::move(capture), run);
  std::vector<std::string> warnings;
  events::Started started;
  trainer.stream().listen([&](const events::Event& event) {
    if (const auto* warning = std::get_if<events::Warning>(&event)) warnings.push_back(warning->text);
    if (const auto* start = std::get_if<events::Started>(&event)) started = *start;
  });
  trainer.run(never);
  EXPECT_EQ(started.points, points);
  EXPECT_EQ(started.points_in_view, 0);
  EXPECT_THAT(warnings,
              ::testing::Contains("no training view sees any of the " + std::to_string(points) +
                                  " points: surfels start at random; are the points in the capture's "
                                  "own coordinates?"));
}

TEST(Trainer, NoSetStartsLargerThanItMayGrow) {
  TrainOptions options = preset("paper");
  options.density.max_surfels = 100;
  options.environment_density.max_surfels = 50;
  options.initial.environment_points = 20;
  const Trainer asked = make_trainer(options, "caps_asked");
  EXPECT_EQ(asked.scene().main.count(), 100);
  EXPECT_EQ(asked.scene().environment.count(), 50);

  options = preset("paper");
  options.capture.cache_mebibytes = 1;
  options.memory_budget = 400;
  Trainer dealt = make_trainer(options, "caps_dealt");
  EXPECT_LT(dealt.scene().environment.count(), 163840);
  int64_t told = 0;
  dealt.stream().listen([&](const events::Event& event) {
    if (const auto* start = std::get_if<events::Started>(&event)) told = start->forecast_bytes;
  });
  const std::atomic<bool> at_once{true};
  dealt.run(at_once);
  EXPECT_GT(told, 0);
  EXPECT_LE(told, int64_t{400} << 20);
}

TEST(Memory, AnEnvironmentMapCounts) {
  TrainOptions options = preset("paper");
  options.specular = Specular::none;
  const int64_t none = unlimited_forecast({options, Device::cpu, 3000, 1});
  options.specular = Specular::environment_map;
  const int64_t map = unlimited_forecast({options, Device::cpu, 3000, 1});
  options.initial.map_size = 1024;
  const int64_t large = unlimited_forecast({options, Device::cpu, 3000, 1});
  const NetworkOptions& network = options.deform.environment_network;
  EXPECT_GT(map - none, int64_t{3000} * 4 * network.width * network.depth) << "the field at every pixel";
  EXPECT_GT(large - map, int64_t{6} * 1024 * 1024 * 3 * 4 * 4) << "parameter, gradient and moments";
  options.specular = Specular::environment_gaussians;
  const int64_t near = unlimited_forecast({options, Device::cpu, 3000, 1});
  options.initial.far_size = 1024;
  EXPECT_GT(unlimited_forecast({options, Device::cpu, 3000, 1}) - near, int64_t{6} * 1024 * 1024 * 3 * 4 * 4);
}

TEST(Memory, SamplesCountAsPixels) {
  TrainOptions options = preset("paper");
  options.specular = Specular::none;
  const int64_t more_pixels = unlimited_forecast({options, Device::cpu, 4 * 3000, 1});
  options.render.samples = 2;
  EXPECT_EQ(unlimited_forecast({options, Device::cpu, 3000, 1}), more_pixels);
}

TEST(Memory, TheLargestViewOfEitherSplitCounts) {
  Capture capture;
  const auto add = [](std::vector<View>& split, int width, int height) {
    View& view = split.emplace_back();
    view.camera.width = width;
    view.camera.height = height;
  };
  add(capture.train, 40, 30);
  add(capture.train, 20, 70);
  EXPECT_EQ(largest_view(capture), 1400);
  add(capture.test, 60, 50);
  EXPECT_EQ(largest_view(capture), 3000);

  const TrainOptions options = preset("paper");
  EXPECT_GT(unlimited_forecast({options, Device::cpu, 3000, 1}),
            unlimited_forecast({options, Device::cpu, 1200, 1}));
}

// Light that changes has a grid at every so many-th time, with bodies alone.
TEST(Memory, LongFilmsNeedMoreWhereLightChanges) {
  TrainOptions options = preset("cpu");
  const auto needs = [&](int64_t times) { return unlimited_forecast({options, Device::cpu, 1200, times}); };
  options.deform.lighting.cells = 10;
  options.deform.lighting.every = 2;
  EXPECT_EQ(needs(100) - needs(20), int64_t{7} * 40 * 11 * 11 * 11 * 4);
  options.deform.lighting.cells = 0;
  EXPECT_EQ(needs(100), needs(20));
  options = preset("paper");
  EXPECT_EQ(needs(100), needs(20));
}

// What the page cache holds is given back when it is wanted.
TEST(Memory, TheAutomaticBudgetIsOfWhatTheMachineCanGive) {
  const auto available = static_cast<double>(memory_available());
  EXPECT_NEAR(static_cast<double>(memory_budget_bytes(preset("paper"), Device::cpu)), 0.75 * available,
              0.02 * available);
}

TEST(Memory, TheBudgetLowersTheCapsAndOneThatHoldsNothingIsRefused) {
  TrainOptions options = preset("paper");
  const MemorySetting run{options, Device::cpu, int64_t{480} * 270, 80};
  options.memory_budget = 1 << 20;
  EXPECT_FALSE(plan_memory(run).caps.lowered);
  EXPECT_EQ(plan_memory(run).caps.main, options.density.max_surfels);
  options.memory_budget = 2500;
  const MemoryPlan plan = plan_memory(run);
  EXPECT_TRUE(plan.caps.lowered);
  EXPECT_GT(plan.caps.main, 10000);
  EXPECT_LE(plan.forecast_bytes, int64_t{2500} << 20);
  options.memory_budget = 10;
  EXPECT_THROW(plan_memory(run), InputError);
}

}  // namespace
}  // namespace traceflow
