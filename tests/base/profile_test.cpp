#include "base/profile.h"

#include <gtest/gtest.h>

#include "base/parallel.h"

namespace traceflow::profile {
namespace {

// Profiling on, and a clean table, for one test.
class Profile : public ::testing::Test {
 protected:
  Profile() {
    clear();
    enable(true);
  }
  ~Profile() override {
    enable(false);
    clear();
  }
};

TEST_F(Profile, CountsScopesByNameInTheOrderOfTheirFirstEnd) {
  for (int i = 0; i < 3; ++i) const Scope scope("a");
  { const Scope scope("b"); }
  { const Scope scope("a"); }
  const auto table = entries();
  ASSERT_EQ(table.size(), 2U);
  EXPECT_EQ(table[0].name, "a");
  EXPECT_EQ(table[0].calls, 4);
  EXPECT_EQ(table[1].name, "b");
  EXPECT_EQ(table[1].calls, 1);
  EXPECT_GE(table[0].seconds, 0);
}

TEST_F(Profile, NamesAreComparedByTheirText) {
  const std::string copy = "name";
  { const Scope scope("name"); }
  { const Scope scope(copy.c_str()); }
  EXPECT_EQ(entries().size(), 1U);
}

TEST_F(Profile, RecordsLoopsByTheirDescription) {
  parallel_for("a loop", 10, [](int64_t) {});
  ASSERT_EQ(entries().size(), 1U);
  EXPECT_EQ(entries()[0].name, "a loop");
}

TEST_F(Profile, ScopesInsideAParallelRegionAreNotRecorded) {
  set_threads(2);
  parallel_for(
      "outer", 4, [](int64_t) { const Scope scope("inner"); }, 1);
  set_threads(0);
  ASSERT_EQ(entries().size(), 1U);
  EXPECT_EQ(entries()[0].name, "outer");
}

TEST_F(Profile, RecordsNothingWhenOff) {
  enable(false);
  { const Scope scope("a"); }
  EXPECT_TRUE(entries().empty());
}

TEST_F(Profile, ClearEmptiesTheTable) {
  { const Scope scope("a"); }
  clear();
  EXPECT_TRUE(entries().empty());
}

}  // namespace
}  // namespace traceflow::profile
