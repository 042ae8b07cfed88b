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
// What is written carries a checksum (CRC-32) for each tensor, of its type, shape and bytes, and one for the
// metadata, in one more metadata entry that other readers pass over.
class Safetensors {
 public:
  // Throws InputError for a file that is missing or is not one, whose header points outside it, or of which a
  // section does not agree with its checksum: then the error names the tensor, or "metadata". UnreadableFile
  // (files/input_file.h) where the system refuses.
  static Safetensors read(const std::filesystem::path& path);

  // Takes a copy of the tensor, wherever it is.
  void add(const std::string& name, const Tensor<float>& tensor);
  void add(const std::string& name, const Tensor<double>& tensor);
  void add(const std::string& name, const Tensor<int32_t>& tensor);
  void add(const std::string& name, const Tensor<int64_t>& tensor);
  void add(const std::string& name, const Tensor<uint8_t>& tensor);
  // Atomically (base/atomic_file.h). Equal contents give equal bytes.
  void write(const std::filesystem::path& path) const;

  // The file that this was read from, for errors.
  const std::string& origin() const { return origin_; }
  bool has(const std::string& name) const;
  std::vector<std::string> names() const;
  // T is float, double, int32_t, int64_t or uint8_t. Throws InputError naming the file and the tensor when it
  // is missing or has another type.
  template <class T>
  Tensor<T> tensor(const std::string& name) const;

  // Whether this was read from a file that carried checksums.
  bool has_checksums() const { return has_checksums_; }

  std::map<std::string, std::string> metadata;
  // An entry of it, in the second case a number from 0 to 1e15. Throws InputError naming the file and the key
  // when it is missing or no such number.
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
