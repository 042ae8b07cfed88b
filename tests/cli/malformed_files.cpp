#include "cli/malformed_cases.h"
#include "cli/program.h"
#include "files/npy.h"
#include "files/png.h"
#include "splat/ply.h"
#include "splat/spz.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"

namespace traceflow::cli {

namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

std::string picture_bytes() {
  Tensor<uint8_t> pixels({16, 24, 3});
  for (int64_t i = 0; i < pixels.size(); ++i) pixels[i] = static_cast<uint8_t>(37 * i);
  return png_bytes(pixels);
}

Files capture() {
  Json camera{{"orientation", {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}},
              {"position", {0, 0, -1}},
              {"focal_length", 20},
              {"principal_point", {12, 8}},
              {"image_size", {24, 16}}};
  Files files{{"capture/dataset.json", R"({"ids":["a","b"],"train_ids":["a"],"val_ids":["b"]})"},
              {"capture/metadata.json", R"({"a":{"time_id":0},"b":{"time_id":1}})"},
              {"capture/scene.json", R"({"scale":0.5,"center":[0,0,1],"near":0.1,"far":2})"},
              {"capture/rgb/1x/a.png", picture_bytes()},
              {"capture/rgb/1x/b.png", picture_bytes()},
              {"capture/normal/1x/a.png", picture_bytes()}};
  files["capture/camera/a.json"] = camera.dump();
  camera["position"] = {0.1, 0, -1};
  files["capture/camera/b.json"] = camera.dump();
  for (const char* format : {"colmap", "transforms"}) {
    for (const char* id : {"a", "b"}) files[std::string(format) + "/images/" + id + ".png"] = picture_bytes();
  }
  files["colmap/sparse/0/cameras.txt"] = "1 PINHOLE 24 16 20 20 12 8\n";
  files["colmap/sparse/0/images.txt"] = "1 1 0 0 0 0 0 1 1 a.png\n\n2 1 0 0 0 0.1 0 1 1 b.png\n\n";
  files["colmap/sparse/0/points3D.txt"] = "1 0 0 2 9 9 9 0.5 1 0 2 0\n";
  const Json pose = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 1}, {0, 0, 0, 1}};
  Json transforms{{"fl_x", 20}, {"frames", Json::array()}};
  for (const char* id : {"a", "b"})
    transforms["frames"].push_back({{"file_path", std::string("images/") + id}, {"transform_matrix", pose}});
  files["transforms/transforms.json"] = transforms.dump();
  return files;
}

void add_written(const fs::path& folder, Files& files) {
  Surfels surfels{Tensor<float>({1, 3}), Tensor<float>({1, 2}),    Tensor<float>({1, 4}),
                  Tensor<float>({1}),    Tensor<float>({1, 1, 3}), Tensor<float>()};
  surfels.rotation(0, 0) = 1;
  write_ply(folder / "scene.ply", {surfels, {}});
  write_spz(folder / "scene.spz", surfels);
  write_npy(folder / "rays.npy", Tensor<float>({1, 6}));
  write_npy(folder / "capture/points.npy", Tensor<float>({2, 3}));
  for (const char* name : {"scene.ply", "scene.spz", "rays.npy", "capture/points.npy"})
    files[name] = bytes_of(folder / name);
}

// By training for one iteration.
void add_run(const fs::path& folder, Files& files) {
  const std::string data = folder / "capture", run = folder / "run";
  const char* command[] = {"traceflow", "train",    "-d",   data.c_str(), "-o", run.c_str(),
                           "-q",        "--preset", "demo", "-i",         "1"};
  cli::run(static_cast<int>(std::size(command)), command);
  files["run/checkpoint.safetensors"] = bytes_of(folder / "run/checkpoint.safetensors");
}

}  // namespace

const Files& good_files() {
  static const Files files = [] {
    const TempFolder folder;
    Files made = capture();
    for (const auto& [name, bytes] : made) {
      fs::create_directories((folder / name).parent_path());
      write_bytes(folder / name, bytes);
    }
    add_written(folder.path(), made);
    add_run(folder.path(), made);
    made["cameras.json"] =
        R"([{"id":0,"width":4,"height":2,"position":[0,0,1],"rotation":[[1,0,0],[0,1,0],[0,0,1]],"fx":3,"fy":3}])";
    return made;
  }();
  return files;
}

std::function<void(Files&)> put(const std::string& file, const std::string& bytes) {
  return [=](Files& files) { files[file] = bytes; };
}
std::function<void(Files&)> cut(const std::string& file, size_t bytes) {
  return [=](Files& files) { files.at(file).resize(bytes); };
}
std::function<void(Files&)> replace(const std::string& file, const std::string& from, const std::string& to) {
  return [=](Files& files) {
    std::string& bytes = files.at(file);
    bytes.replace(bytes.find(from), from.size(), to);
  };
}
std::function<void(Files&)> remove(const std::string& file) {
  return [=](Files& files) { files.erase(file); };
}
std::function<void(Files&)> set(const std::string& file, const std::string& pointer, const Json& value) {
  return [=](Files& files) {
    Json json = Json::parse(files.at(file));
    json[Json::json_pointer(pointer)] = value;
    files[file] = json.dump();
  };
}
std::function<void(Files&)> unset(const std::string& file, const std::string& pointer) {
  return [=](Files& files) {
    Json json = Json::parse(files.at(file));
    const Json::json_pointer at(pointer);
    json[at.parent_pointer()].erase(at.back());
    files[file] = json.dump();
  };
}

}  // namespace traceflow::cli
