#include "scene/scene_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "scene/rows.h"
#include "support/refusal.h"

namespace traceflow {
namespace {

Tensor<float> noise(const Shape& shape, Random& random) {
  Tensor<float> t(shape);
  for (float& v : t.values()) v = static_cast<float>(random.normal());
  return t;
}

Surfels random_surfels(int64_t count, bool tint, Random& random) {
  Surfels s;
  s.position = noise({count, 3}, random);
  s.log_scale = noise({count, 2}, random);
  s.rotation = noise({count, 4}, random);
  s.opacity_logit = noise({count}, random);
  s.sh = noise({count, 4, 3}, random);
  if (tint) s.tint_logit = noise({count}, random);
  if (tint) s.roughness_logit = noise({count}, random);
  return s;
}

Scene full_scene() {
  Random random(5);
  NetworkOptions network;
  network.width = 16;
  network.depth = 3;
  network.skip = 1;
  Scene scene;
  scene.main = random_surfels(7, true, random);
  scene.environment = random_surfels(4, false, random);
  scene.main_field = make_field(network, residual::main_outputs, random);
  scene.environment_field = make_field(network, residual::environment_outputs, random);
  scene.environment_map.emplace();
  scene.environment_map->logit = noise({12, 2, 3}, random);
  scene.environment_map->field = make_field(network, 3, random);
  scene.specular = Specular::environment_map;
  scene.normalisation = {{0.1, -2, 3}, 0.37};
  scene.extent = 1.75F;
  scene.focal = 310.5F;
  scene.main_max_displacement[0] = 0.125F;
  scene.main.body = tensor_of(std::vector<int32_t>{-1, 0, 1, 1, -1, 0, 0});
  scene.main_motion = still_motion(noise({2, 3}, random), tensor_of(std::vector<float>{0, 0.25F, 1}));
  for (float& v : scene.main_motion->shift.values()) v = static_cast<float>(random.normal());
  scene.main_nodes = Nodes{tensor_of(std::vector<int32_t>{0, 1, 1}),
                           tensor_of(std::vector<float>{0, 0.5F}),
                           noise({3, 3}, random),
                           tensor_of(std::vector<float>{1, 2, 3}),
                           noise({3, 2, 3}, random),
                           noise({3, 2, 3}, random),
                           noise({3, 2, 3}, random)};
  scene.lighting = Lighting{tensor_of(std::vector<float>{0, 0, 0, 1, 2, 3}),
                            tensor_of(std::vector<float>{0, 1}),
                            noise({2, 3, 4, 5}, random),
                            noise({2, 2, 3}, random),
                            tensor_of(std::vector<float>{0.5F, 2}),
                            noise({2, 2, 4}, random)};
  scene.lighting->box.resize({2, 3});
  return scene;
}

std::vector<float> all_numbers(const Scene& scene) {
  std::vector<float> all{scene.extent, scene.focal, scene.main_max_displacement[0],
                         static_cast<float>(scene.normalisation.scale)};
  const auto take = [&](const auto&, const Tensor<float>& t) {
    all.insert(all.end(), t.values().begin(), t.values().end());
  };
  scene.main.for_each(take);
  scene.environment.for_each(take);
  if (scene.main_field) scene.main_field->for_each(take);
  if (scene.main_motion) {
    scene.main_motion->for_each(take);
    take("", scene.main_motion->time);
    take("", scene.main_motion->centre);
  }
  if (scene.main_nodes) {
    scene.main_nodes->for_each(take);
    take("", scene.main_nodes->time);
    take("", scene.main_nodes->centre);
    take("", scene.main_nodes->radius);
    take("", scene.main_nodes->anchor);
    for (const int32_t body : scene.main_nodes->body.values()) all.push_back(static_cast<float>(body));
  }
  if (scene.lighting) {
    scene.lighting->for_each(take);
    take("", scene.lighting->box);
    take("", scene.lighting->time);
    take("", scene.lighting->centre);
    take("", scene.lighting->radius);
  }
  for (const int32_t body : scene.main.body.values()) all.push_back(static_cast<float>(body));
  if (scene.environment_field) scene.environment_field->for_each(take);
  if (scene.environment_map) {
    take("map", scene.environment_map->logit);
    if (scene.environment_map->field) scene.environment_map->field->for_each(take);
  }
  return all;
}

TEST(SceneFile, GivesBackWhatWasPut) {
  const Scene scene = full_scene();
  const auto path = std::filesystem::path(testing::TempDir()) / ("scene_file_" + std::to_string(::getpid()));
  Safetensors file;
  put_scene(scene, file);
  file.write(path);
  const Scene back = get_scene(Safetensors::read(path));
  EXPECT_EQ(all_numbers(back), all_numbers(scene));
  EXPECT_EQ(back.specular, scene.specular);
  EXPECT_EQ(back.normalisation.centre, scene.normalisation.centre);
  EXPECT_EQ(back.main_field->shape.skip, 1);
}

TEST(SceneFile, AStaticSceneHasNoFields) {
  Random random(6);
  Scene scene;
  scene.main = random_surfels(3, true, random);
  scene.specular = Specular::none;
  Safetensors file;
  put_scene(scene, file);
  const Scene back = get_scene(file);
  EXPECT_FALSE(back.main_field || back.environment_field || back.environment_map);
  EXPECT_EQ(back.environment.count(), 0);
}

TEST(SceneFile, AMissingOrMisshapenTensorIsNamed) {
  const Scene scene = full_scene();
  Safetensors file;
  put_scene(scene, file);
  file.add("scene/main/opacity_logit", Tensor<float>(Shape{99}));
  try {
    get_scene(file);
    FAIL() << "accepted";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("scene/main/opacity_logit"), std::string::npos) << error.what();
  }
  EXPECT_THROW(get_scene(Safetensors{}), InputError);
}

TEST(SceneFile, NodesThatFitNoBodyOrHaveNoSizeAreRefused) {
  const auto says = [](auto&& spoil) {
    Scene scene = full_scene();
    spoil(*scene.main_nodes);
    Safetensors file;
    put_scene(scene, file);
    return refusal_of([&] { get_scene(file); });
  };
  EXPECT_NE(says([](Nodes& nodes) { nodes.body[1] = 2; }).find("scene/nodes: found"), std::string::npos);
  EXPECT_NE(says([](Nodes& nodes) { nodes.time[0] = 0.9F; }).find("ascending times"), std::string::npos);
  EXPECT_EQ(says([](Nodes& nodes) { nodes.radius[2] = 0; }),
            "safetensors: scene/nodes/radius: found 0, expected above 0");
  EXPECT_NE(says([](Nodes& nodes) {
              nodes.turn.resize({3, 1, 3});
            }).find("scene/nodes/turn"),
            std::string::npos);
}

TEST(SceneFile, LightingWithoutASizeOrWithoutItsTimesIsRefused) {
  const auto says = [](auto&& spoil) {
    Scene scene = full_scene();
    spoil(*scene.lighting);
    Safetensors file;
    put_scene(scene, file);
    return refusal_of([&] { get_scene(file); });
  };
  EXPECT_EQ(says([](Lighting&) {}), "accepted");
  EXPECT_EQ(says([](Lighting& lighting) { lighting.box(1, 2) = 0; }),
            "safetensors: scene/lighting/box: found 0, expected below 0");
  EXPECT_NE(says([](Lighting& lighting) { lighting.time[0] = 2; }).find("ascending times"),
            std::string::npos);
  EXPECT_NE(says([](Lighting& lighting) { lighting.time.resize({1}); }).find("L×Z×Y×X"), std::string::npos);
  EXPECT_NE(says([](Lighting& lighting) {
              lighting.brightness.resize({2, 2, 4, 5});
            }).find("of 3 or more"),
            std::string::npos);
  EXPECT_EQ(says([](Lighting& lighting) { lighting.radius[1] = 0; }),
            "safetensors: scene/lighting/radius: found 0, expected above 0");
  EXPECT_NE(says([](Lighting& lighting) {
              lighting.centre.resize({2, 1, 3});
            }).find("scene/lighting/middle"),
            std::string::npos);
  EXPECT_NE(says([](Lighting& lighting) {
              lighting.body_brightness.resize({1, 2, 4});
            }).find("scene/lighting/body_brightness"),
            std::string::npos);
}

// Checkpoints of programs before light on bodies changed.
TEST(SceneFile, LightingMayHaveNoBodies) {
  Scene scene = full_scene();
  for (Tensor<float>* const part :
       {&scene.lighting->centre, &scene.lighting->radius, &scene.lighting->body_brightness})
    *part = {};
  Safetensors file;
  put_scene(scene, file);
  EXPECT_EQ(all_numbers(get_scene(file)), all_numbers(scene));
}

// What get_scene says where one field of the scene's metadata is another.
std::string refusal(const std::string& pointer, const nlohmann::json& value) {
  Safetensors file;
  put_scene(full_scene(), file);
  nlohmann::json json = nlohmann::json::parse(file.metadata["scene"]);
  json[nlohmann::json::json_pointer(pointer)] = value;
  file.metadata["scene"] = json.dump();
  return refusal_of([&] { get_scene(file); });
}

TEST(SceneFile, MetadataThatPromisesWhatIsNotThereIsRefusedBeforeMemoryIsTaken) {
  EXPECT_EQ(refusal("/main_field/outputs", 2147483647),
            "safetensors: scene: main_field.outputs: found 2147483647, expected 11");
  EXPECT_EQ(refusal("/main_field/outputs", -1),
            "safetensors: scene: main_field.outputs: found -1, expected 11");
  EXPECT_EQ(refusal("/main_field/width", 1024),
            "safetensors: scene/main_field/weight0: found shape 16x76, expected 1024x76");
  EXPECT_NE(refusal("/main_field/depth", 1000).find("expected 1 to 32 layers"), std::string::npos);
  EXPECT_EQ(refusal("/extent", -1), "safetensors: scene: extent: found -1, expected 1e-12 to 1000000000000");
  EXPECT_EQ(refusal("/scale", 0), "safetensors: scene: scale: found 0, expected 1e-12 to 1000000000000");
  EXPECT_EQ(refusal("/environment", 1), "safetensors: scene: environment: found 1, expected true or false");
  EXPECT_EQ(refusal("/specular", "mirrors"),
            "safetensors: scene: specular: found \"mirrors\", expected none, environment-gaussians or "
            "environment-map");
}

TEST(SceneFile, TensorsThatMakeNoSceneAreRefused) {
  for (const auto& [name, shape] :
       std::vector<std::pair<std::string, Shape>>{{"scene/map/logit", {12, 3, 3}},
                                                  {"scene/map/logit", {0, 0, 3}},
                                                  {"scene/map/logit", {36}},
                                                  {"scene/main/sh", {7, 5, 3}},
                                                  {"scene/main/sh", {7, 4}},
                                                  {"scene/main/position", {7}},
                                                  {"scene/main_field/bias0", {17}}}) {
    Safetensors file;
    put_scene(full_scene(), file);
    file.add(name, Tensor<float>(shape));
    EXPECT_THROW(get_scene(file), InputError) << name << " " << shape.to_string();
  }
}

TEST(SceneFile, DamagedMetadataIsRefused) {
  Safetensors file;
  put_scene(full_scene(), file);
  for (const char* text : {"", "{", "[]", "{\"specular\": 3}", "{\"specular\": \"mirror\"}"}) {
    file.metadata["scene"] = text;
    EXPECT_THROW(get_scene(file), InputError) << text;
  }
}

TEST(Rows, AnEditCopiesDropsAndAdds) {
  Random random(7);
  Surfels s = random_surfels(5, true, random);
  const Surfels before = s;
  RowEdit edit;
  edit.keep(4);
  edit.keep(1);
  edit.add(1);
  edit_rows(s, edit);
  ASSERT_EQ(s.count(), 3);
  for (int64_t k = 0; k < 12; ++k) {
    EXPECT_EQ(s.sh.row(0)[k], before.sh.row(4)[k]);
    EXPECT_EQ(s.sh.row(2)[k], before.sh.row(1)[k]);
  }
  const Tensor<float> moments = edited_rows(before.rotation, PlacedEdit(edit, Device::cpu), true);
  EXPECT_EQ(moments(1, 3), before.rotation(1, 3));
  EXPECT_EQ(moments(2, 3), 0);
}

TEST(Rows, AppendingJoinsTwoSets) {
  Random random(8);
  Surfels a = random_surfels(3, false, random);
  const Surfels first = a;
  const Surfels b = random_surfels(2, false, random);
  append_rows(a, b);
  ASSERT_EQ(a.count(), 5);
  EXPECT_EQ(a.position(2, 1), first.position(2, 1));
  EXPECT_EQ(a.position(4, 1), b.position(1, 1));
  EXPECT_EQ(a.sh.row(3)[11], b.sh.row(0)[11]);
}

}  // namespace
}  // namespace traceflow
