#include "serve/hello.h"

#include <nlohmann/json.hpp>

#include "base/version.h"
#include "serve/view_camera.h"
#include "viz/cameras/look_at.h"
#include "viz/cameras/orbit.h"
#include "viz/colour_map.h"
#include "viz/layers.h"

namespace traceflow::serve {

namespace {

using Json = nlohmann::ordered_json;

Json captured_json(const CapturedCamera& captured, const SceneNormalisation& normalisation) {
  Json json = to_json(viewpoint_of(captured.camera, normalisation));
  json["id"] = captured.id;
  json["time"] = captured.time;
  json["width"] = captured.camera.width;
  json["height"] = captured.camera.height;
  json["centre"] = {captured.camera.centre_x / static_cast<float>(captured.camera.width),
                    captured.camera.centre_y / static_cast<float>(captured.camera.height)};
  return json;
}

Json captured_json(const std::vector<CapturedCamera>& cameras, const SceneNormalisation& normalisation) {
  Json list = Json::array();
  for (const CapturedCamera& captured : cameras) list.push_back(captured_json(captured, normalisation));
  return list;
}

Json layers(bool with_photographs) {
  Json list = Json::array();
  for (size_t i = 0; i < viz::layer_names.size(); ++i) {
    list.push_back({{"name", viz::layer_names[i]},
                    {"kind", viz::has_colours(static_cast<viz::Layer>(i)) ? "colour" : "number"}});
  }
  if (with_photographs) list.push_back({{"name", "difference"}, {"kind", "number"}});
  return list;
}

// The page's first camera.
struct Start {
  Camera<float> camera;
  viz::Aim aim;
};

Start start_of(const SceneView& view, const SceneInfo& info) {
  std::vector<Camera<float>> cameras;
  for (const CapturedCamera& captured : info.train) cameras.push_back(captured.camera);
  for (const CapturedCamera& captured : info.test) cameras.push_back(captured.camera);
  if (!cameras.empty()) return {cameras.front(), viz::aim_of(cameras)};
  const Tensor<float> points = view.scene.main.position.on(Device::cpu);
  Start start{viz::orbit_around_points(points, 16, 9, 1).front().camera, {}};
  start.aim.target = viz::median_point(points);
  return start;
}

}  // namespace

Json to_json(const Vec3<double>& v) { return {v.x, v.y, v.z}; }

Json to_json(const Viewpoint& camera) {
  const Mat3<double> rows = transpose(camera.world_from_camera);
  return {{"position", to_json(camera.position)},
          {"rotation", {to_json(rows[0]), to_json(rows[1]), to_json(rows[2])}},
          {"fov_y", camera.fov_y}};
}

std::string hello_text(const SceneView& view, const SceneInfo& info) {
  const Scene& scene = view.scene;
  const SceneNormalisation& normalisation = scene.normalisation;
  const Start start = start_of(view, info);
  Json maps = Json::array();
  for (const std::string_view name : enum_names(viz::ColourMap{})) maps.push_back(std::string(name));
  const Json hello = {{"type", "hello"},
                      {"version", version()},
                      {"source", info.source},
                      {"name", info.name},
                      {"capture", info.capture != nullptr ? info.capture->name : ""},
                      {"device", name_of(scene.device())},
                      {"moves", scene.main_field.has_value() || scene.main_motion.has_value() ||
                                    scene.environment_field.has_value()},
                      {"layers", layers(info.capture != nullptr)},
                      {"maps", std::move(maps)},
                      {"cameras",
                       {{"train", captured_json(info.train, normalisation)},
                        {"test", captured_json(info.test, normalisation)}}},
                      {"start", to_json(viewpoint_of(start.camera, normalisation))},
                      {"target", to_json(normalisation.in_capture(start.aim.target))},
                      {"up", to_json(start.aim.up)},
                      {"extent", scene.extent / normalisation.scale}};
  return hello.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace traceflow::serve
