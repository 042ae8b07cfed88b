#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <memory>

#include "capture/synth/synth.h"
#include "scene/scene_file.h"
#include "support/file_bytes.h"
#include "train/trainer.h"

// A training run that takes a moment, for the tests of training as a whole.
namespace traceflow {

namespace fs = std::filesystem;

// A capture small enough that a run of forty iterations takes a second; made once for all tests.
inline const fs::path& capture_folder() {
  static const fs::path folder = [] {
    fs::path path = fs::path(::testing::TempDir()) / ("trainer_capture_" + std::to_string(::getpid()));
    SynthOptions options;
    options.frames = 5;
    options.width = 40;
    options.height = 24;
    options.samples = 2;
    options.points = 300;
    options.test_every = 2;
    write_synthetic_capture(options, path);
    return path;
  }();
  return folder;
}

// A run without reflections on a capture that is made for it, up to where its bodies have been followed.
inline std::unique_ptr<Trainer> followed(SynthOptions capture, int iterations, const fs::path& folder,
                                         const BendOptions& bend = {},
                                         const events::Listener& listener = nullptr) {
  capture.samples = 1;
  write_synthetic_capture(capture, folder);
  TrainOptions options = preset("cpu");
  options.iterations = iterations;
  options.specular = Specular::none;
  options.deform.bend = bend;
  options.initial.max_points = options.density.max_surfels = capture.points;
  auto trainer = std::make_unique<Trainer>(options, load_capture(folder, {}), folder / "run");
  if (listener) trainer->stream().listen(listener);
  const auto keys = static_cast<int>(trainer->scene().main_motion->keys());
  while (trainer->iteration() <= iterations / 8 + (keys - 1) * options.deform.track.map_each) trainer->step();
  return trainer;
}

inline TrainOptions small_run(int iterations) {
  TrainOptions o = preset("demo");
  o.deform.kind = "network";
  o.initial.roughness = 0.05F;
  o.iterations = iterations;
  o.schedule.length = 40;
  o.schedule.deform_from = 4;
  o.schedule.normal_from = 6;
  o.schedule.specular_from = 10;
  o.schedule.joint_from = 16;
  o.schedule.sh_every = 8;
  o.schedule.time_jitter_until = 20;
  o.schedule.all_times_from = 24;
  o.density.from = 4;
  o.density.every = 4;
  o.density.until = 36;
  o.density.gradient_threshold = 1e-6F;
  o.density.max_surfels = 330;
  o.environment_density.from = 12;
  o.environment_density.every = 6;
  o.environment_density.until = 36;
  o.environment_density.gradient_threshold = 1e-8F;
  o.initial.environment_cells = 5;
  o.initial.environment_per_cell = 2;
  o.environment_density.max_surfels = 260;
  o.deform.network.depth = 3;
  o.deform.network.width = 16;
  o.deform.network.skip = 2;
  o.deform.environment_network = o.deform.network;
  o.save_every = 1000;
  return o;
}

inline Trainer make_trainer(const TrainOptions& options, const std::string& name,
                            Device device = Device::cpu) {
  const fs::path run = fs::path(::testing::TempDir()) / (name + "_" + std::to_string(::getpid()));
  fs::remove_all(run);
  return Trainer(options, load_capture(capture_folder(), options.capture), run, device);
}

// The scene's bytes, as a checkpoint has them.
inline std::string scene_bytes(const Scene& scene) {
  Safetensors file;
  put_scene(scene, file);
  const fs::path path = fs::path(::testing::TempDir()) / ("scene_" + std::to_string(::getpid()));
  file.write(path);
  return bytes_of(path);
}

inline const std::atomic<bool> never{false};

}  // namespace traceflow
