#pragma once

#include <filesystem>
#include <string_view>

#include "base/tensor.h"
#include "files/input_file.h"

// Images of either kind that cameras and programs write. What a file is, its first bytes say, not its name.
namespace traceflow {

struct ImageSize {
  int width, height;
  int channels;         // 1 (grey), 2 (grey, alpha), 3 (RGB) or 4 (RGBA)
  int bits = 8;         // of a stored number: 1 to 16
  int orientation = 1;  // EXIF's, 1 to 8. Pixels are taken as stored, to which calibrations refer.
};

// Whether a file of this name may be a PNG or JPEG image.
bool has_image_name(const std::filesystem::path& name);

// From the header alone. These throw InputError for what is neither PNG nor JPEG, is broken or cut short, or
// is larger than 32,768 pixels a side or 2²⁸ in all.
ImageSize read_image_size(const InputFile& file);
// H×W×C in 8 bits, more being rounded.
Tensor<uint8_t> read_image(const InputFile& file);
// The same in 16 bits, 65,535 being full.
Tensor<uint16_t> read_image16(const InputFile& file);

}  // namespace traceflow
