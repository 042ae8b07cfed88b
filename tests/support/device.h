#pragma once

#include <gtest/gtest.h>

#include "primitives/gemm.h"
#include "support/gradients.h"

// What the parity tests share: the same op on the CPU and on the CUDA device, or on its emulation.
namespace traceflow::testing {

// A test of this fixture is skipped where no device answers.
class OnDevice : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string why_not;
    if (!cuda::is_ready(why_not)) GTEST_SKIP() << "no CUDA device: " << why_not;
  }
};

// expect_close of what the device holds.
template <class A, class B>
void expect_close_on_host(const Tensor<A>& found, const Tensor<B>& expected, double tolerance,
                          const char* what) {
  ASSERT_EQ(found.device(), Device::cuda) << what;
  expect_close(found.on(Device::cpu), expected, tolerance, what);
}

}  // namespace traceflow::testing
