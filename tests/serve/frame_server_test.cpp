#include "serve/frame_server.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numeric>
#include <set>

#include "files/png.h"
#include "serve/clients/fake_page.h"
#include "support/temp_folder.h"
#include "train/small_run.h"
#include "viz/layers.h"

namespace traceflow::serve {
namespace {

using nlohmann::json;
using serve::testing::FakePage;
using serve::testing::Received;
using serve::testing::view_request;

// A page that looks at the scene that a training begins with.
struct Screening {
  explicit Screening(const std::string& name)
      : trainer(make_trainer(small_run(20), name)),
        frame_server(clients,
                     make_scene_info("run", name, &trainer.capture(), trainer.scene().normalisation)),
        page(clients, 1) {}

  SceneView stage() {
    RenderOptions render = trainer.options().render;
    render.samples = samples;
    return {trainer.scene(), render, picture_request(trainer.options(), 20), 7};
  }
  void project() {
    while (const auto job = clients.next()) {
      frame_server.answer(*job, stage());
      page.acknowledge_frames();
    }
  }
  // What comes of a message.
  std::vector<Received> answer(const json& message, const std::string& type) {
    page.say(message);
    project();
    return page.of(type);
  }
  // The last ViewRequest's pixels.
  Tensor<uint8_t> still(int width, int height) {
    const std::string png =
        answer({{"type", "still"}, {"id", 1}, {"width", width}, {"height", height}}, "still").back().picture;
    std::ofstream(folder / "still.png", std::ios::binary) << png;
    return read_png(folder / "still.png");
  }

