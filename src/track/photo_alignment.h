#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "capture/capture.h"
#include "track/body_surface.h"
#include "track/normal_equations.h"

// Direct alignment: how a body has turned from one photograph to another, by its texture. It needs no colours
// of the model, which are blurred while bodies are followed.
namespace traceflow {

// A photograph as alignment compares it.
struct DetailPhoto {
  Camera<float> camera;
  Tensor<float>
      detail;  // H×W×3, the colour less its mean within a few pixels of the mask: what shading leaves
  Tensor<uint8_t> mask;  // H×W
};
// blur: pixels; detail is then what is coarser than that and finer than three times it. The mask leaves out
// what is clipped, unless that is more than a fifth.
DetailPhoto detail_of(FinePhotograph photograph, double blur = 0);

// The part that the mask covers; as it is where it covers nothing.
DetailPhoto cropped(const DetailPhoto& photo);

// A photograph at a place between pixels, and its derivatives along both sides.
struct Looked {
  Vec3<double> value, by_x, by_y;
};
// Bilinear; none outside of the mask or the picture.
std::optional<Looked> look(const DetailPhoto& photo, double x, double y);

// Points of bodies at rest, with the detail that the photograph of one time shows there.
struct DetailSample {
  SurfacePoint rest;
  Vec3<float> detail{0};
};

// Which turns of each body photographs decide: projects its ω onto them; 0 for none.
using LooseTurns = std::vector<Mat3<double>>;

// The samples of a key, body after body, at most 2,000 of each body that has loose turns. surface: as drawn
// at that key.
std::vector<DetailSample> detail_samples(const DetailPhoto& photo, const BodySurface& surface,
                                         const Motion& motion, int64_t key, const LooseTurns& loose);

// What an earlier time says of the photograph of another.
struct Alignment {
  std::shared_ptr<const DetailPhoto> photo;  // of the time whose poses are sought
  std::vector<DetailSample> samples;
  double weight = 1;  // of a sample's cost
};

// The robust cost (Huber) of the alignment with bodies as they stand at a key; samples that do not show count
// as the mean of their body's that do. Adds to `equations`, six numbers a body of which ω (about its pivot)
// is used, unless it is null. Its b is the cost's derivative, negative.
double align(const Alignment& alignment, const Motion& motion, int64_t key, const LooseTurns& loose,
             NormalEquations* equations);

}  // namespace traceflow
