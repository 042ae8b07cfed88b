#include "cli/malformed_cases.h"

namespace traceflow::cli {

namespace {

using Json = nlohmann::json;

const std::vector<std::string> inspect = {"inspect", "-d", "capture"};
const std::vector<std::string> render = {"render", "scene.ply", "--cameras", "cameras.json", "-o", "out"};
const std::string dataset = "capture/dataset.json", metadata = "capture/metadata.json",
                  scene = "capture/scene.json", camera = "capture/camera/a.json", cameras = "cameras.json";

}  // namespace

MalformedKind malformed_json() {
  return {
      "A capture's JSON",
      {{"cut short", inspect, cut(dataset, 20), ""},
       {"text that is not UTF-8", inspect, put(scene, "{\"scale\": \"\xff\"}"), ""},
       {"brackets in brackets, a hundred thousand deep", inspect, put(dataset, std::string(100000, '[')), ""},
       {"a number that no double holds", inspect, put(scene, R"({"scale": 1e400})"), ""},
       {"a list in the place of the object", inspect, put(metadata, "[]"), ""},
       {"no views", inspect, put(dataset, "{}"), ""},
       {"ids that are no list", inspect, set(dataset, "/train_ids", "all"), ""},
       {"an id that leads out of the folder", inspect, set(dataset, "/train_ids/0", "../../etc/passwd"), ""},
       {"an id that would clear the terminal", inspect, set(dataset, "/train_ids/0", "a\x1b[2J"), ""},
       {"an id longer than a file's name can be", inspect,
        set(dataset, "/train_ids/0", std::string(300, 'x')), ""},
       {"a time before the first", inspect, set(metadata, "/a/time_id", -1), ""},
       {"a time in words", inspect, set(metadata, "/a/time_id", "noon"), ""},
       {"no scale", inspect, unset(scene, "/scale"), ""},
       {"a scale of zero", inspect, set(scene, "/scale", 0), ""},
       {"a scale that single precision does not hold", inspect, set(scene, "/scale", 1e300), ""},
       {"a place with two coordinates", inspect, set(scene, "/center", {0, 1}), ""},
       {"a far plane before the near one", inspect, set(scene, "/far", 0.05), ""},
       {"a rotation that mirrors", inspect, set(camera, "/orientation/1/1", -1), ""},
       {"a rotation that stretches", inspect, set(camera, "/orientation/0/0", 2), ""},
       {"a camera beyond single precision", inspect, set(camera, "/position/0", 1e30), ""},
       {"a focal length of zero", inspect, set(camera, "/focal_length", 0), ""},
       {"a focal length that single precision does not hold", inspect, set(camera, "/focal_length", 1e300),
        ""},
       {"no principal point", inspect, unset(camera, "/principal_point"), ""},
       {"an image's size of one number", inspect, set(camera, "/image_size", Json::array({24})), ""},
       {"a distortion that folds the image over", inspect, set(camera, "/radial_distortion", {-50, 0, 0}),
        ""}}};
}

MalformedKind malformed_camera_lists() {
  return {"A list of cameras",
          {{"an empty list", render, put(cameras, "[]"), ""},
           {"a picture of a million pixels a side", render, set(cameras, "/0/width", 1000000), ""},
           {"a width of half a pixel", render, set(cameras, "/0/width", 0.5), ""},
           {"a focal length in words", render, set(cameras, "/0/fx", "long"), ""},
           {"a time after the end", render, set(cameras, "/0/time", 1.5), ""},
           {"a name that leads out of the folder", render, set(cameras, "/0/img_name", "../a"), ""},
           {"two cameras of one name", render,
            [](Files& files) {
              Json list = Json::parse(files.at(cameras));
              list.push_back(list[0]);
              files[cameras] = list.dump();
            },
            ""}}};
}

MalformedKind malformed_folders() {
  namespace fs = std::filesystem;
  const auto nothing = [](Files&) {};
  return {"Files and folders",
          {{"no such capture", {"inspect", "-d", "nowhere"}, nothing, ""},
           {"an empty folder",
            {"inspect", "-d", "empty"},
            nothing,
            "",
            [](const fs::path& folder) { fs::create_directory(folder / "empty"); }},
           {"a file that is no archive", {"inspect", "-d", "cameras.json"}, nothing, ""},
           {"a link out of the capture", inspect, remove("capture/points.npy"), "",
            [](const fs::path& folder) {
              fs::create_symlink(folder / "rays.npy", folder / "capture/points.npy");
            }},
           {"a link to itself", inspect, remove(dataset), "",
            [](const fs::path& folder) { fs::create_symlink("dataset.json", folder / dataset); }},
           {"a folder in the place of a file", inspect, remove(dataset), "",
            [](const fs::path& folder) { fs::create_directory(folder / dataset); }},
           {"no images at the size asked for",
            {"inspect", "-d", "capture", "--set", "downscale=3"},
            [](Files& files) {
              for (const char* id : {"a", "b"}) {
                files[std::string("capture/rgb/2x/") + id + ".png"] =
                    files[std::string("capture/rgb/1x/") + id + ".png"];
                files.erase(std::string("capture/rgb/1x/") + id + ".png");
              }
            },
            ""},
           {"no view that is whole", inspect, remove("capture/rgb/1x/a.png"), ""},
           {"no such scene", {"render", "nowhere.ply", "-o", "out"}, nothing, ""},
           {"a run's folder without a checkpoint", {"export", "capture", "-o", "out"}, nothing, ""},
           {"a run in the folder for a new one", {"train", "-d", "capture", "-o", "run"}, nothing, ""}}};
}

}  // namespace traceflow::cli
