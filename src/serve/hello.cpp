#include "serve/hello.h"

#include <nlohmann/json.hpp>

#include "base/version.h"
#include "serve/look_camera.h"
#include "show/cameras/look_at.h"
#include "show/cameras/orbit.h"
#include "show/colour_map.h"
#include "show/layers.h"

namespace traceflow::serve {

namespace {

using Json = nlohmann::ordered_json;

Json captured_json(const CapturedCamera& view, const SceneNormalisation& normalisation) {
  Json json = to_json(viewpoint_of(view.camera, normalisation));
  json["id"] = view.id;
  json["time"] = view.time;
  json["width"] = view.camera.width;
  json["height"] = view.camera.height;
  json["centre"] = {view.camera.centre_x / static_cast<float>(view.camera.width),
                    view.camera.centre_y / static_cast<float>(view.camera.height)};
  return json;
}

Json captured_json(const std::vector<CapturedCamera>& views, const SceneNormalisation& normalisation) {
  Json list = Json::array();
  for (const CapturedCamera& view : views) list.push_back(captured_json(view, normalisation));
  return list;
}

Json layers(bool with_photographs) {
  Json list = Json::array();
  for (size_t i = 0; i < show::layer_names.size(); ++i) {
    list.push_back({{"name", show::layer_names[i]},
                    {"kind", show::has_colours(static_cast<show::Layer>(i)) ? "colour" : "number"}});
  }
  if (with_photographs) list.push_back({{"name", "difference"}, {"kind", "number"}});
  return list;
}

// Where to look from first, and at what.
struct Start {
  Camera<float> camera;
  show::Aim aim;
};

Start start_of(const Stage& stage, const Setting& setting) {
  std::vector<Camera<float>> cameras;
  for (const CapturedCamera& view : setting.train) cameras.push_back(view.camera);
  for (const CapturedCamera& view : setting.test) cameras.push_back(view.camera);
  if (!cameras.empty()) return {cameras.front(), show::aim_of(cameras)};
  const Tensor<float> points = stage.scene.main.position.on(Device::cpu);
  Start start{show::orbit_around_points(points, 16, 9, 1).front().camera, {}};
  start.aim.target = show::median_point(points);
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

std::string hello_text(const Stage& stage, const Setting& setting) {
  const Scene& scene = stage.scene;
  const SceneNormalisation& normalisation = scene.normalisation;
  const Start start = start_of(stage, setting);
  Json maps = Json::array();
  for (const std::string_view name : enum_names(show::ColourMap{})) maps.push_back(std::string(name));
  const Json hello = {{"type", "hello"},
                      {"version", version()},
                      {"source", setting.source},
                      {"name", setting.name},
                      {"capture", setting.capture != nullptr ? setting.capture->name : ""},
                      {"device", name_of(scene.device())},
                      {"moves", scene.main_field.has_value() || scene.main_motion.has_value() ||
                                    scene.environment_field.has_value()},
                      {"layers", layers(setting.capture != nullptr)},
                      {"maps", std::move(maps)},
                      {"cameras",
                       {{"train", captured_json(setting.train, normalisation)},
                        {"test", captured_json(setting.test, normalisation)}}},
                      {"start", to_json(viewpoint_of(start.camera, normalisation))},
                      {"target", to_json(normalisation.in_capture(start.aim.target))},
                      {"up", to_json(start.aim.up)},
                      {"extent", scene.extent / normalisation.scale}};
  return hello.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace traceflow::serve
