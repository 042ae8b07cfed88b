#include "prepare/film.h"

#include <fmt/format.h>

#include <charconv>
#include <fstream>
#include <optional>

#include "base/error.h"
#include "base/process.h"
#include "base/work.h"
#include "prepare/netpbm.h"
#include "prepare/programs.h"

namespace traceflow::prepare {

namespace {

std::string filters(const Film& film) {
  std::string chain;
  if (film.longest_side > 0) {
    const std::string shrink = fmt::format("min(1,{}/max(iw*sar,ih))", film.longest_side);
    chain = fmt::format("scale=w='max(1,round(iw*sar*{0}))':h='max(1,round(ih*{0}))':flags=area,", shrink);
  } else {
    chain = "scale=w='round(iw*sar)':h=ih:flags=area,";
  }
  return chain + "showinfo=checksum=0";
}

// ffmpeg's command line.
std::vector<std::string> words_for(const Film& film) {
  const std::string path = std::filesystem::absolute(film.path).string();
  std::vector<std::string> words{"ffmpeg", "-nostdin", "-hide_banner", "-nostats", "-loglevel", "info"};
  const auto add = [&](const std::vector<std::string>& more) {
    words.insert(words.end(), more.begin(), more.end());
  };
  // An image's name such as "a%d.png" would be taken for a pattern; a video's would not.
  if (film.is_still && path.find('%') != std::string::npos) add({"-f", "image2", "-pattern_type", "none"});
  // "file:" prevents names from being read as options or protocols. V excludes attached images such as
  // covers.
  add({"-i", "file:" + path, "-map", "0:V:0", "-vf", filters(film), "-fps_mode", "passthrough"});
  add({"-f", "image2pipe", "-c:v", film.grey ? "pgm" : "ppm", "-pix_fmt", film.grey ? "gray" : "rgb24", "-"});
  return words;
}

// The integer after `key` in the line; spaces may precede it.
std::optional<int64_t> number_after(const std::string& line, const std::string& key) {
  const size_t at = line.find(key);
  if (at == std::string::npos) return std::nullopt;
  const size_t begin = line.find_first_not_of(' ', at + key.size());
  int64_t number = 0;
  if (begin == std::string::npos ||
      std::from_chars(line.data() + begin, line.data() + line.size(), number).ec != std::errc())
    return std::nullopt;
  return number;
}

// Seconds of the images in showinfo's output, up to the first without a time. They are counted in the video's
// time base: showinfo's seconds have six digits, too few late in a long video.
std::vector<double> read_times(const std::filesystem::path& log) {
  const std::string unit_key = " config in time_base: ";
  std::vector<double> times;
  double unit = 0;
  std::ifstream file(log);
  for (std::string line; std::getline(file, line);) {
    if (line.find("showinfo") == std::string::npos) continue;
    if (const auto numerator = number_after(line, unit_key)) {
      const auto denominator = number_after(line.substr(line.find(unit_key)), "/");
      unit = denominator && *denominator > 0
                 ? static_cast<double>(*numerator) / static_cast<double>(*denominator)
                 : 0;
    } else if (line.find(" pts:") != std::string::npos) {
      const auto stamp = number_after(line, " pts:");
      if (!stamp || !(unit > 0)) break;
      times.push_back(static_cast<double>(*stamp) * unit);
    }
  }
  return times;
}

}  // namespace

std::vector<double> decode_film(const Film& film, const std::filesystem::path& log,
                                const std::atomic<bool>& stop,
                                const std::function<bool(int64_t index, Tensor<uint8_t>&& picture)>& take) {
  const Descriptor told = open_log(log);
  Pipe pipe = make_pipe();
  Process process(words_for(film), {.output = pipe.writing.number(), .error = told.number()});
  pipe.writing.close();
  NetpbmStream pictures(std::move(pipe.reading), film.path.string(), stop);
  int64_t count = 0;
  bool wanted = true;
  while (wanted) {
    if (stop) throw Stopped{};
    std::optional<Tensor<uint8_t>> picture = pictures.next();
    if (!picture) break;
    wanted = take(count++, std::move(*picture));
  }
  if (!wanted) process.end();
  const bool ended_well = !wanted || process.wait(stop);
  if (stop) throw Stopped{};
  if (!ended_well || count == 0) {
    throw InputError(film.path.string(), "", "what ffmpeg cannot read: " + last_line(log),
                     "a film or picture");
  }
  std::vector<double> times = read_times(log);
  if (times.size() < static_cast<size_t>(count)) {
    throw InputError(film.path.string(), "time stamps", std::to_string(times.size()),
                     std::to_string(count) + ", one for each picture", "write the film anew with ffmpeg");
  }
  times.resize(static_cast<size_t>(count));
  return times;
}

Tensor<uint8_t> decode_picture(const Film& film, const std::filesystem::path& log,
                               const std::atomic<bool>& stop) {
  Tensor<uint8_t> first;
  decode_film(film, log, stop, [&](int64_t, Tensor<uint8_t>&& picture) {
    first = std::move(picture);
    return false;
  });
  return first;
}

}  // namespace traceflow::prepare
