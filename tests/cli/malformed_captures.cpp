#include "cli/malformed_cases.h"

namespace traceflow::cli {

namespace {

using Json = nlohmann::json;

const std::vector<std::string> render = {"render", "scene.ply", "--cameras", "cameras.json", "-o", "out"};
const std::string dataset = "capture/dataset.json", metadata = "capture/metadata.json",
                  scene = "capture/scene.json", camera = "capture/camera/a.json",
                  camera_list = "cameras.json";

}  // namespace

MalformedKind malformed_json() {
  return {
      "A capture's JSON",
      {{"cut short", inspect_capture, cut(dataset, 20),
        "capture/dataset.json: byte 21: found text that is not JSON, expected JSON"},
       {"text that is not UTF-8", inspect_capture, put(scene, "{\"scale\": \"\xff\"}"),
        "capture/scene.json: byte 12: found text that is not JSON, expected JSON"},
       {"brackets nested 100,000 deep", inspect_capture, put(dataset, std::string(100000, '[')),
        "capture/dataset.json: found brackets more than 64 deep, expected JSON of common depth"},
       {"a number beyond double precision", inspect_capture, put(scene, R"({"scale": 1e400})"),
        "capture/scene.json: found a number beyond double precision, expected numbers up to 1.8e308"},
       {"a list for an object", inspect_capture, put(metadata, "[]"),
        "capture/metadata.json: found [], expected an object"},
       {"no views", inspect_capture, put(dataset, "{}"),
        "capture/dataset.json: found no ids, expected train_ids and val_ids, or ids"},
       {"no views to train on", inspect_capture, set(dataset, "/train_ids", Json::array()),
        "capture/dataset.json: train_ids: found an empty list, expected the ids of the views to train on; "
        "list them, or take train_ids and val_ids away, and ids is split"},
       {"ids that are not a list", inspect_capture, set(dataset, "/train_ids", "all"),
        "capture/dataset.json: train_ids: found \"all\", expected a list"},
       {"an id that leads out of the folder", inspect_capture,
        set(dataset, "/train_ids/0", "../../etc/passwd"),
        "capture/dataset.json: train_ids: found the id \"../../etc/passwd\", expected ids that can name a "
        "file"},
       {"an id with a terminal escape sequence", inspect_capture, set(dataset, "/train_ids/0", "a\x1b[2J"),
        "capture/dataset.json: train_ids: found the id \"a?[2J\", expected ids that can name a file"},
       {"an id longer than a file name", inspect_capture, set(dataset, "/train_ids/0", std::string(300, 'x')),
        "capture/dataset.json: train_ids: found the id "
        "\"xxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxxx…\", expected ids that can name a "
        "file"},
       {"a negative time", inspect_capture, set(metadata, "/a/time_id", -1),
        "capture/metadata.json: a.time_id: found -1, expected a number of at least zero"},
       {"a string for a time", inspect_capture, set(metadata, "/a/time_id", "noon"),
        "capture/metadata.json: a.time_id: found \"noon\", expected a finite number"},
       {"a missing scale", inspect_capture, unset(scene, "/scale"),
        "capture/scene.json: scale: found nothing, expected a value"},
       {"a scale of zero", inspect_capture, set(scene, "/scale", 0),
        "capture/scene.json: scale: found 0, expected a number above zero"},
       {"a scale beyond single precision", inspect_capture, set(scene, "/scale", 1e300),
        "capture/scene.json: scale: found 1e+300, expected 1e-12 to 1000000000000"},
       {"a position with two coordinates", inspect_capture, set(scene, "/center", {0, 1}),
        "capture/scene.json: center: found [0,1], expected a list of 3"},
       {"a far plane before the near one", inspect_capture, set(scene, "/far", 0.05),
        "capture/scene.json: far: found 0.05, expected more than near (0.1)"},
       {"a rotation that is a reflection", inspect_capture, set(camera, "/orientation/1/1", -1),
        "capture/camera/a.json: orientation: found a mirrored frame, expected a rotation"},
       {"a rotation that is not orthonormal", inspect_capture, set(camera, "/orientation/0/0", 2),
        "capture/camera/a.json: orientation: found rows that are not orthonormal, expected a rotation, three "
        "rows of three numbers"},
       {"a camera beyond single precision", inspect_capture, set(camera, "/position/0", 1e30),
        "capture/camera/a.json: position[0]: found 1e+30, expected -1000000000000000 to 1000000000000000"},
       {"a focal length of zero", inspect_capture, set(camera, "/focal_length", 0),
        "capture/camera/a.json: focal_length: found 0, expected a number above zero"},
       {"a focal length beyond single precision", inspect_capture, set(camera, "/focal_length", 1e300),
        "capture/camera/a.json: focal_length: found 1e+300, expected 1e-06 to 1000000000"},
       {"a missing principal point", inspect_capture, unset(camera, "/principal_point"),
        "capture/camera/a.json: principal_point: found nothing, expected a value"},
       {"an image size of one number", inspect_capture, set(camera, "/image_size", Json::array({24})),
        "capture/camera/a.json: image_size: found [24], expected a list of 2"},
       {"a distortion that folds the image", inspect_capture, set(camera, "/radial_distortion", {-50, 0, 0}),
        "capture/camera/a.json: distortion: found a lens whose straightened image has no pixels, expected "
        "distortion that moves pixels by less than half the image"}}};
}

MalformedKind malformed_camera_lists() {
  return {"A list of cameras",
          {{"an empty list", render, put(camera_list, "[]"),
            "cameras.json: found an empty list, expected at least one camera"},
           {"an image of a million pixels a side", render, set(camera_list, "/0/width", 1000000),
            "cameras.json: [0].width: found 1000000, expected a whole number, 1 to 32768"},
           {"a width of half a pixel", render, set(camera_list, "/0/width", 0.5),
            "cameras.json: [0].width: found 0.5, expected a whole number, 1 to 32768"},
           {"a string for a focal length", render, set(camera_list, "/0/fx", "long"),
            "cameras.json: [0].fx: found \"long\", expected a number"},
           {"a time after the end", render, set(camera_list, "/0/time", 1.5),
            "cameras.json: [0].time: found 1.5, expected 0 to 1"},
           {"a name that leads out of the folder", render, set(camera_list, "/0/img_name", "../a"),
            "cameras.json: [0].img_name: found \"../a\", expected a file name that stays in its folder"},
           {"two cameras with one name", render,
            [](Files& files) {
              Json list = Json::parse(files.at(camera_list));
              list.push_back(list[0]);
              files[camera_list] = list.dump();
            },
            "cameras.json: [1]: found 0 a second time, expected names that differ"}}};
}

MalformedKind malformed_folders() {
  namespace fs = std::filesystem;
  const auto nothing = [](Files&) {};
  return {
      "Files and folders",
      {{"a missing capture",
        {"inspect", "-d", "nowhere"},
        nothing,
        "nowhere: found nothing, expected a folder or a zip archive"},
       {"an empty folder",
        {"inspect", "-d", "empty"},
        nothing,
        "empty: found no capture, expected dataset.json (Nerfies, HyperNeRF, NeRF-DS), splits/train.json "
        "(DyCheck), sparse/0 with cameras and images (COLMAP), transforms.json or transforms_train.json; see "
        "docs/captures.md",
        [](const fs::path& folder) { fs::create_directory(folder / "empty"); }},
       {"a file that is not an archive",
        {"inspect", "-d", "cameras.json"},
        nothing,
        "cameras.json: found a file that is not a zip archive, expected a whole zip archive, stored or "
        "deflated; pack or "
        "save it again"},
       {"a dangling link", inspect_capture, remove("capture/points.npy"),
        "capture/points.npy: found the link points.npy to ../disk/points.npy, which is not there, expected a "
        "readable file; make the link again, or put the files themselves there",
        [](const fs::path& folder) {
          fs::create_symlink("../disk/points.npy", folder / "capture/points.npy");
        }},
       {"a dangling link to the folder of images", inspect_capture,
        [](Files& files) {
          std::erase_if(files, [](const auto& file) { return file.first.starts_with("capture/rgb/"); });
        },
        "capture/rgb/1x/a.png: found the link rgb to ../disk/rgb, which is not there, expected a readable "
        "file; make the link again, or put the files themselves there",
        [](const fs::path& folder) { fs::create_symlink("../disk/rgb", folder / "capture/rgb"); }},
       {"a link to itself", inspect_capture, remove(dataset),
        "capture/dataset.json: found the link dataset.json to dataset.json, which leads back to itself, "
        "expected a readable file; make the link again, or put the files themselves there",
        [](const fs::path& folder) { fs::create_symlink("dataset.json", folder / dataset); }},
       {"a folder for a file", inspect_capture, remove(dataset),
        "capture: dataset.json: found no such file, expected a capture in the NeRF-DS, Nerfies or HyperNeRF "
        "layout; see docs/captures.md",
        [](const fs::path& folder) { fs::create_directory(folder / dataset); }},
       {"no images at the requested size",
        {"inspect", "-d", "capture", "--set", "capture.downscale=3"},
        [](Files& files) {
          for (const char* id : {"a", "b"}) {
            files[std::string("capture/rgb/2x/") + id + ".png"] =
                files[std::string("capture/rgb/1x/") + id + ".png"];
            files.erase(std::string("capture/rgb/1x/") + id + ".png");
          }
        },
        "capture/rgb/1x: found rgb/2x, expected images at full size or at a divisor of the downscale (3); "
        "use a --downscale that the folder has"},
       {"no complete view", inspect_capture, remove("capture/rgb/1x/a.png"),
        "capture: training views: found no complete view, expected an image, a camera and a time each; see "
        "what is missing: 1 of 1 training views have no image (a): left out"},
       {"a missing scene",
        {"render", "nowhere.ply", "-o", "out"},
        nothing,
        "nowhere.ply: found no such file or folder, expected a run's folder, a .ply or an .spz"},
       {"a run's folder without a checkpoint",
        {"export", "capture", "-o", "out"},
        nothing,
        "capture: checkpoint.safetensors: found no such file, expected a folder that traceflow train wrote"},
       {"an existing run in the output folder",
        {"train", "-d", "capture", "-o", "run"},
        nothing,
        "--output: found run, which holds a run, expected a new folder; add --resume to continue it, or "
        "choose another"}}};
}

}  // namespace traceflow::cli
