#include "mesh/fuse_views.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "mesh/shapes.h"
#include "support/refusal.h"
#include "viz/moving_board.h"

namespace traceflow::mesh {
namespace {

using testing::HasSubstr;

// The board, made solid, and the wall behind it, in a capture whose coordinates are not the scene's; cameras
// in a row before it.
struct BoardInCapture {
  viz::Subject subject;
  std::vector<viz::Shot> shots;

  BoardInCapture() {
    viz::MovingBoard board;
    for (int64_t i = 0; i < viz::MovingBoard::points; ++i) {
      for (int64_t k = 0; k < 2; ++k) board.scene.main.log_scale(i, k) = std::log(0.15F);
    }
    for (int64_t key = 0; key < 5; ++key) {
      for (int64_t k = 0; k < 4; ++k) board.scene.main_motion->rotation(0, key, k) = k == 0 ? 1 : 0;
    }
    // All of one colour: 0.75, 0.5 and 0.25.
    board.scene.main.sh.fill(0);
    for (int64_t i = 0; i < board.scene.main.count(); ++i) {
      board.scene.main.sh(i, 0, 0) = 0.25F / 0.28209479F;
      board.scene.main.sh(i, 0, 2) = -0.25F / 0.28209479F;
    }
    subject.scene = board.scene;
    subject.scene.normalisation = {{10, -20, 5}, 0.25};
    subject.request = board.request;
    for (const float x : {-0.3F, 0.0F, 0.3F}) {
      viz::Shot shot;
      shot.camera = board.request.camera;
      shot.camera.position.x = x;
      shots.push_back(shot);
    }
  }

  static FusionOptions options() {
    FusionOptions options;
    options.voxel = 0.12F;
    return options;
  }
  // The vertices near the board, which is nearer than z = 1 in the scene, in scene units.
  static std::vector<V> of_board(const TriangleMesh& mesh) {
    std::vector<V> result;
    for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
      const V v = (vertex_of(mesh, i) - V(10, -20, 5)) * 0.25;
      if (v.z < 1) result.push_back(v);
    }
    return result;
  }
};

TEST(FuseViews, FindsTheSurfaceOfATimeInTheCapturesCoordinates) {
  const BoardInCapture f;
  for (const float time : {0.0F, 0.5F, 1.0F}) {
    const TriangleMesh mesh = fuse_views(f.subject, f.shots, time, BoardInCapture::options());
    const std::vector<V> board = BoardInCapture::of_board(mesh);
    ASSERT_GT(board.size(), 100U);
    V middle(0);
    for (const V& v : board) {
      EXPECT_NEAR(v.z, 0.4 * time, 0.035) << "about a voxel";
      middle += v / static_cast<double>(board.size());
    }
    EXPECT_NEAR(middle.x, 0.3 * time, 0.05);
    EXPECT_NEAR(middle.y, -0.2 * time, 0.05);
    EXPECT_GT(mesh.vertex_count() - static_cast<int64_t>(board.size()), 100) << "the wall";
    double facing = 0;
    for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
      EXPECT_LT(length(load3<double>(mesh.colours.row(i)) - V(0.75, 0.5, 0.25)), 0.02);
      facing -= mesh.normals(i, 2) / static_cast<double>(mesh.vertex_count());
    }
    EXPECT_GT(facing, 0.97) << "normals are towards the cameras";
  }
}

