#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

#include "fake_capture.h"
#include "files/jpeg.h"
#include "support/colmap_writer.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {

// What a folder holds, as a zip archive beside it.
inline std::filesystem::path zipped(const std::filesystem::path& folder,
                                    const std::filesystem::path& archive) {
  std::vector<std::pair<std::string, std::string>> members;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    members.emplace_back("capture/" + std::filesystem::relative(entry.path(), folder).string(),
                         bytes_of(entry.path()));
  }
  write_bytes(archive, zip_archive(members, true));
  return archive;
}

// Cameras in a row along x that look along z, at a wall of points.
struct ColmapCapture : FakeCapture {
  ColmapFiles model;

  explicit ColmapCapture(int views = 10, const std::string& extension = ".png") {
    model.cameras = {
        {1, 1, "PINHOLE", static_cast<uint64_t>(width), static_cast<uint64_t>(height), {10, 11, 6, 4}}};
    for (int i = 0; i < views; ++i) {
      const std::string name = "frame_" + std::to_string(i) + extension;
      // COLMAP's order is its own.
      model.images.insert(
          model.images.begin(),
          {static_cast<uint32_t>(100 - i), {1, 0, 0, 0}, {-0.1 * i, 0, 0}, 1, name, {1, -1, 2}});
      write_photograph("images/" + name, i);
    }
    for (uint64_t i = 0; i < 50; ++i) {
      const auto x = static_cast<double>(i);
      model.points.push_back({i + 1, {0.04 * x - 0.5, 0.01 * x, 2}, {9, 9, 9}, 0.5, 3});
    }
  }
  void write_photograph(const std::string& name, int view) const {
    if (name.ends_with(".png")) return write_image(name, image(view));
    write_text(name, jpeg_bytes(image(view), 100));
  }
  void save() const { model.save_binary(path() / "sparse/0"); }
};

// Cameras on a ring about the origin that look at it, as OpenGL has them.
struct TransformsCapture : FakeCapture {
  std::map<std::string, Json> files;

  static Json frame(const std::string& file_path, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    // Backward is the direction from the origin; up is the world's z.
    return {{"file_path", file_path},
            {"transform_matrix", {{-s, 0, c, 4 * c}, {c, 0, s, 4 * s}, {0, 1, 0, 0}, {0, 0, 0, 1}}}};
  }
  void save() const {
    for (const auto& [name, json] : files) write_text(name, json.dump());
  }
};

// NeRF-synthetic, and with times D-NeRF.
struct SyntheticCapture : TransformsCapture {
  explicit SyntheticCapture(bool timed = false) {
    for (const std::string split : {"train", "test", "val"}) {
      Json& json = files["transforms_" + split + ".json"];
      json = {{"camera_angle_x", 1.0}, {"frames", Json::array()}};
      for (int i = 0; i < (split == "train" ? 6 : 3); ++i) {
        const std::string name = split + "/r_" + std::to_string(i);
        json["frames"].push_back(frame("./" + name, i + (split == "train" ? 0.0 : 0.5)));
        if (timed) json["frames"].back()["time"] = 0.2 * i;
        Tensor<uint8_t> pixels({height, width, 4});
        const Tensor<uint8_t> rgb = image(i);
        for (int64_t p = 0; p < pixels.size() / 4; ++p) {
          std::copy_n(&rgb[3 * p], 3, &pixels[4 * p]);
          pixels[4 * p + 3] = p % 3 == 0 ? 0 : p % 3 == 1 ? 255 : 100;
        }
        write_image(name + ".png", pixels);
      }
    }
  }
};

// instant-ngp and nerfstudio: one file.
struct NgpCapture : TransformsCapture {
  explicit NgpCapture(int views = 9) {
    Json& json = files["transforms.json"];
    json = {{"fl_x", 10.0}, {"fl_y", 11.0}, {"cx", 6.5},        {"cy", 4.5},
            {"w", width},   {"h", height},  {"aabb_scale", 16}, {"frames", Json::array()}};
    for (int i = views - 1; i >= 0; --i) {
      const std::string name = "images/" + std::to_string(i) + ".jpg";
      json["frames"].push_back(frame(name, i));
      write_text(name, jpeg_bytes(image(i), 100));
    }
  }
  Json& json() { return files["transforms.json"]; }
};

}  // namespace traceflow
