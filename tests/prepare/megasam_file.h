#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <string>

#include "base/tensor.h"
#include "support/file_bytes.h"
#include "support/zip_writer.h"

namespace traceflow::prepare {

// An .npz as numpy.savez writes it for MegaSaM, with its types.
struct MegaSamFile {
  Tensor<float> cameras;    // T×4×4, float32
  Tensor<float> intrinsic;  // 3×3, float64
  Tensor<float> images;     // T×H×W×3, uint8, here 0 to 255
  Tensor<float> depths;     // T×H×W, float16

  void save(const std::filesystem::path& path) const {
    write_bytes(path, zip_archive({{"images.npy", npy<uint8_t>("|u1", images)},
                                   {"depths.npy", npy<Half>("<f2", depths)},
                                   {"intrinsic.npy", npy<double>("<f8", intrinsic)},
                                   {"cam_c2w.npy", npy<float>("<f4", cameras)}},
                                  false, true));
  }

 private:
  // Rounds to nearest; numbers too small for a normal one become zero, too large ones infinite.
  struct Half {
    uint16_t bits;
    explicit Half(float value) {
      const auto from = std::bit_cast<uint32_t>(value);
      const uint32_t sign = from >> 16 & 0x8000, exponent = from >> 23 & 0xff;
      const uint32_t rounded = (from & 0x7fffffff) + 0x1000;
      const uint32_t to = (rounded >> 13) - (112U << 10);
      const bool nan = exponent == 255 && (from & 0x7fffff) != 0;
      bits = static_cast<uint16_t>(sign | (nan ? 0x7e00 : exponent < 113 ? 0 : to >= 0x7c00 ? 0x7c00 : to));
    }
  };

  template <class T>
  static std::string npy(const std::string& type, const Tensor<float>& array) {
    std::string header = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (";
    for (int r = 0; r < array.shape().rank(); ++r) header += std::to_string(array.dim(r)) + ", ";
    header += "), }";
    header.append(63 - (10 + header.size()) % 64, ' ').push_back('\n');
    std::string bytes = std::string("\x93NUMPY\1\0", 8) + little_endian(header.size(), 2) + header;
    for (const float value : array.values()) {
      const T number = static_cast<T>(value);
      bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
    }
    return bytes;
  }
};

}  // namespace traceflow::prepare
