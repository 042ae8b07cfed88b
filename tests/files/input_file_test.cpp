#include "files/input_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/error.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

// Nobody will ever write to it: whoever waited for that would wait for ever.
TEST(InputFileHostile, APipeIsRefusedAtOnce) {
  const TempFolder folder;
  const auto path = folder / "points.npy";
  ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);
  try {
    const InputFile file(path);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_EQ(std::string(error.what()),
              path.string() + ": found something that is not a regular file, expected a readable file");
  }
}

}  // namespace
}  // namespace traceflow
