#pragma once

#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>

#include "capture/checks/inspection.h"
#include "capture/synth/synth.h"
#include "files/npy.h"
#include "files/png.h"
#include "support/temp_folder.h"

namespace traceflow {

// A healthy synthetic capture in a folder of its own, in which a test breaks one thing.
class BrokenCapture {
 public:
  using Json = nlohmann::json;

  BrokenCapture() {
    std::filesystem::copy(healthy(), folder_.path(), std::filesystem::copy_options::recursive);
  }

  std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }
  static std::string id(int frame) {
    return std::string(frame < 10 ? "00000" : "0000") + std::to_string(frame) + "_left";
  }
  static std::string image(int frame) { return "rgb/1x/" + id(frame) + ".png"; }
  static std::string mask(int frame) { return "mask/1x/" + id(frame) + ".png.png"; }
  static std::string prior(int frame) { return "normal/1x/" + id(frame) + ".png"; }

  void edit_json(const std::string& name, const std::function<void(Json&)>& edit) const {
    Json json = Json::parse(std::ifstream(*this / name));
    edit(json);
    std::ofstream(*this / name) << json.dump();
  }
  void edit_camera(int frame, const std::function<void(Json&)>& edit) const {
    edit_json("camera/" + id(frame) + ".json", edit);
  }
  void edit_image(const std::string& name, const std::function<void(Tensor<uint8_t>&)>& edit) const {
    Tensor<uint8_t> pixels = read_png(*this / name);
    edit(pixels);
    write_png(*this / name, pixels);
  }
  void edit_points(const std::function<void(Tensor<float>&)>& edit) const {
    Tensor<float> points = read_npy(InputFile(*this / "points.npy"));
    edit(points);
    write_npy(*this / "points.npy", points);
  }

  Inspection inspection() const { return inspect(load_capture(folder_.path(), {})); }

 private:
  // Made once: forty pictures of the training camera, ten of the test camera.
  static const std::filesystem::path& healthy() {
    static const TempFolder made;
    static const bool is_made = [] {
      SynthOptions options;
      options.frames = 40;
      options.width = 96;
      options.height = 54;
      options.samples = 4;
      options.points = 1500;
      options.test_every = 4;
      write_synthetic_capture(options, made.path());
      return true;
    }();
    static_cast<void>(is_made);
    return made.path();
  }

  TempFolder folder_;
};

}  // namespace traceflow
