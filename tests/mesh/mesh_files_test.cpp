#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mesh/mesh_glb.h"
#include "mesh/mesh_ply.h"
#include "mesh/shapes.h"
#include "support/file_bytes.h"
#include "support/glb_file.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow::mesh {
namespace {

using nlohmann::json;
using testing::HasSubstr;

// A box whose corners have the colours of their places.
TriangleMesh coloured_box() {
  TriangleMesh mesh = box_mesh({-1, -2, -3}, {0.5, 1.25, 0.1});
  for (int64_t i = 0; i < mesh.colours.size(); ++i) mesh.colours[i] = static_cast<float>(i % 7) / 6;
  return mesh;
}

TEST(MeshPly, HoldsTheMesh) {
  const TempFolder folder;
  const TriangleMesh mesh = coloured_box();
  write_mesh_ply(folder / "box.ply", mesh);
  const std::string bytes = bytes_of(folder / "box.ply");
  const std::string header =
      "ply\nformat binary_little_endian 1.0\ncomment traceflow mesh\nelement vertex 24\n"
      "property float x\nproperty float y\nproperty float z\n"
      "property float nx\nproperty float ny\nproperty float nz\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\n"
      "element face 12\nproperty list uchar int vertex_indices\nend_header\n";
  ASSERT_EQ(bytes.substr(0, header.size()), header);
  ASSERT_EQ(bytes.size(), header.size() + 24 * 27 + 12 * 13);
  for (int64_t i = 0; i < 24; ++i) {
    const size_t row = header.size() + static_cast<size_t>(i) * 27;
    for (int64_t c = 0; c < 3; ++c) {
      const auto k = static_cast<size_t>(c);
      EXPECT_EQ(number_at<float>(bytes, row + 4 * k), mesh.vertices(i, c));
      EXPECT_EQ(number_at<float>(bytes, row + 12 + 4 * k), mesh.normals(i, c));
      EXPECT_EQ(number_at<uint8_t>(bytes, row + 24 + k), std::lround(255 * mesh.colours(i, c)));
    }
  }
  for (int64_t t = 0; t < 12; ++t) {
    const size_t row = header.size() + 24 * 27 + static_cast<size_t>(t) * 13;
    EXPECT_EQ(bytes[row], 3);
    for (int64_t k = 0; k < 3; ++k)
      EXPECT_EQ(number_at<int32_t>(bytes, row + 1 + 4 * static_cast<size_t>(k)), mesh.triangles(t, k));
  }
}

TEST(MeshPly, HoldsAMeshOfNothing) {
  const TempFolder folder;
  write_mesh_ply(folder / "none.ply", TriangleMesh());
  EXPECT_THAT(bytes_of(folder / "none.ply"), HasSubstr("element face 0\n"));
}

TEST(MeshGlb, HoldsTheMesh) {
  const TempFolder folder;
  const TriangleMesh mesh = coloured_box();
  write_mesh_glb(folder / "box.glb", mesh);
  const GlbFile file(bytes_of(folder / "box.glb"));
  const json& document = file.document;
  EXPECT_EQ(document.at("asset").at("version"), "2.0");
  EXPECT_THAT(document.at("asset").at("generator").get<std::string>(), HasSubstr("traceflow"));

  const json& attributes = file.primitive().at("attributes");
  const size_t position = file.place_of(attributes.at("POSITION"), 5126, "VEC3", 24, 12);
  const size_t normal = file.place_of(attributes.at("NORMAL"), 5126, "VEC3", 24, 12);
  const size_t colour = file.place_of(attributes.at("COLOR_0"), 5123, "VEC4", 24, 8);
  const size_t index = file.place_of(file.primitive().at("indices"), 5125, "SCALAR", 36, 4);
  EXPECT_TRUE(
      document.at("accessors").at(attributes.at("COLOR_0").get<size_t>()).at("normalized").get<bool>());
  for (size_t i = 0; i < 24; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      const auto row = static_cast<int64_t>(i), column = static_cast<int64_t>(c);
      EXPECT_EQ(number_at<float>(file.binary, position + 12 * i + 4 * c), mesh.vertices(row, column));
      EXPECT_EQ(number_at<float>(file.binary, normal + 12 * i + 4 * c), mesh.normals(row, column));
    }
    EXPECT_EQ(number_at<uint16_t>(file.binary, colour + 8 * i + 6), 65535) << "opaque";
  }
  for (size_t k = 0; k < 36; ++k)
    EXPECT_EQ(number_at<uint32_t>(file.binary, index + 4 * k),
              static_cast<uint32_t>(mesh.triangles[static_cast<int64_t>(k)]));

