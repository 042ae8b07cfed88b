#include "scene/rows.h"

#include <gtest/gtest.h>

namespace traceflow {
namespace {

// Surfels whose positions count up from `first`.
Surfels numbered(int64_t count, float first) {
  Surfels s;
  s.position.reset({count, 3});
  s.log_scale.reset({count, 2});
  s.rotation.reset({count, 4});
  s.opacity_logit.reset({count});
  s.sh.reset({count, 4, 3});
  for (int64_t i = 0; i < s.position.size(); ++i) s.position[i] = first + static_cast<float>(i);
  return s;
}

TEST(AppendRows, PutsTheSecondSetAfterTheFirst) {
  Surfels s = numbered(2, 0);
  append_rows(s, numbered(3, 100));
  ASSERT_EQ(s.count(), 5);
  EXPECT_EQ(s.position(1, 2), 5);
  EXPECT_EQ(s.position(2, 0), 100);
  EXPECT_EQ(s.position(4, 2), 108);
  EXPECT_EQ(s.sh.shape(), (Shape{5, 4, 3}));
}

TEST(AppendRows, BodiesCarryBothSetsOrNeither) {
  Surfels s = numbered(2, 0), more = numbered(1, 100);
  s.body = tensor_of(std::vector<int32_t>{0, -1});
  EXPECT_THROW(append_rows(s, more), InternalError);
  more.body = tensor_of(std::vector<int32_t>{1});
  append_rows(s, more);
  EXPECT_EQ(std::vector<int32_t>(s.body.values().begin(), s.body.values().end()),
            (std::vector<int32_t>{0, -1, 1}));
}

TEST(AppendRows, AnEmptySetAddsNothing) {
  Surfels s = numbered(2, 0);
  append_rows(s, numbered(0, 0));
  EXPECT_EQ(s.count(), 2);
  EXPECT_EQ(s.position(1, 2), 5);
}

TEST(AppendRows, AnotherSetOfGroupsIsRefused) {
  Surfels s = numbered(2, 0);
  Surfels flat = numbered(2, 0);
  flat.sh.reset({2, 1, 3});
  EXPECT_THROW(append_rows(s, flat), InternalError);
}

}  // namespace
}  // namespace traceflow
