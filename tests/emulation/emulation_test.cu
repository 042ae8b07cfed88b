#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>
#include <string>
#include <vector>

#include "base/kernel.h"
#include "base/tensor.h"
#include "emulation/device.h"

// The emulation itself: that kernels compute what CUDA would, and that what CUDA leaves undefined ends the
// program.
namespace traceflow {
namespace {

constexpr int block = 64;

struct Padded {
  bool flag = false;
  int32_t* to = nullptr;
};
__global__ void write_flag(Padded argument) { argument.to[threadIdx.x] = argument.flag ? 1 : 0; }

__global__ void reverse_block(const int32_t* from, int32_t* to) {
  __shared__ int32_t kept[block];
  kept[threadIdx.x] = from[blockIdx.x * block + threadIdx.x];
  __syncthreads();
  to[blockIdx.x * block + threadIdx.x] = kept[block - 1 - threadIdx.x];
}

__global__ void without_barrier(int32_t* to) {
  __shared__ int32_t kept[block];
  kept[threadIdx.x] = 0;
  __syncthreads();
  kept[threadIdx.x] = 1;
  to[threadIdx.x] = kept[block - 1 - threadIdx.x];
}

__global__ void warp_operations(float* sum, uint32_t* odd, int32_t* above) {
  const unsigned lane = threadIdx.x % 32;
  sum[threadIdx.x] = cuda::warp_sum(static_cast<float>(lane));
  odd[threadIdx.x] = __ballot_sync(cuda::full_warp, lane % 2 == 1);
  above[threadIdx.x] = __shfl_up_sync(cuda::full_warp, static_cast<int32_t>(lane), 1);
}

__global__ void count_into(int32_t* total) { atomicAdd(total, 1); }

__global__ void take_a_number(int32_t* next, int32_t* number) { number[blockIdx.x] = atomicAdd(next, 1); }

__global__ void half_a_warp_misses_the_mask(int32_t* to) {
  if (threadIdx.x < 16) to[threadIdx.x] = __shfl_sync(0xffff0000U, 1, 0);
}

__global__ void half_a_block_waits(int32_t* to) {
  if (threadIdx.x < 32) {
    __syncthreads();
  } else {
    to[threadIdx.x] = __shfl_sync(cuda::full_warp, 1, 0);
    if (threadIdx.x == 40) to[0] = __shfl_sync(cuda::full_warp, 1, 0);
  }
}

Tensor<int32_t> numbers(int64_t count) {
  Tensor<int32_t> list({count});
  for (int64_t i = 0; i < count; ++i) list[i] = static_cast<int32_t>(i);
  return list.on(Device::cuda);
}

TEST(Emulation, SharedMemoryAndBarriersWorkAsInABlock) {
  const Tensor<int32_t> from = numbers(3 * block);
  Tensor<int32_t> to({3 * block}, Device::cuda);
  cuda::launch("reverse", {3, block}, reverse_block, from.data(), to.data());
  const Tensor<int32_t> found = to.on(Device::cpu);
  for (int64_t i = 0; i < found.size(); ++i) ASSERT_EQ(found[i], i / block * block + block - 1 - i % block);
}

TEST(Emulation, ABarrierThatIsMissingShows) {
  Tensor<int32_t> to({block}, Device::cuda);
  int64_t stale = 0;
  for (int run = 0; run < 5; ++run) {
    cuda::launch("without barrier", {1, block}, without_barrier, to.data());
    const Tensor<int32_t> found = to.on(Device::cpu);
    for (const int32_t v : found.values()) stale += v == 0 ? 1 : 0;
  }
  EXPECT_GT(stale, 0);
}

TEST(Emulation, WarpsShuffleAndVote) {
  Tensor<float> sum({block}, Device::cuda);
  Tensor<uint32_t> odd({block}, Device::cuda);
  Tensor<int32_t> above({block}, Device::cuda);
  cuda::launch("warp", {1, block}, warp_operations, sum.data(), odd.data(), above.data());
  const Tensor<float> sums = sum.on(Device::cpu);
  const Tensor<uint32_t> votes = odd.on(Device::cpu);
  const Tensor<int32_t> shifted = above.on(Device::cpu);
  for (int64_t i = 0; i < block; ++i) {
    EXPECT_EQ(sums[i], 31 * 32 / 2);
    EXPECT_EQ(votes[i], 0xaaaaaaaaU);
    EXPECT_EQ(shifted[i], std::max<int64_t>(i % 32 - 1, 0));
  }
}

TEST(Emulation, AtomicsOfAllBlocksMeet) {
  Tensor<int32_t> total({1}, Device::cuda);
  cuda::launch("count", {7, block}, count_into, total.data());
  EXPECT_EQ(total.on(Device::cpu)[0], 7 * block);
}

TEST(Emulation, EveryBlockComesOnceInNoOrder) {
  for (const int64_t blocks : {1, 60, 97}) {
    std::vector<std::vector<int32_t>> orders;
    for (int time = 0; time < 2; ++time) {
      Tensor<int32_t> next({1}, Device::cuda), number({blocks}, Device::cuda);
      cuda::launch("order", {blocks, 1}, take_a_number, next.data(), number.data());
      const Tensor<int32_t> found = number.on(Device::cpu);
      orders.emplace_back(found.values().begin(), found.values().end());
    }
    EXPECT_EQ(orders[0] == orders[1], blocks == 1);
    for (std::vector<int32_t>& order : orders) {
      EXPECT_EQ(std::is_sorted(order.begin(), order.end()), blocks == 1);
      std::sort(order.begin(), order.end());
      for (int64_t k = 0; k < blocks; ++k) EXPECT_EQ(order[static_cast<size_t>(k)], k);
    }
  }
}

TEST(Emulation, FreshMemoryHoldsNoNumbers) {
  Tensor<float> fresh;
  fresh.place(Device::cuda).resize({100});
  const Tensor<float> found = fresh.on(Device::cpu);
  for (const float v : found.values()) EXPECT_TRUE(std::isnan(v));
}

using EmulationDeathTest = ::testing::Test;

TEST(EmulationDeathTest, TheHostDoesNotReadTheDevicesMemory) {
  const Tensor<int32_t> list = numbers(10);
  EXPECT_DEATH(std::printf("%d", list[3]), "");
}

TEST(EmulationDeathTest, AKernelIsNotGivenATensorOnTheHost) {
  const Tensor<int32_t> from({block});
  Tensor<int32_t> to({block}, Device::cuda);
  EXPECT_DEATH(cuda::launch("reverse", {1, block}, reverse_block, from.data(), to.data()),
               "reverse: the kernel is given a tensor on the host");
}

TEST(Emulation, WhatLiesBetweenTheMembersOfAnArgumentIsNoTensor) {
  const Tensor<int32_t> on_host({block});
  Tensor<int32_t> to({block}, Device::cuda);
  Padded argument;
  const void* const stale = on_host.data();
  std::memcpy(static_cast<void*>(&argument), &stale, sizeof(stale));
  argument.flag = true;
  argument.to = to.data();
  cuda::launch("padded", {1, block}, write_flag, argument);
  EXPECT_EQ(to.on(Device::cpu)[3], 1);
}

TEST(EmulationDeathTest, AMaskThatLeavesItsLaneOutEndsTheProgram) {
  Tensor<int32_t> to({block}, Device::cuda);
  EXPECT_DEATH(cuda::launch("mask", {1, 32}, half_a_warp_misses_the_mask, to.data()), "leaves it out");
}

TEST(EmulationDeathTest, ThreadsThatWaitForNobodyEndTheProgram) {
  Tensor<int32_t> to({block}, Device::cuda);
  EXPECT_DEATH(cuda::launch("wait", {1, block}, half_a_block_waits, to.data()), "never come");
}

// Without memory a kernel is not started; what the pool held may be enough for the second try.
TEST(Emulation, AKernelThatFindsNoMemoryIsTriedAgainOnceThePoolIsTrimmed) {
  Tensor<int32_t> total({1}, Device::cuda);
  const auto run = [&] { cuda::launch("count", {2, block}, count_into, total.data()); };
  const int64_t trims = emulation::trims();
  emulation::refuse_launches(1, 1);
  run();
  EXPECT_EQ(emulation::trims(), trims);
  run();
  EXPECT_EQ(emulation::trims(), trims + 1);
  EXPECT_EQ(total.on(Device::cpu)[0], 2 * 2 * block);
}

TEST(Emulation, AKernelThatTwiceFindsNoMemoryIsOutOfMemoryAndNoFaultOfTheProgram) {
  Tensor<int32_t> total({1}, Device::cuda);
  const auto run = [&] { cuda::launch("count", {2, block}, count_into, total.data()); };
  const int64_t trims = emulation::trims();
  emulation::refuse_launches(0, 2);
  try {
    run();
    FAIL() << "was started";
  } catch (const memory::OutOfMemory& error) {
    EXPECT_EQ(std::string(error.what()).find("out of device memory: the driver found none for itself, "), 0U)
        << error.what();
  }
  EXPECT_EQ(emulation::trims(), trims + 1);
  EXPECT_EQ(total.on(Device::cpu)[0], 0);
  run();
  EXPECT_EQ(total.on(Device::cpu)[0], 2 * block);
}

}  // namespace
}  // namespace traceflow
