#include "camera.h"
#include "layers.h"
#include "parts.h"
#include "scene.h"

namespace traceflow::python {

namespace {

// Calls f(name, set.colour, …) for each layer of a frame that has a gradient.
template <class F>
void for_each_frame_layer(F&& f, FrameGradient& set) {
  f("colour", set.colour);
  f("normal", set.normal);
  f("pseudo_normal", set.pseudo_normal);
  f("distortion", set.distortion);
  f("alpha", set.alpha);
  f("silhouette", set.silhouette);
}

struct SavedRender {
  std::shared_ptr<HeldScene> scene;
  Renderer renderer;
  FrameRequest request;
};

std::pair<py::dict, std::unique_ptr<SavedRender>> render_forward(const std::shared_ptr<HeldScene>& scene,
                                                                 const py::object& where,
                                                                 const py::object& time) {
  const Place place = place_of(scene->scene().normalisation, where, time);
  const viz::Subject& subject = scene->loaded.subject;
  auto saved = std::make_unique<SavedRender>(SavedRender{scene, Renderer(subject.render), subject.request});
  saved->request.camera = place.camera;
  saved->request.time = place.time;
  saved->request.pseudo_normals = true;
  saved->request.silhouette = true;
  const Frame* frame = nullptr;
  {
    const py::gil_scoped_release others_run;
    frame = &saved->renderer.forward(subject.scene, saved->request, true);
  }
  py::dict layers;
  const auto give = [&](const char* name, const Tensor<float>& layer) {
    if (!layer.empty()) layers[name] = array_of(layer.on(Device::cpu));
  };
  give("colour", frame->colour);
  give("normal", frame->raster.normal);
  give("pseudo_normal", frame->pseudo_normal);
  give("distortion", frame->raster.distortion);
  give("alpha", frame->raster.alpha);
  give("silhouette", frame->raster.silhouette);
  return {layers, std::move(saved)};
}

template <class T>
std::shared_ptr<T> taken(T& part, bool is_there) {
  return is_there ? std::make_shared<T>(std::move(part)) : nullptr;
}

py::dict render_backward(SavedRender& saved, const py::dict& gradients) {
  FrameGradient given;
  take_layer_gradients(gradients, saved.request.camera, [&](auto&& f) { for_each_frame_layer(f, given); });
  const Scene& scene = saved.scene->scene();
  for_each_frame_layer(
      [&](const char*, Tensor<float>& layer) {
        if (!layer.empty()) layer = layer.on(scene.device());
      },
      given);
  SceneGradient gradient;
  {
    const py::gil_scoped_release others_run;
    gradient.reset(scene);
    saved.renderer.backward(scene, saved.request, Trainable{}, given, gradient);
  }
  py::dict result;
  result["main"] = taken(gradient.main, true);
  result["environment"] = taken(gradient.environment, true);
  result["main_field"] = taken(gradient.main_field, scene.main_field.has_value());
  result["environment_field"] = taken(gradient.environment_field, scene.environment_field.has_value());
  result["motion"] = taken(gradient.main_motion, scene.main_motion.has_value());
  result["nodes"] = taken(gradient.main_nodes, scene.main_nodes.has_value());
  result["lighting"] = taken(gradient.lighting, scene.lighting.has_value());
  result["environment_map"] = taken(gradient.environment_map, scene.environment_map.has_value());
  result["camera"] = dict_of(gradient.camera);
  return result;
}

}  // namespace

void add_render_op(py::module_& ops) {
  auto module = ops.def_submodule("render", "One frame of a scene with all ops, and its derivative.");
  py::class_<SavedRender>(module, "Saved", "What backward needs.");
  module.def("forward", &render_forward, py::arg("scene"), py::arg("camera"), py::arg("time") = py::none(),
             "camera, time: as for Scene.render(). Returns a dict of float32 layers and what backward needs: "
             "colour, normal (world axes, not normalised), pseudo_normal (of the depth): H×W×3; distortion, "
             "alpha, and with bodies silhouette: H×W. The scene must not change until backward.");
  module.def("backward", &render_backward, py::arg("saved"), py::arg("gradients"),
             "gradients: dict of the loss's derivatives by layers; a missing one is zero. Returns a dict of "
             "the gradients by all that the scene has, in the classes of its parts (Surfels, Field, Motion, "
             "…; None if it lacks one), and by the camera's pose.");
}

}  // namespace traceflow::python
