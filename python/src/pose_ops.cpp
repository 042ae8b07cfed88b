#include <fmt/format.h>

#include <cmath>

#include "ops/deform/deform.h"
#include "ops/lighting/lighting.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "options.h"
#include "parts.h"
#include "render/render_options.h"
#include "tensor_fields.h"

namespace traceflow::python {

namespace {

using Posed = std::shared_ptr<PosedSurfels>;

field::Precision precision_of(const std::string& name) {
  RenderOptions options;
  py::dict one;
  one["precision"] = name;
  set_options(options, one);
  return options.precision;
}

int degree_of(const Surfels& surfels) {
  return static_cast<int>(std::lround(std::sqrt(surfels.sh.empty() ? 1 : surfels.sh.dim(1)))) - 1;
}

// Throws InputError unless the gradient has the shapes of the surfels.
void check_gradient(const PosedSurfels& gradient, const PosedSurfels& surfels) {
  const auto check = [](const char* name, const Tensor<float>& has, const Tensor<float>& should) {
    if (has.shape() != should.shape()) {
      throw InputError("argument", std::string("gradient: ") + name, "shape " + has.shape().to_string(),
                       "that of the surfels, " + should.shape().to_string());
    }
  };
  check("position", gradient.position, surfels.position);
  check("scale", gradient.scale, surfels.scale);
  check("rotation", gradient.rotation, surfels.rotation);
  check("opacity", gradient.opacity, surfels.opacity);
  check("sh", gradient.sh, surfels.sh);
  check("tint", gradient.tint, surfels.tint);
  check("roughness", gradient.roughness, surfels.roughness);
}

// Throws InputError if a surfel is in a body that there is not.
void check_bodies(const Tensor<int32_t>& body, int64_t bodies) {
  for (const int32_t b : body.values()) {
    if (b >= bodies)
      throw InputError("argument", "body", fmt::format("body {}", b), fmt::format("less than {}", bodies));
  }
}

struct SavedDeform {
  std::shared_ptr<const Surfels> stored;
  std::shared_ptr<const Field> network;
  float time;
  Posed posed;
  deform::Saved saved = {};
};

std::pair<Posed, std::unique_ptr<SavedDeform>> deform_forward(const std::shared_ptr<Surfels>& surfels,
                                                              const std::shared_ptr<Field>& network,
                                                              float time, const py::object& sh_degree,
                                                              const std::string& precision) {
  auto saved =
      std::make_unique<SavedDeform>(SavedDeform{surfels, network, time, std::make_shared<PosedSurfels>()});
  const field::Precision arithmetic = precision_of(precision);
  const int degree = sh_degree.is_none() ? degree_of(*surfels) : py::cast<int>(sh_degree);
  if (degree < 0 || degree > degree_of(*surfels))
    throw InputError("argument", "sh_degree", fmt::format("{}", degree),
                     fmt::format("0 to {}", degree_of(*surfels)));
  const py::gil_scoped_release others_run;
  deform::forward(*surfels, network.get(), time, {}, degree, arithmetic, *saved->posed, &saved->saved);
  Posed posed = saved->posed;
  return {std::move(posed), std::move(saved)};
}

std::pair<std::shared_ptr<Surfels>, std::shared_ptr<Field>> deform_backward(const SavedDeform& saved,
                                                                            const PosedSurfels& gradient) {
  check_gradient(gradient, *saved.posed);
  auto grad_stored = std::make_shared<Surfels>(zeros_like<float>(*saved.stored));
  std::shared_ptr<Field> grad_field;
  if (saved.network) grad_field = std::make_shared<Field>(zeros_like<float>(*saved.network));
  const py::gil_scoped_release others_run;
  deform::backward(*saved.stored, saved.network.get(), saved.time, {}, *saved.posed, saved.saved, gradient,
                   {}, *grad_stored, grad_field.get());
  return {grad_stored, grad_field};
}

// A step that changes posed surfels in place. From Python it works on a copy.
template <class Part, class SavedPtr>
struct SavedChange {
  std::shared_ptr<const Part> part;
  std::shared_ptr<const Tensor<int32_t>> body;
  float time;
  Posed posed;  // afterwards
  SavedPtr saved;
};
using SavedMotion = SavedChange<Motion, motion::SavedPtr>;
using SavedNodes = SavedChange<Nodes, nodes::SavedPtr>;
using SavedLighting = SavedChange<Lighting, lighting::SavedPtr>;

template <class Saved, class Part, class Forward>
std::pair<Posed, std::unique_ptr<Saved>> change(const std::shared_ptr<Part>& part, const py::object& body,
                                                float time, const PosedSurfels& posed,
                                                decltype(Saved::saved) made, const Forward& forward) {
  auto of_surfels = tensor_of_array<int32_t>(body, "body", {posed.count()});
  if constexpr (requires { part->bodies(); }) {
    if (part->bodies() > 0 || std::is_same_v<Part, Motion>) check_bodies(*of_surfels, part->bodies());
  }
  auto saved = std::make_unique<Saved>(
      Saved{part, std::move(of_surfels), time, std::make_shared<PosedSurfels>(posed), std::move(made)});
  const py::gil_scoped_release others_run;
  forward(*part, *saved->body, time, Tensor<int32_t>(), *saved->posed, *saved->saved);
  Posed changed = saved->posed;
  return {std::move(changed), std::move(saved)};
}

std::pair<Posed, std::shared_ptr<Motion>> motion_backward(const SavedMotion& s,
                                                          const PosedSurfels& gradient) {
  check_gradient(gradient, *s.posed);
  auto before = std::make_shared<PosedSurfels>(gradient);
  auto by_part = std::make_shared<Motion>(zeros_like<float>(*s.part));
  const py::gil_scoped_release others_run;
  motion::backward(*s.part, *s.body, s.time, {}, *s.posed, *s.saved, *before, by_part.get());
  return {before, by_part};
}

std::pair<Posed, std::shared_ptr<Nodes>> nodes_backward(SavedNodes& s, const PosedSurfels& gradient) {
  check_gradient(gradient, *s.posed);
  auto before = std::make_shared<PosedSurfels>(gradient);
  auto by_part = std::make_shared<Nodes>(zeros_like<float>(*s.part));
  const py::gil_scoped_release others_run;
  nodes::backward(*s.part, *s.body, s.time, {}, *s.saved, *before, by_part.get());
  return {before, by_part};
}

std::pair<Posed, std::shared_ptr<Lighting>> lighting_backward(SavedLighting& s,
                                                              const PosedSurfels& gradient) {
  check_gradient(gradient, *s.posed);
  auto before = std::make_shared<PosedSurfels>(gradient);
  auto by_part = std::make_shared<Lighting>(zeros_like<float>(*s.part));
  const py::gil_scoped_release others_run;
  lighting::backward(*s.part, s.time, *s.posed, *s.saved, *before, by_part.get());
  return {before, by_part};
}

constexpr const char* change_forward_doc =
    "body: M int32, the body of each surfel (Surfels.body). Returns changed surfels and what backward needs.";
constexpr const char* change_backward_doc =
    "gradient: by the changed surfels. Returns the gradients by the surfels before, and by the first "
    "argument of forward.";

}  // namespace

void add_pose_ops(py::module_& ops) {
  auto deform = ops.def_submodule(
      "deform", "Stored surfels to surfels at a time: residuals of the field, activations.");
  py::class_<SavedDeform>(deform, "Saved", "What backward needs.");
  deform.def("forward", &deform_forward, py::arg("surfels"), py::arg("field") = nullptr, py::kw_only(),
             py::arg("time") = 0.0F, py::arg("sh_degree") = py::none(), py::arg("precision") = "fp32",
             "field: a Field, or None for no residuals. time: in [0, 1]. sh_degree: the highest that is "
             "used, at most and by default that of the surfels. Returns PosedSurfels and what "
             "backward needs; the arguments must not change until then.");
  deform.def("backward", &deform_backward, py::arg("saved"), py::arg("gradient"),
             "gradient: by the PosedSurfels. Returns the gradients by the Surfels and by the Field, or None. "
             "The position enters the field as a constant.");

  auto motion = ops.def_submodule("motion", "Moves posed surfels with their bodies.");
  py::class_<SavedMotion>(motion, "Saved", "What backward needs.");
  motion.def(
      "forward",
      [](const std::shared_ptr<Motion>& m, const py::object& body, float time, const PosedSurfels& surfels) {
        return change<SavedMotion>(m, body, time, surfels, motion::make_saved(),
                                   [](auto&&... a) { motion::forward(a...); });
      },
      py::arg("motion"), py::arg("body"), py::arg("time"), py::arg("surfels"), change_forward_doc);
  motion.def("backward", &motion_backward, py::arg("saved"), py::arg("gradient"), change_backward_doc);

  auto nodes = ops.def_submodule("nodes", "Bends posed surfels of bodies, before ops.motion.");
  py::class_<SavedNodes>(nodes, "Saved", "What backward needs.");
  nodes.def(
      "forward",
      [](const std::shared_ptr<Nodes>& n, const py::object& body, float time, const PosedSurfels& surfels) {
        return change<SavedNodes>(n, body, time, surfels, nodes::make_saved(),
                                  [](auto&&... a) { nodes::forward(a...); });
      },
      py::arg("nodes"), py::arg("body"), py::arg("time"), py::arg("surfels"), change_forward_doc);
  nodes.def("backward", &nodes_backward, py::arg("saved"), py::arg("gradient"), change_backward_doc);

  auto lighting =
      ops.def_submodule("lighting", "The colours of posed surfels in changing light, after ops.motion.");
  py::class_<SavedLighting>(lighting, "Saved", "What backward needs.");
  lighting.def(
      "forward",
      [](const std::shared_ptr<Lighting>& l, const py::object& body, float time,
         const PosedSurfels& surfels) {
        return change<SavedLighting>(l, body, time, surfels, lighting::make_saved(),
                                     [](auto&&... a) { lighting::forward(a...); });
      },
      py::arg("lighting"), py::arg("body"), py::arg("time"), py::arg("surfels"), change_forward_doc);
  lighting.def("backward", &lighting_backward, py::arg("saved"), py::arg("gradient"), change_backward_doc);
}

}  // namespace traceflow::python
