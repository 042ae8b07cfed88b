#include "base/atomic_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <iterator>
#include <thread>

#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

namespace fs = std::filesystem;

std::string refusal(const fs::path& path) {
  return refusal_of([&] { write_atomically(path, "text"); });
}

int64_t entries(const fs::path& folder) {
  return std::distance(fs::directory_iterator(folder), fs::directory_iterator());
}

TEST(AtomicFile, HoldsExactlyTheBytesGiven) {
  const TempFolder folder;
  const std::array<std::byte, 4> bytes{std::byte{0}, std::byte{255}, std::byte{10}, std::byte{13}};
  write_atomically(folder / "bytes", std::span<const std::byte>(bytes));
  EXPECT_EQ(bytes_of(folder / "bytes"), std::string("\0\xFF\n\r", 4));
  write_atomically(folder / "empty", "");
  EXPECT_EQ(bytes_of(folder / "empty"), "");
  EXPECT_TRUE(fs::exists(folder / "empty"));
  const std::string large(3'000'000, 'x');
  write_atomically(folder / "large", large);
  EXPECT_EQ(bytes_of(folder / "large"), large);
}

TEST(AtomicFile, WritesPartsInOrder) {
  const TempFolder folder;
  const std::string first = "one ", second, third = "three";
  write_atomically(folder / "parts", {std::as_bytes(std::span(first)), std::as_bytes(std::span(second)),
                                      std::as_bytes(std::span(third))});
  EXPECT_EQ(bytes_of(folder / "parts"), "one three");
}

TEST(AtomicFile, ReplacesTheOldFileAndLeavesNothingElse) {
  const TempFolder folder;
  write_atomically(folder / "file", "a long first version");
  write_atomically(folder / "file", "second");
  EXPECT_EQ(bytes_of(folder / "file"), "second");
  EXPECT_EQ(entries(folder.path()), 1);
}

TEST(AtomicFile, ARefusalNamesTheFileAndTheReason) {
  const TempFolder folder;
  const fs::path missing = folder / "missing" / "file";
  EXPECT_THAT(refusal(missing), testing::AllOf(testing::HasSubstr(missing.string()),
                                               testing::HasSubstr("No such file or directory")));
}

// The name is taken by a folder: the rename fails after all bytes were written.
TEST(AtomicFile, AFailedRenameLeavesNoPartBehind) {
  const TempFolder folder;
  fs::create_directory(folder / "taken");
  EXPECT_THAT(refusal(folder / "taken"), testing::HasSubstr("rename"));
  EXPECT_TRUE(fs::is_directory(folder / "taken"));
  EXPECT_EQ(entries(folder.path()), 1);
}

TEST(AtomicFile, ARefusalKeepsTheOldFile) {
  const TempFolder folder;
  write_atomically(folder / "file", "old");
  fs::create_directory(folder / "file.partial");  // stands where the temporary file would
  EXPECT_NE(refusal(folder / "file"), "accepted");
  EXPECT_EQ(bytes_of(folder / "file"), "old");
}

// Whoever was killed may have left more than is written now.
TEST(AtomicFile, WhatWasLeftHalfWrittenIsWrittenOver) {
  const TempFolder folder;
  write_bytes(folder / "file.partial", std::string(100'000, 'x'));
  write_atomically(folder / "file", "new");
  EXPECT_EQ(bytes_of(folder / "file"), "new");
  EXPECT_EQ(entries(folder.path()), 1);
}

TEST(AtomicFile, ALinkThatStandsInTheWayIsNotFollowed) {
  const TempFolder folder;
  write_bytes(folder / "elsewhere", "mine");
  fs::create_symlink("elsewhere", folder / "file.partial");
  EXPECT_NE(refusal(folder / "file"), "accepted");
  EXPECT_EQ(bytes_of(folder / "elsewhere"), "mine");
}

TEST(AtomicFile, ANameMayBeAsLongAsTheSystemTakes) {
  const TempFolder folder;
  const std::string first = std::string(254, 'n') + "1", second = std::string(254, 'n') + "2";
  write_atomically(folder / first, "one");
  write_atomically(folder / second, "two");
  EXPECT_EQ(bytes_of(folder / first), "one");
  EXPECT_EQ(bytes_of(folder / second), "two");
  EXPECT_EQ(entries(folder.path()), 2);
}

// Whoever reads meanwhile finds one writer's text, whole.
TEST(AtomicFile, SeveralMayWriteOneFileAtOnce) {
  const TempFolder folder;
  const fs::path path = folder / "file";
  write_atomically(path, "a");
  std::atomic<int> at_work{4};
  std::vector<std::string> troubles(4);
  std::vector<std::thread> writers;
  for (size_t i = 0; i < 4; ++i) {
    writers.emplace_back([&, i] {
      const std::string text(1 + 30'000 * i, static_cast<char>('a' + i));
      for (int round = 0; round < 100 && (troubles[i].empty() || troubles[i] == "accepted"); ++round)
        troubles[i] = refusal_of([&] { write_atomically(path, text); });
      --at_work;
    });
  }
  while (at_work > 0) {
    const std::string text = bytes_of(path);
    if (text.empty() || text != std::string(1 + 30'000 * static_cast<size_t>(text[0] - 'a'), text[0])) {
      ADD_FAILURE() << text.size() << " bytes";
      break;
    }
  }
  for (std::thread& writer : writers) writer.join();
  EXPECT_THAT(troubles, testing::Each("accepted"));
  EXPECT_EQ(entries(folder.path()), 1);
}

}  // namespace
}  // namespace traceflow
