#include <fmt/format.h>
#include <pybind11/stl.h>

#include "camera.h"
#include "layers.h"
#include "ops/shade/shade.h"
#include "ops/surface/surface.h"
#include "parts.h"
#include "render/render_options.h"

namespace traceflow::python {

namespace {

struct SavedRaster {
  std::shared_ptr<const PosedSurfels> surfels;
  Camera<float> camera;
  raster::Options options;
  raster::SavedPtr saved = raster::make_saved();
};

std::pair<py::dict, std::unique_ptr<SavedRaster>> raster_forward(const std::shared_ptr<PosedSurfels>& surfels,
                                                                 const Camera<float>& camera,
                                                                 const RenderOptions& options, float extent) {
  auto saved = std::make_unique<SavedRaster>(SavedRaster{surfels, camera, options.raster_options(extent)});
  raster::Output output;
  {
    const py::gil_scoped_release others_run;
    raster::forward(*surfels, camera, saved->options, output, saved->saved.get());
  }
  py::dict layers;
  for_each_raster_layer(
      [&](const char* name, Tensor<float>& layer) {
        if (layer.shape().rank() > 0) layers[name] = array_of(std::move(layer));
      },
      output);
  return {layers, std::move(saved)};
}

py::tuple raster_backward(const SavedRaster& saved, const py::dict& gradients) {
  raster::OutputGradient given;
  take_layer_gradients(gradients, saved.camera, [&](auto&& f) { for_each_raster_layer(f, given); });
  raster::InputGradient gradient;
  {
    const py::gil_scoped_release others_run;
    raster::backward(*saved.surfels, saved.camera, saved.options, *saved.saved, given, gradient);
  }
  return py::make_tuple(std::make_shared<PosedSurfels>(std::move(gradient.surfels)), dict_of(gradient.camera),
                        array_of(std::move(gradient.screen_gradient)));
}

using Image = std::shared_ptr<const Tensor<float>>;

// Indices of pixels, ascending as ops expect them.
std::shared_ptr<const Tensor<int32_t>> pixels_of(const py::object& array, int64_t count) {
  auto pixels = tensor_of_array<int32_t>(array, "pixels", {'P'});
  int64_t least = 0;
  for (const int32_t pixel : pixels->values()) {
    if (pixel < least || pixel >= count) {
      throw InputError("argument", "pixels", fmt::format("{}", pixel),
                       fmt::format("ascending indices from 0 to {}", count - 1));
    }
    least = int64_t{pixel} + 1;
  }
  return pixels;
}
int64_t count_of(const Camera<float>& camera) { return int64_t{camera.width} * camera.height; }

// H×W arrays of a camera.
Image of_pixels(const py::object& array, const char* name, const Camera<float>& camera) {
  return tensor_of_array<float>(array, name, {camera.height, camera.width});
}
Image of_pixels3(const py::object& array, const char* name, const Camera<float>& camera) {
  return tensor_of_array<float>(array, name, {camera.height, camera.width, 3});
}

void add_raster(py::module_& ops) {
  auto module = ops.def_submodule("raster", "Rasterises surfels with exact ray–surfel intersection.");
  py::class_<SavedRaster>(module, "Saved", "What backward needs.");
  module.def("forward", &raster_forward, py::arg("surfels"), py::arg("camera"),
             py::arg_v("options", RenderOptions(), "RenderOptions()"), py::arg("extent") = 1.0F,
             "surfels: PosedSurfels. Returns a dict of float32 layers and what backward needs. H×W×3: "
             "colour, normal (world axes, not normalised). H×W: alpha, tint, depth, median_depth (along the "
             "camera's z, scene units), distortion, and, where the surfels have them, silhouette and "
             "roughness. Lengths in options are relative to `extent`, scene units.");
  module.def("backward", &raster_backward, py::arg("saved"), py::arg("gradients"),
             "gradients: dict of the loss's derivatives by layers, in their shapes; a missing one is zero. "
             "Returns the gradient by the surfels (PosedSurfels), by the camera's pose (dict) and the signal "
             "of density control (M).");
}

void add_surface(py::module_& ops) {
  auto module = ops.def_submodule("surface", "From depths and normals to the surface that reflects.");
  module.def(
      "pseudo_normals",
      [](const Camera<float>& camera, const py::object& depth, const py::object& median_depth,
         const py::object& alpha, float depth_ratio) {
        const Image z = of_pixels(depth, "depth", camera),
                    median = of_pixels(median_depth, "median_depth", camera),
                    opacity = of_pixels(alpha, "alpha", camera);
        Tensor<float> normal;
        surface::pseudo_normals(camera, *z, *median, *opacity, depth_ratio, normal);
        return array_of(std::move(normal));
      },
      py::arg("camera"), py::arg("depth"), py::arg("median_depth"), py::arg("alpha"),
      py::arg("depth_ratio") = 0.0F,
      "Normals of the depth image: H×W×3, world axes, unit or zero. Inputs: H×W; depths in scene units.");
  module.def(
      "pseudo_normals_backward",
      [](const Camera<float>& camera, const py::object& depth, const py::object& median_depth,
         const py::object& alpha, float depth_ratio, const py::object& gradient) {
        const Image z = of_pixels(depth, "depth", camera),
                    median = of_pixels(median_depth, "median_depth", camera),
                    opacity = of_pixels(alpha, "alpha", camera),
                    grad = of_pixels3(gradient, "gradient", camera);
        Tensor<float> grad_depth(z->shape()), grad_median(z->shape());
        CameraGradient<float> grad_camera;
        surface::pseudo_normals_backward(camera, *z, *median, *opacity, depth_ratio, *grad, grad_depth,
                                         grad_median, &grad_camera);
        return py::make_tuple(array_of(std::move(grad_depth)), array_of(std::move(grad_median)),
                              dict_of(grad_camera));
      },
      py::arg("camera"), py::arg("depth"), py::arg("median_depth"), py::arg("alpha"), py::arg("depth_ratio"),
      py::arg("gradient"), "Gradients by depth, median_depth (H×W) and the camera's pose (dict).");
  module.def(
      "select_pixels",
      [](const py::object& alpha, const py::object& tint, const py::object& normal,
         const RenderOptions& options) {
        const auto opacity = tensor_of_array<float>(alpha, "alpha", {'H', 'W'});
        const auto shine = tensor_of_array<float>(tint, "tint", {opacity->dim(0), opacity->dim(1)});
        const auto n = tensor_of_array<float>(normal, "normal", {opacity->dim(0), opacity->dim(1), 3});
        return array_of(surface::select_pixels(*opacity, *shine, *n, options.select, false, 0).pixel);
      },
      py::arg("alpha"), py::arg("tint"), py::arg("normal"),
      py::arg_v("options", RenderOptions(), "RenderOptions()"),
      "The pixels whose reflections are traced: P int32, row-major indices, ascending.");
  module.def(
      "reflection_rays",
      [](const Camera<float>& camera, const py::object& pixels, const py::object& depth,
         const py::object& median_depth, const py::object& normal, float depth_ratio) {
        const auto listed = pixels_of(pixels, count_of(camera));
        const Image z = of_pixels(depth, "depth", camera),
                    median = of_pixels(median_depth, "median_depth", camera),
                    n = of_pixels3(normal, "normal", camera);
        Tensor<float> origins, directions;
        surface::reflection_rays(camera, *listed, *z, *median, *n, depth_ratio, origins, directions);
        return py::make_tuple(array_of(std::move(origins)), array_of(std::move(directions)));
      },
      py::arg("camera"), py::arg("pixels"), py::arg("depth"), py::arg("median_depth"), py::arg("normal"),
      py::arg("depth_ratio") = 0.0F,
      "Reflected rays of the pixels (P int32): origins and unit directions, P×3 each, world.");
  module.def(
      "reflection_rays_backward",
      [](const Camera<float>& camera, const py::object& pixels, const py::object& depth,
         const py::object& median_depth, const py::object& normal, float depth_ratio,
         const py::object& grad_origins, const py::object& grad_directions) {
        const auto listed = pixels_of(pixels, count_of(camera));
        const Image z = of_pixels(depth, "depth", camera),
                    median = of_pixels(median_depth, "median_depth", camera),
                    n = of_pixels3(normal, "normal", camera);
        const Dimensions shape = {listed->size(), 3};
        const auto by_origins = tensor_of_array<float>(grad_origins, "grad_origins", shape),
                   by_directions = tensor_of_array<float>(grad_directions, "grad_directions", shape);
        Tensor<float> grad_depth(z->shape()), grad_median(z->shape()), grad_normal(n->shape());
        CameraGradient<float> grad_camera;
        surface::reflection_rays_backward(camera, *listed, *z, *median, *n, depth_ratio, *by_origins,
                                          *by_directions, grad_depth, grad_median, grad_normal, &grad_camera);
        return py::make_tuple(array_of(std::move(grad_depth)), array_of(std::move(grad_median)),
                              array_of(std::move(grad_normal)), dict_of(grad_camera));
      },
      py::arg("camera"), py::arg("pixels"), py::arg("depth"), py::arg("median_depth"), py::arg("normal"),
      py::arg("depth_ratio"), py::arg("grad_origins"), py::arg("grad_directions"),
      "Gradients by depth, median_depth (H×W), normal (H×W×3) and the camera's pose (dict).");
}

void add_shade(py::module_& ops) {
  auto module = ops.def_submodule(
      "shade", "Blends the diffuse and the specular image: C = (1 − tint) diffuse + tint specular.");
  module.def(
      "forward",
      [](const py::object& diffuse, const py::object& tint, const py::object& pixels,
         const py::object& specular) {
        const auto colours = tensor_of_array<float>(diffuse, "diffuse", {'H', 'W', 3});
        const auto shine = tensor_of_array<float>(tint, "tint", {colours->dim(0), colours->dim(1)});
        const auto listed = pixels_of(pixels, shine->size());
        const auto mirrored = tensor_of_array<float>(specular, "specular", {listed->size(), 3});
        Tensor<float> colour;
        shade::forward(*colours, *shine, *listed, *mirrored, colour);
        return array_of(std::move(colour));
      },
      py::arg("diffuse"), py::arg("tint"), py::arg("pixels"), py::arg("specular"),
      "diffuse: H×W×3; tint: H×W; pixels: P int32, the traced ones, ascending; specular: P×3. Returns "
      "H×W×3.");
  module.def(
      "backward",
      [](const py::object& diffuse, const py::object& tint, const py::object& pixels,
         const py::object& specular, const py::object& gradient) {
        const auto colours = tensor_of_array<float>(diffuse, "diffuse", {'H', 'W', 3});
        const int64_t height = colours->dim(0), width = colours->dim(1);
        const auto shine = tensor_of_array<float>(tint, "tint", {height, width});
        const auto listed = pixels_of(pixels, shine->size());
        const auto mirrored = tensor_of_array<float>(specular, "specular", {listed->size(), 3});
        const auto grad = tensor_of_array<float>(gradient, "gradient", {height, width, 3});
        Tensor<float> weights({listed->size()}), grad_diffuse, grad_tint({height, width}), grad_specular;
        weights.fill(1);
        shade::backward(*colours, *shine, *listed, weights, *mirrored, *grad, grad_diffuse, grad_tint,
                        grad_specular);
        return py::make_tuple(array_of(std::move(grad_diffuse)), array_of(std::move(grad_tint)),
                              array_of(std::move(grad_specular)));
      },
      py::arg("diffuse"), py::arg("tint"), py::arg("pixels"), py::arg("specular"), py::arg("gradient"),
      "gradient: by the blended image, H×W×3. Returns the gradients by diffuse, tint and specular.");
}

}  // namespace

void add_image_ops(py::module_& ops) {
  add_raster(ops);
  add_surface(ops);
  add_shade(ops);
}

}  // namespace traceflow::python
