#include "files/base64.h"

#include <gtest/gtest.h>

#include <array>

namespace traceflow {
namespace {

// The examples of RFC 4648, section 10, and bytes above 127.
TEST(Base64, EncodesTheStandardsExamples) {
  EXPECT_EQ(base64(""), "");
  EXPECT_EQ(base64("f"), "Zg==");
  EXPECT_EQ(base64("fo"), "Zm8=");
  EXPECT_EQ(base64("foo"), "Zm9v");
  EXPECT_EQ(base64("foob"), "Zm9vYg==");
  EXPECT_EQ(base64("fooba"), "Zm9vYmE=");
  EXPECT_EQ(base64("foobar"), "Zm9vYmFy");
  EXPECT_EQ(base64("\xff\xfe\xfd\xfb"), "//79+w==");
}

}  // namespace
}  // namespace traceflow