// A ball of flat surfels, rendered from all sides: the whole chain against the true surface.
TEST(FuseViews, BallOfSurfelsIsWithinHalfAVoxel) {
  constexpr int count = 2500;
  Random random(5);
  viz::Subject subject;
  subject.scene.specular = Specular::none;
  subject.scene.main = scattered(count, 0, false, random);
  Surfels& s = subject.scene.main;
  s.opacity_logit.fill(6);
  s.log_scale.fill(std::log(0.05F));
  const std::vector<V> out = directions(count);
  for (int64_t i = 0; i < count; ++i) {
    const V& normal = out[static_cast<size_t>(i)];
    store3(s.position.row(i), normal);
    // The half turn that takes z to the normal.
    const V axis = viz::unit(normal + V(0, 0, 1), V(1, 0, 0));
    s.rotation(i, 0) = 0;
    for (int k = 0; k < 3; ++k) s.rotation(i, k + 1) = static_cast<float>(axis[k]);
  }
  std::vector<viz::Shot> shots;
  for (const V& direction : directions(16)) {
    viz::Shot shot;
    shot.camera = camera_at(3.5 * direction, V(0), 64);
    shots.push_back(shot);
  }
  FusionOptions options;
  options.voxel = 0.06F;
  const TriangleMesh mesh = fuse_views(subject, shots, 0, options);

  SurfaceSamples truth{Tensor<float>(Shape{count, 3}), Tensor<float>(Shape{count, 3}), Tensor<float>()};
  double accuracy = 0, turn = 0;
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    const V v = vertex_of(mesh, i);
    accuracy += std::fabs(length(v) - 1) / static_cast<double>(mesh.vertex_count());
    turn += std::acos(std::clamp(dot(load3<double>(mesh.normals.row(i)), normalize(v)), -1.0, 1.0)) * 180 /
            std::numbers::pi / static_cast<double>(mesh.vertex_count());
  }
  for (int64_t i = 0; i < count; ++i) {
    store3(truth.points.row(i), out[static_cast<size_t>(i)]);
    store3(truth.normals.row(i), out[static_cast<size_t>(i)]);
  }
  const SurfaceError error = compare_surfaces(sample_surface(mesh, 20000), truth);
  RecordProperty("accuracy_voxels", std::to_string(accuracy / 0.06));
  RecordProperty("completeness_voxels", std::to_string(error.completeness / 0.06));
  RecordProperty("normal_error_degrees", std::to_string(turn));
  EXPECT_LT(accuracy, 0.5 * 0.06);
  EXPECT_LT(error.completeness, 0.5 * 0.06);
  EXPECT_LT(turn, 5);
}

TEST(FuseViews, ChoosesAVoxelByTheBoxOfTheViews) {
  const BoardInCapture f;
  FusionOptions options;
  options.resolution = 32;
  std::vector<std::pair<size_t, size_t>> progress;
  const TriangleMesh mesh = fuse_views(f.subject, f.shots, 0, options,
                                       [&](size_t done, size_t all) { progress.emplace_back(done, all); });
  ASSERT_EQ(progress.size(), 6U);
  for (size_t i = 0; i < 6; ++i) EXPECT_EQ(progress[i], std::pair(i + 1, size_t{6}));
  // Three images of 64/70 of a depth of 5 are seen of the wall, which is the longest side.
  const double longest = 5 * 64 / 70.0 + 0.6;
  double least = 0, most = 0;
  for (int64_t i = 0; i < mesh.vertex_count(); ++i) {
    least = std::min(least, 0.25 * (mesh.vertices(i, 0) - 10.0));
    most = std::max(most, 0.25 * (mesh.vertices(i, 0) - 10.0));
  }
  EXPECT_NEAR(most - least, longest, 0.3);
  // A voxel has about two triangles on a wall.
  const double voxel = longest / 32;
  const double wall_voxels = longest * (5 * 48 / 70.0) / (voxel * voxel);
  EXPECT_GT(static_cast<double>(mesh.triangle_count()), wall_voxels);
  EXPECT_LT(static_cast<double>(mesh.triangle_count()), 4 * wall_voxels);
}

TEST(FuseViews, LeavesOutWhatIsTooFar) {
  const BoardInCapture f;
  FusionOptions options = BoardInCapture::options();
  options.max_depth = 4 * 4;  // in the capture's units: between board and wall
  const TriangleMesh mesh = fuse_views(f.subject, f.shots, 0, options);
  EXPECT_EQ(static_cast<int64_t>(BoardInCapture::of_board(mesh).size()), mesh.vertex_count());
  options.max_depth = 1;
  EXPECT_THAT(refusal_of([&] { fuse_views(f.subject, f.shots, 0, options); }), HasSubstr("no surface"));
  options.voxel = 0;
  EXPECT_THAT(refusal_of([&] { fuse_views(f.subject, f.shots, 0, options); }), HasSubstr("no surface"));
}

TEST(DepthViewOfAFrame, BlendsDepthsAsTheSurfaceDoes) {
  Frame frame;
  frame.camera.width = 2;
  frame.camera.height = 1;
  frame.raster.depth = tensor_of(std::vector<float>{2, 3});
  frame.raster.median_depth = tensor_of(std::vector<float>{4, 0});
  EXPECT_EQ(depth_view(frame, 0).depth[0], 2);
  EXPECT_EQ(depth_view(frame, 1).depth[0], 4);
  EXPECT_EQ(depth_view(frame, 0.25F).depth[0], 2.5F);
  EXPECT_EQ(depth_view(frame, 1).depth[1], 3) << "without a median depth the expected one counts";
}

}  // namespace
}  // namespace traceflow::mesh
