#pragma once

#include <filesystem>

#include "base/tensor.h"

namespace traceflow {

// Reads a .npy array of up to 4 dimensions as float32. Accepts little-endian float16/32/64, int and uint of 8 to 64 bits and
// bool, C order (Fortran order is transposed). Throws InputError for object arrays, other types, and sizes that the file
// does not hold (checked before memory is taken).
Tensor<float> read_npy(const std::filesystem::path& path);
// The array `name` of a .npz (zip, stored or deflated); an empty name takes the only one.
Tensor<float> read_npz(const std::filesystem::path& path, const std::string& name = "");
// float32, C order, format version 1.0. Written atomically.
void write_npy(const std::filesystem::path& path, const Tensor<float>& array);

}  // namespace traceflow