  const json& bounds = document.at("accessors").at(attributes.at("POSITION").get<size_t>());
  EXPECT_EQ(bounds.at("min").get<std::vector<float>>(), (std::vector<float>{-1, -2, -3}));
  EXPECT_EQ(bounds.at("max").get<std::vector<float>>(), (std::vector<float>{0.5F, 1.25F, 0.1F}));
}

TEST(MeshGlb, ColoursAreLinear) {
  const TempFolder folder;
  TriangleMesh mesh = coloured_box();
  // Values of the sRGB standard's curve: 0.5 is about 21 % of the light; dark colours have a straight part.
  const std::array<std::pair<float, double>, 5> known = {
      {{0.0F, 0.0}, {0.04F, 0.04 / 12.92}, {0.5F, 0.214041}, {0.735357F, 0.5}, {1.0F, 1.0}}};
  for (size_t i = 0; i < known.size(); ++i)
    for (int64_t c = 0; c < 3; ++c) mesh.colours(static_cast<int64_t>(i), c) = known[i].first;
  write_mesh_glb(folder / "box.glb", mesh);
  const GlbFile file(bytes_of(folder / "box.glb"));
  const size_t colour = file.place_of(file.primitive().at("attributes").at("COLOR_0"), 5123, "VEC4", 24, 8);
  for (size_t i = 0; i < known.size(); ++i)
    EXPECT_NEAR(number_at<uint16_t>(file.binary, colour + 8 * i), 65535 * known[i].second, 1);
}

// Captures have y down, glTF has it up.
TEST(MeshGlb, RootTurnsDownToUpAndTheMaterialIsMatt) {
  const TempFolder folder;
  write_mesh_glb(folder / "box.glb", coloured_box());
  const json document = GlbFile(bytes_of(folder / "box.glb")).document;
  const json& root = document.at("nodes").at(document.at("scenes").at(0).at("nodes").at(0).get<size_t>());
  EXPECT_EQ(root.at("mesh"), 0);
  const auto q = root.at("rotation").get<std::vector<double>>();  // x y z w
  ASSERT_EQ(q.size(), 4U);
  const V axis(q[0], q[1], q[2]), down(0, 1, 0);
  const V turned = down + 2.0 * cross(axis, cross(axis, down) + q[3] * down);
  EXPECT_NEAR(turned.y, -1, 1e-12);
  const json& material = document.at("materials").at(0);
  EXPECT_TRUE(material.at("doubleSided").get<bool>());
  EXPECT_EQ(material.at("pbrMetallicRoughness").at("metallicFactor"), 0);
  EXPECT_EQ(material.at("pbrMetallicRoughness").at("roughnessFactor"), 1);
}

TEST(MeshGlb, RefusesAMeshOfNothing) {
  const TempFolder folder;
  const std::string refusal = refusal_of([&] { write_mesh_glb(folder / "none.glb", TriangleMesh()); });
  EXPECT_THAT(refusal, HasSubstr("none.glb"));
  EXPECT_FALSE(std::filesystem::exists(folder / "none.glb"));
}

}  // namespace
}  // namespace traceflow::mesh
