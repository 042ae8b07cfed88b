#include <pybind11/stl/filesystem.h>

#include <filesystem>

#include "arrays.h"
#include "files/png.h"
#include "parts.h"
#include "viz/picture.h"
#include "viz/video.h"

namespace traceflow::python {

namespace {

viz::Layer layer_named(const std::string& name) {
  const std::vector<viz::Layer> layers = viz::parse_layers(name);
  if (layers.size() != 1) throw InputError("argument", "layer", name, "the name of one layer");
  return layers.front();
}

// Values of a layer: H×W×3 if it has colours, otherwise H×W.
std::shared_ptr<const Tensor<float>> values_of(const py::object& array, viz::Layer layer) {
  return viz::has_colours(layer) ? tensor_of_array<float>(array, "values", {'H', 'W', 3})
                                 : tensor_of_array<float>(array, "values", {'H', 'W'});
}

// A picture of 8 bits a channel: itself, or colours in [0, 1].
std::shared_ptr<const Tensor<uint8_t>> picture_of(const py::object& array) {
  if (!py::isinstance<py::array>(array)) refuse_array("picture", array, "an array");
  const auto given = py::reinterpret_borrow<py::array>(array);
  const bool grey = given.ndim() == 2;
  const Dimensions shape = grey ? Dimensions{'H', 'W'} : Dimensions{'H', 'W', 3};
  if (given.dtype().kind() != 'f') return tensor_of_array<uint8_t>(array, "picture", shape);
  return std::make_shared<Tensor<uint8_t>>(to_8bit(*tensor_of_array<float>(array, "picture", shape)));
}

}  // namespace

void add_pictures(py::module_& module) {
  py::class_<viz::Painter>(module, "Painter",
                           "Turns layers into pictures as `render` does. The ranges of depths and distortion "
                           "are those of the first picture, so that a film does not flicker.")
      .def(py::init<>())
      .def(
          "paint",
          [](viz::Painter& self, const std::string& name, const py::object& values) {
            const viz::Layer layer = layer_named(name);
            return array_of(self.paint(layer, *values_of(values, layer)));
          },
          py::arg("layer"), py::arg("values"),
          "values: as Scene.render() gives them. Returns uint8, H×W×3, or H×W for layers in grey.");
  py::class_<viz::Video>(module, "Video",
                         "A film that ffmpeg encodes. The file gets its name when finish() completes it.")
      .def(py::init([](const std::filesystem::path& path, double frames_per_second) {
             viz::Video::prepare(path);
             return std::make_unique<viz::Video>(path, frames_per_second);
           }),
           py::arg("path"), py::arg("frames_per_second") = 30.0)
      .def(
          "add",
          [](viz::Video& self, const py::object& picture) { self.add(viz::in_colour(*picture_of(picture))); },
          py::arg("picture"), "A frame: H×W×3 or H×W, uint8, or float32 in [0, 1]. All have one size.")
      .def("finish", &viz::Video::finish, "Completes the file.");
  module.def(
      "write_png",
      [](const std::filesystem::path& path, const py::object& picture) {
        write_png(path, *picture_of(picture));
      },
      py::arg("path"), py::arg("picture"), "Writes H×W×3 or H×W, uint8, or float32 in [0, 1].");
}

}  // namespace traceflow::python
