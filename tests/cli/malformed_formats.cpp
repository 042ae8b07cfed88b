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
      {{"an unsupported camera model", inspect_colmap, put(cameras + ".txt", "1 EUCM 24 16 20 20 12 8 1 1\n"),
        "colmap/sparse/0/cameras.txt: cameras[0].model: found EUCM, expected a perspective or equidistant "
        "fisheye camera; undistort the images with colmap image_undistorter"},
       {"an unknown camera model", inspect_colmap, put(cameras + ".txt", "1 PINHOLE_2 24 16 20\n"),
        "colmap/sparse/0/cameras.txt: cameras[0].model: found \"PINHOLE_2\", expected a camera model of "
        "COLMAP"},
       {"the parameters of another camera model", inspect_colmap,
        put(cameras + ".txt", "1 PINHOLE 24 16 20 12 8\n"),
        "colmap/sparse/0/cameras.txt: cameras[0].params: found 3 numbers, expected 4 (PINHOLE)"},
       {"a negative focal length", inspect_colmap, put(cameras + ".txt", "1 PINHOLE 24 16 20 -20 12 8\n"),
        "colmap/sparse/0/cameras.txt: cameras[0].params[1]: found -20.000000, expected a focal length above "
        "zero"},
       {"NaN", inspect_colmap, put(cameras + ".txt", "1 PINHOLE 24 16 nan 20 12 8\n"),
        "colmap/sparse/0/cameras.txt: cameras[0].params[0]: found nan, expected a finite number"},
       {"a truncated line", inspect_colmap, put(images + ".txt", "1 1 0 0 0 0 0\n"),
        "colmap/sparse/0/images.txt: line 1, images[0].tvec: found the end of the line, expected a number"},
       {"a string for a number", inspect_colmap, put(images + ".txt", "1 1 0 0 none 0 0 1 1 a.png\n"),
        "colmap/sparse/0/images.txt: line 1, images[0].qvec: found \"none\", expected a number"},
       {"missing lines of 2D points", inspect_colmap,
        put(images + ".txt", "1 1 0 0 0 0 0 1 1 a.png\n2 1 0 0 0 0 0 1 1 b.png\n"),
        "colmap/sparse/0/images.txt: line 2, images[0].points2D: found 10 words, expected x, y and a point's "
        "id of each, in a line that may be empty"},
       {"a zero quaternion", inspect_colmap, put(images + ".txt", "1 0 0 0 0 0 0 1 1 a.png\n"),
        "colmap/sparse/0/images.txt: images[0].qvec: found 0.000000 0.000000 0.000000 0.000000, expected a "
        "rotation's quaternion"},
       {"a camera that is missing", inspect_colmap, put(images + ".txt", "1 1 0 0 0 0 0 1 7 a.png\n"),
        "colmap/sparse/0/images.txt: images[0].camera_id: found 7, expected a camera of "
        "colmap/sparse/0/cameras.txt"},
       {"an image listed twice", inspect_colmap,
        put(images + ".txt", "1 1 0 0 0 0 0 1 1 a.png\n\n2 1 0 0 0 0 0 1 1 a.png\n"),
        "colmap/sparse/0/images.txt: images[1].name: found a.png a second time, expected each image once"},
       {"a name with a terminal escape sequence", inspect_colmap,
        [](Files& files) {
          files["colmap/images/a\x1b[2J.png"] = files["colmap/images/a.png"];
          files[images + ".txt"] = "1 1 0 0 0 0 0 1 1 a\x1b[2J.png\n";
        },
        "colmap/sparse/0/images.txt: image names: found \"a?[2J.png\", expected names that can name a file"},
       {"a model without images", inspect_colmap, put(images + ".txt", "# no image\n"),
        "colmap/sparse/0/images.txt: found no images, expected those that COLMAP registered; run COLMAP's "
        "mapper again, or copy the whole model"},
       {"no image of the model in the folder", inspect_colmap,
        put(images + ".txt", "1 1 0 0 0 0 0 1 1 ../../passwd\n"),
        "colmap: images: found none of the 1 photographs that sparse/0/images.txt names, expected them in "
        "images/; the first is ../../passwd"},
       {"a point at infinity", inspect_colmap, put(points + ".txt", "1 0 inf 2 9 9 9 0.5\n"),
        "colmap/sparse/0/points3D.txt: points3D[0].xyz: found 0.000000 inf 2.000000, expected finite "
        "numbers"},
       {"binary: more cameras than the file holds", inspect_colmap, put(cameras + ".bin", many),
        "colmap/sparse/0/cameras.bin: the number of cameras: found 9187201950435737471 in the 56 bytes that "
        "follow, expected as many as the file holds"},
       {"binary: an unknown camera model", inspect_colmap,
        put(cameras + ".bin", replaced(binary, 12, "\x63")),
        "colmap/sparse/0/cameras.bin: cameras[0].model: found 99, expected 0 to 17"},
       {"binary: cut short", inspect_colmap, put(images + ".bin", seen.substr(0, 60)),
        "colmap/sparse/0/images.bin: the number of images: found 1 in the 52 bytes that follow, expected as "
        "many as the file holds"},
       {"binary: more 2D points than the file holds", inspect_colmap,
        put(images + ".bin", replaced(seen, seen.size() - 32, std::string(7, '\xff'))),
        "colmap/sparse/0/images.bin: images[0].points2D: found 72057594037927935 in the 24 bytes that "
        "follow, expected as many as the file holds"},
       {"binary: bytes after the end", inspect_colmap, put(cameras + ".bin", binary + "more"),
        "colmap/sparse/0/cameras.bin: found 4 bytes after the last row, expected the end of the file"}}};
}

