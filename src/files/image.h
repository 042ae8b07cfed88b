#pragma once

#include <filesystem>
#include <string>

#include "base/tensor.h"
#include "files/input_file.h"

// PNG and JPEG images of cameras and programs. The first bytes of a file decide its format, not its name.
namespace traceflow {

struct ImageSize {
  int width, height;
  int channels;         // 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA)
  int bits = 8;         // per stored number: 1 to 16
  int orientation = 1;  // of EXIF, 1 to 8. Pixels are read as stored, since calibrations refer to them so.
};

// The extension of a file's name in lower case: ".png".
std::string lower_extension(const std::filesystem::path& name);
// Whether a file of this name may be a PNG or JPEG image.
bool has_image_name(const std::filesystem::path& name);

// Reads the header only. All three functions throw InputError for what is neither PNG nor JPEG, is broken or
// truncated, or is larger than 32,768 pixels a side or 2²⁸ in all.
ImageSize read_image_size(const InputFile& file);
// H×W×C in 8 bits; higher depths are rounded.
Tensor<uint8_t> read_image(const InputFile& file);
// The same in 16 bits, full scale 65,535.
Tensor<uint16_t> read_image16(const InputFile& file);
// Converts 8 bits to 16, full scale to full scale.
Tensor<uint16_t> in_16_bits(const Tensor<uint8_t>& pixels);

}  // namespace traceflow
