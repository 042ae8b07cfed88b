#include <pybind11/stl.h>

#include "capture.h"
#include "eval/metrics.h"
#include "eval/report.h"
#include "ops/loss/loss.h"
#include "parts.h"
#include "scene.h"

namespace traceflow::python {

namespace {

using Pixels = std::shared_ptr<const Tensor<float>>;
using Mask = std::shared_ptr<const Tensor<uint8_t>>;

Pixels colours_of(const py::object& array, const char* name) {
  return tensor_of_array<float>(array, name, {'H', 'W', 3});
}
Pixels like(const Tensor<float>& other, const py::object& array, const char* name) {
  return tensor_of_array<float>(array, name, {other.dim(0), other.dim(1), 3});
}
Mask mask_like(const Tensor<float>& image, const py::object& array) {
  return tensor_or_none<uint8_t>(array, "mask", {image.dim(0), image.dim(1)});
}

std::optional<double> psnr_of(const py::object& image, const py::object& target, const py::object& mask) {
  const Pixels a = colours_of(image, "image");
  return eval::psnr(*a, *like(*a, target, "target"), *mask_like(*a, mask));
}

double ssim_of(const py::object& image, const py::object& target, const py::object& mask) {
  const Pixels a = colours_of(image, "image");
  return loss::ssim(*a, *like(*a, target, "target"), *mask_like(*a, mask));
}

std::optional<double> normal_error(const py::object& normal, const py::object& truth,
                                   const py::object& mask) {
  const Pixels a = colours_of(normal, "normal");
  return eval::normal_mae_deg(*a, *like(*a, truth, "truth"), *mask_like(*a, mask));
}

py::array depth_errors_of(const py::object& depth, const py::object& truth, const py::object& alpha,
                          double z_per_truth) {
  const auto z = tensor_of_array<float>(depth, "depth", {'H', 'W'});
  const Dimensions shape = {z->dim(0), z->dim(1)};
  return array_of(eval::depth_errors(*z, *tensor_or_none<float>(alpha, "alpha", shape),
                                     *tensor_of_array<float>(truth, "truth", shape), z_per_truth));
}

double lpips_of(const lpips::Network& network, const py::object& image, const py::object& target,
                bool published) {
  const Pixels a = colours_of(image, "image"), b = like(*a, target, "target");
  return lpips::distance(network, *a, *b, published ? lpips::Input::published : lpips::Input::defined);
}

// The content of metrics.json.
py::object evaluate_scene(HeldScene& self, const HeldCapture& held, const std::string& split,
                          const lpips::Network* network) {
  if (split != "train" && split != "test") throw InputError("argument", "split", split, "train or test");
  const Capture& capture = held.capture;
  const std::vector<View>& views = views_of(capture, split);
  eval::Report report;
  report.capture = capture.name;
  report.split = split;
  report.downscale = held.options.downscale;
  report.device = name_of(self.scene().device());
  if (const auto& run = self.loaded.run) {
    report.views_as_trained = has_views_of(*run, capture);
    report.train_seconds = run->train_seconds;
  }
  report.iterations = self.iteration;
  {
    const py::gil_scoped_release others_run;
    const std::lock_guard one_at_a_time(self.rendering);
    eval::evaluate(
        self.loaded.subject, capture, views, network,
        [](const View&, const ViewImages&, const Frame&) {
          const py::gil_scoped_acquire held_for_signals;
          if (PyErr_CheckSignals() != 0) throw py::error_already_set();
        },
        report);
  }
  return py::module_::import("json").attr("loads")(eval::report_json(report));
}

}  // namespace

void add_metrics(py::module_& module) {
  module.def(
      "psnr", &psnr_of, py::arg("image"), py::arg("target"), py::arg("mask") = py::none(),
      "dB, for H×W×3 in [0, 1]; mask: H×W, where it is not zero. None for equal images and an empty mask.");
  module.def("ssim", &ssim_of, py::arg("image"), py::arg("target"), py::arg("mask") = py::none(),
             "Mean structural similarity, window 11×11, for H×W×3 in [0, 1]; mask: H×W.");
  module.def("normal_mae_deg", &normal_error, py::arg("normal"), py::arg("truth"),
             py::arg("mask") = py::none(),
             "Mean angle in degrees between normals (H×W×3, any length) and true ones (unit or zero). Pixels "
             "where nothing was rendered count as 90°. None if no pixel has a truth.");
  module.def("depth_errors", &depth_errors_of, py::arg("depth"), py::arg("truth"),
             py::arg("alpha") = py::none(), py::arg("z_per_truth") = 1.0,
             "|z / true z − 1|, H×W float32; −1 where the truth is unknown (0), 1 where nothing was "
             "rendered. z_per_truth converts true depths to rendered units.");
  module.def("lpips", &lpips_of, py::arg("network"), py::arg("image"), py::arg("target"),
             py::arg("published") = false,
             "LPIPS with an ops.loss.LpipsNetwork; published: with inputs in [0, 1], as in tables of "
             "radiance fields.");
  module.def("evaluate", &evaluate_scene, py::arg("scene"), py::arg("capture"), py::arg("split") = "test",
             py::arg("lpips") = nullptr,
             "Renders and measures the views of a split. Returns what `eval` writes to metrics.json "
             "(docs/eval.md), but for figures with aligned cameras.");
}

}  // namespace traceflow::python
