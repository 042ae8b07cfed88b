#include "prepare/frames.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/robust.h"
#include "capture/sharpness.h"
#include "files/json_document.h"
#include "files/png.h"
#include "prepare/picture_source.h"

namespace traceflow::prepare {

namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// Times and sharpness of all images.
std::vector<Candidate> look_at(const PictureSource& source, const Work& work) {
  const auto all = static_cast<int64_t>(source.names().size());
  std::vector<Candidate> found;
  const std::vector<double> times = source.take_all(true, [&](int64_t, Tensor<uint8_t>&& picture) {
    found.push_back({0, sharpness(picture), static_cast<int64_t>(found.size())});
    work.tell(static_cast<int64_t>(found.size()), all);
  });
  for (size_t i = 0; i < found.size(); ++i) found[i].time = times[i];
  return found;
}

void check_count(const fs::path& input, size_t found) {
  const auto count = static_cast<int64_t>(found);
  if (count >= fewest_frames && count <= most_frames) return;
  throw InputError(input.string(), "pictures", std::to_string(count),
                   fmt::format("{} to {} between --start and --end", fewest_frames, most_frames),
                   count > most_frames ? "use --frames, or a smaller --rate" : "");
}

// Selects every n-th time of the first camera and the second camera's images at these times.
void add_test_camera(const PrepareOptions& options, std::vector<Candidate> second, double first_time,
                     Frames& frames) {
  std::vector<double> times, gaps;
  for (size_t i = 0; i < frames.frames.size(); ++i) {
    if (i > 0) gaps.push_back(frames.frames[i].time - frames.frames[i - 1].time);
    if (static_cast<int>(i) % options.test_every == options.test_every / 2)
      times.push_back(frames.frames[i].time);
  }
  if (times.empty()) {
    throw InputError(
        "option", "test_every", std::to_string(options.test_every),
        fmt::format("at most {} for {} pictures", 2 * frames.frames.size() - 1, frames.frames.size()));
  }
  for (Candidate& c : second) c.time += options.test_offset - first_time;
  std::erase_if(second, [](const Candidate& c) { return c.time < 0; });
  const std::vector<int64_t> nearest = nearest_frames(second, times, median(std::move(gaps)) / 2);
  for (size_t i = 0; i < times.size(); ++i) {
    if (nearest[i] < 0) continue;
    const Candidate& c = second[static_cast<size_t>(nearest[i])];
    const size_t beside =
        i * static_cast<size_t>(options.test_every) + static_cast<size_t>(options.test_every / 2);
    frames.frames.push_back({fmt::format("{:06}_right", beside), 1, "", c.index, c.time, c.sharpness});
  }
  if (frames.frames.back().camera == 0) {
    throw InputError(options.test_video, "time stamps", "none at the first film's times",
                     "films that run at the same time",
                     "say with --test-offset how much later it was started");
  }
}

void write_pictures(const PictureSource& source, int camera, const fs::path& folder, const Work& work,
                    Frames& frames) {
  std::vector<Frame*> mine;
  std::vector<int64_t> indices;
  for (Frame& frame : frames.frames) {
    if (frame.camera != camera) continue;
    mine.push_back(&frame);
    indices.push_back(frame.index);
  }
  const std::vector<std::string> names = source.names();
  source.take_some(false, indices, [&](int64_t place, Tensor<uint8_t>&& picture) {
    Frame& frame = *mine[static_cast<size_t>(place)];
    frame.width = picture.dim(1);
    frame.height = picture.dim(0);
    if (!names.empty()) frame.source = names[static_cast<size_t>(frame.index)];
    if (frame.width != mine.front()->width || frame.height != mine.front()->height) {
      throw InputError(frame.source, "size", fmt::format("{}×{}", frame.width, frame.height),
                       fmt::format("{}×{} as the first", mine.front()->width, mine.front()->height),
                       "pictures of one camera, none of them turned");
    }
    write_png(folder / (frame.id + ".png"), picture);
    work.tell(place + 1, static_cast<int64_t>(indices.size()));
  });
}

}  // namespace

Frames take_frames(const fs::path& input, const PrepareOptions& options, const fs::path& folder,
                   const fs::path& log, const Work& work) {
  const PictureSource first(input, options.size, log, work.stop());
  if (first.is_folder() && (options.rate > 0 || !options.test_video.empty())) {
    throw InputError(input.string(), "", "pictures without times", "a film for --rate and --test-video",
                     "use --frames");
  }
  std::optional<PictureSource> second;
  if (!options.test_video.empty()) {
    second.emplace(options.test_video, options.size, log, work.stop());
    if (second->is_folder())
      throw InputError(options.test_video, "", "pictures without times", "a film for --test-video");
  }
  const std::vector<Candidate> candidates = look_at(first, work);
  const std::vector<int64_t> chosen = choose_frames(candidates, options);
  check_count(input, chosen.size());
  Frames frames;
  frames.source_frames.push_back(static_cast<int64_t>(candidates.size()));
  const double first_time = candidates[static_cast<size_t>(chosen.front())].time;
  const char* side = second ? "_left" : "";
  for (const int64_t i : chosen) {
    const Candidate& c = candidates[static_cast<size_t>(i)];
    frames.frames.push_back(
        {fmt::format("{:06}{}", frames.frames.size(), side), 0, "", i, c.time - first_time, c.sharpness});
  }
  fs::remove_all(folder);
  fs::create_directories(folder);
  if (second) {
    std::vector<Candidate> others = look_at(*second, work);
    frames.source_frames.push_back(static_cast<int64_t>(others.size()));
    add_test_camera(options, std::move(others), first_time, frames);
    write_pictures(*second, 1, folder, work, frames);
  }
  write_pictures(first, 0, folder, work, frames);
  return frames;
}

void write_frames(const fs::path& file, const Frames& frames) {
  json list = json::array();
  for (const Frame& f : frames.frames) {
    list.push_back({{"id", f.id},
                    {"camera", f.camera},
                    {"source", f.source},
                    {"index", f.index},
                    {"time", f.time},
                    {"sharpness", f.sharpness},
                    {"width", f.width},
                    {"height", f.height}});
  }
  write_atomically(file, json{{"source_frames", frames.source_frames}, {"frames", list}}.dump(1) + "\n");
}

Frames read_frames(const fs::path& path) {
  constexpr int64_t many = int64_t{1} << 40;
  const JsonFile file(path);
  Frames frames;
  for (const JsonField& count : file["source_frames"].elements())
    frames.source_frames.push_back(count.whole(0, many));
  for (const JsonField& f : file["frames"].elements()) {
    frames.frames.push_back({f["id"].text(), static_cast<int>(f["camera"].whole(0, 1)), f["source"].text(),
                             f["index"].whole(0, many), f["time"].number(), f["sharpness"].number(),
                             f["width"].whole(1, 16384), f["height"].whole(1, 16384)});
  }
  return frames;
}

}  // namespace traceflow::prepare
