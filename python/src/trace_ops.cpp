#include <fmt/format.h>

#include "ops/environment_map/environment_map.h"
#include "ops/trace/trace.h"
#include "parts.h"
#include "render/render_options.h"
#include "tensor_fields.h"

namespace traceflow::python {

namespace {

struct SavedTrace {
  std::shared_ptr<const PosedSurfels> surfels;
  trace::Rays rays;
  trace::Options options;
  trace::BvhPtr bvh = trace::make_bvh();
  trace::SavedPtr saved = trace::make_saved();
};

std::pair<py::dict, std::unique_ptr<SavedTrace>> trace_forward(const std::shared_ptr<PosedSurfels>& surfels,
                                                               const py::object& origins,
                                                               const py::object& directions,
                                                               const py::object& widths,
                                                               const RenderOptions& options, float extent) {
  auto saved = std::make_unique<SavedTrace>(SavedTrace{surfels, {}, options.trace_options(extent)});
  take(saved->rays.origins, origins, "origins", {'R', 3});
  const int64_t rays = saved->rays.count();
  take(saved->rays.directions, directions, "directions", {rays, 3});
  take(saved->rays.widths, widths, "widths", {rays});
  trace::Output output;
  {
    const py::gil_scoped_release others_run;
    trace::build(*surfels, saved->options, *saved->bvh);
    trace::forward(*surfels, *saved->bvh, saved->rays, saved->options, output, saved->saved.get());
  }
  py::dict result;
  result["colour"] = array_of(std::move(output.colour));
  result["alpha"] = array_of(std::move(output.alpha));
  result["distance"] = array_of(std::move(output.distance));
  return {result, std::move(saved)};
}

py::tuple trace_backward(const SavedTrace& saved, const py::object& colour, const py::object& alpha,
                         const py::object& distance) {
  const int64_t rays = saved.rays.count();
  trace::OutputGradient given;
  take(given.colour, colour, "colour", {rays, 3});
  take(given.alpha, alpha, "alpha", {rays});
  take(given.distance, distance, "distance", {rays});
  trace::InputGradient gradient;
  {
    const py::gil_scoped_release others_run;
    trace::backward(*saved.surfels, saved.rays, saved.options, *saved.saved, given, gradient);
  }
  py::dict by_rays;
  by_rays["origins"] = array_of(std::move(gradient.rays.origins));
  by_rays["directions"] = array_of(std::move(gradient.rays.directions));
  by_rays["widths"] = array_or_none(std::move(gradient.rays.widths));
  return py::make_tuple(std::make_shared<PosedSurfels>(std::move(gradient.surfels)), by_rays,
                        array_of(std::move(gradient.position_gradient)));
}

std::shared_ptr<const Tensor<float>> cube_of(const py::object& logit) {
  auto cube = tensor_of_array<float>(logit, "logit", {'N', 'S', 3});
  if (cube->dim(0) != 6 * cube->dim(1))
    throw InputError("argument", "logit", fmt::format("shape {}×{}×3", cube->dim(0), cube->dim(1)),
                     "shape 6·S×S×3");
  return cube;
}

}  // namespace

void add_trace_ops(py::module_& ops) {
  auto module = ops.def_submodule("trace", "Traces rays through surfels, all hits in the order of distance.");
  py::class_<SavedTrace>(module, "Saved", "What backward needs.");
  module.def("forward", &trace_forward, py::arg("surfels"), py::arg("origins"), py::arg("directions"),
             py::arg("widths") = py::none(), py::arg_v("options", RenderOptions(), "RenderOptions()"),
             py::arg("extent") = 1.0F,
             "surfels: PosedSurfels. origins, directions: R×3, world, any length; widths: R, the spread of "
             "each ray's cone, a tangent. Returns a dict of float32 arrays, colour R×3, alpha R, distance R "
             "(in lengths of the direction), and what backward needs. Lengths in options are relative to "
             "`extent`, scene units.");
  module.def("backward", &trace_backward, py::arg("saved"), py::arg("colour") = py::none(),
             py::arg("alpha") = py::none(), py::arg("distance") = py::none(),
             "The loss's derivatives by the outputs; None is zero. Returns the gradients by the surfels "
             "(PosedSurfels), by the rays (dict) and the signal of density control (M).");
  auto map = ops.def_submodule("environment_map", "Looks colours up in a cube map.");
  map.def(
      "forward",
      [](const py::object& logit, const py::object& directions) {
        Tensor<float> colour;
        environment_map::forward(*cube_of(logit), *tensor_of_array<float>(directions, "directions", {'R', 3}),
                                 colour);
        return array_of(std::move(colour));
      },
      py::arg("logit"), py::arg("directions"), "logit: (6·S)×S×3; directions: R×3, any length. Returns R×3.");
  map.def(
      "backward",
      [](const py::object& logit, const py::object& directions, const py::object& gradient) {
        const auto cube = cube_of(logit);
        const auto rays = tensor_of_array<float>(directions, "directions", {'R', 3});
        const auto grad = tensor_of_array<float>(gradient, "gradient", {rays->dim(0), 3});
        Tensor<float> grad_logit(cube->shape()), grad_directions(rays->shape());
        environment_map::backward(*cube, *rays, *grad, grad_logit, grad_directions);
        return py::make_tuple(array_of(std::move(grad_logit)), array_of(std::move(grad_directions)));
      },
      py::arg("logit"), py::arg("directions"), py::arg("gradient"),
      "gradient: by the colours, R×3. Returns the gradients by logit and directions.");
}

}  // namespace traceflow::python
