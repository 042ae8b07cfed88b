#include "capture/image_cache.h"

#include <gtest/gtest.h>

#include <thread>

#include "base/parallel.h"
#include "fake_capture.h"
#include "files/npy.h"

namespace traceflow {
namespace {

// 1024×512 colours: 1.5 MiB a view, so that a bound in MiB holds few.
struct WideCapture : InterpCapture {
  WideCapture() : InterpCapture(0) {
    width = 1024;
    height = 512;
    std::vector<std::string> train;
    for (int i = 0; i < 6; ++i) {
      train.push_back(std::to_string(i));
      add_view(train.back(), i, i);
    }
    add_view("test", 6, 6);
    dataset = {{"ids", train}, {"train_ids", train}, {"val_ids", {"test"}}};
    save();
  }
};

CaptureOptions with_cache(int64_t mebibytes) {
  CaptureOptions options;
  options.cache_mebibytes = mebibytes;
  return options;
}

void expect_view(const Capture& capture, size_t i) {
  const auto images = load_images(capture, capture.train[i]);
  for (int64_t y = 0; y < 512; y += 37) {
    for (int64_t x = 0; x < 1024; x += 41) {
      ASSERT_EQ(images->colour(y, x, 1),
                static_cast<float>(FakeCapture::colour(static_cast<int>(i), y, x, 1)) / 255.0F);
    }
  }
}

TEST(ImageCache, never_grows_past_its_bound) {
  const WideCapture fake;
  const Capture capture = load_capture(fake.path(), with_cache(4));
  for (int round = 0; round < 2; ++round) {
    for (size_t i = 0; i < 6; ++i) {
      expect_view(capture, i);
      EXPECT_LE(capture.images->bytes(), int64_t{4} << 20);
    }
  }
  EXPECT_EQ(capture.images->bytes(), 2 * 3 * 1024 * 512);
}

TEST(ImageCache, drops_the_least_recently_used) {
  const WideCapture fake;
  const Capture capture = load_capture(fake.path(), with_cache(4));
  for (const size_t i : {0, 1, 0, 2}) expect_view(capture, i);
  // 0 and 2 are held, 1 is not: with the files gone only the held ones are found.
  std::filesystem::remove_all(fake.path() / "rgb");
  expect_view(capture, 0);
  expect_view(capture, 2);
  EXPECT_THROW(load_images(capture, capture.train[1]), InputError);
}

TEST(ImageCache, works_without_room) {
  const WideCapture fake;
  const Capture capture = load_capture(fake.path(), with_cache(0));
  for (size_t i = 0; i < 6; ++i) expect_view(capture, i);
  EXPECT_EQ(capture.images->bytes(), 0);
}

TEST(ImageCache, prefetch_fills_it_but_no_further) {
  const WideCapture fake;
  const Capture capture = load_capture(fake.path(), with_cache(4));
  prefetch(capture, capture.train);
  EXPECT_EQ(capture.images->bytes(), 2 * 3 * 1024 * 512);
  std::filesystem::remove_all(fake.path() / "rgb");
  expect_view(capture, 0);
  expect_view(capture, 1);
}

TEST(ImageCache, many_threads_see_the_same_pixels) {
  const WideCapture fake;
  const Capture capture = load_capture(fake.path(), with_cache(4));
  std::vector<std::thread> threads;
  for (size_t t = 0; t < 4; ++t) {
    threads.emplace_back([&, t] {
      for (size_t k = 0; k < 12; ++k) expect_view(capture, (k * (t + 1) + t) % 6);
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_LE(capture.images->bytes(), int64_t{4} << 20);
}

TEST(ImageCache, bytes_are_equal_at_any_thread_count) {
  NerfDsCapture fake;
  for (auto& [id, camera] : fake.cameras) camera["radial_distortion"] = {0.05, 0.01, 0.0};
  Tensor<float> priors({4, 8, 12, 3});
  for (int64_t i = 0; i < priors.size(); ++i) priors[i] = static_cast<float>((i * 31) % 17) - 8;
  write_npy(fake.path() / "normal.npy", priors);
  fake.save();
  std::vector<std::shared_ptr<const ViewImages>> first;
  for (const int threads : {1, 4}) {
    set_threads(threads);
    const Capture capture = load_capture(fake.path(), {});
    prefetch(capture, capture.train);
    for (size_t i = 0; i < capture.train.size(); ++i) {
      const auto images = load_images(capture, capture.train[i]);
      if (threads == 1) {
        first.push_back(images);
        continue;
      }
      EXPECT_TRUE(std::equal(images->colour.data(), images->colour.data() + images->colour.size(),
                             first[i]->colour.data()));
      EXPECT_TRUE(std::equal(images->normal_prior.data(),
                             images->normal_prior.data() + images->normal_prior.size(),
                             first[i]->normal_prior.data()));
    }
  }
  set_threads(0);
}

TEST(ImageCache, a_view_of_another_capture_is_a_bug) {
  NerfDsCapture fake;
  fake.save();
  const Capture capture = load_capture(fake.path(), {});
  View other;
  other.id = "elsewhere";
  EXPECT_THROW(load_images(capture, other), InternalError);
}

}  // namespace
}  // namespace traceflow
