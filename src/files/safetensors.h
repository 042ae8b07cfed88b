#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "base/tensor.h"

namespace traceflow {

// The safetensors format: a JSON header with names, types, shapes and offsets, then the bytes. Types: F32,
// F64, I32, I64, U8, and for reading also F16 and BF16 (widened to float). Metadata is a map of strings.
//
// Written files have a checksum (CRC-32) for each tensor, of its type, shape and bytes, and one for the
// metadata, in an additional metadata entry that other readers ignore.
class Safetensors {
 public:
  // Throws InputError for a file that is missing or not in this format, whose header points outside it, or
  // whose content does not match a checksum: then the error names the tensor, or "metadata". Throws
  // UnreadableFile (files/input_file.h) if the system denies access.
  static Safetensors read(const std::filesystem::path& path);

  // Stores a copy of the tensor, from any device. T is float, double, int32_t, int64_t or uint8_t.
  template <class T>
  void add(const std::string& name, const Tensor<T>& tensor);
  // Writes atomically (base/atomic_file.h). Equal contents give equal bytes.
  void write(const std::filesystem::path& path) const;

  // The file that this was read from, for errors.
  const std::string& origin() const { return origin_; }
  bool has(const std::string& name) const;
  std::vector<std::string> names() const;
  // T as above. Throws InputError with the file and the tensor if it is missing or has another type.
  template <class T>
  Tensor<T> tensor(const std::string& name) const;

  // Whether this was read from a file that carried checksums.
  bool has_checksums() const { return has_checksums_; }

  std::map<std::string, std::string> metadata;
  // A metadata entry, or one as a number from 0 to 1e15. Throws InputError with the file and the key if it is
  // missing or not such a number.
  const std::string& text(const std::string& key) const;
  double number(const std::string& key) const;

 private:
  struct Entry {
    std::string type;
    Shape shape;
    std::vector<std::byte> bytes;
  };
  std::string origin_ = "safetensors";
  std::map<std::string, Entry> entries_;
  bool has_checksums_ = false;
};

}  // namespace traceflow
