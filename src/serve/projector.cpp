#include "serve/projector.h"

#include <nlohmann/json.hpp>

#include "base/machine.h"
#include "capture/lens/resample.h"
#include "files/jpeg.h"
#include "files/png.h"
#include "render/samples.h"
#include "serve/hello.h"
#include "serve/look_camera.h"
#include "show/cameras/camera_path.h"
#include "show/probe.h"

namespace traceflow::serve {

namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

constexpr const char* about_memory = "memory";  // what a trouble is about
// That a frame takes with all its layers, and more.
constexpr int64_t bytes_per_pixel = 300;
constexpr int64_t most_previewed = 20'000;  // frames of a camera path
constexpr int photo_quality = 90;
// How fast the ranges of depth and distortion follow the picture: settled after some ten frames.
constexpr float follow = 0.25F;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The mean over every new pixel's area.
Tensor<float> fitted(const Tensor<float>& image, int64_t width, int64_t height) {
  if (image.dim(0) == height && image.dim(1) == width) return image;
  return resample(image, {width, height, static_cast<double>(image.dim(1)) / static_cast<double>(width),
                          static_cast<double>(image.dim(0)) / static_cast<double>(height)});
}

// A new pixel is known where all of what it is made of is.
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
  const auto* const known = std::find(show::layer_names.begin(), show::layer_names.end(), layer);
  return known == show::layer_names.end() ||
         show::needs_reflections(static_cast<show::Layer>(known - show::layer_names.begin()));
}

show::Layer layer_named(const std::string& name) {
  const std::vector<show::Layer> layers = show::parse_layers(name);
  if (layers.size() != 1) throw InputError("message", "layer", name, "one layer");
  return layers[0];
}

// The system may promise memory that is not there, and then end the program: a training, perhaps.
void check_memory_for(const FrameRequest& request, const Stage& stage) {
  const int64_t samples =
      samples::samples_for(request.camera, stage.render.samples, stage.scene.focal, request.most_samples);
  const int64_t wanted = bytes_per_pixel * samples * samples * request.camera.width * request.camera.height;
  if (stage.scene.device() == Device::cpu && wanted > memory_available() / 2) throw std::bad_alloc();
}

Json vector_json(const Vec3<float>& v) { return to_json(Vec3<double>(v)); }

