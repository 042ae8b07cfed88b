#include "train/continuation.h"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "base/device_memory.h"
#include "base/version.h"
#include "files/options_json.h"
#include "primitives/instructions.h"

namespace traceflow {

namespace {

constexpr const char* views_key = "views_crc32";
constexpr const char* arithmetic_key = "arithmetic";
constexpr const char* version_key = "program_version";
constexpr const char* other_end = ": it ends in other bytes than one that was never stopped";

// Rounded, so that another compiler's rounding of the last bit does not change the checksum.
int64_t rounded(double value) { return std::llround(value * 1e5); }

bool agree(const SceneNormalisation& a, const SceneNormalisation& b) {
  const auto near = [](double x, double y, double length) { return std::fabs(x - y) <= 1e-6 * length; };
  const double length =
      std::max(1 / b.scale, std::max({std::fabs(b.centre.x), std::fabs(b.centre.y), std::fabs(b.centre.z)}));
  return near(a.scale, b.scale, b.scale) && near(a.centre.x, b.centre.x, length) &&
         near(a.centre.y, b.centre.y, length) && near(a.centre.z, b.centre.z, length);
}

struct Difference {
  std::string path, before, now;
};

// The first differing option for which `counts` is true.
std::optional<Difference> first_difference(TrainOptions before, TrainOptions now,
                                           const std::function<bool(const std::string&)>& counts) {
  const std::vector<OptionField> old_fields = option_fields(before), new_fields = option_fields(now);
  for (size_t i = 0; i < old_fields.size(); ++i) {
    const OptionValue was = old_fields[i].get(), is = new_fields[i].get();
    if (was != is && counts(old_fields[i].path))
      return Difference{old_fields[i].path, option_text(was), option_text(is)};
  }
  return std::nullopt;
}

std::string arithmetic_of(Device device) {
  if (device == Device::cpu) return "the CPU with " + instructions_in_use();
  return "CUDA (" + cuda::facts().name + (cuda::deterministic() ? "), deterministic" : ")");
}

// Older checkpoints may lack the entry.
std::optional<std::string> entry(const Safetensors& checkpoint, const std::string& key) {
  const auto found = checkpoint.metadata.find(key);
  return found == checkpoint.metadata.end() ? std::nullopt : std::optional(found->second);
}

}  // namespace

TrainOptions options_in(const Safetensors& checkpoint, const std::string& where) {
  TrainOptions options = preset("paper");
  // Checkpoints from before these options pruned from the first density control on, by extents only.
  options.density.prune_above_from = options.environment_density.prune_above_from = 0;
  options.environment_density.prune_above_cloud = 1000;
  options_from_json(checkpoint.text("options"), option_fields(options), where + ": options");
  return options;
}

void refuse_reshaping(const TrainOptions& before, const TrainOptions& now) {
  const auto shapes = [](const std::string& path) {
    return path.starts_with("initial.") || path.starts_with("deform.") || path == "specular" ||
           path == "seed";
  };
  if (const auto other = first_difference(before, now, shapes)) {
    throw InputError("--resume", other->path, other->now, other->before + ", with which the run was begun",
                     "leave it out, or begin a new run");
  }
}

void refuse_other_preset(const std::string& name, const TrainOptions& of_preset, const TrainOptions& now) {
  if (const auto other = first_difference(now, of_preset, [](const std::string&) { return true; })) {
    throw InputError("--preset", other->path, other->now + " in " + name,
                     other->before + ", which the run that is resumed has",
                     "leave --preset out; --set changes single options");
  }
}

std::string checksum_of_views(const Capture& capture) {
  uLong crc = 0;
  const auto add = [&crc](const void* bytes, size_t size) {
    crc = crc32_z(crc, static_cast<const Bytef*>(bytes), size);
  };
  for (const View& view : capture.train) {
    add(view.id.c_str(), view.id.size() + 1);
    const Mat3<float>& r = view.camera.camera_from_world;
    const Vec3<float>& p = view.camera.position;
    for (const float value :
         {view.time, p.x, p.y, p.z, r[0].x, r[0].y, r[0].z, r[1].x, r[1].y, r[1].z, r[2].x, r[2].y, r[2].z}) {
      const int64_t number = rounded(value);
      add(&number, sizeof number);
    }
  }
  return std::to_string(crc);
}

void put_views(const std::string& checksum, Safetensors& checkpoint) {
  checkpoint.metadata[views_key] = checksum;
}

std::string views_in(const Safetensors& checkpoint) { return entry(checkpoint, views_key).value_or(""); }

bool are_views_of(const std::string& views, const SceneNormalisation& normalisation, const Capture& capture) {
  return agree(capture.normalisation, normalisation) &&
         (views.empty() || views == checksum_of_views(capture));
}

void check_views(const Safetensors& checkpoint, const SceneNormalisation& normalisation,
                 const Capture& capture) {
  if (are_views_of(views_in(checkpoint), normalisation, capture)) return;
  throw InputError("--data", "", capture.folder.string() + ", whose views have other names, times or poses",
                   "the capture that the run was begun with, then in " + checkpoint.text("capture_folder"),
                   "begin a new run for another capture");
}

void put_found_masks(const Capture& capture, Safetensors& checkpoint) {
  checkpoint.metadata["found_masks"] = std::to_string(capture.found_masks);
}

void check_found_masks(const Safetensors& checkpoint, const Capture& capture,
                       const std::filesystem::path& folder) {
  const std::string found = entry(checkpoint, "found_masks").value_or("0");
  const std::string now = std::to_string(capture.found_masks);
  if (found == now) return;
  throw InputError(folder.string(), "", now + " masks", "the " + found + " that the run found",
                   "put them back, or begin again");
}

void put_caps(const SurfelCaps& caps, Safetensors& checkpoint) {
  checkpoint.metadata["cap_main"] = std::to_string(caps.main);
  checkpoint.metadata["cap_environment"] = std::to_string(caps.environment);
}

std::optional<SurfelCaps> caps_to_keep(const Safetensors& checkpoint, const TrainOptions& now) {
  if (!entry(checkpoint, "cap_main")) return std::nullopt;
  const TrainOptions before = options_in(checkpoint);
  if (before.memory_budget != now.memory_budget || before.density.max_surfels != now.density.max_surfels ||
      before.environment_density.max_surfels != now.environment_density.max_surfels) {
    return std::nullopt;
  }
  SurfelCaps caps;
  caps.main = std::llround(checkpoint.number("cap_main"));
  caps.environment = std::llround(checkpoint.number("cap_environment"));
  return caps;
}

void put_arithmetic(Device device, Safetensors& checkpoint) {
  checkpoint.metadata[arithmetic_key] = arithmetic_of(device);
}

std::string other_arithmetic(const Safetensors& checkpoint, Device device) {
  const auto before = entry(checkpoint, arithmetic_key);
  const std::string now = arithmetic_of(device);
  if (!before || *before == now) return "";
  return "the run was computed on " + *before + " and goes on on " + now + other_end;
}

void put_version(Safetensors& checkpoint) { checkpoint.metadata[version_key] = version(); }

std::string other_version(const Safetensors& checkpoint) {
  const auto before = entry(checkpoint, version_key);
  if (!before || *before == version()) return "";
  return "the run was computed by version " + *before + " and goes on by version " + version() + other_end;
}

}  // namespace traceflow
