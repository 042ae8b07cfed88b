#include "files/zip.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

using testing::HasSubstr;

// What is said of an archive, all of whose members are unpacked.
std::string zip_refusal(const std::string& bytes) {
  const TempFolder folder;
  write_bytes(folder / "a.zip", bytes);
  return refusal_of([&] {
    const InputFile file(folder / "a.zip");
    for (const ZipMember& member : list_zip(file)) {
      if (member.deflated) inflate_to_scratch(file, member);
    }
  });
}

// The archive with these bytes at a place of the last member's entry in the directory.
std::string in_directory(std::string zip, size_t at, const std::string& bytes) {
  return zip.replace(zip.rfind("PK\1\2") + at, bytes.size(), bytes);
}

// A member of so many zeros, put into the archive as it is and then said to be deflated.
std::string archive_of_zeros(size_t size) {
  const std::string zeros(size, '\0');
  const uLong checksum = crc32(0, reinterpret_cast<const Bytef*>(zeros.data()), static_cast<uInt>(size));
  std::string zip = zip_archive({{"a", deflated(zeros, Z_BEST_COMPRESSION)}}, false);
  zip = in_directory(zip, 10, little_endian(8, 2));
  zip = in_directory(zip, 16, little_endian(checksum, 4));
  return in_directory(zip, 24, little_endian(size, 4));
}

// The reader's pieces are of 256 KiB. One may be full when all is taken in: zlib then holds back the end of
// the last match, up to 257 bytes.
TEST(Zip, MembersThatEndJustBeyondAPieceAreUnpacked) {
  constexpr size_t piece = size_t{1} << 18;
  for (size_t beyond = 1; beyond <= 258; ++beyond) {
    EXPECT_EQ(zip_refusal(archive_of_zeros(piece + beyond)), "accepted") << beyond;
    if (beyond % 8 != 1) continue;
    EXPECT_EQ(zip_refusal(archive_of_zeros(2 * piece + beyond)), "accepted") << beyond;
  }
}

TEST(Zip, UnpacksWhatTheChecksumSays) {
  const std::string zip = zip_archive({{"a", std::string(1000, 'a')}, {"b", ""}}, true);
  EXPECT_EQ(zip_refusal(zip), "accepted");
  EXPECT_THAT(zip_refusal(in_directory(zip, 16, "\1")), HasSubstr("wrong checksum"));
}

TEST(ZipHostile, SizesThatAreNotThoseOfTheDataAreRefused) {
  const std::string zip = zip_archive({{"a", std::string(1000, 'a')}}, true);
  EXPECT_THAT(zip_refusal(in_directory(zip, 24, little_endian(999, 4))), HasSubstr("more data than"));
  EXPECT_THAT(zip_refusal(in_directory(zip, 24, little_endian(1001, 4))), HasSubstr("wrong checksum"));
  EXPECT_THAT(zip_refusal(in_directory(zip, 24, little_endian(0x7fffffff, 4))),
              HasSubstr("bytes that unpacks to 2147483647"));
}

TEST(ZipHostile, CompressedDataThatAreCutShortAreRefused) {
  for (const size_t size : {size_t{1000}, size_t{1} << 18, (size_t{1} << 18) + 100}) {
    const std::string zip = archive_of_zeros(size);
    const size_t stored = deflated(std::string(size, '\0'), Z_BEST_COMPRESSION).size();
    for (const size_t missing : {size_t{1}, size_t{2}}) {
      EXPECT_THAT(zip_refusal(in_directory(zip, 20, little_endian(stored - missing, 4))),
                  HasSubstr("compressed data that is cut short"));
    }
  }
}

// A petabyte of zeros in a small archive: every member has the same data.
TEST(ZipHostile, MembersOnTopOfOneAnotherAreRefused) {
  const std::string zip = zip_archive({{"a", "12"}, {"b", "12"}}, false);
  EXPECT_EQ(zip_refusal(zip), "accepted");
  EXPECT_THAT(zip_refusal(in_directory(zip, 42, little_endian(0, 4))), HasSubstr("overlapping zip members"));
}

TEST(ZipHostile, AMemberThatTheTemporaryFolderHasNoRoomForIsRefusedBeforeItIsUnpacked) {
  const TempFolder folder;
  write_bytes(folder / "a.zip", zip_archive({{"a", "12"}}, true));
  const InputFile file(folder / "a.zip");
  ZipMember member = list_zip(file)[0];
  member.size = INT64_MAX;
  try {
    inflate_to_scratch(file, member);
    FAIL();
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), HasSubstr("9223372036854775807 bytes to unpack"));
    EXPECT_THAT(error.what(), HasSubstr("set TMPDIR"));
  }
}

}  // namespace
}  // namespace traceflow
