#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string_view>

namespace traceflow {

// Writes bytes under a temporary name in the same folder, syncs file and folder, and renames: readers see the
// old file or the new one, never a part. Throws InputError naming the path and the reason when the disk
// refuses.
void write_atomically(const std::filesystem::path& path, std::span<const std::byte> bytes);
void write_atomically(const std::filesystem::path& path, std::string_view text);

}  // namespace traceflow
