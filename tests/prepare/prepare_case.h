#pragma once

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <iomanip>
#include <sstream>
#include <string>
#include <vector>

#include "capture/synth/synth.h"
#include "files/eight_bit.h"
#include "prepare/prepare.h"
#include "prepare/steps.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

// The whole of `prepare`, with small scripts in the place of ffmpeg and colmap that give out what was
// recorded.
namespace traceflow::prepare {

namespace fs = std::filesystem;

// For a film F it writes F.ppm or F.pgm, a row of pictures, and says F.times.
inline constexpr const char* fake_ffmpeg = R"sh(#!/bin/sh
kind=ppm
words=$*
while [ $# -gt 0 ]; do
  case "$1" in
    -i) film=${2#file:} ;;
    pgm) kind=pgm ;;
  esac
  shift
done
echo "ffmpeg $kind $words" >> "$CALLS"
[ "$FAIL" != silent ] || sleep 1000
# Beside a picture that lies among others they are hidden.
[ -e "$film.$kind" ] || film="${film%/*}/.${film##*/}"
[ -e "$film.$kind" ] || { echo "$film: Invalid data found when processing input" >&2; exit 1; }
cat "$film.times" >&2
cat "$film.$kind"
)sh";

// Writes what COLMAP would have left where its arguments say; the model is $MODEL. It speaks as version 3.8
// does, or (COLMAP=4.1) as 4.1, and knows no option that they do not know.
inline constexpr const char* fake_colmap = R"sh(#!/bin/sh
if [ "$COLMAP" = 4.1 ]; then
  kind=Feature
  glog="20260717 10:20:30.405060 7 file.cc:80] "
  nothing="E${glog}Failed to create any sparse model"
  say() { echo "$1" >&2; }
else
  kind=Sift
  nothing="ERROR: failed to create sparse model"
  say() { echo "$1"; }
fi
refuse() { echo "${glog:+E$glog}$1" >&2; exit 1; }

verb=$1
words=$*
shift
case $verb in
  feature_extractor)
    flags="--database_path --image_path --image_list_path --ImageReader.single_camera \
      --ImageReader.camera_model --ImageReader.mask_path --SiftExtraction.max_num_features \
      --${kind}Extraction.use_gpu --${kind}Extraction.num_threads" ;;
  exhaustive_matcher) flags="--database_path --${kind}Matching.use_gpu --${kind}Matching.num_threads" ;;
  sequential_matcher)
    flags="--database_path --${kind}Matching.use_gpu --${kind}Matching.num_threads --SequentialMatching.overlap" ;;
  mapper) flags="--database_path --image_path --output_path --Mapper.num_threads --Mapper.min_model_size" ;;
  *) refuse "Command \`$verb\` not recognized." ;;
esac
if [ "$1" = --help ]; then
  [ "$FAIL" != help ] || exit 0
  for flag in $flags; do say "  $flag arg"; done
  exit 0
fi
echo "colmap $words" >> "$CALLS"
while [ $# -gt 0 ]; do
  case " $flags " in
    *" $1 "*) ;;
    *) refuse "Failed to parse options - unrecognised option '$1'." ;;
  esac
  case "$1" in
    --database_path) database=$2 ;;
    --output_path) output=$2 ;;
    --image_list_path) list=$2 ;;
    --ImageReader.mask_path) masks=$2 ;;
  esac
  shift 2
