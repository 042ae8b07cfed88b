#include "train/found_masks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "base/parallel.h"
#include "base/robust.h"
#include "capture/image_cache.h"
#include "files/png.h"
#include "train/small_run.h"

namespace traceflow {
namespace {

using ::testing::HasSubstr;

bool same(const Tensor<uint8_t>& a, const Tensor<uint8_t>& b) {
  return a.shape() == b.shape() && std::ranges::equal(a.values(), b.values());
}
bool same(const FoundMasks& a, const FoundMasks& b) {
  return a.size() == b.size() && std::ranges::all_of(a, [&](const auto& mask) {
           return b.contains(mask.first) && same(mask.second, b.at(mask.first));
         });
}

const StepsDone always = [](int64_t, int64_t) { return true; };

Tensor<float> filled(const Shape& shape, float value) {
  Tensor<float> tensor(shape);
  tensor.fill(value);
  return tensor;
}

// A texture that no brightness explains.
void paint(Tensor<float>& image, int64_t y, int64_t x) {
  for (int64_t c = 0; c < 3; ++c) {
    const float angle =
        0.6F * static_cast<float>(y) + 0.8F * static_cast<float>(x) + 2 * static_cast<float>(c);
    image(y, x, c) = 0.5F + 0.1F * std::sin(angle);
  }
}

bool is_inside(int64_t y, int64_t x) { return y >= 8 && y < 20 && x >= 10 && x < 26; }

struct Seen {
  StillScene::Look still;
  ViewImages photograph;
};
// A textured wall, and in the photograph a box of one colour before it, with a shadow on its right.
Seen box_before_wall() {
  const int64_t height = 30, width = 40;
  Seen seen;
  seen.still.colour.resize({height, width, 3});
  seen.still.agreement = filled({height, width}, 1);
  seen.photograph.colour.resize({height, width, 3});
  for (int64_t y = 0; y < height; ++y) {
    for (int64_t x = 0; x < width; ++x) {
      paint(seen.still.colour, y, x);
      paint(seen.photograph.colour, y, x);
      for (int64_t c = 0; c < 3; ++c) {
        if (x >= 30) seen.photograph.colour(y, x, c) *= 0.7F;
        if (is_inside(y, x)) seen.photograph.colour(y, x, c) = c == 0 ? 0.9F : 0.1F;
      }
    }
  }
  return seen;
}

// The largest error of a box that is found, but for its edge of two pixels.
void expect_box(const Tensor<float>& share) {
  for (int64_t y = 0; y < share.dim(0); ++y) {
    for (int64_t x = 0; x < share.dim(1); ++x) {
      bool is_edge = false;
      for (int64_t k = 0; k < 25; ++k) is_edge |= is_inside(y + k / 5 - 2, x + k % 5 - 2) != is_inside(y, x);
      if (is_edge) continue;
      if (is_inside(y, x)) {
        EXPECT_GT(share(y, x), 0.5F) << y << ' ' << x;
      } else {
        EXPECT_LT(share(y, x), 0.4F) << y << ' ' << x;
      }
    }
  }
}

TEST(FoundMasks, ShowWhatDiffersFromTheStillSceneAndNotItsShadow) {
  const Seen seen = box_before_wall();
  expect_box(moving_share(seen.still, seen.photograph));
}

TEST(FoundMasks, ReachWhatTheStillSceneDoesNotKnow) {
  // Nothing is known of what is behind the lower half of the box and of a part of the wall below it; the
  // still scene says that the photograph is right there. The normals of the box and the wall differ.
  Seen seen = box_before_wall();
  seen.photograph.normal_prior.resize(seen.photograph.colour.shape());
  for (int64_t y = 0; y < 30; ++y) {
    for (int64_t x = 0; x < 40; ++x) {
      store3(&seen.photograph.normal_prior(y, x, 0),
             is_inside(y, x) ? Vec3<float>(0, 1, 0) : Vec3<float>(0, 0, 1));
      if (y < 14 || y >= 24 || x < 6 || x >= 30) continue;
      seen.still.agreement(y, x) = 0.4F;
      for (int64_t c = 0; c < 3; ++c) seen.still.colour(y, x, c) = seen.photograph.colour(y, x, c);
    }
  }
  expect_box(moving_share(seen.still, seen.photograph));
}

TEST(MeanDifference, IsThatOfSquares) {
  Random random(3);
  Tensor<float> a({6, 9, 3}), b({6, 9, 3});
  for (float& v : a.values()) v = static_cast<float>(random.uniform());
  for (float& v : b.values()) v = static_cast<float>(random.uniform());
  const Tensor<float> off = mean_difference(a, b);
  for (int64_t y = 0; y < 6; ++y) {
    for (int64_t x = 0; x < 9; ++x) {
      double largest = 0;
      for (int64_t c = 0; c < 3; ++c) {
        double sum = 0;
        int count = 0;
        for (int64_t i = std::max<int64_t>(0, y - 2); i <= std::min<int64_t>(5, y + 2); ++i) {
          for (int64_t j = std::max<int64_t>(0, x - 2); j <= std::min<int64_t>(8, x + 2); ++j) {
            sum += static_cast<double>(a(i, j, c)) - b(i, j, c);
            ++count;
          }
        }
        largest = std::max(largest, std::abs(sum / count));
      }
      EXPECT_NEAR(off(y, x), largest, 1e-5);
    }
  }
}

// A film of tumbling things, and the same without the masks of its training views.
class Films : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder() = fs::path(::testing::TempDir()) / ("found_masks_" + std::to_string(::getpid()));
    SynthOptions options;
    options.scene = SynthScene::tumble;
    options.frames = 16;
    options.width = 64;
    options.height = 36;
    options.samples = 2;
    options.points = 4000;
    write_synthetic_capture(options, folder() / "with");
    fs::copy(folder() / "with", folder() / "without", fs::copy_options::recursive);
    for (const View& view : load_capture(folder() / "with", {}).train)
      fs::remove(folder() / "without/mask/1x" / (view.id + ".png.png"));
  }
  static void TearDownTestSuite() { fs::remove_all(folder()); }
  static fs::path& folder() {
    static fs::path path;
    return path;
  }
  static Capture with() { return load_capture(folder() / "with", {}); }
  static Capture without() { return load_capture(folder() / "without", {}); }
};

