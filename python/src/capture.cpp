#include "capture.h"

#include <fmt/format.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <filesystem>

#include "arrays.h"
#include "options.h"
#include "parts.h"

namespace traceflow::python {

namespace {

void synth(const std::filesystem::path& folder, const py::object& given, const py::kwargs& values) {
  SynthOptions options;
  if (!given.is_none()) options = py::cast<SynthOptions>(given);
  set_options(options, values);
  const py::gil_scoped_release others_run;
  write_synthetic_capture(options, folder);
}

std::shared_ptr<HeldCapture> read_capture_of_user(const std::filesystem::path& path, const py::object& given,
                                                  const py::kwargs& values) {
  auto held = std::make_shared<HeldCapture>();
  if (!given.is_none()) held->options = py::cast<CaptureOptions>(given);
  set_options(held->options, values);
  const py::gil_scoped_release others_run;
  held->capture = load_capture(path, held->options);
  return held;
}

using Views = std::vector<View> Capture::*;

std::vector<std::shared_ptr<HeldView>> views_of(const std::shared_ptr<HeldCapture>& held, Views views,
                                                const char* split) {
  std::vector<std::shared_ptr<HeldView>> list;
  for (const View& view : held->capture.*views)
    list.push_back(std::make_shared<HeldView>(HeldView{held, &view, split}));
  return list;
}

std::shared_ptr<const ViewImages> images_of(const HeldView& held) {
  std::shared_ptr<const ViewImages> images = held.images.lock();
  if (images) return images;
  {
    const py::gil_scoped_release others_run;
    images = load_images(held.capture->capture, *held.view);
  }
  held.images = images;
  return images;
}

std::shared_ptr<const ViewTruth> truth_of(const HeldView& held) {
  std::shared_ptr<const ViewTruth> truth = held.truth.lock();
  if (truth) return truth;
  {
    const py::gil_scoped_release others_run;
    truth = std::make_shared<const ViewTruth>(load_truth(held.capture->capture, *held.view));
  }
  held.truth = truth;
  return truth;
}

template <class T>
void add_pixels(py::class_<HeldView, std::shared_ptr<HeldView>>& kind, const char* name,
                Tensor<T> ViewImages::*member, const char* doc) {
  kind.def_property_readonly(
      name,
      [member](const HeldView& self) {
        const auto images = images_of(self);
        return array_or_none(images, (*images).*member, Access::read_only);
      },
      doc);
}

void add_truth(py::class_<HeldView, std::shared_ptr<HeldView>>& kind, const char* name,
               Tensor<float> ViewTruth::*member, const char* doc) {
  kind.def_property_readonly(
      name,
      [member](const HeldView& self) {
        const auto truth = truth_of(self);
        return array_or_none(truth, (*truth).*member, Access::read_only);
      },
      doc);
}

void add_view(py::module_& module) {
  py::class_<HeldView, std::shared_ptr<HeldView>> kind(
      module, "View",
      "One photograph with its camera and time. Arrays are decoded when asked for and are read-only; those "
      "that the capture lacks are None.");
  kind.def_property_readonly(
          "name", [](const HeldView& self) { return self.view->id; }, "Its id in the capture.")
      .def_property_readonly(
          "split", [](const HeldView& self) { return self.split; }, "train or test.")
      .def_property_readonly(
          "time", [](const HeldView& self) { return self.view->time; }, "In [0, 1].")
      .def_property_readonly(
          "camera", [](const HeldView& self) { return self.view->camera; },
          "A copy of its camera, in the capture's normalised scene.");
  add_pixels(kind, "image", &ViewImages::colour, "Colours, H×W×3 float32 in [0, 1].");
  add_pixels(kind, "known", &ViewImages::known, "H×W uint8, 1 where the colour is known; None: everywhere.");
  add_pixels(kind, "mask", &ViewImages::mask, "H×W uint8, 1 on the moving specular object.");
  add_pixels(kind, "coverage", &ViewImages::coverage,
             "H×W float32 in [0, 1], the share of a pixel that the mask covers.");
  add_pixels(kind, "normal", &ViewImages::normal_prior,
             "Prior normals, H×W×3 float32, world axes, unit; zero where there is none.");
  add_pixels(kind, "depth", &ViewImages::depth_prior,
             "Prior depths along the camera's z, H×W float32, scene units; 0 if unknown.");
  add_truth(kind, "true_normal", &ViewTruth::normal,
            "True normals, H×W×3 float32, world axes, unit or zero.");
  add_truth(kind, "true_depth", &ViewTruth::depth,
            "True depth along the camera's z, H×W float32, scene units; 0 if unknown.");
  kind.def("__repr__", [](const HeldView& self) {
    const View& view = *self.view;
    return fmt::format("<View {} of split {}, {}×{}, time {}>", view.id, self.split, view.camera.width,
                       view.camera.height, view.time);
  });
}

std::vector<std::string> warnings_of(const HeldCapture& held) {
  std::vector<std::string> texts;
  for (const Finding& finding : held.capture.warnings) texts.push_back(finding.text);
  return texts;
}

}  // namespace

void add_capture(py::module_& module) {
  add_view(module);
  py::class_<HeldCapture, std::shared_ptr<HeldCapture>>(
      module, "Capture",
      "Views of one moving scene, with points and normalisation. Images are decoded on demand.")
      .def_property_readonly(
          "name", [](const HeldCapture& self) { return self.capture.name; }, "That of its folder or archive.")
      .def_property_readonly(
          "format", [](const HeldCapture& self) { return self.capture.format; },
          "The layout that it was recognised by (docs/captures.md).")
      .def_property_readonly(
          "folder", [](const HeldCapture& self) { return self.capture.folder; }, "Its folder or archive.")
      .def_property_readonly(
          "train",
          [](const std::shared_ptr<HeldCapture>& self) { return views_of(self, &Capture::train, "train"); },
          "The views that training uses.")
      .def_property_readonly(
          "test",
          [](const std::shared_ptr<HeldCapture>& self) { return views_of(self, &Capture::test, "test"); },
          "The held-out views.")
      .def_property_readonly(
          "times", [](const HeldCapture& self) { return times_of(self.capture); },
          "The times of all views, ascending, each once, in [0, 1].")
      .def_property_readonly(
          "points",
          [](const std::shared_ptr<HeldCapture>& self) {
            return array_or_none(self, self->capture.points, Access::read_only);
          },
          "P×3 float32, scene units; None if the capture has none.")
      .def_property_readonly(
          "extent", [](const HeldCapture& self) { return self.capture.extent; },
          "1.1 times the largest distance of a training camera from their mean, scene units.")
      .def_property_readonly(
          "scale", [](const HeldCapture& self) { return self.capture.normalisation.scale; },
          "Scene units per unit of the capture: x_in_scene = (x_in_capture − centre) · scale.")
      .def_property_readonly(
          "centre",
          [](const HeldCapture& self) {
            const Vec3<double>& c = self.capture.normalisation.centre;
            return py::make_tuple(c.x, c.y, c.z);
          },
          "The origin of the scene, in the capture's coordinates.")
      .def_property_readonly("warnings", &warnings_of, "What looks wrong, one line each.")
      .def_property_readonly(
          "options", [](const HeldCapture& self) { return self.options; },
          "A copy of the options that it was read with.")
      .def("__repr__", [](const HeldCapture& self) {
        return fmt::format("<Capture {} ({}), {} training views, {} test views>", self.capture.name,
                           self.capture.format, self.capture.train.size(), self.capture.test.size());
      });
  module.def(
      "synth", &synth, py::arg("folder"), py::arg("options") = py::none(),
      "Makes a synthetic capture with ground truth in `folder`, which must be absent, empty or an earlier "
      "synthetic capture. Options are those of SynthOptions, as keywords or whole (docs/synth.md).");
  module.def("load_capture", &read_capture_of_user, py::arg("path"), py::arg("options") = py::none(),
             "Reads the views of a folder or a zip archive. Options are those of CaptureOptions, as keywords "
             "or whole (docs/captures.md).");
}

}  // namespace traceflow::python