Json to_json(int64_t id, const std::optional<show::ProbeResult>& found) {
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

void Projector::greet(const Stage& stage) { audience_.greet_with(hello_text(stage, setting_)); }

void Projector::scene_changed(Device device) {
  posed_ = false;
  follower_.reset();
  if (device == Device::cuda) forget();
}

void Projector::forget() {
  renderer_ = nullptr;
  follower_.reset();
  posed_ = false;
}

Renderer& Projector::renderer(const Stage& stage) {
  if (!renderer_) renderer_ = std::make_unique<Renderer>(stage.render);
  renderer_->options() = stage.render;  // a training changes them as it goes on
  return *renderer_;
}

show::Tracks Projector::tracks(const FrameRequest& request, const Stage& stage) {
  if (!follower_) follower_.emplace(stage.scene, stage.request, stage.render, setting_.times);
  return follower_->at(stage.scene, request.time);
}

void Projector::answer(const Job& job, const Stage& stage) {
  try {
    std::visit([&](const auto& what) { answer(job, what, stage); }, job.what);
    if (!audience_.anybody_lacks_memory()) audience_.tell_trouble(about_memory, "");
  } catch (const std::bad_alloc& error) {
    forget();
    // What the host says has no numbers.
    const auto* const device = dynamic_cast<const memory::OutOfMemory*>(&error);
    const std::string why = "No memory for a picture of this size" +
                            (device == nullptr ? "." : ": " + std::string(device->what()));
    if (std::holds_alternative<FrameJob>(job.what)) {
      audience_.no_memory_for(job);
      audience_.tell_trouble(about_memory, why);
    } else {
      audience_.refuse(job, why);
    }
  } catch (const std::exception& error) {
    audience_.refuse(job, error.what());
  }
  std::erase_if(painters_, [&](const auto& entry) { return !audience_.is_here(entry.first); });
}

FrameRequest Projector::request_for(const Look& look, const Stage& stage, double divisor) const {
  FrameRequest request = stage.request;
  request.camera = camera_of(look, setting_, stage.scene.normalisation, divisor);
  request.time = look.time;
  request.reuse_pose = posed_;
  request.specular = stage.request.specular && shows_reflections(look.layer);
  return request;
}

std::shared_ptr<const ViewImages> Projector::photograph(const PhotoRef& photo) const {
  if (setting_.capture == nullptr)
    throw InputError("message", "photo", "a scene without photographs", "a run");
  captured(photo, setting_);
  const std::vector<View>& views = photo.test ? setting_.capture->test : setting_.capture->train;
  return load_images(*setting_.capture, views.at(static_cast<size_t>(photo.index)));
}

Tensor<uint8_t> Projector::picture(const Look& look, const FrameRequest& request, const Stage& stage,
                                   show::Painter& painter) {
  painter.options() = {show::parse_colour_map(look.map), look.exposure, look.moving ? follow : 1};
  const bool difference = look.layer == "difference";
  const auto* photo = std::get_if<PhotoRef>(&look.camera);
  if (difference && photo == nullptr) throw InputError("message", "layer", "difference", "a captured camera");
  const show::Layer layer = difference ? show::Layer::rgb : layer_named(look.layer);

  const Frame& frame = renderer(stage).forward(stage.scene, request);
  posed_ = true;
  if (!difference) {
    const show::Tracks paths = layer == show::Layer::tracks ? tracks(request, stage) : show::Tracks();
    return show::in_colour(
        painter.paint(layer, show::layer_values(frame, layer, stage.scene.normalisation.scale, paths)));
  }
  const std::shared_ptr<const ViewImages> images = photograph(*photo);
  const int64_t width = request.camera.width, height = request.camera.height;
  return painter.paint_difference(show::difference_values(frame, fitted(images->colour, width, height),
                                                          fitted_known(images->known, width, height)));
}

void Projector::answer(const Job& job, const FrameJob& frame, const Stage& stage) {
  const Clock::time_point start = Clock::now();
  FrameRequest request = request_for(frame.look, stage, frame.coarseness.divisor);
  if (!frame.coarseness.final) request.most_samples = 1;
  check_memory_for(request, stage);
  const std::string bytes =
      jpeg_bytes(picture(frame.look, request, stage, painters_[job.guest]), frame.coarseness.quality);
  const double seconds = seconds_since(start);
  const int width = request.camera.width, height = request.camera.height;
  audience_.show_frame(job,
                       {{"type", "frame"},
                        {"look", frame.look.id},
                        {"width", width},
                        {"height", height},
                        {"final", frame.coarseness.final},
                        {"milliseconds", std::round(seconds * 1e4) / 10},
                        {"iteration", stage.iteration},
                        {"format", "jpeg"}},
                       bytes, static_cast<double>(width) * height, seconds);
}

void Projector::answer(const Job& job, const StillJob& still, const Stage& stage) {
  Look look = still.look;
  look.width = still.still.width;
  look.height = still.still.height;
  const FrameRequest request = request_for(look, stage, 1);
  check_memory_for(request, stage);
  // A copy: the page's ranges stay as they are.
  show::Painter painter = painters_[job.guest];
  const std::string bytes = png_bytes(picture(look, request, stage, painter));
  audience_.reply(job.guest, picture_message({{"type", "still"},
                                              {"id", still.still.id},
                                              {"width", request.camera.width},
                                              {"height", request.camera.height},
                                              {"format", "png"}},
                                             bytes));
  // What so large a picture took is not kept.
  forget();
}

void Projector::answer(const Job& job, const Photo& photo, const Stage&) {
  const std::shared_ptr<const ViewImages> images = photograph(photo.photo);
  const Tensor<float>& colour = images->colour;
  const int64_t width = std::min<int64_t>(photo.width, colour.dim(1));
  const int64_t height = std::max<int64_t>(
      1, std::llround(static_cast<double>(width * colour.dim(0)) / static_cast<double>(colour.dim(1))));
  audience_.reply(job.guest,
                  picture_message({{"type", "photo"},
                                   {"split", photo.photo.test ? "test" : "train"},
                                   {"index", photo.photo.index},
                                   {"width", width},
                                   {"height", height},
                                   {"format", "jpeg"}},
                                  jpeg_bytes(to_8bit(fitted(colour, width, height)), photo_quality)));
}

void Projector::answer(const Job& job, const Path& path, const Stage& stage) {
  const SceneNormalisation& normalisation = stage.scene.normalisation;
  const show::CameraPath asked = show::parse_camera_path(path.path, "camera path");
  check_option(show::frame_count(asked) <= most_previewed, "frames", show::frame_count(asked),
               "at most " + std::to_string(most_previewed) + " to preview");
  Json shots = Json::array();
  for (const show::Shot& shot : show::shots_of(asked, normalisation)) {
    shots.push_back(
        {{"camera", to_json(viewpoint_of(shot.camera, normalisation))}, {"time", shot.time.value_or(0.0F)}});
  }
  audience_.reply(job.guest, json_message({{"type", "path"}, {"id", path.id}, {"shots", std::move(shots)}}));
}

void Projector::answer(const Job& job, const ProbeJob& probe, const Stage& stage) {
  FrameRequest request = request_for(probe.look, stage, 1);
  request.specular = stage.request.specular;  // whatever the layer shows
  const double x = probe.probe.x * request.camera.width, y = probe.probe.y * request.camera.height;
  std::optional<show::ProbeResult> found = show::probe(renderer(stage), stage.scene, request, x, y);
  posed_ = true;
  if (found) found = show::in_capture(*found, stage.scene.normalisation);
  audience_.reply(job.guest, json_message(to_json(probe.probe.id, found)));
}

}  // namespace traceflow::serve
