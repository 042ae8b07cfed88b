// Makes a synthetic capture of two mirror balls, trains on it and writes a held-out view as view.png.
//   train_balls FOLDER
#include <atomic>
#include <cstdio>
#include <filesystem>
#include <variant>

#include "capture/capture.h"
#include "capture/pixels.h"
#include "capture/synth/synth.h"
#include "files/png.h"
#include "render/renderer.h"
#include "train/trainer.h"

using namespace traceflow;

int main(int argc, char** argv) {
  const std::filesystem::path folder = argc > 1 ? argv[1] : "balls";
  SynthOptions synth;
  synth.frames = 10;
  synth.width = 120;
  synth.height = 68;
  write_synthetic_capture(synth, folder / "capture");

  TrainOptions options = preset("demo");
  options.iterations = 300;
  const Capture capture = load_capture(folder / "capture", options.capture);
  Trainer trainer(options, capture, folder / "run");
  trainer.stream().listen([](const events::Event& event) {
    const auto* step = std::get_if<events::Step>(&event);
    if (step != nullptr && step->iteration % 50 == 0)
      std::printf("iteration %d, %.1f dB\n", static_cast<int>(step->iteration), step->psnr);
  });
  trainer.run(std::atomic<bool>(false));

  FrameRequest request;
  request.camera = capture.test.front().camera;
  request.time = capture.test.front().time;
  Renderer renderer(options.render);
  write_png(folder / "view.png", to_8bit(renderer.forward(trainer.scene(), request).colour));
}
