#include "capture/formats/nerfies/nerfies_camera.h"

#include <vector>

#include "files/json_document.h"
#include "math/pixel_limits.h"

namespace traceflow {

namespace {

double length_in_pixels(const JsonField& field) {
  field.positive();
  return field.number(smallest_pixels, largest_pixels);
}

std::vector<double> bounded(const JsonField& field, size_t count) {
  std::vector<double> result;
  for (const JsonField& number : field.elements(count))
    result.push_back(number.number(-largest_pixels, largest_pixels));
  return result;
}

}  // namespace

CapturedCamera read_nerfies_camera(const InputFile& input) {
  const JsonFile file(input);
  CapturedCamera camera;
  camera.camera_from_world = file["orientation"].rotation();
  camera.position = file["position"].vector();
  Lens& lens = camera.lens;
  const std::vector<JsonField> size = file["image_size"].elements(2);
  lens.width = length_in_pixels(size[0]);
  lens.height = length_in_pixels(size[1]);
  const double aspect = file.has("pixel_aspect_ratio") ? length_in_pixels(file["pixel_aspect_ratio"]) : 1;
  const double focal = length_in_pixels(file["focal_length"]);
  lens.focal = {focal, focal * aspect};
  const std::vector<double> centre = bounded(file["principal_point"], 2);
  lens.centre = {centre[0], centre[1]};
  if (file.has("skew")) lens.skew = file["skew"].number(-largest_pixels, largest_pixels);
  if (file.has("radial_distortion"))
    lens.radial = load3<double>(bounded(file["radial_distortion"], 3).data());
  const char* tangential = file.has("tangential") ? "tangential" : "tangential_distortion";
  if (file.has(tangential)) {
    const std::vector<double> p = bounded(file[tangential], 2);
    lens.tangential = {p[0], p[1]};
  }
  return camera;
}

}  // namespace traceflow
