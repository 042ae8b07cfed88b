#include "scene/scene_file.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "files/json_document.h"

namespace traceflow {

namespace {

using Json = nlohmann::json;

constexpr const char* specular_names[] = {"none", "environment-gaussians", "environment-map"};

// Visitors that convert a network's shape to JSON and back.
struct ToJson {
  Json& json;
  template <class T>
  void field(const char* name, const T& value, const char*, const char*) {
    json[name] = value;
  }
};
struct FromJson {
  const JsonField& json;
  void field(const char* name, int& value, const char*, const char*) {
    value = static_cast<int>(json[name].whole(0, 1 << 20));
  }
};

// Returns the network's shape.
Json put_field(const Field& field, const std::string& prefix, Safetensors& file) {
  Json json = Json::object();
  NetworkOptions shape = field.shape;
  ToJson visitor{json};
  shape.visit(visitor);
  json["outputs"] = field.outputs();
  field.for_each(
      [&](const std::string& name, const Tensor<float>& tensor) { file.add(prefix + name, tensor); });
  return json;
}

// A tensor that must have this shape. The shape from the file is checked, so no more memory is allocated than
// the file has data.
Tensor<float> take(const Safetensors& file, const std::string& name, const Shape& shape) {
  Tensor<float> stored = file.tensor<float>(name);
  if (stored.shape() != shape)
    throw InputError(file.origin(), name, "shape " + stored.shape().to_string(), shape.to_string());
  return stored;
}

Field get_field(const JsonField& json, int outputs, const std::string& prefix, const Safetensors& file) {
  Field field;
  FromJson visitor{json};
  field.shape.visit(visitor);
  try {
    field.shape.validate();
  } catch (const InputError& error) {
    json.fail(error.what(), "the shape of a network");
  }
  if (json["outputs"].json() != outputs) json["outputs"].expect(std::to_string(outputs));
  for (int layer = 0; layer < field.shape.depth; ++layer) {
    const std::string number = std::to_string(layer);
    field.weight.push_back(
        take(file, prefix + "weight" + number, {field.shape.width, field.shape.layer_inputs(layer)}));
    field.bias.push_back(take(file, prefix + "bias" + number, {field.shape.width}));
  }
  field.head_weight = take(file, prefix + "head_weight", {outputs, field.shape.width});
  field.head_bias = take(file, prefix + "head_bias", {outputs});
  return field;
}

Surfels get_surfels(const std::string& prefix, const Safetensors& file) {
  Surfels surfels;
  surfels.position = file.tensor<float>(prefix + "position");
  const int64_t n = surfels.position.shape().rank() == 2 ? surfels.position.dim(0) : -1;
  surfels.sh = file.tensor<float>(prefix + "sh");
  const int64_t k = surfels.sh.shape().rank() == 3 ? surfels.sh.dim(1) : -1;
  const bool has_degree = k == 1 || k == 4 || k == 9 || k == 16;
  if (n < 0 || !has_degree || surfels.position.shape() != Shape{n, 3} ||
      surfels.sh.shape() != Shape{n, k, 3}) {
    throw InputError(
        file.origin(), prefix,
        "shapes " + surfels.position.shape().to_string() + " and " + surfels.sh.shape().to_string(),
        "N×3 positions and N×K×3 harmonics, K of 1, 4, 9 or 16");
  }
  for_each_field(
      [&](const SurfelField& field, Tensor<float>& tensor) {
        const std::string name = prefix + std::string(field.name);
        if (field.name == "position" || field.name == "sh") return;  // read above
        if (field.is_optional && !file.has(name)) return;
        tensor = take(file, name, field.width == 1 ? Shape{n} : Shape{n, field.width});
      },
      surfels);
  return surfels;
}

void put_motion(const Motion& motion, const Tensor<int32_t>& body, Safetensors& file) {
  file.add("scene/main/body", body);
  file.add("scene/motion/time", motion.time);
  file.add("scene/motion/centre", motion.centre);
  file.add("scene/motion/rotation", motion.rotation);
  file.add("scene/motion/shift", motion.shift);
}

void get_motion(const Safetensors& file, Scene& scene) {
  Motion motion;
  motion.time = file.tensor<float>("scene/motion/time");
  motion.centre = file.tensor<float>("scene/motion/centre");
  const int64_t bodies = motion.centre.shape().rank() == 2 ? motion.centre.dim(0) : -1;
  const int64_t keys = motion.time.shape().rank() == 1 ? motion.time.dim(0) : -1;
  const bool ascends = std::is_sorted(motion.time.data(), motion.time.data() + motion.time.size());
  if (bodies < 1 || keys < 1 || motion.centre.shape() != Shape{bodies, 3} || !ascends) {
    throw InputError(
        file.origin(), "scene/motion",
        "shapes " + motion.centre.shape().to_string() + " and " + motion.time.shape().to_string(),
        "B×3 centres of bodies and K ascending times");
  }
  motion.rotation = take(file, "scene/motion/rotation", {bodies, keys, 4});
  motion.shift = take(file, "scene/motion/shift", {bodies, keys, 3});
  scene.main.body = file.tensor<int32_t>("scene/main/body");
  bool fits = scene.main.body.shape() == Shape{scene.main.count()};
  for (const int32_t body : scene.main.body.values()) fits = fits && body >= motionless && body < bodies;
  if (!fits) {
    throw InputError(file.origin(), "scene/main/body", scene.main.body.shape().to_string(),
                     "for each main surfel a body from -2 to " + std::to_string(bodies - 1));
  }
  scene.main_motion = std::move(motion);
}

void put_nodes(const Nodes& nodes, Safetensors& file) {
  file.add("scene/nodes/body", nodes.body);
  file.add("scene/nodes/time", nodes.time);
  file.add("scene/nodes/centre", nodes.centre);
  file.add("scene/nodes/radius", nodes.radius);
  file.add("scene/nodes/turn", nodes.turn);
  file.add("scene/nodes/shift", nodes.shift);
  file.add("scene/nodes/anchor", nodes.anchor);
}

Nodes get_nodes(const Safetensors& file, int64_t bodies) {
  Nodes nodes;
  nodes.body = file.tensor<int32_t>("scene/nodes/body");
  nodes.time = file.tensor<float>("scene/nodes/time");
  const int64_t count = nodes.body.shape().rank() == 1 ? nodes.body.size() : -1;
  const int64_t times = nodes.time.shape().rank() == 1 ? nodes.time.size() : -1;
  bool fits =
      count > 0 && times > 0 && std::is_sorted(nodes.time.data(), nodes.time.data() + nodes.time.size());
  for (const int32_t body : nodes.body.values()) fits = fits && body >= 0 && body < bodies;
  if (!fits) {
    throw InputError(file.origin(), "scene/nodes",
                     "shapes " + nodes.body.shape().to_string() + " and " + nodes.time.shape().to_string(),
                     "N bodies from 0 to " + std::to_string(bodies - 1) + " and L ascending times");
  }
  nodes.centre = take(file, "scene/nodes/centre", {count, 3});
  nodes.radius = take(file, "scene/nodes/radius", {count});
  for (const float radius : nodes.radius.values()) {
    if (!(radius > 0)) throw InputError(file.origin(), "scene/nodes/radius", number_text(radius), "above 0");
  }
  nodes.turn = take(file, "scene/nodes/turn", {count, times, 3});
  nodes.shift = take(file, "scene/nodes/shift", {count, times, 3});
  nodes.anchor = take(file, "scene/nodes/anchor", {count, times, 3});
  return nodes;
}

void put_lighting(const Lighting& lighting, Safetensors& file) {
  file.add("scene/lighting/box", lighting.box);
  file.add("scene/lighting/time", lighting.time);
  file.add("scene/lighting/brightness", lighting.brightness);
  if (lighting.bodies() == 0) return;
  file.add("scene/lighting/middle", lighting.centre);
  file.add("scene/lighting/radius", lighting.radius);
  file.add("scene/lighting/body_brightness", lighting.body_brightness);
}

Lighting get_lighting(const Safetensors& file, int64_t bodies) {
  constexpr int64_t most_points = 1 << 24;  // cells are counted in 32 bits
  Lighting lighting;
  lighting.box = take(file, "scene/lighting/box", {2, 3});
  lighting.time = file.tensor<float>("scene/lighting/time");
  lighting.brightness = file.tensor<float>("scene/lighting/brightness");
  const Shape& shape = lighting.brightness.shape();
  bool fits = lighting.time.shape().rank() == 1 && lighting.times() > 0 && shape.rank() == 4 &&
              shape[0] == lighting.times() &&
              std::is_sorted(lighting.time.data(), lighting.time.data() + lighting.times());
  for (int axis = 1; fits && axis < 4; ++axis) fits = shape[axis] >= 3 && shape[axis] <= most_points;
  if (!fits || lighting.points() > most_points) {
    throw InputError(file.origin(), "scene/lighting",
                     "shapes " + lighting.time.shape().to_string() + " and " + shape.to_string(),
                     "L ascending times and L×Z×Y×X numbers, Z, Y, X of 3 or more");
  }
  for (int64_t axis = 0; axis < 3; ++axis) {
    if (!(lighting.box(0, axis) < lighting.box(1, axis)))
      throw InputError(file.origin(), "scene/lighting/box", number_text(lighting.box(0, axis)),
                       "below " + number_text(lighting.box(1, axis)));
  }
  if (!file.has("scene/lighting/radius")) return lighting;
  lighting.radius = take(file, "scene/lighting/radius", {bodies});
  for (const float radius : lighting.radius.values()) {
    if (!(radius > 0))
      throw InputError(file.origin(), "scene/lighting/radius", number_text(radius), "above 0");
  }
  lighting.centre = take(file, "scene/lighting/middle", {bodies, lighting.times(), 3});
  lighting.body_brightness = take(file, "scene/lighting/body_brightness", {bodies, lighting.times(), 4});
  return lighting;
}

EnvironmentMap get_map(const JsonField& json, const Safetensors& file) {
  EnvironmentMap map;
  map.logit = file.tensor<float>("scene/map/logit");
  const int64_t side = map.logit.shape().rank() == 3 ? map.logit.dim(1) : 0;
  if (side < 1 || map.logit.shape() != Shape{6 * side, side, 3}) {
    throw InputError(file.origin(), "scene/map/logit", "shape " + map.logit.shape().to_string(),
                     "six square faces of three colours");
  }
  if (json.has("map_field")) map.field = get_field(json["map_field"], 3, "scene/map/field/", file);
  return map;
}

Specular specular_from(const JsonField& name) {
  for (int i = 0; i < 3; ++i) {
    if (name.text() == specular_names[i]) return static_cast<Specular>(i);
  }
  name.expect("none, environment-gaussians or environment-map");
}

Scene scene_from(const JsonField& json, const Safetensors& file) {
  // Limits of lengths, so that single precision can hold them.
  constexpr double largest = 1e12, smallest = 1e-12;
  Scene scene;
  scene.specular = specular_from(json["specular"]);
  scene.normalisation = {json["centre"].vector(), json["scale"].number(smallest, largest)};
  scene.extent = static_cast<float>(json["extent"].number(smallest, largest));
  if (json.has("focal")) scene.focal = static_cast<float>(json["focal"].number(0, largest));
  scene.main_max_displacement[0] = static_cast<float>(json["main_reach"].number(0, largest));
  scene.main = get_surfels("scene/main/", file);
  if (json["environment"].yes()) scene.environment = get_surfels("scene/environment/", file);
  if (json.has("main_field"))
    scene.main_field = get_field(json["main_field"], residual::main_outputs, "scene/main_field/", file);
  if (json.has("motion") && json["motion"].yes()) get_motion(file, scene);
  if (scene.main_motion && json.has("nodes") && json["nodes"].yes())
    scene.main_nodes = get_nodes(file, scene.main_motion->bodies());
  if (json.has("lighting") && json["lighting"].yes()) {
    scene.lighting = get_lighting(file, scene.main_motion ? scene.main_motion->bodies() : 0);
  }
  if (json.has("environment_field")) {
    scene.environment_field =
        get_field(json["environment_field"], residual::environment_outputs, "scene/environment_field/", file);
  }
  if (json["map"].yes()) scene.environment_map = get_map(json, file);
  return scene;
}

}  // namespace

void put_scene(const Scene& scene, Safetensors& file) {
  Json json = Json::object();
  json["specular"] = specular_names[static_cast<int>(scene.specular)];
  const Vec3<double>& centre = scene.normalisation.centre;
  json["centre"] = std::array<double, 3>{centre.x, centre.y, centre.z};
  json["scale"] = scene.normalisation.scale;
  json["extent"] = scene.extent;
  json["focal"] = scene.focal;
  json["main_reach"] = scene.main_max_displacement.on(Device::cpu)[0];
  json["environment"] = scene.environment.count() > 0;
  json["map"] = scene.environment_map.has_value();
  put_surfels(scene.main, "scene/main/", file);
  if (scene.environment.count() > 0) put_surfels(scene.environment, "scene/environment/", file);
  json["motion"] = scene.main_motion.has_value();
  if (scene.main_motion) put_motion(*scene.main_motion, scene.main.body, file);
  json["nodes"] = scene.main_nodes.has_value();
  if (scene.main_nodes) put_nodes(*scene.main_nodes, file);
  json["lighting"] = scene.lighting.has_value();
  if (scene.lighting) put_lighting(*scene.lighting, file);
  if (scene.main_field) json["main_field"] = put_field(*scene.main_field, "scene/main_field/", file);
  if (scene.environment_field)
    json["environment_field"] = put_field(*scene.environment_field, "scene/environment_field/", file);
  if (scene.environment_map) {
    file.add("scene/map/logit", scene.environment_map->logit);
    if (scene.environment_map->field)
      json["map_field"] = put_field(*scene.environment_map->field, "scene/map/field/", file);
  }
  file.metadata["scene"] = json.dump();
}

Scene get_scene(const Safetensors& file) {
  const auto found = file.metadata.find("scene");
  if (found == file.metadata.end()) {
    throw InputError(file.origin(), "scene", "no such metadata", "a checkpoint written by traceflow train");
  }
  return scene_from(JsonDocument(file.origin() + ": scene", found->second), file);
}

}  // namespace traceflow
