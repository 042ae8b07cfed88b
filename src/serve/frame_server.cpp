#include "serve/frame_server.h"

#include <nlohmann/json.hpp>

#include "base/clock.h"
#include "base/machine.h"
#include "capture/lens/resample.h"
#include "files/jpeg.h"
#include "files/png.h"
#include "render/samples.h"
#include "serve/hello.h"
#include "serve/view_camera.h"
#include "viz/cameras/camera_path.h"
#include "viz/probe.h"

namespace traceflow::serve {

namespace {

using Json = nlohmann::ordered_json;

constexpr const char* about_memory = "memory";  // key of a warning
// Upper limit for a frame with all its layers.
constexpr int64_t bytes_per_pixel = 300;
constexpr int64_t max_previewed_frames = 20'000;  // frames of a camera path
constexpr int photo_quality = 90;
// How fast the ranges of depth and distortion adapt: within about ten frames.
constexpr float follow = 0.25F;

// Averages over the area of each new pixel.
Tensor<float> fitted(const Tensor<float>& image, int64_t width, int64_t height) {
  if (image.dim(0) == height && image.dim(1) == width) return image;
  return resample(image, {width, height, static_cast<double>(image.dim(1)) / static_cast<double>(width),
                          static_cast<double>(image.dim(0)) / static_cast<double>(height)});
}

// A new pixel is known if all stored pixels below it are known.
Tensor<uint8_t> fitted_known(const Tensor<uint8_t>& known, int64_t width, int64_t height) {
  if (known.empty() || (known.dim(0) == height && known.dim(1) == width)) return known;
  constexpr float whole = 0.999F;
  Tensor<float> share({known.dim(0), known.dim(1), 1});
  for (int64_t i = 0; i < share.size(); ++i) share[i] = known[i];
  share = fitted(share, width, height);
  Tensor<uint8_t> result({height, width});
  for (int64_t i = 0; i < result.size(); ++i) result[i] = share[i] > whole ? 1 : 0;
  return result;
}

bool shows_reflections(const std::string& layer) {
  const auto* const known = std::find(viz::layer_names.begin(), viz::layer_names.end(), layer);
  return known == viz::layer_names.end() ||
         viz::needs_reflections(static_cast<viz::Layer>(known - viz::layer_names.begin()));
}

viz::Layer layer_named(const std::string& name) {
  const std::vector<viz::Layer> layers = viz::parse_layers(name);
  if (layers.size() != 1) throw InputError("message", "layer", name, "one layer");
  return layers[0];
}

// The system may promise memory that it does not have and then kill the program, perhaps with its training.
void check_memory_for(const FrameRequest& request, const SceneView& view) {
  const int64_t samples =
      samples::samples_for(request.camera, view.render.samples, view.scene.focal, request.most_samples);
  const int64_t wanted = bytes_per_pixel * samples * samples * request.camera.width * request.camera.height;
  if (view.scene.device() == Device::cpu && wanted > memory_available() / 2) throw std::bad_alloc();
}

Json vector_json(const Vec3<float>& v) { return to_json(Vec3<double>(v)); }

Json probe_json(int64_t id, const std::optional<viz::ProbeResult>& found) {
  Json json = {{"type", "probe"}, {"id", id}, {"hit", found.has_value()}};
  if (!found) return json;
  json["surface"] = vector_json(found->surface);
  json["normal"] = vector_json(found->normal);
  json["depth"] = found->depth;
  json["alpha"] = found->alpha;
  json["tint"] = found->tint;
  json["colour"] = vector_json(found->colour);
  json["diffuse"] = vector_json(found->diffuse);
  json["specular"] = vector_json(found->specular);
  if (found->mirrored) {
    json["mirrored"] = {{"direction", vector_json(found->mirrored->direction)},
                        {"end", vector_json(found->mirrored->end)},
                        {"distance", found->mirrored->distance},
                        {"alpha", found->mirrored->alpha}};
  }
  return json;
}

}  // namespace

void FrameServer::send_hello(const SceneView& view) { clients_.set_hello(hello_text(view, info_)); }

void FrameServer::scene_changed(Device device) {
  posed_ = false;
  follower_.reset();
  if (device == Device::cuda) forget();
}

void FrameServer::forget() {
  renderer_ = nullptr;
  follower_.reset();
  posed_ = false;
}

Renderer& FrameServer::renderer(const SceneView& view) {
  if (!renderer_) renderer_ = std::make_unique<Renderer>(view.render);
  renderer_->options() = view.render;  // a training may change them
  return *renderer_;
}

viz::Tracks FrameServer::tracks(const FrameRequest& request, const SceneView& view) {
  if (!follower_) follower_.emplace(view.scene, view.request, view.render, info_.times);
  return follower_->at(view.scene, request.time);
}

void FrameServer::answer(const Job& job, const SceneView& view) {
  try {
    std::visit([&](const auto& what) { answer(job, what, view); }, job.what);
    if (!clients_.any_lacks_memory()) clients_.set_warning(about_memory, "");
  } catch (const std::bad_alloc& error) {
    forget();
    // Only the device's error has numbers.
    const auto* const device = dynamic_cast<const memory::OutOfMemory*>(&error);
    const std::string why = "No memory for a picture of this size" +
                            (device == nullptr ? "." : ": " + std::string(device->what()));
    if (std::holds_alternative<FrameJob>(job.what)) {
      clients_.no_memory_for(job);
      clients_.set_warning(about_memory, why);
    } else {
      clients_.refuse(job, why);
    }
  } catch (const std::exception& error) {
    clients_.refuse(job, error.what());
  }
  std::erase_if(painters_, [&](const auto& entry) { return !clients_.is_connected(entry.first); });
}

FrameRequest FrameServer::request_for(const ViewRequest& view_request, const SceneView& view,
                                      double divisor) const {
  FrameRequest request = view.request;
  request.camera = camera_of(view_request, info_, view.scene.normalisation, divisor);
  request.time = view_request.time;
  request.reuse_pose = posed_;
  request.specular = view.request.specular && shows_reflections(view_request.layer);
  return request;
}

std::shared_ptr<const ViewImages> FrameServer::photograph(const PhotoRef& photo) const {
  if (info_.capture == nullptr) throw InputError("message", "photo", "a scene without photographs", "a run");
  captured(photo, info_);
  const std::vector<View>& views = photo.test ? info_.capture->test : info_.capture->train;
  return load_images(*info_.capture, views.at(static_cast<size_t>(photo.index)));
}

Tensor<uint8_t> FrameServer::picture(const ViewRequest& view_request, const FrameRequest& request,
                                     const SceneView& view, viz::Painter& painter) {
  painter.options() = {viz::parse_colour_map(view_request.map), view_request.exposure,
                       view_request.moving ? follow : 1};
  const bool difference = view_request.layer == "difference";
  const auto* photo = std::get_if<PhotoRef>(&view_request.camera);
  if (difference && photo == nullptr) throw InputError("message", "layer", "difference", "a captured camera");
  const viz::Layer layer = difference ? viz::Layer::rgb : layer_named(view_request.layer);

  const Frame& frame = renderer(view).forward(view.scene, request);
  posed_ = true;
  if (!difference) {
    const viz::Tracks paths = layer == viz::Layer::tracks ? tracks(request, view) : viz::Tracks();
    return viz::in_colour(
        painter.paint(layer, viz::layer_values(frame, layer, view.scene.normalisation.scale, paths)));
  }
  const std::shared_ptr<const ViewImages> images = photograph(*photo);
  const int64_t width = request.camera.width, height = request.camera.height;
  return painter.paint_difference(viz::difference_values(frame, fitted(images->colour, width, height),
                                                         fitted_known(images->known, width, height)));
}

void FrameServer::answer(const Job& job, const FrameJob& frame, const SceneView& view) {
  const Clock::time_point start = Clock::now();
  FrameRequest request = request_for(frame.view_request, view, frame.coarseness.divisor);
  if (!frame.coarseness.final) request.most_samples = 1;
  check_memory_for(request, view);
  const std::string bytes =
      jpeg_bytes(picture(frame.view_request, request, view, painters_[job.client]), frame.coarseness.quality);
  const double seconds = seconds_since(start);
  const int width = request.camera.width, height = request.camera.height;
  clients_.show_frame(job,
                      {{"type", "frame"},
                       {"view", frame.view_request.id},
                       {"width", width},
                       {"height", height},
                       {"final", frame.coarseness.final},
                       {"milliseconds", std::round(seconds * 1e4) / 10},
                       {"iteration", view.iteration},
                       {"format", "jpeg"}},
                      bytes, static_cast<double>(width) * height, seconds);
}

void FrameServer::answer(const Job& job, const StillJob& still, const SceneView& view) {
  ViewRequest view_request = still.view_request;
  view_request.width = still.still.width;
  view_request.height = still.still.height;
  const FrameRequest request = request_for(view_request, view, 1);
  check_memory_for(request, view);
  // A copy, so that the page's ranges do not change.
  viz::Painter painter = painters_[job.client];
  const std::string bytes = png_bytes(picture(view_request, request, view, painter));
  clients_.reply(job.client, picture_message({{"type", "still"},
                                              {"id", still.still.id},
                                              {"width", request.camera.width},
                                              {"height", request.camera.height},
                                              {"format", "png"}},
                                             bytes));
  // Frees the buffers of so large a picture.
  forget();
}

void FrameServer::answer(const Job& job, const Photo& photo, const SceneView&) {
  const std::shared_ptr<const ViewImages> images = photograph(photo.photo);
  const Tensor<float>& colour = images->colour;
  const int64_t width = std::min<int64_t>(photo.width, colour.dim(1));
  const int64_t height = std::max<int64_t>(
      1, std::llround(static_cast<double>(width * colour.dim(0)) / static_cast<double>(colour.dim(1))));
  clients_.reply(job.client,
                 picture_message({{"type", "photo"},
                                  {"split", photo.photo.test ? "test" : "train"},
                                  {"index", photo.photo.index},
                                  {"width", width},
                                  {"height", height},
                                  {"format", "jpeg"}},
                                 jpeg_bytes(to_8bit(fitted(colour, width, height)), photo_quality)));
}

void FrameServer::answer(const Job& job, const Path& path, const SceneView& view) {
  const SceneNormalisation& normalisation = view.scene.normalisation;
  const viz::CameraPath asked = viz::parse_camera_path(path.path, "camera path");
  check_option(viz::frame_count(asked) <= max_previewed_frames, "frames", viz::frame_count(asked),
               "at most " + std::to_string(max_previewed_frames) + " to preview");
  Json shots = Json::array();
  for (const viz::Shot& shot : viz::shots_of(asked, normalisation)) {
    shots.push_back(
        {{"camera", to_json(viewpoint_of(shot.camera, normalisation))}, {"time", shot.time.value_or(0.0F)}});
  }
  clients_.reply(job.client, json_message({{"type", "path"}, {"id", path.id}, {"shots", std::move(shots)}}));
}

void FrameServer::answer(const Job& job, const ProbeJob& probe, const SceneView& view) {
  FrameRequest request = request_for(probe.view_request, view, 1);
  request.specular = view.request.specular;  // for all layers
  const double x = probe.probe.x * request.camera.width, y = probe.probe.y * request.camera.height;
  std::optional<viz::ProbeResult> found = viz::probe(renderer(view), view.scene, request, x, y);
  posed_ = true;
  if (found) found = viz::in_capture(*found, view.scene.normalisation);
  clients_.reply(job.client, json_message(probe_json(probe.probe.id, found)));
}

}  // namespace traceflow::serve
