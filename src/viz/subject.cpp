#include "viz/subject.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <map>

#include "base/robust.h"
#include "files/options_json.h"
#include "ops/deform/deform.h"
#include "ops/lighting/lighting.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "scene/rows.h"
#include "splat/ply.h"
#include "splat/sog.h"
#include "splat/splat_file.h"
#include "splat/spz.h"

namespace traceflow::viz {

namespace {

// Keys of the comments in a .ply's header.
constexpr const char* extent_note = "extent";
constexpr const char* focal_note = "focal";
constexpr const char* render_note = "render";
constexpr const char* environment_note = "environment";

std::string note(const PlyScene& file, const char* key) {
  const auto found = file.notes.find(key);
  return found == file.notes.end() ? "" : found->second;
}

// The number in a comment; 0 if the comment is missing.
float number_in(const PlyScene& file, const char* key, const std::filesystem::path& path) {
  const std::string text = note(file, key);
  if (text.empty()) return 0;
  float number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc() || end != text.data() + text.size() || !(number > 0) || !std::isfinite(number)) {
    throw InputError(path.string(), fmt::format("comment traceflow {}", key), text, "a positive number");
  }
  return number;
}

// The environment's file in the same folder. The comment must be a plain file name.
std::filesystem::path beside(const std::filesystem::path& path, const std::string& name) {
  const std::filesystem::path file(name);
  if (file.filename() != file || name == "." || name == "..") {
    throw InputError(path.string(), "comment traceflow environment", name, "the name of a file beside it");
  }
  return path.parent_path() / file;
}

bool finite_row(const Tensor<float>& tensor, int64_t row) {
  const float* values = tensor.row(row);
  return std::all_of(values, values + tensor.row_size(), [](float v) { return std::isfinite(v); });
}

// Stored values plus the field's residuals, before activation. Surfels that are not finite are left out, as
// in renders.
Surfels posed(const Surfels& stored, const Field* field, const Nodes* nodes, const Motion* motion,
              const Lighting* lighting, std::optional<float> time, field::Precision precision) {
  Surfels result =
      field != nullptr && time ? deform::displaced(stored, *field, *time, precision) : Surfels(stored);
  if (nodes != nullptr && time) nodes::bend(*nodes, stored.body, *time, result);
  if (motion != nullptr && time) motion::move(*motion, stored.body, *time, result);
  if (lighting != nullptr && time) lighting::light(*lighting, stored.body, *time, result);
  RowEdit finite;
  for (int64_t i = 0; i < result.count(); ++i) {
    bool all = true;
    result.for_each(
        [&](const std::string&, const Tensor<float>& tensor) { all = all && finite_row(tensor, i); });
    if (all) finite.keep(i);
  }
  if (finite.count() < result.count()) edit_rows(result, finite);
  return result;
}

const char* extension_of(SplatFormat format) {
  return format == SplatFormat::spz ? ".spz" : format == SplatFormat::sog ? ".sog" : ".ply";
}

}  // namespace

Subject read_splat_subject(const std::filesystem::path& path, const std::filesystem::path& environment) {
  PlyScene file = read_splat_file(path);
  Subject subject;
  subject.scene.specular = Specular::none;
  subject.scene.extent = number_in(file, extent_note, path);
  subject.scene.focal = number_in(file, focal_note, path);
  if (const std::string text = note(file, render_note); !text.empty()) {
    options_from_json(text, option_fields(subject.render), path.string() + ": comment traceflow render");
    subject.render.validate();
  }
  subject.scene.main = std::move(file.surfels);
  if (file.vertex == PlyVertex::gaussian) {
    subject.warning =
        path.string() + " holds 3D Gaussians: each is drawn as a surfel without its shortest axis";
  }

  std::filesystem::path reflected = environment;
  if (reflected.empty() && !note(file, environment_note).empty()) {
    reflected = beside(path, note(file, environment_note));
    if (!std::filesystem::exists(reflected)) {
      subject.warning = reflected.string() + " is not there: pictures are without reflections";
      reflected.clear();
    }
  }
  if (!reflected.empty()) {
    subject.scene.environment = read_splat_file(reflected).surfels;
    subject.scene.environment.tint_logit = subject.scene.environment.roughness_logit = Tensor<float>();
    subject.scene.specular = Specular::environment_gaussians;
    if (!subject.scene.main.has_tint()) {
      subject.warning = path.string() + " has no tint: pictures are without reflections";
    }
  }
  return subject;
}

float extent_seen_from(const Surfels& surfels, const std::vector<Shot>& shots) {
  Vec3<double> middle(0);
  for (const Shot& shot : shots)
    middle += Vec3<double>(shot.camera.position) / static_cast<double>(shots.size());
  std::vector<float> distances;
  for (int64_t i = 0; i < surfels.count(); ++i) {
    const auto d = static_cast<float>(length(load3<double>(surfels.position.row(i)) - middle));
    if (std::isfinite(d)) distances.push_back(d);
  }
  if (distances.empty()) return 1;
  const float median = ranked(distances, distances.size() / 2);
  return median > 0 ? median : 1;
}

Surfels posed_main(const Subject& subject, std::optional<float> time) {
  const Scene& scene = subject.scene;
  return posed(scene.main, subject.request.deform_main && scene.main_field ? &*scene.main_field : nullptr,
               scene.main_nodes ? &*scene.main_nodes : nullptr,
               scene.main_motion ? &*scene.main_motion : nullptr, scene.lighting ? &*scene.lighting : nullptr,
               time, subject.render.precision);
}

std::vector<std::filesystem::path> write_subject(const Subject& subject, std::optional<float> time,
                                                 Surfels surfels, const std::filesystem::path& folder,
                                                 SplatFormat format, const std::string& name_suffix) {
  const Scene& scene = subject.scene;
  const FrameRequest& request = subject.request;
  std::filesystem::create_directories(folder);
  const std::filesystem::path path = folder / ("main" + name_suffix + extension_of(format));
  PlyScene main{std::move(surfels), {}, PlyVertex::surfel};
  undo_normalisation(scene.normalisation, main.surfels);
  switch (format) {
    case SplatFormat::spz:
      write_spz(path, main.surfels);
      return {path};
    case SplatFormat::sog:
      write_sog(path, main.surfels);
      return {path};
    case SplatFormat::gaussian_ply:
      main.vertex = PlyVertex::gaussian;
      write_ply(path, main);
      return {path};
    case SplatFormat::surfel_ply:
      break;
  }

  std::vector<std::filesystem::path> written = {path};
  std::map<std::string, std::string> notes;
  if (scene.extent > 0)
    notes[extent_note] = fmt::format("{}", static_cast<float>(scene.extent / scene.normalisation.scale));
  if (scene.focal > 0) notes[focal_note] = fmt::format("{}", scene.focal);
  main.notes = notes;
  main.notes[render_note] = options_to_json(subject.render);
  if (request.specular && scene.specular == Specular::environment_gaussians &&
      scene.environment.count() > 0) {
    written.push_back(folder / ("environment" + name_suffix + ".ply"));
    main.notes[environment_note] = written[1].filename().string();
    const Field* field =
        request.deform_environment && scene.environment_field ? &*scene.environment_field : nullptr;
    PlyScene environment{
        posed(scene.environment, field, nullptr, nullptr, nullptr, time, subject.render.precision), notes};
    undo_normalisation(scene.normalisation, environment.surfels);
    write_ply(written[1], environment);
  }
  write_ply(path, main);
  return written;
}

}  // namespace traceflow::viz
