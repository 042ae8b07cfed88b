#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "base/tensor.h"
#include "files/eight_bit.h"

namespace traceflow {

// An 8-bit image as stored, H×W×C with C = 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA). 16-bit files keep
// their high byte; palettes are expanded. Throws InputError for what is not a PNG or is larger than 32,768
// pixels a side.
Tensor<uint8_t> read_png(const std::filesystem::path& path);
// Width and height from the header alone.
struct PngSize {
  int width, height, channels;
};
PngSize read_png_size(const std::filesystem::path& path);
// pixels: H×W (grey) or H×W×C. Written atomically.
void write_png(const std::filesystem::path& path, const Tensor<uint8_t>& pixels);
// The file's bytes. Throws InputError for more than 32,768 pixels a side.
std::string png_bytes(const Tensor<uint8_t>& pixels);

// Whole images, on the host.
Tensor<uint8_t> to_8bit(const Tensor<float>& image);
Tensor<float> from_8bit(const Tensor<uint8_t>& image);

}  // namespace traceflow