TEST_F(Films, AreLookedAtWhereNoMaskShowsWhatMoves) {
  TrainOptions options = preset("cpu");
  EXPECT_EQ(iterations_to_find_objects(without(), options), 1000);
  EXPECT_EQ(iterations_to_find_objects(with(), options), 0);
  options.iterations = 1000;
  EXPECT_EQ(iterations_to_find_objects(without(), options), 400);
  options.iterations = 400;
  EXPECT_EQ(iterations_to_find_objects(without(), options), 0) << "too short a run";
  options = preset("cpu");
  options.deform.find = 0;
  EXPECT_EQ(iterations_to_find_objects(without(), options), 0);
  options = preset("paper");
  EXPECT_EQ(iterations_to_find_objects(without(), options), 0);
  Capture short_film = without();
  short_film.train.resize(9);
  EXPECT_EQ(iterations_to_find_objects(short_film, preset("cpu")), 0);
}

TEST_F(Films, AreLookedAtWhereTheFirstMasksAreMissing) {
  Capture film = with();
  std::vector<std::string> ids;
  for (const View& view : film.train) ids.push_back(view.id);
  const TrainOptions options = preset("cpu");
  film.images->leave_masks_out(std::span(ids).subspan(1));
  EXPECT_EQ(iterations_to_find_objects(film, options), 0) << "the first mask is there";
  film = with();
  film.images->leave_masks_out(std::span(ids).first(2));
  EXPECT_EQ(iterations_to_find_objects(film, options), 1000);
  // Only views without masks get new ones, and the others still tell what mirrors.
  const std::optional<FoundObjects> found = find_objects(film, options, 10, always);
  ASSERT_TRUE(found.has_value());
  EXPECT_EQ(found->masks.size(), 2U);
  EXPECT_TRUE(found->masks.contains(ids[0]) && found->masks.contains(ids[1]));
  give_objects(*found, film);
  EXPECT_FALSE(film.masks_are_found);
  EXPECT_TRUE(film.images->has_mask(ids[0]));
}

TEST_F(Films, ShowWhatMoves) {
  Capture film = without();
  const Capture truth = with();
  std::optional<FoundObjects> found = find_objects(film, preset("cpu"), 500, always);
  ASSERT_TRUE(found.has_value());
  ASSERT_EQ(found->masks.size(), film.train.size());
  int64_t both = 0, any = 0;
  for (const View& view : truth.train) {
    const Tensor<uint8_t> mask = load_images(truth, view)->mask;
    for (int64_t i = 0; i < mask.size(); ++i) {
      const bool is_found = found->masks.at(view.id)[i] >= 128;
      both += is_found && mask[i] != 0 ? 1 : 0;
      any += is_found || mask[i] != 0 ? 1 : 0;
    }
  }
  EXPECT_GT(static_cast<double>(both) / static_cast<double>(any), 0.6);
  // Bodies are followed by them, and they say nothing of mirrors.
  give_objects(*found, film);
  const TrainOptions options = preset("cpu");
  EXPECT_TRUE(follows_bodies(film, options));
  const Trainer trainer(options, film, folder() / "run");
  ASSERT_TRUE(trainer.scene().main_motion.has_value());
  for (const float tint : trainer.scene().main.tint_logit.values())
    EXPECT_FLOAT_EQ(tint, trainer.scene().main.tint_logit[0]);
  // What stands is not carried: where all points stood, only made up ones would be left for bodies.
  const double standing = static_cast<double>(film.standing_points.dim(0));
  EXPECT_GT(standing, 0.4 * static_cast<double>(film.points.dim(0)));
  EXPECT_LT(standing, 0.95 * static_cast<double>(film.points.dim(0)));
  film.standing_points = film.points;
  Random random(1);
  const InitialScene made = initial_scene(film, options, random);
  ASSERT_TRUE(made.scene.main_motion.has_value());
  for (int64_t i = 0; i < made.at_points; ++i) ASSERT_LT(made.scene.main.body[i], 0);
  EXPECT_GT(made.scene.main.count(), made.at_points);
}

