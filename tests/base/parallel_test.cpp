#include "base/parallel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <omp.h>
#include <rapidcheck/gtest.h>

#include <atomic>
#include <bit>
#include <numeric>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>

#include "base/indices.h"
#include "base/random.h"

namespace traceflow {
namespace {

// Restores the machine's own number of threads when a test ends.
struct ThreadsForOneTest {
  ThreadsForOneTest() = default;
  ThreadsForOneTest(const ThreadsForOneTest&) = delete;
  ThreadsForOneTest& operator=(const ThreadsForOneTest&) = delete;
  ~ThreadsForOneTest() { set_threads(0); }
};

TEST(Parallel, ThreadCountIsWhatWasSet) {
  const ThreadsForOneTest restore;
  set_threads(3);
  EXPECT_EQ(thread_count(), 3);
  const int usual = omp_get_max_threads();
  omp_set_num_threads(5);  // as OMP_NUM_THREADS=5 does
  set_threads(0);
  EXPECT_EQ(thread_count(), 5);
  set_threads(-5);
  EXPECT_EQ(thread_count(), 5);
  omp_set_num_threads(usual);
}

RC_GTEST_PROP(ParallelProperty, BlocksCoverEveryElementOnceAtFixedBoundaries, ()) {
  const ThreadsForOneTest restore;
  const auto n = *rc::gen::inRange<int64_t>(0, 2000);
  const auto grain = *rc::gen::inRange<int64_t>(1, 300);
  set_threads(*rc::gen::inRange(1, 5));
  std::vector<int> visits(static_cast<size_t>(n));
  std::mutex mutex;
  std::set<std::pair<int64_t, int64_t>> blocks;
  parallel_blocks("test", n, grain, [&](int64_t begin, int64_t end) {
    for (int64_t i = begin; i < end; ++i) visits[static_cast<size_t>(i)] += 1;
    const std::lock_guard lock(mutex);
    blocks.emplace(begin, end);
  });
  for (const int v : visits) RC_ASSERT(v == 1);
  for (const auto& [begin, end] : blocks) {
    RC_ASSERT(begin % grain == 0);
    RC_ASSERT(end == std::min(n, begin + grain));
  }
}

TEST(Parallel, ForVisitsEveryElement) {
  std::vector<int64_t> squares(5000);
  parallel_for(
      "test", 5000, [&](int64_t i) { squares[static_cast<size_t>(i)] = i * i; }, 17);
  for (size_t i = 0; i < squares.size(); ++i) EXPECT_EQ(squares[i], static_cast<int64_t>(i * i));
  parallel_for("test", 0, [](int64_t) { FAIL(); });
}

// Numbers of very different size: a sum in any other order rounds differently.
TEST(Parallel, OrderedSumHasTheSameBytesAtAnyThreadCount) {
  const ThreadsForOneTest restore;
  Random random(1);
  std::vector<float> values(100'003);
  for (float& v : values) v = static_cast<float>(random.normal() * std::exp(10 * random.normal()));
  const auto sum = [&] {
    return ordered_sum<float>(
        "test", static_cast<int64_t>(values.size()),
        [&](int64_t i) { return values[static_cast<size_t>(i)]; }, 1000);
  };
  // Oracle: the blocks' sums, added in order, by hand.
  float expected = 0;
  for (size_t begin = 0; begin < values.size(); begin += 1000) {
    const auto end = std::min(begin + 1000, values.size());
    expected += std::accumulate(values.begin() + static_cast<ptrdiff_t>(begin),
                                values.begin() + static_cast<ptrdiff_t>(end), 0.0F);
  }
  EXPECT_NE(expected, std::accumulate(values.begin(), values.end(), 0.0F));
  for (int threads = 1; threads <= 4; ++threads) {
    set_threads(threads);
    for (int repeat = 0; repeat < 5; ++repeat) {
      const float found = sum();
      EXPECT_EQ(std::bit_cast<uint32_t>(found), std::bit_cast<uint32_t>(expected)) << threads << " threads";
    }
  }
}

TEST(Parallel, OrderedSumOfNothingIsZero) {
  EXPECT_EQ(ordered_sum<double>("test", 0, [](int64_t) { return 1.0; }), 0);
}

TEST(Parallel, AnExceptionComesOutOfTheLoop) {
  const ThreadsForOneTest restore;
  for (int threads = 1; threads <= 4; ++threads) {
    set_threads(threads);
    const auto run = [] {
      parallel_for(
          "test", 1000,
          [](int64_t i) {
            if (i % 100 == 77) throw std::runtime_error("element");
          },
          10);
    };
    EXPECT_THROW(run(), std::runtime_error);
  }
}

// What a loop fails with must not hang on which thread came first: the same bad input has the same message.
TEST(Parallel, TheFirstElementThatFailsIsTheOneThatIsTold) {
  const ThreadsForOneTest restore;
  for (int threads = 1; threads <= 4; ++threads) {
    set_threads(threads);
    std::atomic<bool> later_failed = false;
    const auto run = [&] {
      parallel_for(
          "test", 100,
          [&](int64_t i) {
            if (i == 3 && threads > 1) {
              for (int turn = 0; turn < 1'000'000 && !later_failed; ++turn) std::this_thread::yield();
            }
            if (i == 3 || i == 4) {
              later_failed = i == 4;
              throw std::runtime_error(std::to_string(i));
            }
          },
          1);
    };
    EXPECT_THAT(run, testing::ThrowsMessage<std::runtime_error>("3"));
  }
}

TEST(Parallel, LoopsNest) {
  const ThreadsForOneTest restore;
  set_threads(2);
  std::atomic<int> count = 0;
  parallel_for(
      "outer", 8,
      [&](int64_t) {
        parallel_for(
            "inner", 100, [&](int64_t) { ++count; }, 10);
      },
      1);
  EXPECT_EQ(count, 800);
}

TEST(Indices, RiseWithinTheirRange) {
  const auto check = [](const std::vector<int32_t>& indices, int64_t limit) {
    require_ascending(tensor_of(indices), limit);
  };
  EXPECT_NO_THROW(check({}, 0));
  EXPECT_NO_THROW(check({0, 1, 5}, 6));
  EXPECT_THROW(check({0, 6}, 6), InternalError);
  EXPECT_THROW(check({-1}, 6), InternalError);
  EXPECT_THROW(check({2, 2}, 6), InternalError);
  EXPECT_THROW(check({3, 2}, 6), InternalError);
}

TEST(ParallelBlocks, NothingMoreIsRunOnceSomethingHasThrown) {
  set_threads(1);
  int64_t run = 0;
  EXPECT_THROW(parallel_blocks("test: throws", 100, 1,
                               [&](int64_t begin, int64_t) {
                                 ++run;
                                 if (begin == 10) throw std::bad_alloc();
                               }),
               std::bad_alloc);
  EXPECT_EQ(run, 11);
  set_threads(0);
}

}  // namespace
}  // namespace traceflow
