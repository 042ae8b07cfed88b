#include <pybind11/stl/filesystem.h>
#include <filesystem>

#include "arrays.h"
#include "ops/loss/loss.h"
#include "ops/lpips/lpips.h"
#include "parts.h"

namespace traceflow::python {

namespace {

using Image = std::shared_ptr<const Tensor<float>>;

Image colours(const py::object& array, const char* name) {
  return tensor_of_array<float>(array, name, {'H', 'W', 3});
}

Dimensions shape_of(const Tensor<float>& like) {
  Dimensions shape;
  for (int i = 0; i < like.shape().rank(); ++i) shape.emplace_back(like.dim(i));
  return shape;
}

// A term of one image and a target of its shape, with its gradient by the image.
template <class Term>
py::tuple compared(const Image& image, const py::object& target, const char* name, const Term& term) {
  const Image other = tensor_of_array<float>(target, name, shape_of(*image));
  Tensor<float> gradient(image->shape());
  const double value = loss::value_of(
      Device::cpu, [&](const loss::MeanSlot& slot) { term(*image, *other, 1.0, gradient, slot); });
  return py::make_tuple(value, array_of(std::move(gradient)));
}

void add_image_terms(py::module_& module) {
  module.def(
      "l1",
      [](const py::object& image, const py::object& target) {
        return compared(colours(image, "image"), target, "target", [](auto&&... a) { loss::l1(a...); });
      },
      py::arg("image"), py::arg("target"), "Mean |image − target|. H×W×3 each; gradient by the image.");
  module.def(
      "ssim",
      [](const py::object& image, const py::object& target) {
        return compared(colours(image, "image"), target, "target",
                        [](auto&&... a) { loss::ssim_loss(a...); });
      },
      py::arg("image"), py::arg("target"),
      "Mean 1 − SSIM, window 11×11. H×W×3 each, in [0, 1]; gradient by the image.");
  module.def(
      "silhouette",
      [](const py::object& silhouette, const py::object& mask) {
        return compared(tensor_of_array<float>(silhouette, "silhouette", {'H', 'W'}), mask, "mask",
                        [](auto&&... a) { loss::silhouette(a...); });
      },
      py::arg("silhouette"), py::arg("mask"),
      "Mean Huber distance. H×W each, in [0, 1]; gradient by the silhouette.");
  module.def(
      "depth_prior",
      [](const py::object& depth, const py::object& prior) {
        return compared(tensor_of_array<float>(depth, "depth", {'H', 'W'}), prior, "prior",
                        [](auto&&... a) { loss::depth_prior(a...); });
      },
      py::arg("depth"), py::arg("prior"),
      "Mean Huber distance of depth / prior from 1. H×W each, 0: unknown; gradient by the depth.");
  module.def(
      "distortion",
      [](const py::object& map) {
        const auto values = tensor_of_array<float>(map, "distortion", {'H', 'W'});
        Tensor<float> gradient(values->shape());
        const double value = loss::value_of(
            Device::cpu, [&](const loss::MeanSlot& slot) { loss::distortion(*values, 1.0, gradient, slot); });
        return py::make_tuple(value, array_of(std::move(gradient)));
      },
      py::arg("distortion"), "The mean of the layer, H×W; gradient by it.");
  module.def(
      "row_norm",
      [](const py::object& rows) {
        const auto values = tensor_of_array<float>(rows, "rows", {'N', 'K'});
        Tensor<float> gradient(values->shape());
        const double value = loss::value_of(
            Device::cpu, [&](const loss::MeanSlot& slot) { loss::row_norm(*values, 1.0, gradient, slot); });
        return py::make_tuple(value, array_of(std::move(gradient)));
      },
      py::arg("rows"), "The mean length of rows, N×K, smooth at zero; gradient by them.");
}

void add_normal_terms(py::module_& module) {
  module.def(
      "normal_consistency",
      [](const py::object& normal, const py::object& alpha, const py::object& pseudo_normal) {
        const Image n = colours(normal, "normal");
        const auto opacity = tensor_of_array<float>(alpha, "alpha", {n->dim(0), n->dim(1)}),
                   pseudo = tensor_of_array<float>(pseudo_normal, "pseudo_normal", shape_of(*n));
        Tensor<float> by_normal(n->shape()), by_alpha(opacity->shape()), by_pseudo(n->shape());
        const double value = loss::value_of(Device::cpu, [&](const loss::MeanSlot& slot) {
          loss::normal_consistency(*n, *opacity, *pseudo, 1.0, by_normal, by_alpha, by_pseudo, slot);
        });
        return py::make_tuple(value, array_of(std::move(by_normal)), array_of(std::move(by_alpha)),
                              array_of(std::move(by_pseudo)));
      },
      py::arg("normal"), py::arg("alpha"), py::arg("pseudo_normal"),
      "How far blended normals (H×W×3, not normalised) are from those of the depth (H×W×3). alpha: H×W. "
      "Gradients by normal, alpha and pseudo_normal.");
  module.def(
      "normal_prior",
      [](const py::object& normal, const py::object& prior, const py::object& tint, double on_mirrors) {
        const Image n = colours(normal, "normal");
        const auto known = tensor_of_array<float>(prior, "prior", shape_of(*n)),
                   shine = tensor_or_none<float>(tint, "tint", {n->dim(0), n->dim(1)});
        Tensor<float> gradient(n->shape());
        const double value = loss::value_of(Device::cpu, [&](const loss::MeanSlot& slot) {
          loss::normal_prior(*n, *known, *shine, on_mirrors, 1.0, gradient, slot);
        });
        return py::make_tuple(value, array_of(std::move(gradient)));
      },
      py::arg("normal"), py::arg("prior"), py::arg("tint") = py::none(), py::arg("on_mirrors") = 1.0,
      "Mean 1 − cosine to prior normals (H×W×3, unit or zero), `on_mirrors` times as heavy where tint (H×W) "
      "is 1. Gradient by normal.");
}

}  // namespace

void add_loss_ops(py::module_& ops) {
  auto module = ops.def_submodule("loss", "Terms of the loss: each returns its value and its gradients.");
  add_image_terms(module);
  add_normal_terms(module);
  py::class_<lpips::Network, std::shared_ptr<lpips::Network>>(
      module, "LpipsNetwork", "The network of LPIPS, from a file of scripts/export_lpips.py.")
      .def(py::init([](const std::filesystem::path& path) {
             return std::make_shared<lpips::Network>(lpips::network_of(lpips::read_weights(path)));
           }),
           py::arg("path"));
  module.def(
      "lpips",
      [](const lpips::Network& network, const py::object& image, const py::object& target) {
        return compared(colours(image, "image"), target, "target",
                        [&](const Tensor<float>& a, const Tensor<float>& b, double weight,
                            Tensor<float>& gradient, const loss::MeanSlot& slot) {
                          lpips::distance(network, a, b, lpips::Input::defined, weight, gradient, slot);
                        });
      },
      py::arg("network"), py::arg("image"), py::arg("target"),
      "The perceptual distance LPIPS. H×W×3 each, in [0, 1], sides of 16 or more; gradient by the image.");
}

}  // namespace traceflow::python
