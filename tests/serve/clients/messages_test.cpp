#include "serve/clients/messages.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "support/refusal.h"

namespace traceflow::serve {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

json good_view_request() {
  return json::parse(R"({"type":"view","id":7,"camera":{"position":[1,2,3],
      "rotation":[[0,-1,0],[1,0,0],[0,0,1]],"fov_y":40},"time":0.25,"width":960,"height":540,"layer":"depth",
      "exposure":-1.5,"map":"turbo","moving":true})");
}

std::string complaint(const std::string& text) {
  return refusal_of([&] { parse_request(text); });
}

TEST(Messages, AViewRequestIsRead) {
  const ViewRequest view = std::get<ViewRequest>(parse_request(good_view_request().dump()));
  EXPECT_EQ(view.id, 7);
  const Viewpoint& camera = std::get<Viewpoint>(view.camera);
  EXPECT_EQ(camera.position, Vec3<double>(1, 2, 3));
  // Rows are world_from_camera's: the camera's x axis is the world's y.
  EXPECT_EQ(camera.world_from_camera * Vec3<double>(1, 0, 0), Vec3<double>(0, 1, 0));
  EXPECT_EQ(camera.fov_y, 40);
  EXPECT_EQ(view.time, 0.25F);
  EXPECT_EQ(view.width, 960);
  EXPECT_EQ(view.height, 540);
  EXPECT_EQ(view.layer, "depth");
  EXPECT_EQ(view.exposure, -1.5F);
  EXPECT_EQ(view.map, "turbo");
  EXPECT_TRUE(view.moving);
}

TEST(Messages, APhotographTakesThePlaceOfACamera) {
  json view = good_view_request();
  view["photo"] = {{"split", "test"}, {"index", 3}};
  EXPECT_EQ(std::get<PhotoRef>(std::get<ViewRequest>(parse_request(view.dump())).camera),
            (PhotoRef{true, 3}));
}

TEST(Messages, EveryOtherKindIsRead) {
  EXPECT_TRUE(std::holds_alternative<Sleep>(parse_request(R"({"type":"sleep"})")));
  EXPECT_EQ(std::get<FrameShown>(parse_request(R"({"type":"frame_shown","frame":12})")).frame, 12);
  const Probe probe = std::get<Probe>(parse_request(R"({"type":"probe","id":3,"x":0.5,"y":1})"));
  EXPECT_EQ(probe.x, 0.5);
  EXPECT_EQ(probe.y, 1);
  EXPECT_EQ(std::get<Still>(parse_request(R"({"type":"still","id":1,"width":8192,"height":2})")).width, 8192);
  EXPECT_EQ(std::get<Photo>(parse_request(R"({"type":"photo","split":"train","index":2,"width":100})")).photo,
            (PhotoRef{false, 2}));
  EXPECT_EQ(json::parse(std::get<Path>(parse_request(R"({"type":"path","id":1,"path":{"a":[1]}})")).path),
            json::parse(R"({"a":[1]})"));
  const std::vector<std::pair<std::string, Action>> words = {
      {"pause", Action::pause}, {"resume", Action::resume}, {"save", Action::save}, {"stop", Action::stop}};
  for (const auto& [word, action] : words) {
    EXPECT_EQ(std::get<Command>(parse_request(R"({"type":"command","do":")" + word + "\"}")).action, action);
  }
}

// What each broken ViewRequest is refused for names the field.
TEST(Messages, WhatIsWrongWithAViewRequestIsNamed) {
  const std::vector<std::pair<json, std::string>> wrongs = {
      {R"([{"op":"replace","path":"/id","value":-1}])"_json, "id"},
      {R"([{"op":"replace","path":"/id","value":1.5}])"_json, "id"},
      {R"([{"op":"remove","path":"/camera"}])"_json, "camera"},
      {R"([{"op":"replace","path":"/camera/fov_y","value":0}])"_json, "camera.fov_y"},
      {R"([{"op":"replace","path":"/camera/position","value":[1,2]}])"_json, "camera.position"},
      {R"([{"op":"replace","path":"/camera/position/1","value":1e300}])"_json, "camera.position"},
      {R"([{"op":"replace","path":"/camera/rotation/0/0","value":0.5}])"_json, "camera.rotation"},
      {R"([{"op":"replace","path":"/camera/rotation","value":[[1,0,0],[0,1,0],[0,0,-1]]}])"_json, "mirrored"},
      {R"([{"op":"replace","path":"/time","value":1.01}])"_json, "time"},
      {R"([{"op":"replace","path":"/width","value":4097}])"_json, "width"},
      {R"([{"op":"replace","path":"/height","value":0}])"_json, "height"},
      {R"([{"op":"replace","path":"/layer","value":3}])"_json, "layer"},
      {R"([{"op":"replace","path":"/exposure","value":"1"}])"_json, "exposure"},
      {R"([{"op":"replace","path":"/moving","value":1}])"_json, "moving"},
      {R"([{"op":"add","path":"/photo","value":{"split":"all","index":0}}])"_json, "photo.split"},
      {R"([{"op":"add","path":"/photo","value":{"split":"test","index":-1}}])"_json, "photo.index"},
  };
  for (const auto& [patch, field] : wrongs) {
    EXPECT_THAT(complaint(good_view_request().patch(patch).dump()), HasSubstr(field)) << patch.dump();
  }
}

TEST(Messages, WhatIsNoMessageIsRefused) {
  for (const std::string& text :
       {std::string(), std::string("{"), std::string("[]"), std::string("null"), std::string("{}"),
        std::string(R"({"type":3})"), std::string(R"({"type":"dance"})"), std::string("\xff\xfe"),
        std::string(R"({"type":"command","do":"sing"})"), "\"" + std::string(60000, 'a') + "\"",
        std::string(30000, '[') + std::string(30000, ']'),
        R"({"type":"path","id":1,"path":)" + std::string(64, '[') + std::string(64, ']') + "}"}) {
    EXPECT_NE(complaint(text), "accepted") << text.substr(0, 40);
  }
}

}  // namespace
}  // namespace traceflow::serve
