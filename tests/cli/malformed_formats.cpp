#include "cli/malformed_cases.h"
#include "support/colmap_writer.h"

namespace traceflow::cli {

namespace {

const std::vector<std::string> inspect_colmap = {"inspect", "-d", "colmap"};
const std::vector<std::string> inspect_transforms = {"inspect", "-d", "transforms"};
const std::string cameras = "colmap/sparse/0/cameras", images = "colmap/sparse/0/images",
                  points = "colmap/sparse/0/points3D", transforms = "transforms/transforms.json";

std::string replaced(std::string bytes, size_t at, const std::string& by) {
  return bytes.replace(at, by.size(), by);
}

}  // namespace

MalformedKind malformed_colmap() {
  ColmapFiles model;
  model.cameras = {{1, 1, "PINHOLE", 24, 16, {20, 20, 12, 8}}};
  model.images = {{1, {1, 0, 0, 0}, {0, 0, 1}, 1, "a.png", {-1}}};
  const std::string binary = model.cameras_binary(), seen = model.images_binary();
  const std::string many = replaced(binary, 0, std::string(8, '\x7f'));
  return {
      "COLMAP",
      {{"a camera that no lens is made for", inspect_colmap,
        put(cameras + ".txt", "1 EUCM 24 16 20 20 12 8 1 1\n"), ""},
       {"a camera that COLMAP does not know", inspect_colmap, put(cameras + ".txt", "1 PINHOLE_2 24 16 20\n"),
        ""},
       {"a camera of another kind's parameters", inspect_colmap,
        put(cameras + ".txt", "1 PINHOLE 24 16 20 12 8\n"), ""},
       {"a focal length below zero", inspect_colmap, put(cameras + ".txt", "1 PINHOLE 24 16 20 -20 12 8\n"),
        ""},
       {"a number that is none", inspect_colmap, put(cameras + ".txt", "1 PINHOLE 24 16 nan 20 12 8\n"), ""},
       {"a line that ends early", inspect_colmap, put(images + ".txt", "1 1 0 0 0 0 0\n"), ""},
       {"words for a number", inspect_colmap, put(images + ".txt", "1 1 0 0 none 0 0 1 1 a.png\n"), ""},
       {"a quaternion of no length", inspect_colmap, put(images + ".txt", "1 0 0 0 0 0 0 1 1 a.png\n"), ""},
       {"a camera that is missing", inspect_colmap, put(images + ".txt", "1 1 0 0 0 0 0 1 7 a.png\n"), ""},
       {"an image that comes twice", inspect_colmap,
        put(images + ".txt", "1 1 0 0 0 0 0 1 1 a.png\n\n2 1 0 0 0 0 0 1 1 a.png\n"), ""},
       {"a name that would clear the terminal", inspect_colmap,
        [](Files& files) {
          files["colmap/images/a\x1b[2J.png"] = files["colmap/images/a.png"];
          files[images + ".txt"] = "1 1 0 0 0 0 0 1 1 a\x1b[2J.png\n";
        },
        ""},
       {"no image of the model there", inspect_colmap,
        put(images + ".txt", "1 1 0 0 0 0 0 1 1 ../../passwd\n"), ""},
       {"a point that is nowhere", inspect_colmap, put(points + ".txt", "1 0 inf 2 9 9 9 0.5\n"), ""},
       {"in binary, more cameras than the file has", inspect_colmap, put(cameras + ".bin", many), ""},
       {"in binary, a camera of an unknown number", inspect_colmap,
        put(cameras + ".bin", replaced(binary, 12, "\x63")), ""},
       {"in binary, cut short", inspect_colmap, put(images + ".bin", seen.substr(0, 60)), ""},
       {"in binary, more sightings than the file has", inspect_colmap,
        put(images + ".bin", replaced(seen, seen.size() - 32, std::string(7, '\xff'))), ""},
       {"in binary, bytes left over", inspect_colmap, put(cameras + ".bin", binary + "more"), ""}}};
}

MalformedKind malformed_transforms() {
  const std::string frame = "/frames/0";
  return {
      "transforms.json",
      {{"no frames", inspect_transforms, unset(transforms, "/frames"), ""},
       {"a frame without a file", inspect_transforms, unset(transforms, frame + "/file_path"), ""},
       {"a frame without a pose", inspect_transforms, unset(transforms, frame + "/transform_matrix"), ""},
       {"a pose of two rows", inspect_transforms,
        set(transforms, frame + "/transform_matrix", {{1, 0, 0, 0}, {0, 1, 0, 0}}), ""},
       {"a pose that mirrors", inspect_transforms, set(transforms, frame + "/transform_matrix/0/0", -1), ""},
       {"a pose that shears", inspect_transforms, set(transforms, frame + "/transform_matrix/0/1", 1), ""},
       {"a pose in words", inspect_transforms, set(transforms, frame + "/transform_matrix/0/1", "0"), ""},
       {"a focal length of zero", inspect_transforms, set(transforms, "/fl_x", 0), ""},
       {"no focal length", inspect_transforms, unset(transforms, "/fl_x"), ""},
       {"a field of view of half a turn", inspect_transforms, set(transforms, "/camera_angle_x", 3.2), ""},
       {"a camera that no lens is made for", inspect_transforms,
        set(transforms, "/camera_model", "EQUIRECTANGULAR"), ""},
       {"a time in words", inspect_transforms, set(transforms, frame + "/time", "noon"), ""},
       {"no image where the frames say", inspect_transforms,
        put(transforms, R"({"fl_x":20,"frames":[{"file_path":"/etc/passwd","transform_matrix":)"
                        R"([[1,0,0,0],[0,1,0,0],[0,0,1,1]]}]})"),
        ""}}};
}

}  // namespace traceflow::cli
