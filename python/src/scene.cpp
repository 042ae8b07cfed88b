#include "scene.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <filesystem>

#include "capture.h"
#include "parts.h"
#include "primitives/gemm.h"
#include "scene/viewpoint.h"
#include "viz/cameras/camera_path.h"
#include "viz/cameras/orbit.h"
#include "viz/cameras/spiral.h"

namespace traceflow::python {

namespace {

std::shared_ptr<HeldScene> read_scene_of_user(const std::filesystem::path& path,
                                              const std::string& environment, const std::string& device) {
  const Device where = device_of(device);
  auto held = std::make_shared<HeldScene>();
  const py::gil_scoped_release others_run;
  held->loaded = load_scene(path, environment);
  if (held->loaded.run) held->iteration = held->loaded.run->iterations;
  held->scene().move_to(where);
  return held;
}

std::vector<viz::Layer> layers_of(const py::object& names) {
  if (py::isinstance<py::str>(names)) return viz::parse_layers(py::cast<std::string>(names));
  return viz::parse_layers(fmt::format("{}", fmt::join(py::cast<std::vector<std::string>>(names), ",")));
}

// The capture of the run, or the one in `folder`. Its warning becomes one of the capture.
std::shared_ptr<HeldCapture> capture_of_scene(const HeldScene& self, const py::object& path, int downscale) {
  const auto folder = path.is_none() ? std::filesystem::path() : py::cast<std::filesystem::path>(path);
  auto held = std::make_shared<HeldCapture>();
  if (self.loaded.run) held->options = self.loaded.run->options.capture;
  if (downscale > 0) held->options.downscale = downscale;
  const py::gil_scoped_release others_run;
  std::string warning;
  held->capture = capture_of(self.loaded, folder, downscale, warning);
  if (!warning.empty()) held->capture.warnings.emplace_back(warning, "other-views");
  return held;
}

// The points of the layer `tracks` are chosen once. They are followed over the times of the capture, if that
// is there.
viz::Tracks tracks_at(HeldScene& self, float time) {
  viz::Subject& subject = self.loaded.subject;
  if (!self.follower) {
    std::vector<float> times;
    std::string warning;
    if (self.loaded.run && std::filesystem::exists(self.loaded.run->capture_folder))
      times = times_of(capture_of(self.loaded, "", 0, warning));
    self.follower.emplace(subject.scene, subject.request, subject.render, times);
  }
  return self.follower->at(subject.scene, time);
}

std::vector<Tensor<float>> render_layers(HeldScene& self, const Place& place,
                                         const std::vector<viz::Layer>& layers) {
  const std::lock_guard one_at_a_time(self.rendering);
  viz::Subject& subject = self.loaded.subject;
  if (!(subject.scene.extent > 0))
    subject.scene.extent = viz::extent_seen_from(subject.scene.main, {{"", place.time, place.camera}});
  if (!self.renderer) self.renderer.emplace(subject.render);
  FrameRequest request = subject.request;
  request.camera = place.camera;
  request.time = place.time;
  request.specular = request.specular && std::ranges::any_of(layers, viz::needs_reflections);
  const Frame& frame = self.renderer->forward(subject.scene, request);
  std::vector<Tensor<float>> values;
  values.reserve(layers.size());
  for (const viz::Layer layer : layers) {
    values.push_back(
        viz::layer_values(frame, layer, subject.scene.normalisation.scale,
                          layer == viz::Layer::tracks ? tracks_at(self, place.time) : viz::Tracks()));
  }
  return values;
}

py::dict render(HeldScene& self, const py::object& where, const py::object& time, const py::object& names) {
  const std::vector<viz::Layer> layers = layers_of(names);
  const Place place = place_of(self.scene().normalisation, where, time);
  std::vector<Tensor<float>> values;
  {
    const py::gil_scoped_release others_run;
    values = render_layers(self, place, layers);
  }
  py::dict result;
  for (size_t i = 0; i < layers.size(); ++i)
    result[viz::to_string(layers[i])] = array_of(std::move(values[i]));
  return result;
}

// A member of the scene that lives as long as the scene does; None if it is absent.
template <class T>
std::shared_ptr<T> part_of(const std::shared_ptr<HeldScene>& self, std::optional<T>& part) {
  return part ? std::shared_ptr<T>(self, &*part) : nullptr;
}

using Path = std::vector<std::pair<Camera<float>, float>>;

Path path_of(const std::vector<viz::Shot>& shots) {
  Path path;
  for (size_t i = 0; i < shots.size(); ++i) {
    const double last = std::max<double>(1, static_cast<double>(shots.size()) - 1);
    path.emplace_back(shots[i].camera,
                      shots[i].time.value_or(static_cast<float>(static_cast<double>(i) / last)));
  }
  return path;
}

template <class Make>
Path around(const HeldCapture& held, int frames, int width, int height, const Make& make) {
  std::vector<Camera<float>> cameras;
  for (const View& view : held.capture.train) cameras.push_back(view.camera);
  if (frames < 1) throw InputError("argument", "frames", fmt::format("{}", frames), "1 or more");
  std::vector<viz::Shot> shots = make(cameras, frames);
  for (viz::Shot& shot : shots) {
    if (width > 0) {
      // As `render --size` does: the vertical field of view stays.
      const float scale = static_cast<float>(height) / static_cast<float>(shot.camera.height);
      shot.camera.centre_x = static_cast<float>(width) / 2 +
                             scale * (shot.camera.centre_x - static_cast<float>(shot.camera.width) / 2);
      shot.camera.centre_y *= scale;
      shot.camera.focal_x *= scale;
      shot.camera.focal_y *= scale;
      shot.camera.width = width;
      shot.camera.height = height;
    }
  }
  return path_of(shots);
}

void add_paths(py::module_& module) {
  const char* doc =
      "A path of `frames` cameras, pairs of Camera and time; time runs once from 0 to 1. Cameras are in the "
      "capture's normalised scene, which is that of a run trained on it. width, height: pixels; 0: as the "
      "photographs.";
  module.def(
      "orbit",
      [](const HeldCapture& capture, int frames, int width, int height) {
        return around(capture, frames, width, height, viz::orbit_around_cameras);
      },
      py::arg("capture"), py::arg("frames") = 120, py::arg("width") = 0, py::arg("height") = 0, doc);
  module.def(
      "spiral",
      [](const HeldCapture& capture, int frames, int width, int height) {
        return around(capture, frames, width, height, viz::spiral_around_cameras);
      },
      py::arg("capture"), py::arg("frames") = 120, py::arg("width") = 0, py::arg("height") = 0, doc);
  module.def(
      "load_camera_path",
      [](const std::filesystem::path& path, HeldScene& scene) {
        return path_of(viz::shots_of(viz::read_camera_path(path), scene.scene().normalisation));
      },
      py::arg("path"), py::arg("scene"),
      "Pairs of Camera and time along a path through keyframes, from a file that the viewer saved "
      "(docs/view.md).");
}

void add_members(py::class_<HeldScene, std::shared_ptr<HeldScene>>& kind) {
  using Self = std::shared_ptr<HeldScene>;
  kind.def_property_readonly(
          "main", [](const Self& self) { return std::shared_ptr<Surfels>(self, &self->scene().main); },
          "The main surfels, whose arrays share the scene's memory.")
      .def_property_readonly(
          "environment",
          [](const Self& self) { return std::shared_ptr<Surfels>(self, &self->scene().environment); },
          "The surfels that reflections show.")
      .def_property_readonly(
          "main_field", [](const Self& self) { return part_of(self, self->scene().main_field); },
          "What moves main surfels of no body; None without one.")
      .def_property_readonly(
          "environment_field",
          [](const Self& self) { return part_of(self, self->scene().environment_field); },
          "What moves environment surfels; None without one.")
      .def_property_readonly(
          "motion", [](const Self& self) { return part_of(self, self->scene().main_motion); },
          "Poses of bodies; None without bodies.")
      .def_property_readonly(
          "nodes", [](const Self& self) { return part_of(self, self->scene().main_nodes); },
          "How bodies bend; None if none does.")
      .def_property_readonly(
          "lighting", [](const Self& self) { return part_of(self, self->scene().lighting); },
          "How light changes; None if it is constant.")
      .def_property_readonly(
          "environment_map", [](const Self& self) { return part_of(self, self->scene().environment_map); },
          "The cube map that reflections show or that is behind the environment surfels; None without one.")
      .def_property_readonly(
          "device", [](const Self& self) { return std::string(name_of(self->scene().device())); },
          "cpu or cuda. Arrays of a scene on cuda are copies on the host.")
      .def_property_readonly(
          "iteration", [](const Self& self) { return self->iteration; },
          "Completed iterations of its training; 0 for a .ply.")
      .def_property_readonly(
          "extent", [](const Self& self) { return self->scene().extent; },
          "1.1 times the largest distance of a training camera from their mean, scene units. A .ply that "
          "does not tell it gets one with the first picture.")
      .def_property_readonly(
          "scale", [](const Self& self) { return self->scene().normalisation.scale; },
          "Scene units per unit of the capture.")
      .def_property_readonly(
          "warning", [](const Self& self) { return self->loaded.subject.warning; },
          "What pictures lack, or that a checkpoint is not the newest; one line, or empty.")
      .def_property_readonly(
          "capture_folder",
          [](const Self& self) -> py::object {
            if (!self->loaded.run) return py::none();
            return py::cast(self->loaded.run->capture_folder);
          },
          "Where the capture was during training; None for a .ply.")
      .def_property(
          "options", [](const Self& self) { return self->loaded.subject.render; },
          [](HeldScene& self, const RenderOptions& options) {
            options.validate();
            const std::lock_guard one_at_a_time(self.rendering);
            self.loaded.subject.render = options;
            self.renderer.reset();
            self.follower.reset();
          },
          "How it is rendered: a copy; assign to it to change it.");
}

}  // namespace

Device device_of(const std::string& name) {
  if (name != "auto" && name != "cpu" && name != "cuda")
    throw InputError("argument", "device", name, "auto, cpu or cuda");
  std::string why_not;
  if (name == "cpu") return Device::cpu;
  if (cuda::is_ready(why_not)) return Device::cuda;
  if (name == "cuda")
    throw InputError("argument", "device", "cuda, but " + why_not, "a CUDA device", "use cpu");
  return Device::cpu;
}

Place place_of(const SceneNormalisation& of_scene, const py::object& place, const py::object& time) {
  Place result{};
  if (py::isinstance<HeldView>(place)) {
    const auto& held = py::cast<const HeldView&>(place);
    result = {renormalised(held.view->camera, held.capture->capture.normalisation, of_scene),
              held.view->time};
  } else if (py::isinstance<Camera<float>>(place)) {
    result = {py::cast<Camera<float>>(place), 0};
    if (time.is_none()) throw InputError("argument", "time", "nothing", "0 to 1, with a Camera");
  } else {
    refuse_array("camera", place, "a View or a Camera");
  }
  if (!time.is_none()) result.time = py::cast<float>(time);
  if (!(result.time >= 0 && result.time <= 1))
    throw InputError("argument", "time", fmt::format("{}", result.time), "0 to 1");
  return result;
}

void add_scene(py::module_& module) {
  py::class_<HeldScene, std::shared_ptr<HeldScene>> kind(
      module, "Scene", "What is reconstructed: surfels, their motion, and how they are rendered.");
  add_members(kind);
  kind.def("render", &render, py::arg("camera"), py::arg("time") = py::none(), py::arg("layers") = "rgb",
           "Renders layers, a dict of float32 arrays by name: H×W×3 for rgb, diffuse, specular, normal "
           "(world axes, as blended), surfels and tracks; H×W for tint, roughness, alpha, depth and "
           "median-depth (along the camera's z, in the capture's units) and distortion. camera: a View, or a "
           "Camera with a time in [0, 1]. layers: a list of names, or as on the command line.");
  kind.def("capture", &capture_of_scene, py::arg("path") = py::none(), py::arg("downscale") = 0,
           "The capture that the run was trained on, or the one at `path` if it has moved; training views "
           "have the cameras that the run refined. downscale 0: that of the run.");
  kind.def("__repr__", [](HeldScene& self) {
    return fmt::format("<Scene of {} main and {} environment surfels>", self.scene().main.count(),
                       self.scene().environment.count());
  });
  module.def("load_scene", &read_scene_of_user, py::arg("path"), py::arg("environment") = "",
             py::arg("device") = "cpu",
             "Loads a run's folder, a .ply, an .spz or a folder that `export` wrote. environment: a second "
             ".ply with the reflected surfels. device: cpu, cuda or auto.");
  add_paths(module);
}

}  // namespace traceflow::python