done
case $verb in
  feature_extractor)
    [ "$FAIL" != features ] || refuse "Check failed: no memory"
    # From 3.12 on such a picture gets no features.
    if [ -n "$masks" ] && [ $kind = Feature ]; then
      while read -r name; do
        [ -e "$masks/$name.png" ] || refuse "Mask at $masks/$name.png does not exist."
      done < "$list"
    fi
    echo features > "$database" ;;
  *_matcher) [ "$(cat "$database")" = features ] || exit 1; echo matches > "$database" ;;
  mapper)
    [ "$(cat "$database")" = matches ] || exit 1
    [ "$FAIL" != mapper ] || { say "=> No good initial image pair found."; echo "$nothing" >&2; exit 1; }
    [ "$FAIL" != slow ] || sleep 1000
    mkdir "$output/0"
    [ "$FAIL" != disk ] || { echo "No space left on device" >&2; exit 1; }
    mkdir "$output/1"
    cp "$MODEL"/* "$output/1/"
    cp "$MODEL"/cameras.txt "$output/0/"
    grep -v 000003 "$MODEL"/images.txt > "$output/0/images.txt"
    cp "$MODEL"/points3D.txt "$output/0/" ;;
esac
)sh";

// NOLINTNEXTLINE(concurrency-mt-unsafe): one thread reads and writes the environment
inline void set_variable(const char* name, const std::string& value) { ::setenv(name, value.c_str(), 1); }

class PrepareTest : public testing::Test {
 protected:
  static constexpr int frames = 14;

  // NOLINTNEXTLINE(concurrency-mt-unsafe): one thread reads and writes the environment
  PrepareTest() : path_(std::getenv("PATH")) {
    fs::create_directories(folder_ / "bin");
    fs::create_directories(folder_ / "model");
    write_program("ffmpeg", fake_ffmpeg);
    write_program("colmap", fake_colmap);
    set_variable("PATH", ((folder_ / "bin").string() + ":" + path_));
    set_variable("CALLS", (folder_ / "calls"));
    set_variable("MODEL", (folder_ / "model"));
    set_variable("FAIL", "");
    set_variable("COLMAP", "3.8");
    SynthOptions options;
    options.frames = frames;
    options.width = 64;
    options.height = 40;
    options.samples = 1;
    options.points = 300;
    options.test_every = frames;
    for (const SynthView& view : synth_views(options)) {
      if (!view.is_test) views_.push_back(view);
    }
    write_film(options, film());
    write_model(options);
  }
  ~PrepareTest() override { set_variable("PATH", path_); }

  void write_program(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / "bin" / name) << text;
    fs::permissions(folder_ / "bin" / name, fs::perms::owner_all);
  }

  static void append(const Tensor<uint8_t>& picture, std::ostream& colour, std::ostream& grey) {
    colour << "P6\n64 40\n255\n";
    grey << "P5\n64 40\n255\n";
    colour.write(reinterpret_cast<const char*>(picture.data()), picture.size());
    for (int64_t i = 0; i < picture.size(); i += 3) grey.put(static_cast<char>(picture[i + 1]));
  }

  // A file that the ffmpeg of these tests reads as one picture.
  static void write_still(const std::string& file) {
    std::ofstream(file) << "a picture";
    std::ofstream(file + ".times") << "[Parsed_showinfo_1 @ 0x55] config in time_base: 1/25\n"
                                   << "[Parsed_showinfo_1 @ 0x55] n:   0 pts:   0\n";
  }

  // Every picture twice, the second time sharper; a quarter of a second apart, from one second on.
  void write_film(const SynthOptions& options, const std::string& film) const {
    std::ofstream colour(film + ".ppm", std::ios::binary), grey(film + ".pgm", std::ios::binary),
        times(film + ".times");
    std::ofstream(film) << "a film";
    times << "[Parsed_showinfo_1 @ 0x55] config in time_base: 1/4, frame_rate: 4/1\n";
    for (const SynthView& view : views_) {
      const Tensor<uint8_t> sharp = to_8bit(synth_images(options, view).colour);
      Tensor<uint8_t> blurred = sharp;
      blurred.fill(90);
      const Tensor<uint8_t>& flat = blurred;
      for (const Tensor<uint8_t>* picture : {&flat, &sharp}) {
        append(*picture, colour, grey);
        times << "[Parsed_showinfo_1 @ 0x55] n:   0 pts:      "
              << 4 + 2 * view.frame + (picture == &sharp ? 1 : 0) << " pts_time:0       fmt:rgb24\n";
      }
    }
  }

  void write_model(const SynthOptions& options) const {
    std::ofstream cameras(folder_ / "model/cameras.txt"), images(folder_ / "model/images.txt"),
        points(folder_ / "model/points3D.txt");
    for (std::ofstream* file : {&cameras, &images, &points}) *file << std::setprecision(17);
    const Camera<double>& lens = views_.front().camera;
    cameras << "1 PINHOLE 64 40 " << lens.focal_x << " " << lens.focal_y << " " << lens.centre_x << " "
            << lens.centre_y << "\n";
    for (const SynthView& view : views_) {
      const glm::dquat q = glm::quat_cast(view.camera.camera_from_world);
      const Vec3<double> t = -(view.camera.camera_from_world * view.camera.position);
      std::ostringstream name;
      name << std::setw(6) << std::setfill('0') << view.frame << ".png";
      images << view.frame + 1 << " " << q.w << " " << q.x << " " << q.y << " " << q.z << " " << t.x << " "
             << t.y << " " << t.z << " 1 " << name.str() << "\n\n";
    }
    const Tensor<float> cloud = synth_points(options);
    for (int64_t i = 0; i < cloud.dim(0); ++i) {
      points << i + 1 << " " << cloud(i, 0) << " " << cloud(i, 1) << " " << cloud(i, 2)
             << " 9 9 9 0.5 1 0 2 0 3 0\n";
    }
  }

  std::string film() const { return (folder_ / "film.mp4").string(); }
  fs::path capture() const { return folder_ / "capture"; }

  PrepareOptions options() const {
    PrepareOptions o;
    o.frames = frames;
    o.masks = "none";
    o.test_every = 4;
    return o;
  }

  bool prepare(const PrepareOptions& options) { return prepare(film(), capture(), options); }
  bool prepare(const fs::path& input, const fs::path& capture, const PrepareOptions& options) {
    lines_.clear();
    told_.clear();
    fs::remove(folder_ / "calls");
    return prepare_capture(input, capture, options,
                           {[this](const std::string& line) { lines_.push_back(line); },
                            [this](Step step, int64_t done, int64_t all) {
                              told_.push_back(fmt::format("{} {}/{}", step_name(step), done, all));
                            }},
                           stop_);
  }
  std::string refusal(const PrepareOptions& options) {
    return refusal_of([&] { prepare(options); });
  }
  // A folder of a mask for each frame, white in its left half, for the ffmpeg of these tests to read.
  fs::path write_masks(int width, int height, const std::string& name = "mine") const {
    fs::create_directory(folder_ / name);
    for (int i = 0; i < frames; ++i) {
      const std::string file = fmt::format("{:06}.png", i), hidden = folder_ / name / ("." + file);
      write_still(hidden);
      std::ofstream(folder_ / name / file) << "a picture";
      std::ofstream colour(hidden + ".ppm", std::ios::binary);
      colour << "P6\n" << width << " " << height << "\n255\n";
      for (int k = 0; k < 3 * width * height; ++k) colour.put(k / 3 % width < width / 2 ? '\xff' : '\0');
    }
    return folder_ / name;
  }
  // A folder of two pictures for each view, IMG_8.png and on, of which now the first and now the second is
  // sharp.
  fs::path write_pictures() const {
    fs::path folder = folder_ / "holiday";
    fs::create_directory(folder);
    SynthOptions options;
    options.width = 64;
    options.height = 40;
    options.samples = 1;
    for (const SynthView& view : views_) {
      const Tensor<uint8_t> sharp = to_8bit(synth_images(options, view).colour);
      Tensor<uint8_t> blurred = sharp;
      blurred.fill(90);
      for (const int i : {0, 1}) {
        const std::string name = fmt::format("IMG_{}.png", 8 + 2 * view.frame + i);
        write_still(folder / ("." + name));
        std::ofstream(folder / name) << "a picture";
        std::ofstream colour(folder / ("." + name + ".ppm"), std::ios::binary),
            grey(folder / ("." + name + ".pgm"), std::ios::binary);
        append(i == view.frame % 2 ? sharp : blurred, colour, grey);
      }
    }
    return folder;
  }
  // Which programs were called: "ffmpeg pgm", "colmap mapper".
  std::vector<std::string> calls() const {
    std::vector<std::string> found;
    std::ifstream file(folder_ / "calls");
    for (std::string program, verb, rest; file >> program >> verb;) {
      std::getline(file, rest);
      found.push_back(program + " " + verb);
    }
    return found;
  }

  std::string path_;
  TempFolder folder_;
  std::vector<SynthView> views_;
  std::vector<std::string> lines_, told_;
  std::atomic<bool> stop_ = false;
};

}  // namespace traceflow::prepare