TEST_F(Films, GiveFinerPhotographsTheSameMasks) {
  CaptureOptions half_size;
  half_size.downscale = 2;
  Capture film = load_capture(folder() / "without", half_size);
  const View& view = film.train[0];
  FoundMasks masks;
  masks[view.id].resize({view.camera.height, view.camera.width});
  for (int64_t i = 0; i < masks[view.id].size(); ++i) masks[view.id][i] = static_cast<uint8_t>(7 * i % 256);
  give_objects({masks, {}}, film);
  const FinePhotograph fine = load_fine_photograph(film, view, 64);
  ASSERT_EQ(fine.coverage.dim(1), 2 * view.camera.width);
  for (int64_t y = 0; y < fine.coverage.dim(0); ++y) {
    for (int64_t x = 0; x < fine.coverage.dim(1); ++x)
      ASSERT_FLOAT_EQ(fine.coverage(y, x), static_cast<float>(masks[view.id](y / 2, x / 2)) / 255);
  }
}

TEST_F(Films, LeaveAStillSceneWithoutWhatMoves) {
  const Capture film = without(), truth = with();
  StillScene still(film, preset("cpu"), 300, always);
  const std::shared_ptr<const ViewImages> images = load_images(truth, truth.train[0]);
  const ViewImages& photograph = *images;
  const Tensor<float> off = mean_difference(still.look(film.train[0]).colour, photograph.colour);
  std::vector<double> inside, outside;
  for (int64_t i = 0; i < off.size(); ++i) (photograph.mask[i] != 0 ? inside : outside).push_back(off[i]);
  EXPECT_GT(median(inside), 0.08);
  EXPECT_LT(median(outside), 0.04);
}

TEST_F(Films, AreLeftWhereWhoeverWaitsSaysSo) {
  int64_t told = 0;
  EXPECT_FALSE(find_objects(without(), preset("cpu"), 600, [&](int64_t done, int64_t all) {
                 EXPECT_EQ(all, 600);
                 told = done;
                 return done < 3;
               }).has_value());
  EXPECT_EQ(told, 3);
}

TEST_F(Films, KeepTheMasksThatAreGiven) {
  Capture film = without();
  FoundMasks masks;
  for (const View& view : film.train) {
    Tensor<uint8_t>& mask = masks[view.id];
    mask.resize({view.camera.height, view.camera.width});
    for (int64_t i = 0; i < mask.size(); ++i) mask[i] = static_cast<uint8_t>(7 * i % 256);
  }
  const fs::path kept = folder() / "kept";
  EXPECT_TRUE(read_masks(kept, film).empty());
  write_masks(masks, kept);
  EXPECT_TRUE(same(read_masks(kept, film), masks));

  EXPECT_TRUE(load_images(film, film.train[0])->mask.empty());
  give_objects({masks, {}}, film);
  for (const View& view : film.train) {
    const auto pixels = load_pixels(film, view);
    EXPECT_TRUE(same(pixels->coverage, masks.at(view.id)));
    for (int64_t i = 0; i < pixels->mask.size(); ++i)
      ASSERT_EQ(pixels->mask[i], masks.at(view.id)[i] >= 128 ? 1 : 0);
    EXPECT_EQ(pixels->bytes(), film.images->bytes_of(view.id));
  }
  film.images->leave_masks_out(std::vector<std::string>{film.train[0].id});
  EXPECT_TRUE(load_images(film, film.train[0])->mask.empty());
  EXPECT_FALSE(load_images(film, film.train[1])->mask.empty());

  fs::remove(kept / (film.train[0].id + ".png"));
  EXPECT_EQ(read_masks(kept, film).size(), film.train.size() - 1);
  write_png(kept / (film.train[0].id + ".png"), Tensor<uint8_t>({3, 4}));
  try {
    read_masks(kept, film);
    ADD_FAILURE() << "a mask of another size";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("begin again"));
  }
}

TEST_F(Films, AreSeenAlikeAtAnyThreadCount) {
  const Capture film = without();
  std::optional<FoundObjects> first;
  for (const int threads : {1, 3}) {
    set_threads(threads);
    const std::optional<FoundObjects> found = find_objects(film, preset("cpu"), 200, always);
    ASSERT_TRUE(found.has_value());
    if (!first) first = found;
    EXPECT_TRUE(same(found->masks, first->masks));
  }
  set_threads(0);
}

}  // namespace
}  // namespace traceflow
