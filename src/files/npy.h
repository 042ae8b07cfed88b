#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "base/tensor.h"
#include "files/input_file.h"

namespace traceflow {

// Reads a .npy array of up to 4 dimensions as float32. Accepts little-endian float16/32/64, int and uint of 8
// to 64 bits and bool, in C or Fortran order (which is transposed). Throws InputError for object arrays,
// other types, and sizes that exceed the file (checked before memory is allocated). A scalar becomes an array
// of one element.
Tensor<float> read_npy(InputFile file);
Tensor<float> read_npy(const std::filesystem::path& path);
// Reads the array `name` of a .npz (zip, stored or deflated); an empty name means the only one.
Tensor<float> read_npz(const std::filesystem::path& path, const std::string& name = "");
// The names of a .npz's arrays, in its order.
std::vector<std::string> names_in_npz(const std::filesystem::path& path);
// Writes float32 or int32, C order, format version 1.0, atomically.
void write_npy(const std::filesystem::path& path, const Tensor<float>& array);
void write_npy(const std::filesystem::path& path, const Tensor<int32_t>& array);
// Writes arrays of float32 under their names as a .npz, not deflated, atomically.
void write_npz(const std::filesystem::path& path,
               const std::vector<std::pair<std::string, const Tensor<float>*>>& arrays);

// An array that stays on the disk and is read in slices, for arrays too large for memory. Throws InputError
// like read_npy.
class NpyFile {
 public:
  // A .npy, or the array `name` of a .npz by its extension (empty: the only one). A deflated array is
  // unpacked once into a nameless temporary file.
  explicit NpyFile(InputFile file, const std::string& name = "");
  explicit NpyFile(const std::filesystem::path& path, const std::string& name = "")
      : NpyFile(InputFile(path), name) {}

  const std::filesystem::path& path() const { return file_.path(); }
  const Shape& shape() const { return shape_; }
  Tensor<float> read() const;
  // Element i of the first dimension (rank ≥ 2, C order). Safe to call from several threads.
  Tensor<float> slice(int64_t i) const;

 private:
  void read_header(int64_t begin, int64_t end);
  Tensor<float> read_elements(int64_t first, const Shape& shape) const;

  InputFile file_;
  Shape shape_;
  char kind_ = 'f';  // of numpy: f, i, u, b
  int width_ = 4;    // bytes per element
  bool fortran_order_ = false;
  int64_t data_offset_ = 0;
};

}  // namespace traceflow
