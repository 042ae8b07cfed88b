#include "prepare/poses.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <sstream>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/parallel.h"
#include "files/json_document.h"
#include "files/png.h"
#include "prepare/masks.h"
#include "prepare/programs.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

constexpr size_t exhaustive_up_to = 80;  // frames

std::string colmap_name(CameraModel model) {
  switch (model) {
    case CameraModel::simple_pinhole:
      return "SIMPLE_PINHOLE";
    case CameraModel::pinhole:
      return "PINHOLE";
    case CameraModel::simple_radial:
      return "SIMPLE_RADIAL";
    case CameraModel::radial:
      return "RADIAL";
    case CameraModel::opencv:
      return "OPENCV";
  }
  return "";
}

bool compares_all(const PrepareOptions& options, const Frames& frames) {
  if (options.matcher == Matcher::automatic) return frames.frames.size() <= exhaustive_up_to;
  return options.matcher == Matcher::exhaustive;
}

// COLMAP's prefix for options of features, from its help: "Feature", or "Sift" before 3.13, which had no
// other kind.
std::string kind_of_features(const PoseFolder& folder, const Work& work) {
  const fs::path log = folder.top / "help.log";
  run_program({"colmap", "feature_extractor", "--help"}, log, work,
              [](const std::string&) { return std::optional<Share>(); });
  const std::string help = read_text(log);
  for (const char* kind : {"Feature", "Sift"}) {
    if (help.find(fmt::format("--{}Extraction.use_gpu", kind)) != std::string::npos) return kind;
  }
  throw InputError("colmap feature_extractor", "help", "no option use_gpu", "COLMAP 3.8 or later",
                   "see " + log.string());
}

// COLMAP reads ID.png.png and takes features where it is not black. Since 3.12 it skips an image without a
// mask.
void write_feature_masks(const Frames& frames, const fs::path& masks, const fs::path& feature_masks) {
  fs::remove_all(feature_masks);
  fs::create_directories(feature_masks);
  for (const Frame& frame : frames.frames) {
    const fs::path mask = masks / (frame.id + ".png");
    Tensor<uint8_t> still({frame.height, frame.width});
    if (fs::exists(mask)) still = as_mask(read_png(mask));
    for (uint8_t& value : still.values()) value = value != 0 ? 0 : 1;
    write_mask(feature_masks / (frame.id + ".png.png"), still);
  }
}

std::string frame_list(const Frames& frames, int camera) {
  std::string list;
  for (const Frame& frame : frames.frames) {
    if (frame.camera == camera) list += frame.id + ".png\n";
  }
  return list;
}

void remove_database(const fs::path& database) {
  for (const char* ending : {"", "-shm", "-wal", "-journal"}) fs::remove(database.string() + ending);
}

ReadShare share_of_all(const Frames& frames) {
  return [count = static_cast<int64_t>(frames.frames.size())](const std::string& said) {
    return share_said(said, count);
  };
}

// Advice on options that have not been tried yet.
std::string advice(const PrepareOptions& options, const Frames& frames) {
  std::string text = "try more frames (--frames, --rate)";
  if (options.masks == "none") text += ", masks of what moves (--masks estimate, or your own)";
  if (options.masks == "estimate") text += ", your own masks or none (--masks)";
  if (!compares_all(options, frames)) text += ", --matcher exhaustive";
  text += options.camera_model == CameraModel::opencv ? ", --camera-model simple-radial"
                                                      : ", --camera-model opencv";
  return text + ", or film again with a camera that moves sideways around the scene";
}

// said: the mapper's last line, if it failed.
[[noreturn]] void refuse_poses(const PrepareOptions& options, const Frames& frames, const PoseFolder& folder,
                               int64_t registered, const std::string& said = "") {
  throw InputError(folder.models().string(), "poses",
                   fmt::format("{} of {} frames registered{}", registered, frames.frames.size(),
                               said.empty() ? "" : fmt::format(" (colmap mapper: {})", said)),
                   fmt::format("at least {} and {:g}% (--least-registered)", fewest_frames,
                               100 * options.least_registered),
                   advice(options, frames));
}

struct Registered {
  fs::path model;
  int64_t frames = 0;
};

Registered largest_model(const fs::path& models) {
  Registered best;
  std::vector<fs::path> folders;
  for (const auto& entry : fs::directory_iterator(models)) {
    if (entry.is_directory()) folders.push_back(entry.path());
  }
  std::ranges::sort(folders);
  for (const fs::path& folder : folders) {
    const auto count = static_cast<int64_t>(read_colmap_model(*FileTree::open(folder), "").images.size());
    if (count > best.frames) best = {folder, count};
  }
  return best;
}

}  // namespace

