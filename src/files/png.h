#pragma once

#include <filesystem>
#include <string>

#include "base/tensor.h"
#include "files/eight_bit.h"
#include "files/input_file.h"

namespace traceflow {

// Reads an image as stored, H×W×C with C = 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA); palettes are
// expanded, 16 bits rounded to 8. Throws InputError for what is not a PNG or is larger than 32,768 pixels a
// side or 2²⁸ in all.
Tensor<uint8_t> read_png(const InputFile& file);
Tensor<uint8_t> read_png(const std::filesystem::path& path);
// The same in 16 bits, full scale 65,535.
Tensor<uint16_t> read_png16(const InputFile& file);
// What the header contains.
struct PngSize {
  int width, height, channels;
  int bits = 8;  // per stored number, before expansion: 1 to 16
};
PngSize read_png_size(const InputFile& file);
PngSize read_png_size(const std::filesystem::path& path);
// Writes an image atomically. pixels: H×W (grey) or H×W×C, of 8 or 16 bits.
void write_png(const std::filesystem::path& path, const Tensor<uint8_t>& pixels);
void write_png(const std::filesystem::path& path, const Tensor<uint16_t>& pixels);
// Encodes a PNG file. Throws InputError for more than 32,768 pixels a side.
std::string png_bytes(const Tensor<uint8_t>& pixels);

// Convert whole images, on the host.
Tensor<uint8_t> to_8bit(const Tensor<float>& image);
Tensor<float> from_8bit(const Tensor<uint8_t>& image);

}  // namespace traceflow
