#include "scene/scene_file.h"

#include <nlohmann/json.hpp>

namespace traceflow {

namespace {

using Json = nlohmann::json;

constexpr const char* specular_names[] = {"none", "environment-gaussians", "environment-map"};

// Visitors that carry a network's shape into JSON and back.
struct ToJson {
  Json& json;
  template <class T>
  void field(const char* name, const T& value, const char*, const char*) {
    json[name] = value;
  }
};
struct FromJson {
  const Json& json;
  template <class T>
  void field(const char* name, T& value, const char*, const char*) {
    value = json.at(name).get<T>();
  }
};

void put_field(const Field& field, const std::string& prefix, Safetensors& file, Json& json) {
  NetworkOptions shape = field.shape;
  ToJson visitor{json};
  shape.visit(visitor);
  json["outputs"] = field.outputs();
  field.for_each(
      [&](const std::string& name, const Tensor<float>& tensor) { file.add(prefix + name, tensor); });
}

void read_into(Tensor<float>& tensor, const std::string& name, const Safetensors& file) {
  Tensor<float> stored = file.tensor<float>(name);
  if (stored.shape() != tensor.shape()) {
    throw InputError("checkpoint", name, "shape " + stored.shape().to_string(), tensor.shape().to_string());
  }
  tensor = std::move(stored);
}

Field get_field(const Json& json, const std::string& prefix, const Safetensors& file) {
  NetworkOptions shape;
  FromJson visitor{json};
  shape.visit(visitor);
  Random unused(0);
  Field field = make_field(shape, json.at("outputs").get<int>(), unused);
  field.for_each(
      [&](const std::string& name, Tensor<float>& tensor) { read_into(tensor, prefix + name, file); });
  return field;
}

Surfels get_surfels(const std::string& prefix, const Safetensors& file) {
  Surfels surfels;
  surfels.position = file.tensor<float>(prefix + "position");
  const int64_t n = surfels.position.shape().rank() == 2 ? surfels.position.dim(0) : -1;
  surfels.sh = file.tensor<float>(prefix + "sh");
  const int64_t k = surfels.sh.shape().rank() == 3 ? surfels.sh.dim(1) : -1;
  if (n < 0 || k < 1 || surfels.position.shape() != Shape{n, 3} || surfels.sh.shape() != Shape{n, k, 3}) {
    throw InputError(
        "checkpoint", prefix,
        "shapes " + surfels.position.shape().to_string() + " and " + surfels.sh.shape().to_string(),
        "N×3 positions and N×K×3 harmonics");
  }
  surfels.log_scale = Tensor<float>(Shape{n, 2});
  surfels.rotation = Tensor<float>(Shape{n, 4});
  surfels.opacity_logit = Tensor<float>(Shape{n});
  read_into(surfels.log_scale, prefix + "log_scale", file);
  read_into(surfels.rotation, prefix + "rotation", file);
  read_into(surfels.opacity_logit, prefix + "opacity_logit", file);
  if (file.has(prefix + "tint_logit")) {
    surfels.tint_logit = Tensor<float>(Shape{n});
    read_into(surfels.tint_logit, prefix + "tint_logit", file);
  }
  return surfels;
}

Specular specular_from(const std::string& name) {
  for (int i = 0; i < 3; ++i) {
    if (name == specular_names[i]) return static_cast<Specular>(i);
  }
  throw InputError("checkpoint", "scene.specular", name, "none, environment-gaussians or environment-map");
}

Scene scene_from(const Json& json, const Safetensors& file) {
  Scene scene;
  scene.specular = specular_from(json.at("specular").get<std::string>());
  const auto centre = json.at("centre").get<std::array<double, 3>>();
  scene.normalisation = {{centre[0], centre[1], centre[2]}, json.at("scale").get<double>()};
  scene.extent = json.at("extent").get<float>();
  scene.main_reach[0] = json.at("main_reach").get<float>();
  scene.main = get_surfels("scene/main/", file);
  if (json.at("environment").get<bool>()) scene.environment = get_surfels("scene/environment/", file);
  if (json.contains("main_field"))
    scene.main_field = get_field(json["main_field"], "scene/main_field/", file);
  if (json.contains("environment_field")) {
    scene.environment_field = get_field(json["environment_field"], "scene/environment_field/", file);
  }
  if (json.at("map").get<bool>()) {
    scene.environment_map.emplace();
    scene.environment_map->logit = file.tensor<float>("scene/map/logit");
    if (json.contains("map_field"))
      scene.environment_map->field = get_field(json["map_field"], "scene/map/field/", file);
  }
  return scene;
}

}  // namespace

void put_scene(const Scene& scene, Safetensors& file) {
  Json json;
  json["specular"] = specular_names[static_cast<int>(scene.specular)];
  const Vec3<double>& centre = scene.normalisation.centre;
  json["centre"] = std::array<double, 3>{centre.x, centre.y, centre.z};
  json["scale"] = scene.normalisation.scale;
  json["extent"] = scene.extent;
  json["main_reach"] = scene.main_reach.on(Device::cpu)[0];
  json["environment"] = scene.environment.count() > 0;
  json["map"] = scene.environment_map.has_value();
  put_surfels(scene.main, "scene/main/", file);
  if (scene.environment.count() > 0) put_surfels(scene.environment, "scene/environment/", file);
  if (scene.main_field) put_field(*scene.main_field, "scene/main_field/", file, json["main_field"]);
  if (scene.environment_field) {
    put_field(*scene.environment_field, "scene/environment_field/", file, json["environment_field"]);
  }
  if (scene.environment_map) {
    file.add("scene/map/logit", scene.environment_map->logit);
    if (scene.environment_map->field)
      put_field(*scene.environment_map->field, "scene/map/field/", file, json["map_field"]);
  }
  file.metadata["scene"] = json.dump();
}

Scene get_scene(const Safetensors& file) {
  const auto found = file.metadata.find("scene");
  if (found == file.metadata.end()) {
    throw InputError("checkpoint", "scene", "no such metadata", "a checkpoint written by traceflow train");
  }
  try {
    return scene_from(Json::parse(found->second), file);
  } catch (const Json::exception& error) {
    throw InputError("checkpoint", "scene", error.what(), "the metadata that traceflow train writes");
  }
}

}  // namespace traceflow
