#include <fmt/format.h>

#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/option_fields.h"
#include "capture/formats/nerfies/nerfies_writer.h"
#include "capture/synth/synth.h"
#include "files/npy.h"
#include "files/png.h"

namespace traceflow {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// The file that marks a folder as a synthetic capture, which may be overwritten.
constexpr const char* marker = "synth.json";
constexpr std::array<const char*, 6> subfolders{"rgb", "camera", "mask", "normal", "truth", "estimates"};

[[noreturn]] void refuse(const fs::path& folder, const std::string& found) {
  throw InputError(folder.string(), "output folder", found, "an empty folder or an earlier synthetic capture",
                   "choose another folder");
}

void claim_folder(const fs::path& folder) {
  if (fs::exists(folder)) {
    if (!fs::is_directory(folder)) refuse(folder, "a file");
    if (!fs::is_empty(folder) && !fs::exists(folder / marker)) refuse(folder, "other files in it");
  }
  fs::remove(folder / "dataset.json");
  for (const char* name : subfolders) fs::remove_all(folder / name);
  for (const char* name : {"rgb/1x", "camera", "mask/1x", "normal/1x", "truth/normal", "truth/depth",
                           "truth/diffuse", "truth/specular", "truth/motion"}) {
    fs::create_directories(folder / name);
  }
}

void prepare_folder(const fs::path& folder) {
  try {
    claim_folder(folder);
  } catch (const fs::filesystem_error& error) {
    refuse(folder, error.code().message());
  }
}

json as_json(const SynthOptions& options) {
  SynthOptions copy = options;
  json values = json::object();
  for (const OptionField& field : option_fields(copy)) {
    std::visit([&](const auto& value) { values[field.path] = value; }, field.get());
  }
  return values;
}

void write_json(const fs::path& path, const json& value) { write_atomically(path, value.dump(1) + "\n"); }

// Unit vectors as 8-bit images: v = (n + 1) / 2.
Tensor<uint8_t> normal_picture(const Tensor<float>& normal) {
  Tensor<float> values = normal;
  for (float& value : values.values()) value = 0.5F * (value + 1);
  return to_8bit(values);
}

Tensor<uint8_t> mask_picture(const Tensor<uint8_t>& mask) {
  Tensor<uint8_t> picture = mask;
  for (uint8_t& value : picture.values()) value = value != 0 ? 255 : 0;
  return picture;
}

// [0, 1] as grey of 16 bits.
Tensor<uint16_t> depth_picture(const Tensor<float>& inverse_depth) {
  constexpr float full = 65535;
  Tensor<uint16_t> picture(inverse_depth.shape());
  for (int64_t i = 0; i < picture.size(); ++i)
    picture[i] = static_cast<uint16_t>(std::lround(full * inverse_depth[i]));
  return picture;
}

void write_truth(const fs::path& folder, const std::string& id, const SynthImages& images) {
  write_png(folder / "truth/normal" / (id + ".png"), normal_picture(images.normal));
  write_npy(folder / "truth/depth" / (id + ".npy"), images.depth);
  write_png(folder / "truth/diffuse" / (id + ".png"), to_8bit(images.diffuse));
  write_png(folder / "truth/specular" / (id + ".png"), to_8bit(images.specular));
}

void write_view(const SynthOptions& options, const SynthView& view, const fs::path& folder) {
  const SynthImages images = synth_images(options, view);
  write_png(folder / "rgb/1x" / (view.id + ".png"), to_8bit(images.colour));
  write_png(folder / "mask/1x" / (view.id + ".png.png"), mask_picture(images.mask));
  if (view.is_test) {
    write_truth(folder, view.id, images);
  } else {
    const Tensor<float> prior = synth_normal_prior(options, view, images.normal);
    write_png(folder / "normal/1x" / (view.id + ".png"), normal_picture(prior));
    if (options.depths) {
      write_png(folder / "estimates/depth" / (view.id + ".png"),
                depth_picture(synth_inverse_depth(options, view, images.depth)));
    }
  }
}

std::vector<NerfiesView> layout_of(const std::vector<SynthView>& views) {
  std::vector<NerfiesView> layout;
  layout.reserve(views.size());
  for (const SynthView& view : views) {
    layout.push_back({view.id, view.camera, view.frame, view.frame, view.is_test ? 1 : 0, view.is_test});
  }
  return layout;
}

}  // namespace

void write_synthetic_capture(const SynthOptions& options, const fs::path& folder) {
  options.validate();
  prepare_folder(folder);
  if (options.depths) fs::create_directories(folder / "estimates/depth");
  write_json(folder / marker, as_json(options));

  const std::vector<SynthView> views = synth_views(options);
  for (const SynthView& view : views) write_view(options, view, folder);
  write_npy(folder / "points.npy", synth_points(options));
  const SynthMotion motion = synth_motion(options);
  write_npy(folder / "truth/motion/points.npy", motion.points);
  write_npy(folder / "truth/motion/object.npy", motion.object);
  write_nerfies_layout(folder, layout_of(views), {synth_normalisation(), synth_near, synth_far});
}

}  // namespace traceflow
