#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "capture/capture.h"
#include "track/body_surface.h"
#include "track/normal_equations.h"

// Direct alignment: the rotation of a body between two photographs, by its texture. It does not use the
// colours of the surfels, which are blurred during tracking.
namespace traceflow {

// A photograph as the alignment compares it.
struct DetailPhoto {
  Camera<float> camera;
  Tensor<float>
      detail;  // H×W×3, the colour minus its mean within a few pixels inside the mask, without shading
  Tensor<uint8_t> mask;  // H×W
};
// blur: in pixels; if it is not 0, the detail is coarser than blur and finer than three times blur. The mask
// leaves out clipped pixels, unless they are more than a fifth of it.
DetailPhoto detail_of(FinePhotograph photograph, double blur = 0);

// The part covered by the mask; the whole image if the mask covers nothing.
DetailPhoto cropped(const DetailPhoto& photo);

// A photograph at a place between pixels, and its derivatives by x and y.
struct PhotoSample {
  Vec3<double> value, by_x, by_y;
};
// Bilinear. Returns nothing outside the mask or the image.
std::optional<PhotoSample> sample_at(const DetailPhoto& photo, double x, double y);

// A point of a body at rest, with the detail of a photograph there.
struct DetailSample {
  SurfacePoint rest;
  Vec3<float> detail{0};
};

// For each body, the projection of ω onto the rotations that photographs determine; 0 if there are none.
using LooseTurns = std::vector<Mat3<double>>;

// The samples of a key, ordered by body, at most 2,000 for each body with loose rotations. surface: rendered
// at that key.
std::vector<DetailSample> detail_samples(const DetailPhoto& photo, const BodySurface& surface,
                                         const Motion& motion, int64_t key, const LooseTurns& loose);

// The comparison of an earlier key with the photograph of another.
struct Alignment {
  std::shared_ptr<const DetailPhoto> photo;  // of the key whose poses are solved
  std::vector<DetailSample> samples;
  double weight = 1;  // of a sample's cost
};

// The robust cost (Huber) of the alignment for the bodies at a key. Hidden samples cost as much as the mean
// of the visible ones of their body. Adds to `equations` unless it is null: six numbers per body, of which
// only ω (about its pivot) is used. b gets the negative derivative of the cost.
double align(const Alignment& alignment, const Motion& motion, int64_t key, const LooseTurns& loose,
             NormalEquations* equations);

}  // namespace traceflow
