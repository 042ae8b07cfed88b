#pragma once

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "base/random.h"
#include "capture/capture.h"
#include "files/png.h"
#include "support/temp_folder.h"

namespace traceflow {

// A small capture folder in a family's exact layout, its JSON open to change before save().
struct FakeCapture {
  using Json = nlohmann::json;

  TempFolder folder;
  Json dataset, metadata, scene;
  std::map<std::string, Json> cameras;
  int width = 12, height = 8;

  std::filesystem::path path() const { return folder.path(); }

  // Colour of a pixel of a view's full-size image: different everywhere, and no plain ramp.
  static uint8_t colour(int view, int64_t y, int64_t x, int64_t channel) {
    return static_cast<uint8_t>((37 * view + 13 * y + 7 * x + 71 * channel + x * y) % 256);
  }

  static Json camera(int width, int height) {
    return {{"orientation", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
            {"position", {0, 0, 0}},
            {"focal_length", 10.0},
            {"principal_point", {width / 2.0, height / 2.0}},
            {"skew", 0.0},
            {"pixel_aspect_ratio", 1.0},
            {"radial_distortion", {0.0, 0.0, 0.0}},
            {"tangential_distortion", {0.0, 0.0}},
            {"image_size", {width, height}}};
  }

  void write_text(const std::filesystem::path& name, const std::string& text) const {
    std::filesystem::create_directories((folder / name).parent_path());
    std::ofstream(folder / name, std::ios::binary) << text;
  }
  void write_image(const std::filesystem::path& name, const Tensor<uint8_t>& pixels) const {
    std::filesystem::create_directories((folder / name).parent_path());
    write_png(folder / name, pixels);
  }
  // An array of zeros, of one byte each, which takes no room on the disk.
  void write_zeros(const std::filesystem::path& name, const Shape& shape) const {
    std::string sides;
    for (int r = 0; r < shape.rank(); ++r) sides += std::to_string(shape[r]) + ",";
    const std::string header = "{'descr': '|u1', 'fortran_order': False, 'shape': (" + sides + ")}";
    const std::string start =
        "\x93NUMPY" + std::string{'\1', '\0', static_cast<char>(header.size()), '\0'} + header;
    write_text(name, start);
    std::filesystem::resize_file(folder / name, start.size() + static_cast<std::uintmax_t>(shape.elements()));
  }
  Tensor<uint8_t> image(int view) const {
    Tensor<uint8_t> pixels({height, width, 3});
    for (int64_t y = 0; y < height; ++y)
      for (int64_t x = 0; x < width; ++x)
        for (int64_t c = 0; c < 3; ++c) pixels(y, x, c) = colour(view, y, x, c);
    return pixels;
  }

  // A view with its image at rgb/1x and a camera moved by its number. Old captures have warp_id alone.
  void add_view(const std::string& id, int number, int time, bool has_time_id = true) {
    cameras[id] = camera(width, height);
    cameras[id]["position"] = {0.1 * number, 0.0, -1.0};
    metadata[id] = {{"warp_id", time}, {"appearance_id", time}, {"camera_id", 0}};
    if (has_time_id) metadata[id]["time_id"] = time;
    write_image("rgb/1x/" + id + ".png", image(number));
  }

  void save() const {
    write_text("dataset.json", dataset.dump());
    write_text("metadata.json", metadata.dump());
    write_text("scene.json", scene.dump());
    for (const auto& [id, text] : cameras) write_text("camera/" + id + ".json", text.dump());
  }
};

// NeRF-DS: N_left trains, N_right tests.
struct NerfDsCapture : FakeCapture {
  explicit NerfDsCapture(int times = 4) {
    scene = {{"scale", 0.5}, {"center", {0.0, 0.0, 1.0}}, {"near", 0.1}, {"far", 2.0}};
    std::vector<std::string> train, test, all;
    for (int t = 0; t < times; ++t) {
      const std::string left = "00000" + std::to_string(t) + "_left",
                        right = "00000" + std::to_string(t) + "_right";
      add_view(left, 2 * t, t);
      add_view(right, 2 * t + 1, t);
      train.push_back(left);
      test.push_back(right);
      all.insert(all.end(), {left, right});
    }
    dataset = {{"count", 2 * times},
               {"num_exemplars", times},
               {"ids", all},
               {"train_ids", train},
               {"val_ids", test}};
  }
};

// HyperNeRF's interpolation captures: every frame is in train_ids, val_ids is empty.
struct InterpCapture : FakeCapture {
  explicit InterpCapture(int frames = 9) {
    scene = {{"scale", 1.0}, {"center", {0.0, 0.0, 0.0}}, {"near", 0.1}, {"far", 2.0}};
    std::vector<std::string> ids;
    for (int t = 0; t < frames; ++t) {
      ids.push_back("00000" + std::to_string(t));
      add_view(ids.back(), t, t);
    }
    dataset = {{"count", frames},
               {"num_exemplars", frames},
               {"ids", ids},
               {"train_ids", ids},
               {"val_ids", Json::array()}};
  }
};

// HyperNeRF's validation rig: two cameras take turns, every frame of one against the other.
struct VrigCapture : FakeCapture {
  explicit VrigCapture(int times = 4) {
    scene = {{"scale", 1.0}, {"center", {0.0, 0.0, 0.0}}, {"near", 0.1}, {"far", 2.0}};
    std::vector<std::string> train, test, all;
    for (int t = 0; t < times; ++t) {
      const std::string left = "left1_00000" + std::to_string(t), right = "right1_00000" + std::to_string(t);
      add_view(left, 2 * t, t);
      add_view(right, 2 * t + 1, t);
      train.push_back(t % 2 == 0 ? left : right);
      test.push_back(t % 2 == 0 ? right : left);
      all.insert(all.end(), {left, right});
    }
    dataset = {{"count", 2 * times},
               {"num_exemplars", times},
               {"ids", all},
               {"train_ids", train},
               {"val_ids", test}};
  }
};

// Nerfies: no time_id, the old key of tangential distortion, no masks.
struct NerfiesCapture : FakeCapture {
  explicit NerfiesCapture(int frames = 6) {
    scene = {{"scale", 0.0387}, {"center", {0.1, -0.2, 0.3}}, {"near", 0.0206}, {"far", 0.826}};
    std::vector<std::string> train, test, all;
    for (int t = 0; t < frames; ++t) {
      const std::string id = "00000" + std::to_string(t);
      add_view(id, t, t, false);
      cameras[id]["tangential"] = cameras[id]["tangential_distortion"];
      cameras[id].erase("tangential_distortion");
      (t % 2 == 0 ? train : test).push_back(id);
      all.push_back(id);
    }
    dataset = {
        {"count", frames}, {"num_exemplars", 3}, {"ids", all}, {"train_ids", train}, {"val_ids", test}};
  }
};

// Whether the capture warns of what has this in its text.
inline bool has_warning(const Capture& capture, const std::string& part) {
  return std::any_of(capture.warnings.begin(), capture.warnings.end(),
                     [&](const Finding& found) { return found.text.find(part) != std::string::npos; });
}

}  // namespace traceflow
