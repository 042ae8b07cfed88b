#include "base/error.h"

#include <gtest/gtest.h>

#include "base/options.h"

namespace traceflow {
namespace {

TEST(InputError, SaysWhereWhatWasFoundAndWhatToDo) {
  EXPECT_STREQ(InputError("a.json", "focal", "-1", "a positive number", "measure it again").what(),
               "a.json: focal: found -1, expected a positive number; measure it again");
  EXPECT_STREQ(InputError("a.json", "", "", "").what(), "a.json");
  EXPECT_STREQ(InputError("a.json", "focal", "", "a number").what(), "a.json: focal, expected a number");
}

TEST(InternalError, CarriesTheInvariantAndTheObservedValues) {
  EXPECT_NO_THROW(require(true, "one is one"));
  try {
    require(false, "shapes fit", "2x3");
    FAIL();
  } catch (const InternalError& error) {
    EXPECT_STREQ(error.what(), "invariant broken: shapes fit (2x3)");
  }
}

TEST(CheckOption, ThrowsInputErrorThatNamesTheOption) {
  EXPECT_NO_THROW(check_option(true, "loss.weight", 1, "0 or more"));
  try {
    check_option(false, "loss.weight", -1, "0 or more");
    FAIL();
  } catch (const InputError& error) {
    EXPECT_STREQ(error.what(), "option: loss.weight: found -1, expected 0 or more");
  }
  EXPECT_THROW(check_option(false, "mode", std::string("x"), "a or b"), InputError);
}

}  // namespace
}  // namespace traceflow
