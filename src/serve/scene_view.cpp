#include "serve/scene_view.h"

#include "scene/viewpoint.h"

namespace traceflow::serve {

namespace {

std::vector<CapturedCamera> cameras_of(const std::vector<View>& views, const SceneNormalisation& capture,
                                       const SceneNormalisation& scene) {
  std::vector<CapturedCamera> cameras;
  cameras.reserve(views.size());
  for (const View& view : views)
    cameras.push_back({view.id, view.time, renormalised(view.camera, capture, scene)});
  return cameras;
}

}  // namespace

SceneInfo make_scene_info(std::string source, std::string name, const Capture* capture,
                          const SceneNormalisation& scene) {
  SceneInfo info{std::move(source), std::move(name), capture, {}, {}, {}};
  if (capture == nullptr) return info;
  info.train = cameras_of(capture->train, capture->normalisation, scene);
  info.test = cameras_of(capture->test, capture->normalisation, scene);
  info.times = times_of(*capture);
  return info;
}

}  // namespace traceflow::serve
