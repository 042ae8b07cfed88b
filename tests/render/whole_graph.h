#pragma once

#include <string>
#include <vector>

#include "render/reference_graph.h"
#include "render/renderer.h"

// A small scene through every phase's graph, for the end-to-end gradient tests.
namespace traceflow::whole_graph {

enum class Graph { diffuse, diffuse_deformed, reflected, reflected_map, reflected_far, several_samples };

struct Case {
  Scene scene;
  FrameRequest request;
  reference::Parameters parameters;
  reference::Setting setting;
  RenderOptions options;
};

Case make_case(Graph graph);

// f(name, parameter numbers, gradient numbers) for every group of both sets, both networks, the map and the
// camera.
template <class F>
void for_each_group(reference::Parameters& p, reference::Gradient& g, const F& f) {
  const auto surfels = [&](const std::string& set, BasicSurfels<double>& a, BasicSurfels<double>& b) {
    std::vector<Tensor<double>*> gradients;
    b.for_each([&](const std::string&, Tensor<double>& t) { gradients.push_back(&t); });
    size_t k = 0;
    a.for_each([&](const std::string& name, Tensor<double>& t) {
      f(set + "." + name, t.values(), gradients[k++]->values());
    });
  };
  const auto field = [&](const std::string& name, BasicField<double>& a, BasicField<double>& b) {
    std::vector<Tensor<double>*> gradients;
    b.for_each([&](const std::string&, Tensor<double>& t) { gradients.push_back(&t); });
    size_t k = 0;
    a.for_each([&](const std::string& tensor, Tensor<double>& t) {
      f(name + "." + tensor, t.values(), gradients[k++]->values());
    });
  };
  surfels("main", p.main, g.main);
  field("main_field", p.main_field, g.main_field);
  if (p.map) f(std::string("map.logit"), p.map->logit.values(), g.map.logit.values());
  if (p.map && p.map->field) {
    field("map.field", *p.map->field, *g.map.field);
  } else {
    surfels("environment", p.environment, g.environment);
    field("environment_field", p.environment_field, g.environment_field);
  }
  const auto nine = [](Mat3<double>& m) { return std::span<double>(&m[0][0], 9); };
  f(std::string("camera.rotation"), nine(p.camera.camera_from_world), nine(g.camera.camera_from_world));
  f(std::string("camera.position"), std::span<double>(&p.camera.position[0], 3),
    std::span<double>(&g.camera.position[0], 3));
}

// The renderer's gradient of the reference's loss by the case's parameters, computed on a device; the numbers
// of all groups one after the other, in the order of for_each_group.
std::vector<float> renderer_gradient(const Case& c, Device device);

// Each group of it agrees with the reference's to 2e-3 of the group's largest.
void expect_agreement_with_reference(Graph graph, Device device);

}  // namespace traceflow::whole_graph
