#include "files/zip_writer.h"

#include <gtest/gtest.h>

#include "files/zip.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

TEST(ZipWriter, AReaderFindsTheEntries) {
  const TempFolder folder;
  const std::vector<ZipEntry> entries = {
      {"a.txt", "one"}, {"folder/b", ""}, {"c", std::string(70000, '\xff')}};
  write_zip(folder / "a.zip", entries);
  const InputFile file(folder / "a.zip");
  const std::vector<ZipMember> members = list_zip(file);
  ASSERT_EQ(members.size(), entries.size());
  for (size_t i = 0; i < members.size(); ++i) {
    EXPECT_EQ(members[i].name, entries[i].name);
    EXPECT_FALSE(members[i].deflated);
    std::string bytes(static_cast<size_t>(members[i].size), '\0');
    file.read_at(members[i].offset, std::as_writable_bytes(std::span(bytes)));
    EXPECT_EQ(bytes, entries[i].bytes);
    EXPECT_EQ(members[i].checksum, crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
  }
}

TEST(ZipWriter, AnArchiveMayBeEmpty) {
  const TempFolder folder;
  write_zip(folder / "a.zip", {});
  EXPECT_TRUE(list_zip(InputFile(folder / "a.zip")).empty());
}

}  // namespace
}  // namespace traceflow