  Trainer trainer;
  int samples = 1;
  Clients clients;
  FrameServer frame_server;
  FakePage page;
  TempFolder folder;
};

json at_photo(int64_t id, const std::string& layer) {
  json message = view_request(id);
  message["photo"] = {{"split", "train"}, {"index", 1}};
  message["layer"] = layer;
  return message;
}

TEST(FrameServer, GreetsWithWhatThereIsToSee) {
  Screening s("greets");
  s.frame_server.send_hello(s.stage());
  const json hello = s.page.of("hello").at(0).json;
  const Capture& capture = s.trainer.capture();
  EXPECT_EQ(hello["source"], "run");
  EXPECT_EQ(hello["capture"], capture.name);
  EXPECT_EQ(hello["cameras"]["train"].size(), capture.train.size());
  EXPECT_EQ(hello["cameras"]["test"].size(), capture.test.size());
  EXPECT_EQ(hello["layers"].back(), json::parse(R"({"name":"difference","kind":"number"})"));
  EXPECT_EQ(hello["maps"].size(), 5U);
  // A captured camera in the capture's own units.
  const View& view = capture.train[1];
  const Vec3<double> position =
      Vec3<double>(view.camera.position) / capture.normalisation.scale + capture.normalisation.centre;
  const json& told = hello["cameras"]["train"][1];
  for (int axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(told["position"][static_cast<size_t>(axis)].get<double>(), position[axis], 1e-6);
    // Rows of world_from_camera are columns of camera_from_world.
    EXPECT_NEAR(told["rotation"][0][static_cast<size_t>(axis)].get<double>(),
                view.camera.camera_from_world[0][axis], 1e-6);
  }
}

TEST(FrameServer, SendsFramesOfTheSizesThatItNames) {
  Screening s("sizes");
  const std::vector<Received> frames = s.answer(view_request(4), "frame");
  ASSERT_GE(frames.size(), 2U);
  const json& last = frames.back().json;
  EXPECT_EQ(last["view"], 4);
  EXPECT_EQ(last["width"], 96);
  EXPECT_EQ(last["height"], 64);
  EXPECT_EQ(last["final"], true);
  EXPECT_EQ(last["iteration"], 7);
  for (const Received& frame : frames) {
    EXPECT_EQ(frame.picture.substr(0, 3), "\xff\xd8\xff");
    EXPECT_NEAR(frame.json["width"].get<double>() / frame.json["height"].get<double>(), 1.5, 0.1);
  }
}

// A still at a photograph's camera is the picture that the verb render makes of it, also where a training has
// meanwhile begun to supersample.
TEST(FrameServer, ShowsACapturedCameraAsRenderDoes) {
  Screening s("captured");
  const Camera<float>& camera = s.trainer.capture().train[1].camera;
  for (s.samples = 1; s.samples <= 2; ++s.samples) {
    s.page.say(at_photo(s.samples, "rgb"));
    const Tensor<uint8_t> shown = s.still(camera.width, camera.height);

    Renderer renderer(s.stage().render);
    FrameRequest request = s.stage().request;
    request.camera = camera;
    request.time = 0;
    const Frame& frame = renderer.forward(s.trainer.scene(), request);
    ASSERT_EQ(frame.samples, s.samples);
    const Tensor<uint8_t> expected = to_8bit(frame.colour);
    ASSERT_EQ(shown.shape(), expected.shape());
    for (int64_t i = 0; i < shown.size(); ++i) ASSERT_NEAR(shown[i], expected[i], 1) << i;
  }
}

// The same view through a free camera: a picture does not depend on how its camera was said.
TEST(FrameServer, AFreeCameraStandsWhereItIsPut) {
  Screening s("free");
  s.frame_server.send_hello(s.stage());
  const Camera<float>& camera = s.trainer.capture().train[1].camera;
  const json told = s.page.of("hello").at(0).json["cameras"]["train"][1];
  json message = view_request(1);
  message["camera"] = {
      {"position", told["position"]}, {"rotation", told["rotation"]}, {"fov_y", told["fov_y"]}};
  s.page.say(message);
  const Tensor<uint8_t> free = s.still(camera.width, camera.height);
  s.page.say(at_photo(2, "rgb"));
  const Tensor<uint8_t> captured = s.still(camera.width, camera.height);
  ASSERT_EQ(free.shape(), captured.shape());
  for (int64_t i = 0; i < free.size(); ++i) ASSERT_NEAR(free[i], captured[i], 1) << i;
}

TEST(FrameServer, EveryLayerIsAPictureOfItsOwn) {
  Screening s("layers");
  std::set<std::vector<uint8_t>> pictures;
  int64_t id = 0;
  std::vector<std::string> names(viz::layer_names.begin(), viz::layer_names.end());
  names.emplace_back("difference");
  std::erase(names, "tracks");  // those of a scene that stands still are `rgb`
  for (const std::string& name : names) {
    s.page.say(at_photo(++id, name));
    const Tensor<uint8_t> picture = s.still(40, 24);
    EXPECT_TRUE(pictures.insert({picture.data(), picture.data() + picture.size()}).second) << name;
  }
  EXPECT_TRUE(s.page.of("refused").empty());
}

// All surfels, opaque, on one body that goes to the right.
Scene moving(const Scene& scene, const std::vector<float>& times) {
  Scene result = scene;
  result.main.opacity_logit.fill(3);
  result.main.body.reset({result.main.count()});
  result.main_motion = still_motion(Tensor<float>(Shape{1, 3}), tensor_of(times));
  for (int64_t k = 0; k < result.main_motion->keys(); ++k)
    result.main_motion->shift(0, k, 0) = 0.5F * result.main_motion->time[k];
  return result;
}

TEST(FrameServer, DrawsThePathsOfWhatMoves) {
  Screening s("paths");
  const auto bytes = [&](const std::string& layer, double time, const SceneView& stage) {
    json message = at_photo(static_cast<int64_t>(s.page.all().size()) + 1, layer);
    message["time"] = time;
    s.page.say(message);
    s.page.say({{"type", "still"}, {"id", 1}, {"width", 40}, {"height", 24}});
    while (const auto job = s.clients.next()) {
      s.frame_server.answer(*job, stage);
      s.page.acknowledge_frames();
    }
    return s.page.of("still").back().picture;
  };
  EXPECT_EQ(bytes("tracks", 0.5, s.stage()), bytes("rgb", 0.5, s.stage())) << "nothing moves yet";

  s.frame_server.forget();
  const Scene scene = moving(s.trainer.scene(), times_of(s.trainer.capture()));
  const SceneView as_is = s.stage();
  const SceneView stage{scene, as_is.render, as_is.request, as_is.iteration};
  const std::string early = bytes("tracks", 0.25, stage), late = bytes("tracks", 1, stage);
  EXPECT_NE(late, bytes("rgb", 1, stage));
  EXPECT_NE(early, late);
  EXPECT_EQ(bytes("tracks", 0.25, stage), early) << "what was seen since does not matter";
  // A scene that has changed has other paths.
  s.frame_server.scene_changed(Device::cpu);
  EXPECT_EQ(bytes("tracks", 0.5, s.stage()), bytes("rgb", 0.5, s.stage()));
}

TEST(FrameServer, ExposureAndMapsChangeThePicture) {
  Screening s("exposure");
  const auto picture_with = [&](const char* layer, double exposure, const char* map) {
    json message = at_photo(static_cast<int64_t>(s.page.all().size()), layer);
    message["exposure"] = exposure;
    message["map"] = map;
    s.page.say(message);
    const Tensor<uint8_t> picture = s.still(40, 24);
    return std::vector<uint8_t>(picture.data(), picture.data() + picture.size());
  };
  const auto sum = [](const std::vector<uint8_t>& v) {
    return std::accumulate(v.begin(), v.end(), int64_t{0});
  };
  EXPECT_GT(sum(picture_with("rgb", 1, "grey")), sum(picture_with("rgb", 0, "grey")));
  EXPECT_EQ(picture_with("rgb", 0, "turbo"), picture_with("rgb", 0, "grey"));
  EXPECT_NE(picture_with("depth", 0, "turbo"), picture_with("depth", 0, "grey"));
}

TEST(FrameServer, SendsPhotographs) {
  Screening s("photographs");
  const Received photo =
      s.answer({{"type", "photo"}, {"split", "test"}, {"index", 0}, {"width", 20}}, "photo").at(0);
  EXPECT_EQ(photo.json["split"], "test");
  EXPECT_EQ(photo.json["width"], 20);
  EXPECT_EQ(photo.json["height"], 12);
  EXPECT_EQ(photo.picture.substr(0, 3), "\xff\xd8\xff");
  // Never larger than it is.
  EXPECT_EQ(s.answer({{"type", "photo"}, {"split", "test"}, {"index", 0}, {"width", 4000}}, "photo")
                .back()
                .json["width"],
            40);
}

TEST(FrameServer, SaysWhatARayMeets) {
  Screening s("probes");
  s.page.say(at_photo(1, "rgb"));
  const json found = s.answer({{"type", "probe"}, {"id", 3}, {"x", 0.5}, {"y", 0.6}}, "probe").at(0).json;
  EXPECT_EQ(found["id"], 3);
  ASSERT_EQ(found["hit"], true);
  // The point lies on the pixel's ray: it is `depth` away along the camera's z.
  const View& view = s.trainer.capture().train[1];
  const SceneNormalisation& n = s.trainer.capture().normalisation;
  Vec3<double> surface;
  for (int axis = 0; axis < 3; ++axis) surface[axis] = found["surface"][static_cast<size_t>(axis)];
  const Vec3<float> in_camera = view.camera.point_in_camera(Vec3<float>((surface - n.centre) * n.scale));
  EXPECT_NEAR(in_camera.z / n.scale, found["depth"].get<double>(), 1e-3 * in_camera.z);
  const Vec2<float> pixel = view.camera.project(in_camera);
  EXPECT_NEAR(pixel.x / static_cast<float>(view.camera.width), 0.5, 1.0 / view.camera.width);
  EXPECT_NEAR(pixel.y / static_cast<float>(view.camera.height), 0.6, 1.0 / view.camera.height);
}

TEST(FrameServer, SaysInWordsWhatItCannotShow) {
  Screening s("refuses");
  json no_layer = view_request(1);
  no_layer["layer"] = "smell";
  EXPECT_THAT(s.answer(no_layer, "refused").back().json["text"].get<std::string>(),
              ::testing::HasSubstr("smell"));
  json no_map = view_request(2);
  no_map["map"] = "rainbow";
  EXPECT_EQ(s.answer(no_map, "refused").size(), 2U);
  json no_photo = view_request(3);
  no_photo["layer"] = "difference";
  EXPECT_EQ(s.answer(no_photo, "refused").size(), 3U);
  json no_view = view_request(4);
  no_view["photo"] = {{"split", "test"}, {"index", 999}};
  EXPECT_EQ(s.answer(no_view, "refused").size(), 4U);
  EXPECT_EQ(s.answer({{"type", "photo"}, {"split", "test"}, {"index", 999}, {"width", 9}}, "refused").size(),
            5U);
  EXPECT_EQ(s.answer({{"type", "path"}, {"id", 1}, {"path", json::object()}}, "refused").size(), 6U);
  EXPECT_TRUE(s.page.of("frame").empty());
}

// Were one begun, it would be refused for its layer, and not for its size.
TEST(FrameServer, DoesNotBeginAPictureForWhichThereIsNoMemory) {
  Screening s("memory");
  const int side = 100'000'000;
  ViewRequest huge;
  huge.id = 1;
  huge.camera = Viewpoint{};
  huge.width = huge.height = side;
  huge.layer = "smell";
  s.frame_server.answer(Job{1, StillJob{huge, Still{2, side, side}}}, s.stage());
  ASSERT_EQ(s.page.of("refused").size(), 1U);
  EXPECT_EQ(s.page.of("refused").at(0).json["text"], "No memory for a picture of this size.");
  EXPECT_FALSE(s.clients.any_lacks_memory());

  s.frame_server.answer(Job{1, FrameJob{huge, Coarseness{}}}, s.stage());
  EXPECT_EQ(s.page.of("refused").size(), 1U) << "coarser frames come in its place";
  EXPECT_THAT(s.page.of("warning").at(0).json["text"].get<std::string>(), ::testing::StartsWith("No memory"));
  EXPECT_TRUE(s.clients.any_lacks_memory());

  // It is the frame's size that counts, not the ViewRequest's.
  huge.layer = "rgb";
  s.frame_server.answer(Job{1, FrameJob{huge, Coarseness{side / 20.0, 75, false}}}, s.stage());
  EXPECT_EQ(s.page.of("frame").at(0).json["width"], 20);
}

// Another page's frames do not change what this one sees, nor does having looked before.
TEST(FrameServer, RemembersNothingThatChangesAPicture) {
  Screening s("remembers");
  s.page.say(at_photo(1, "rgb"));
  const Tensor<uint8_t> before = s.still(40, 24);
  FakePage other(s.clients, 2);
  auto elsewhere = view_request(1);
  elsewhere["time"] = 0.7;
  other.say(elsewhere);
  s.project();
  s.page.say(at_photo(2, "rgb"));
  const Tensor<uint8_t> after = s.still(40, 24);
  EXPECT_TRUE(std::equal(before.data(), before.data() + before.size(), after.data()));
}

}  // namespace
}  // namespace traceflow::serve
