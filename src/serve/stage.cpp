#include "serve/stage.h"

namespace traceflow::serve {

namespace {

std::vector<CapturedCamera> cameras_of(const std::vector<View>& views, const SceneNormalisation& capture,
                                       const SceneNormalisation& scene) {
  const bool same = capture.centre == scene.centre && capture.scale == scene.scale;
  std::vector<CapturedCamera> cameras;
  for (const View& view : views) {
    cameras.push_back({view.id, view.time, view.camera});
    if (same) continue;
    Vec3<float>& position = cameras.back().camera.position;
    const Vec3<double> in_capture = Vec3<double>(position) / capture.scale + capture.centre;
    position = Vec3<float>((in_capture - scene.centre) * scene.scale);
  }
  return cameras;
}

}  // namespace

Setting make_setting(std::string source, std::string name, const Capture* capture,
                     const SceneNormalisation& scene) {
  Setting setting{std::move(source), std::move(name), capture, {}, {}};
  if (capture == nullptr) return setting;
  setting.train = cameras_of(capture->train, capture->normalisation, scene);
  setting.test = cameras_of(capture->test, capture->normalisation, scene);
  return setting;
}

}  // namespace traceflow::serve