std::string extract_features(const PrepareOptions& options, const Frames& frames, const fs::path& pictures,
                             const fs::path& masks, const PoseFolder& folder, const Work& work) {
  fs::create_directories(folder.top);
  remove_database(folder.features());
  const bool masked = wants_masks(options);
  const std::string extraction = "--" + kind_of_features(folder, work) + "Extraction.";
  const ReadShare share = share_of_all(frames);
  if (masked) write_feature_masks(frames, masks, folder.masks());
  for (size_t camera = 0; camera < frames.source_frames.size(); ++camera) {
    const fs::path list = folder.top / fmt::format("camera_{}.txt", camera);
    write_atomically(list, frame_list(frames, static_cast<int>(camera)));
    // One call for each camera, since all images of a call share one lens.
    Words words{"colmap",
                "feature_extractor",
                "--database_path",
                folder.features().string(),
                "--image_path",
                pictures.string(),
                "--image_list_path",
                list.string(),
                "--ImageReader.single_camera",
                "1",
                "--ImageReader.camera_model",
                colmap_name(options.camera_model),
                extraction + "use_gpu",
                "0",
                "--SiftExtraction.max_num_features",
                std::to_string(options.features),
                extraction + "num_threads",
                std::to_string(thread_count())};
    if (masked) words.insert(words.end(), {"--ImageReader.mask_path", folder.masks().string()});
    run_program(words, folder.top / fmt::format("features_{}.log", camera), work, share);
  }
  return fmt::format("up to {} of each of {} frames{}", options.features, frames.frames.size(),
                     masked ? ", none where something moves" : "");
}

std::string match_features(const PrepareOptions& options, const Frames& frames, const PoseFolder& folder,
                           const Work& work) {
  remove_database(folder.matches());
  fs::copy_file(folder.features(), folder.matches());
  const bool all = compares_all(options, frames);
  const std::string matching = "--" + kind_of_features(folder, work) + "Matching.";
  Words words{"colmap",
              all ? "exhaustive_matcher" : "sequential_matcher",
              "--database_path",
              folder.matches().string(),
              matching + "use_gpu",
              "0",
              matching + "num_threads",
              std::to_string(thread_count())};
  if (!all) words.insert(words.end(), {"--SequentialMatching.overlap", std::to_string(options.overlap)});
  run_program(words, folder.top / "matches.log", work, share_of_all(frames));
  return all ? "every frame with every other"
             : fmt::format("every frame with the next {} and some farther ones", options.overlap);
}

std::string find_poses(const PrepareOptions& options, const Frames& frames, const fs::path& pictures,
                       const PoseFolder& folder, const Work& work) {
  fs::remove_all(folder.models());
  fs::create_directories(folder.models());
  const fs::path log = folder.top / "mapper.log";
  std::string failure;
  try {
    run_program({"colmap", "mapper", "--database_path", folder.matches().string(), "--image_path",
                 pictures.string(), "--output_path", folder.models().string(), "--Mapper.num_threads",
                 std::to_string(thread_count()), "--Mapper.min_model_size", "3"},
                log, work, share_of_all(frames));
  } catch (const InputError&) {
    // The mapper fails if it registers nothing, with a different message in each version.
    failure = last_line(log);
    if (failure.empty() || !fs::is_empty(folder.models())) throw;
  }
  const Registered best = largest_model(folder.models());
  if (best.frames == 0) refuse_poses(options, frames, folder, 0, failure);
  write_atomically(folder.chosen(), best.model.filename().string());
  const ColmapModel model = read_chosen_model(folder);
  const Lens& lens = model.cameras.front().lens;
  return fmt::format(
      "{} of {} frames registered, {} points, reprojection error {:.2f} px, lens {} with a focal length of "
      "{:.0f} px for {:.0f}×{:.0f}",
      best.frames, frames.frames.size(), model.points.size(), mean_error(model), model.cameras.front().model,
      lens.focal.x, lens.width, lens.height);
}

ColmapModel read_chosen_model(const PoseFolder& folder) {
  return read_colmap_model(*FileTree::open(folder.models() / read_text(folder.chosen())), "");
}

void require_registered(const PrepareOptions& options, const Frames& frames, const PoseFolder& folder) {
  const auto registered = static_cast<int64_t>(read_chosen_model(folder).images.size());
  const double asked = options.least_registered * static_cast<double>(frames.frames.size());
  if (registered < fewest_frames || static_cast<double>(registered) < asked)
    refuse_poses(options, frames, folder, registered);
}

std::optional<Share> share_said(const std::string& said, int64_t frames) {
  std::optional<Share> share;
  std::istringstream lines(said);
  for (std::string line; std::getline(lines, line);) {
    std::array<long long, 4> n{};
    const auto numbers = [&](const char* key, const char* format) {
      const size_t at = line.find(key);
      // NOLINTNEXTLINE(cert-err34-c): numbers that are too large for COLMAP are no matter here
      return at == std::string::npos ? 0 : std::sscanf(line.c_str() + at, format, &n[0], &n[1], &n[2], &n[3]);
    };
    if (numbers("Processed file [", "Processed file [%lld/%lld") == 2 ||
        numbers("Matching image [", "Matching image [%lld/%lld") == 2 ||
        numbers("Processing image [", "Processing image [%lld/%lld") == 2)
      share = {n[0], n[1]};
    else if (numbers("Matching block [", "Matching block [%lld/%lld, %lld/%lld") == 4 ||
             numbers("Processing block [", "Processing block [%lld/%lld, %lld/%lld") == 4)
      share = {(n[0] - 1) * n[3] + n[2], n[1] * n[3]};
    else if (numbers("Registering image #", "Registering image #%lld (%lld)") == 2 ||
             numbers("Registering image #", "Registering image #%lld (num_reg_frames=%lld)") == 2)
      share = {n[1], frames};
  }
  return share;
}

double mean_error(const ColmapModel& model) {
  double sum = 0, count = 0;
  for (const ColmapPoint& point : model.points) {
    sum += point.error * static_cast<double>(point.track_length);
    count += static_cast<double>(point.track_length);
  }
  return count > 0 ? sum / count : 0;
}

}  // namespace traceflow::prepare
