#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/robust.h"
#include "files/npy.h"
#include "files/png.h"
#include "prepare/attach_priors.h"
#include "small_capture.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow::prepare {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;

SynthOptions with_estimates() {
  SynthOptions options = small_capture();
  options.depths = true;
  return options;
}

// A synthetic capture whose training views another program has estimated the depths of.
class AttachDepth : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    made = std::make_unique<TempFolder>();
    write_synthetic_capture(with_estimates(), *made / "capture");
  }
  static void TearDownTestSuite() { made.reset(); }

  AttachDepth() { fs::copy(*made / "capture", capture(), fs::copy_options::recursive); }

  fs::path capture() const { return folder_ / "capture"; }
  fs::path pictures() const { return capture() / "estimates/depth"; }

  // T×H×W, inverse depths up to a scale and a shift.
  Tensor<float> estimates() const {
    Tensor<float> all({5, 48, 80});
    int64_t i = 0;
    for (const SynthView& view : synth_views(with_estimates())) {
      if (view.is_test) continue;
      const Tensor<float> inverse =
          synth_inverse_depth(with_estimates(), view, synth_images(with_estimates(), view).depth);
      std::ranges::copy(inverse.values(), all.row(i++));
    }
    return all;
  }

  std::string attach(const fs::path& depth, DepthKind kind = DepthKind::automatic) {
    AttachOptions options;
    options.depth = depth;
    options.depth_kind = kind;
    options.force = true;
    std::string said;
    attach_priors(
        capture(), options, [&](const std::string& line) { said += line + "\n"; }, never_);
    return said;
  }

  // The median relative error of the loaded priors of all training views, in and outside the masks.
  double error() const {
    const Capture capture = load_capture(this->capture(), {});
    std::vector<double> errors;
    for (const SynthView& view : synth_views(with_estimates())) {
      if (view.is_test) continue;
      const Tensor<float> truth = synth_images(with_estimates(), view).depth;
      const auto loaded = std::ranges::find(capture.train, view.id, &View::id);
      const Tensor<float> found = load_images(capture, *loaded)->depth_prior;
      EXPECT_EQ(found.shape(), truth.shape());
      for (int64_t i = 0; i < found.size(); ++i)
        errors.push_back(std::abs(found[i] / (truth[i] * capture.normalisation.scale) - 1));
    }
    return median(errors);
  }

  static std::unique_ptr<TempFolder> made;
  TempFolder folder_;
  const std::atomic<bool> never_ = false;
};
std::unique_ptr<TempFolder> AttachDepth::made;

TEST_F(AttachDepth, InverseDepthsInPicturesBecomeDepthsOfTheCapture) {
  EXPECT_THAT(attach(pictures()), AllOf(HasSubstr("5 of 7 views"), HasSubstr("as inverse depth")));
  EXPECT_LT(error(), 0.03);
  EXPECT_THROW(attach(pictures(), DepthKind::depth), InputError) << "nearer is larger";
  EXPECT_LT(error(), 0.03) << "what was there stays";
}

TEST_F(AttachDepth, DepthsOfAnUnknownUnitBecomeDepthsOfTheCapture) {
  Tensor<float> depths = estimates();
  for (float& value : depths.values()) value = 70 / (value + 0.3F) + 9;
  write_npy(folder_ / "depths.npy", depths);
  EXPECT_THAT(attach(folder_ / "depths.npy"), HasSubstr("as depth"));
  // The shift of the inverse depths is now part of a quotient, which a scale and a shift do not undo exactly.
  EXPECT_LT(error(), 0.15);
}

// All that follow give the same values, so that the attached bytes are the same.
TEST_F(AttachDepth, AnArrayAnArchiveAndAFolderOfArraysAreAsGood) {
  const Tensor<float> values = estimates();
  write_npy(folder_ / "depths.npy", values);
  attach(folder_ / "depths.npy");
  const Capture capture = load_capture(this->capture(), {});
  const fs::path written = this->capture() / "depth/1x" / (capture.train[3].id + ".npy");
  const std::string expected = bytes_of(written);
  EXPECT_LT(error(), 0.03);

  write_npz(folder_ / "scene.npz", {{"images", &values}, {"depths", &values}});
  attach(folder_ / "scene.npz");
  EXPECT_EQ(bytes_of(written), expected);

  fs::create_directory(folder_ / "arrays");
  for (size_t i = 0; i < 5; ++i) {
    Tensor<float> one({1, 48, 80});
    std::copy_n(values.row(static_cast<int64_t>(i)), one.size(), one.data());
    if (i % 2 == 0) {
      write_npy(folder_ / "arrays" / (capture.train[i].id + ".npy"), one);
    } else {
      write_npz(folder_ / "arrays" / (capture.train[i].id + ".npz"), {{"depth", &one}, {"intrinsics", &one}});
    }
  }
  attach(folder_ / "arrays");
  EXPECT_EQ(bytes_of(written), expected);
}

TEST_F(AttachDepth, WhatDoesNotFitIsRefused) {
  Tensor<float> backwards = estimates();
  for (float& value : backwards.values()) value = -value;
  write_npy(folder_ / "backwards.npy", backwards);
  EXPECT_THAT(refusal_of([&] { attach(folder_ / "backwards.npy", DepthKind::inverse); }),
              HasSubstr("in 0 of 5 views"));
  write_npy(folder_ / "colours.npy", Tensor<float>({5, 48, 80, 3}));
  EXPECT_THAT(refusal_of([&] { attach(folder_ / "colours.npy"); }), HasSubstr("expected T×H×W"));
  write_npy(folder_ / "turned.npy", Tensor<float>({5, 80, 48}));
  EXPECT_THAT(refusal_of([&] { attach(folder_ / "turned.npy"); }), HasSubstr("depth: found 48×80"));
  write_npy(folder_ / "short.npy", Tensor<float>({4, 48, 80}));
  EXPECT_THAT(refusal_of([&] { attach(folder_ / "short.npy"); }), HasSubstr("count: found 4"));
  fs::create_directory(folder_ / "pictures");
  Tensor<uint8_t> picture({48, 80, 3});
  for (int i = 0; i < 5; ++i) {
    for (int64_t k = 0; k < picture.size(); ++k) picture[k] = static_cast<uint8_t>(k / 3 % 250);
    if (i == 4) picture[30] = 200;
    write_png(folder_ / "pictures" / (std::to_string(i) + ".png"), picture);
  }
  EXPECT_THAT(refusal_of([&] { attach(folder_ / "pictures"); }),
              AllOf(HasSubstr("4.png: colours"), HasSubstr("--grayscale")));
  fs::create_directory(folder_ / "empty");
  EXPECT_THAT(refusal_of([&] { attach(folder_ / "empty"); }), HasSubstr("neither arrays nor pictures"));
  EXPECT_FALSE(fs::exists(capture() / "depth"));
}

}  // namespace
}  // namespace traceflow::prepare
