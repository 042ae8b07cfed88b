#include <fmt/format.h>

#include "parts.h"
#include "scene/environment_map.h"
#include "scene/lighting.h"
#include "scene/motion.h"
#include "scene/nodes.h"
#include "scene/surfels.h"
#include "tensor_fields.h"

namespace traceflow::python {

namespace {

template <class T>
using Class = py::class_<T, std::shared_ptr<T>>;

void check_harmonics(const Tensor<float>& sh) {
  const int64_t count = sh.dim(1);
  for (int64_t degree = 0; degree <= 3; ++degree) {
    if ((degree + 1) * (degree + 1) == count) return;
  }
  throw InputError("argument", "sh", fmt::format("{} harmonics", count),
                   "1, 4, 9 or 16: those of a degree up to 3");
}

std::shared_ptr<Surfels> make_surfels(const py::object& position, const py::object& log_scale,
                                      const py::object& rotation, const py::object& opacity_logit,
                                      const py::object& sh, const py::object& tint_logit,
                                      const py::object& roughness_logit, const py::object& body) {
  auto made = std::make_shared<Surfels>();
  take(made->position, position, "position", {'N', 3});
  const int64_t n = made->count();
  take(made->log_scale, log_scale, "log_scale", {n, 2});
  take(made->rotation, rotation, "rotation", {n, 4});
  take(made->opacity_logit, opacity_logit, "opacity_logit", {n});
  take(made->sh, sh, "sh", {n, 'K', 3});
  check_harmonics(made->sh);
  take(made->tint_logit, tint_logit, "tint_logit", {n});
  take(made->roughness_logit, roughness_logit, "roughness_logit", {n});
  take(made->body, body, "body", {n});
  return made;
}

void add_surfels(py::module_& module) {
  Class<Surfels> kind(module, "Surfels",
                      "N surfels as stored and trained, before activation. Arrays share the memory of the "
                      "surfels. Fields that a set lacks are None.");
  kind.def(py::init(&make_surfels), py::arg("position"), py::arg("log_scale"), py::arg("rotation"),
           py::arg("opacity_logit"), py::arg("sh"), py::arg("tint_logit") = py::none(),
           py::arg("roughness_logit") = py::none(), py::arg("body") = py::none(), "Copies the arrays.");
  add_tensor(kind, "position", &Surfels::position, "N×3 float32, world, scene units.");
  add_tensor(kind, "log_scale", &Surfels::log_scale,
             "N×2 float32, logarithms of the standard deviations along t_u, t_v.");
  add_tensor(kind, "rotation", &Surfels::rotation, "N×4 float32, quaternions (w, x, y, z) of any length.");
  add_tensor(kind, "opacity_logit", &Surfels::opacity_logit, "N float32.");
  add_tensor(kind, "sh", &Surfels::sh, "N×K×3 float32, spherical harmonics, K = (degree + 1)².");
  add_tensor(kind, "tint_logit", &Surfels::tint_logit, "N float32, specular tint; None for the environment.");
  add_tensor(kind, "roughness_logit", &Surfels::roughness_logit,
             "N float32; None if all mirrors are perfect.");
  add_index_tensor(
      kind, "body", &Surfels::body,
      "N int32, the body of each; −1: the field moves it, −2: it is static. Read-only. None without bodies.");
  kind.def("__len__", &Surfels::count);
}

std::shared_ptr<PosedSurfels> make_posed(const py::object& position, const py::object& scale,
                                         const py::object& rotation, const py::object& opacity,
                                         const py::object& sh, const py::object& tint,
                                         const py::object& roughness, const py::object& in_body) {
  auto made = std::make_shared<PosedSurfels>();
  take(made->position, position, "position", {'M', 3});
  const int64_t m = made->count();
  take(made->scale, scale, "scale", {m, 2});
  take(made->rotation, rotation, "rotation", {m, 4});
  take(made->opacity, opacity, "opacity", {m});
  take(made->sh, sh, "sh", {m, 'K', 3});
  check_harmonics(made->sh);
  take(made->tint, tint, "tint", {m});
  take(made->roughness, roughness, "roughness", {m});
  take(made->in_body, in_body, "in_body", {m});
  return made;
}

void add_posed(py::module_& module) {
  Class<PosedSurfels> kind(module, "PosedSurfels",
                           "M surfels at one time, activated: what ops.raster and ops.trace read. Also their "
                           "gradients. Arrays share the memory of the surfels.");
  kind.def(py::init(&make_posed), py::arg("position"), py::arg("scale"), py::arg("rotation"),
           py::arg("opacity"), py::arg("sh"), py::arg("tint") = py::none(), py::arg("roughness") = py::none(),
           py::arg("in_body") = py::none(), "Copies the arrays.");
  add_tensor(kind, "position", &PosedSurfels::position, "M×3 float32, world, scene units.");
  add_tensor(kind, "scale", &PosedSurfels::scale, "M×2 float32, standard deviations, scene units.");
  add_tensor(kind, "rotation", &PosedSurfels::rotation,
             "M×4 float32, quaternions (w, x, y, z) of any length.");
  add_tensor(kind, "opacity", &PosedSurfels::opacity, "M float32 in (0, 1).");
  add_tensor(kind, "sh", &PosedSurfels::sh, "M×K×3 float32, spherical harmonics of the degrees in use.");
  add_tensor(kind, "tint", &PosedSurfels::tint, "M float32 in (0, 1); None for the environment.");
  add_tensor(kind, "roughness", &PosedSurfels::roughness,
             "M float32 in (0, ¼), a tangent; None if all are 0.");
  add_tensor(kind, "in_body", &PosedSurfels::in_body,
             "M float32, 1 on bodies; None if no silhouette is drawn.");
  kind.def("__len__", &PosedSurfels::count);
}

void add_motion(py::module_& module) {
  Class<Motion> kind(module, "Motion", "How B rigid bodies move: a pose at each of K times.");
  kind.def(py::init([](const py::object& time, const py::object& centre, const py::object& rotation,
                       const py::object& shift) {
             auto made = std::make_shared<Motion>();
             take(made->time, time, "time", {'K'});
             take(made->centre, centre, "centre", {'B', 3});
             take(made->rotation, rotation, "rotation", {made->bodies(), made->keys(), 4});
             take(made->shift, shift, "shift", {made->bodies(), made->keys(), 3});
             return made;
           }),
           py::arg("time"), py::arg("centre"), py::arg("rotation"), py::arg("shift"), "Copies the arrays.");
  add_tensor(kind, "time", &Motion::time, "K float32, ascending, in [0, 1].");
  add_tensor(kind, "centre", &Motion::centre,
             "B×3 float32, what a body rotates about, at rest, scene units.");
  add_tensor(kind, "rotation", &Motion::rotation, "B×K×4 float32, quaternions (w, x, y, z).");
  add_tensor(kind, "shift", &Motion::shift, "B×K×3 float32, scene units.");
}

void add_nodes(py::module_& module) {
  Class<Nodes> kind(module, "Nodes", "How bodies bend: N nodes with a turn and a shift at each of L times.");
  add_index_tensor(kind, "body", &Nodes::body, "N int32, read-only.");
  add_tensor(kind, "time", &Nodes::time, "L float32, ascending, in [0, 1].");
  add_tensor(kind, "centre", &Nodes::centre, "N×3 float32, scene units.");
  add_tensor(kind, "radius", &Nodes::radius, "N float32, scene units.");
  add_tensor(kind, "turn", &Nodes::turn, "N×L×3 float32, rotation vectors, radians.");
  add_tensor(kind, "shift", &Nodes::shift, "N×L×3 float32, scene units.");
  kind.def("__len__", &Nodes::count);
}

void add_lighting(py::module_& module) {
  Class<Lighting> kind(module, "Lighting",
                       "How light changes: logarithms of the brightness in a grid and on bodies.");
  add_tensor(kind, "box", &Lighting::box, "2×3 float32, the grid's lowest and highest corner, scene units.");
  add_tensor(kind, "time", &Lighting::time, "L float32, ascending, in [0, 1].");
  add_tensor(kind, "brightness", &Lighting::brightness, "L×Z×Y×X float32, logarithms.");
  add_tensor(kind, "centre", &Lighting::centre,
             "B×L×3 float32, where bodies are, scene units; None if light on them is constant.");
  add_tensor(kind, "radius", &Lighting::radius, "B float32, scene units; None likewise.");
  add_tensor(kind, "body_brightness", &Lighting::body_brightness,
             "B×L×4 float32, logarithms; None likewise.");
}

void add_field(py::module_& module) {
  Class<Field>(module, "Field", "A residual field: a network of position and time.")
      .def(
          "parameters",
          [](const std::shared_ptr<Field>& self) {
            py::dict arrays;
            self->for_each([&](const std::string& name, Tensor<float>& tensor) {
              arrays[py::str(name)] = array_of(self, tensor);
            });
            return arrays;
          },
          "Arrays by name that share the field's memory: weight0, bias0, …, head_weight, head_bias "
          "(float32).")
      .def_property_readonly("outputs", &Field::outputs, "Numbers for each point.");
  Class<EnvironmentMap> map(module, "EnvironmentMap", "A cube map of what is mirrored.");
  add_tensor(map, "logit", &EnvironmentMap::logit,
             "(6·S)×S×3 float32: the faces +x −x +y −y +z −z, one below the other; a colour is the logistic "
             "function of it.");
}

}  // namespace

void add_scene_parts(py::module_& module) {
  add_surfels(module);
  add_posed(module);
  add_motion(module);
  add_nodes(module);
  add_lighting(module);
  add_field(module);
}

}  // namespace traceflow::python
