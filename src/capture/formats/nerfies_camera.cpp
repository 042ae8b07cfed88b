#include "capture/formats/nerfies_camera.h"

#include <vector>

#include "files/json_document.h"

namespace traceflow {

CapturedCamera read_nerfies_camera(const InputFile& input) {
  const JsonFile file(input);
  CapturedCamera camera;
  camera.camera_from_world = file["orientation"].rotation();
  camera.position = file["position"].vector();
  Lens& lens = camera.lens;
  const std::vector<JsonField> size = file["image_size"].elements(2);
  lens.width = size[0].positive();
  lens.height = size[1].positive();
  const double aspect = file.has("pixel_aspect_ratio") ? file["pixel_aspect_ratio"].positive() : 1;
  const double focal = file["focal_length"].positive();
  lens.focal = {focal, focal * aspect};
  const std::vector<double> centre = file["principal_point"].numbers(2);
  lens.centre = {centre[0], centre[1]};
  if (file.has("skew")) lens.skew = file["skew"].number();
  if (file.has("radial_distortion")) lens.radial = load3<double>(file["radial_distortion"].numbers(3).data());
  const char* tangential = file.has("tangential") ? "tangential" : "tangential_distortion";
  if (file.has(tangential)) {
    const std::vector<double> p = file[tangential].numbers(2);
    lens.tangential = {p[0], p[1]};
  }
  return camera;
}

}  // namespace traceflow
