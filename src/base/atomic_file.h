#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>
#include <vector>

namespace traceflow {

// Writes bytes under a temporary name in the same folder, syncs file and folder, and renames: readers see the
// old file or the new one, never a part. Throws InputError naming the path and the reason when the disk
// refuses.
void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void write_atomically(const std::filesystem::path& path, std::string_view text);
// The same of bytes that lie in several places, in order.
void write_atomically(const std::filesystem::path& path,
                      const std::vector<std::span<const std::byte>>& parts);

// Waits until what was renamed in a folder is on the disk.
void sync_folder(const std::filesystem::path& folder);

}  // namespace traceflow
