#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/tensor.h"
#include "files/npy.h"
#include "math/camera.h"
#include "prepare/frames.h"

namespace traceflow::prepare {

// Cameras, images and depth maps of a video by MegaSaM: an .npz with
//   cam_c2w    T×4×4: from camera to world, camera axes x right, y down, z forward
//   intrinsic  3×3, in pixels of the images, the first pixel's centre at 0
//   images     T×H×W×3
//   depths     T×H×W: camera z in cam_c2w's unit; unknown where not positive or not finite
// Arrays stay on the disk. All members throw InputError.
class PoseFile {
 public:
  // Checks the shapes and the intrinsics.
  explicit PoseFile(const std::filesystem::path& path);

  const std::filesystem::path& path() const { return cameras_.path(); }
  int64_t count() const { return cameras_.shape()[0]; }
  int64_t width() const { return depths_.shape()[2]; }
  int64_t height() const { return depths_.shape()[1]; }
  // In pixels of `images`, pixel (i, j)'s centre at (i + 0.5, j + 0.5). The rotation is exactly one.
  Camera<double> camera(int64_t i) const;
  Tensor<float> depth(int64_t i) const { return depths_.slice(i); }  // H×W
  Tensor<float> image(int64_t i) const { return images_.slice(i); }  // H×W×3, 0 to 255

  // For each frame the index of its camera: T must be the number of frames, or of the images of the video or
  // folder that they were selected from.
  std::vector<int64_t> match(const Frames& frames) const;
  // Pixels of a frame of this size for each pixel of the images, along x and y. MegaSaM scales its input to
  // an area of 512×384 and cuts the right and bottom edges to multiples of 8. Images of another size are
  // taken to show the whole frame, and must have its proportions.
  Vec2<double> frame_pixels(double frame_width, double frame_height) const;

 private:
  NpyFile cameras_, images_, depths_;
  Camera<double> lens_;  // without its pose
};

// Throws InputError if the file's images cannot be those of the frames: their number, proportions or content
// differ. pictures: the folder of the frames.
void require_fit(const PoseFile& file, const Frames& frames, const std::filesystem::path& pictures);

}  // namespace traceflow::prepare
