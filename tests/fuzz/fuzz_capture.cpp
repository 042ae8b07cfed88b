// Bytes as files of a capture: the first says of which format, and whether they come in an archive; "@NAME"
// in a line begins the file of that name, of those that are listed below; the others are whole. It is loaded,
// looked at, and its views are decoded.
#include <array>
#include <cmath>
#include <map>

#include "base/parallel.h"
#include "capture/checks/inspection.h"
#include "files/jpeg.h"
#include "files/png.h"
#include "fuzz/scratch_file.h"
#include "support/zip_writer.h"

using namespace traceflow;
using fuzz::promise;

namespace {

constexpr std::array names = {"dataset.json",
                              "metadata.json",
                              "scene.json",
                              "camera/a.json",
                              "camera/b.json",
                              "rgb/1x/a.png",
                              "rgb/1x/b.png",
                              "mask/1x/a.png.png",
                              "normal/1x/a.png",
                              "normal.npy",
                              "normal.npz",
                              "depth/1x/a.npy",
                              "tracks.npy",
                              "points.npy",
                              "truth/normal/b.png",
                              "truth/depth/b.npy",
                              "splits/train.json",
                              "splits/val.json",
                              "images/a.png",
                              "images/b.jpg",
                              "sparse/0/cameras.txt",
                              "sparse/0/images.txt",
                              "sparse/0/points3D.txt",
                              "sparse/0/cameras.bin",
                              "sparse/0/images.bin",
                              "sparse/0/points3D.bin",
                              "transforms.json",
                              "transforms_train.json",
                              "transforms_test.json",
                              "points.ply"};

std::string png(int channels) {
  Tensor<uint8_t> pixels({4, 6, channels});
  for (int64_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(37 * i);
  return png_bytes(pixels);
}

// Whole captures of a view to train on and one to test: in the layout of NeRF-DS, of DyCheck ('d'), COLMAP's
// ('c'), and transforms.json's ('t').
const std::map<std::string, std::string>& whole_capture(char format) {
  static const std::string camera =
      R"({"orientation":[[1,0,0],[0,1,0],[0,0,1]],"position":[0,0,-1],"focal_length":5,"principal_point":[3,2],)"
      R"("image_size":[6,4]})";
  static const std::map<std::string, std::string> files = {
      {"dataset.json", R"({"ids":["a","b"],"train_ids":["a"],"val_ids":["b"]})"},
      {"metadata.json", R"({"a":{"time_id":0},"b":{"time_id":1}})"},
      {"scene.json", R"({"scale":0.5,"center":[0,0,1],"near":0.1,"far":2})"},
      {"camera/a.json", camera},
      {"camera/b.json", camera},
      {"rgb/1x/a.png", png(3)},
      {"rgb/1x/b.png", png(3)}};
  static const auto dycheck = [] {
    std::map<std::string, std::string> result = files;
    result.erase("dataset.json");
    result.erase("metadata.json");
    result["splits/train.json"] = R"({"frame_names":["a"],"camera_ids":[0],"time_ids":[0]})";
    result["splits/val.json"] = R"({"frame_names":["b"],"camera_ids":[1],"time_ids":[1]})";
    return result;
  }();
  static const std::map<std::string, std::string> colmap = {
      {"images/a.png", png(3)},
      {"images/b.jpg", jpeg_bytes(Tensor<uint8_t>({4, 6, 3}), 90)},
      {"sparse/0/cameras.txt", "1 SIMPLE_RADIAL 6 4 5 3 2 0.01\n"},
      {"sparse/0/images.txt", "1 1 0 0 0 0 0 1 1 a.png\n\n2 1 0 0 0 0.1 0 1 1 b.jpg\n\n"},
      {"sparse/0/points3D.txt", "1 0 0 2 9 9 9 0.5 1 0 2 0\n"}};
  static const std::map<std::string, std::string> transforms = {
      {"images/a.png", png(4)},
      {"images/b.jpg", jpeg_bytes(Tensor<uint8_t>({4, 6, 3}), 90)},
      {"transforms.json",
       R"({"fl_x":5,"k1":0.01,"frames":[{"file_path":"images/a.png","time":0,"transform_matrix":)"
       R"([[1,0,0,0],[0,1,0,0],[0,0,1,1],[0,0,0,1]]},{"file_path":"images/b","time":1,"transform_matrix":)"
       R"([[1,0,0,0.1],[0,1,0,0],[0,0,1,1]]}]})"}};
  return format == 'd' ? dycheck : format == 'c' ? colmap : format == 't' ? transforms : files;
}

// What the first byte says: its highest bit that the files come in an archive, and then its fourth that they
// are deflated there.
struct Form {
  explicit Form(char first)
      : packed((first & 0x80) != 0),
        deflated(packed && (first & 0x08) != 0),
        format(packed ? static_cast<char>(first & 0x77) : first) {}

  bool packed, deflated;
  char format;
};

// The files that the bytes name, in the place of those that stand there.
std::map<std::string, std::string> changed_capture(char format, std::string_view bytes) {
  std::map<std::string, std::string> files = whole_capture(format);
  std::string* into = nullptr;
  while (!bytes.empty()) {
    const std::string_view line = bytes.substr(0, bytes.find('\n') + 1);
    const std::string_view text = line.empty() ? bytes : line;
    bytes.remove_prefix(text.size());
    const bool begins = text.size() > 2 && text.front() == '@' && text.back() == '\n';
    const auto* const name =
        std::find(names.begin(), names.end(), begins ? text.substr(1, text.size() - 2) : text);
    if (begins && name != names.end()) {
      into = &files[*name];
      into->clear();
    } else if (into != nullptr) {
      into->append(text);
    }
  }
  return files;
}

class CapturePlace {
 public:
  CapturePlace() {
    for (const char* name : names) std::filesystem::create_directories((folder() / name).parent_path());
    // Loops over views would start threads, which take longer than the views.
    set_threads(1);
  }
  // Puts the files there, and says where they are.
  std::filesystem::path put(const std::map<std::string, std::string>& files, const Form& form) const {
    if (form.packed) return pack(files, form.deflated);
    for (const char* name : names) {
      const auto found = files.find(name);
      if (found != files.end()) {
        place_.write(folder() / name, found->second);
      } else {
        std::filesystem::remove(folder() / name);
      }
    }
    return folder();
  }

 private:
  std::filesystem::path folder() const { return place_.path() / "capture"; }
  std::filesystem::path pack(const std::map<std::string, std::string>& files, bool deflated) const {
    std::vector<std::pair<std::string, std::string>> members;
    members.reserve(files.size());
    for (const auto& [name, bytes] : files) members.emplace_back("capture/" + name, bytes);
    return place_.write("capture.zip", zip_archive(members, deflated));
  }

  fuzz::ScratchFolder place_;
};

void check(const View& view) {
  const Camera<float>& camera = view.camera;
  promise(!view.id.empty() && view.id.size() <= 255 && view.id.find('/') == std::string::npos,
          "an id can name a file");
  promise(view.time >= 0 && view.time <= 1, "a time is in its range");
  promise(camera.width >= 1 && camera.width <= 65536 && camera.height >= 1 && camera.height <= 65536,
          "a size is in its range");
  promise(camera.focal_x > 0 && std::isfinite(camera.focal_x) && camera.focal_y > 0 &&
              std::isfinite(camera.focal_y),
          "a focal length is a length");
  promise(std::isfinite(camera.centre_x) && std::isfinite(camera.centre_y), "a centre is a place");
  promise(std::abs(determinant(camera.camera_from_world) - 1) < 0.1, "a rotation is one");
  promise(std::isfinite(length(camera.position)), "a position is finite");
}

void check(const Capture& capture) {
  promise(!capture.train.empty(), "there is something to train on");
  for (const auto* split : {&capture.train, &capture.test}) {
    for (const View& view : *split) check(view);
  }
  promise(capture.extent > 0 && std::isfinite(capture.extent), "an extent is a length");
  promise(capture.normalisation.scale > 0, "a scale is a factor");
  promise(std::isfinite(capture.near_plane) && std::isfinite(capture.far_plane), "planes are at distances");
  for (const float x : capture.points.values()) promise(std::isfinite(x), "points are finite");
  for (const Finding& warning : capture.warnings) {
    promise(warning.text.size() < 2000, "a warning is short");
    for (const char c : warning.text)
      promise(static_cast<unsigned char>(c) >= 32 && c != 127, "a warning can be shown");
  }
}

void check_pixels(const Capture& capture, const View& view) {
  const int64_t height = view.camera.height, width = view.camera.width;
  const std::shared_ptr<const ViewImages> images = load_images(capture, view);
  promise(images->colour.shape() == Shape{height, width, 3}, "a photograph has its camera's size");
  for (const float v : images->colour.values()) promise(v >= 0 && v <= 1, "a colour is in its range");
  promise(images->known.empty() || images->known.shape() == Shape{height, width},
          "what is known has its camera's size");
  promise(images->mask.empty() || images->mask.shape() == Shape{height, width},
          "a mask has its camera's size");
  promise(images->normal_prior.empty() || images->normal_prior.shape() == Shape{height, width, 3},
          "a prior has its camera's size");
  for (const float v : images->normal_prior.values()) promise(std::isfinite(v), "a prior is finite");
  promise(images->depth_prior.empty() || images->depth_prior.shape() == Shape{height, width},
          "a depth prior has its camera's size");
  for (const float v : images->depth_prior.values())
    promise(std::isfinite(v) && v >= 0, "priors are lengths");
  const ViewTruth truth = load_truth(capture, view);
  for (const float v : truth.normal.values()) promise(std::isfinite(v), "true normals are finite");
  for (const float v : truth.depth.values()) promise(std::isfinite(v) && v >= 0, "true depths are lengths");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  constexpr int64_t most_pixels = int64_t{1} << 16;
  static const CapturePlace place;
  const std::string_view bytes = fuzz::text_of(data, size);
  const Form form(bytes.empty() ? ' ' : bytes.front());
  const std::filesystem::path path = place.put(changed_capture(form.format, bytes), form);
  const std::string where = path.string();
  // What is open stays so while the capture is there.
  fuzz::accepts(where, [&] {
    const Capture capture = load_capture(path, {});
    check(capture);
    int64_t pixels = 0;
    for (const auto* split : {&capture.train, &capture.test}) {
      for (const View& view : *split) pixels += int64_t{view.camera.height} * view.camera.width;
    }
    if (pixels > most_pixels) return;
    for (const auto* split : {&capture.train, &capture.test}) {
      for (const View& view : *split) fuzz::accepts(where, [&] { check_pixels(capture, view); });
    }
    promise(fuzz::accepts(where, [&] { inspect(capture); }), "what loads can be looked at");
  });
  return 0;
}