MalformedKind malformed_transforms() {
  const std::string frame = "/frames/0";
  return {
      "transforms.json",
      {{"no frames", inspect_transforms, unset(transforms, "/frames"),
        "transforms/transforms.json: frames: found nothing, expected a value"},
       {"an empty list of frames", inspect_transforms, set(transforms, "/frames", nlohmann::json::array()),
        "transforms/transforms.json: frames: found an empty list, expected the frames to train on; list "
        "them"},
       {"no frame to train on", inspect_transforms,
        [](Files& files) {
          set(transforms, "/train_filenames", nlohmann::json::array())(files);
          set(transforms, "/test_filenames", nlohmann::json::array({"a.png"}))(files);
        },
        "transforms/transforms.json: train_filenames: found an empty list, expected the file_path of the "
        "frames to train on; list them, or take train_filenames, test_filenames and val_filenames away"},
       {"a frame without a file", inspect_transforms, unset(transforms, frame + "/file_path"),
        "transforms/transforms.json: frames[0].file_path: found nothing, expected a value"},
       {"a frame without a pose", inspect_transforms, unset(transforms, frame + "/transform_matrix"),
        "transforms/transforms.json: frames[0].transform_matrix: found nothing, expected a value"},
       {"a pose of two rows", inspect_transforms,
        set(transforms, frame + "/transform_matrix", {{1, 0, 0, 0}, {0, 1, 0, 0}}),
        "transforms/transforms.json: frames[0].transform_matrix: found [[1,0,0,0],[0,1,0,0]], expected three "
        "or four rows of four numbers"},
       {"a pose with a reflection", inspect_transforms, set(transforms, frame + "/transform_matrix/0/0", -1),
        "transforms/transforms.json: frames[0].transform_matrix: found a mirrored frame, expected a "
        "rotation"},
       {"a pose with shear", inspect_transforms, set(transforms, frame + "/transform_matrix/0/1", 1),
        "transforms/transforms.json: frames[0].transform_matrix: found axes that are not orthonormal, "
        "expected a rotation"},
       {"a string for a pose", inspect_transforms, set(transforms, frame + "/transform_matrix/0/1", "0"),
        "transforms/transforms.json: frames[0].transform_matrix[0][1]: found \"0\", expected a number"},
       {"a focal length of zero", inspect_transforms, set(transforms, "/fl_x", 0),
        "transforms/transforms.json: fl_x: found 0, expected a number above zero"},
       {"a missing focal length", inspect_transforms, unset(transforms, "/fl_x"),
        "transforms/transforms.json: frames[0]: found no focal length, expected fl_x, camera_angle_x or K"},
       {"a field of view above 180°", inspect_transforms, set(transforms, "/camera_angle_x", 3.2),
        "transforms/transforms.json: camera_angle_x: found 3.2, expected an angle below π"},
       {"an unsupported camera model", inspect_transforms,
        set(transforms, "/camera_model", "EQUIRECTANGULAR"),
        "transforms/transforms.json: camera_model: found EQUIRECTANGULAR, expected OPENCV, OPENCV_FISHEYE, "
        "PINHOLE or a simpler model of these; undistort the images with the program that made them"},
       {"a string for a time", inspect_transforms, set(transforms, frame + "/time", "noon"),
        "transforms/transforms.json: frames[0].time: found \"noon\", expected a number"},
       {"a missing image", inspect_transforms,
        put(transforms, R"({"fl_x":20,"frames":[{"file_path":"/etc/passwd","transform_matrix":)"
                        R"([[1,0,0,0],[0,1,0,0],[0,0,1,1]]}]})"),
        "transforms/transforms.json: frames: found none of 1 images, expected files at their file_path, with "
        "or without .png or .jpg; the first is passwd"}}};
}

}  // namespace traceflow::cli
