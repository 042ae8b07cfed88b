#include "serve/stage.h"

#include "scene/viewpoint.h"

namespace traceflow::serve {

namespace {

std::vector<CapturedCamera> cameras_of(const std::vector<View>& views, const SceneNormalisation& capture,
                                       const SceneNormalisation& scene) {
  std::vector<CapturedCamera> cameras;
  cameras.reserve(views.size());
  for (const View& view : views)
    cameras.push_back({view.id, view.time, carried(view.camera, capture, scene)});
  return cameras;
}

}  // namespace

Setting make_setting(std::string source, std::string name, const Capture* capture,
                     const SceneNormalisation& scene) {
  Setting setting{std::move(source), std::move(name), capture, {}, {}, {}};
  if (capture == nullptr) return setting;
  setting.train = cameras_of(capture->train, capture->normalisation, scene);
  setting.test = cameras_of(capture->test, capture->normalisation, scene);
  setting.times = times_of(*capture);
  return setting;
}

}  // namespace traceflow::serve
