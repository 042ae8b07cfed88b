#pragma once

#include <string>

#include "base/tensor.h"
#include "files/input_file.h"

namespace traceflow {

// Encodes a JPEG file. pixels: H×W (grey) or H×W×3, with 1 to 65,500 pixels a side (otherwise InputError);
// quality: 1 to 100. From 90 on colours keep the full resolution; below, it is halved and faster arithmetic
// is used.
std::string jpeg_bytes(const Tensor<uint8_t>& pixels, int quality);

// Reads an image as stored, H×W×C with C = 1 (grey) or 3 (RGB). Throws InputError for what is not a JPEG, for
// data that are broken or truncated anywhere, for CMYK, and for more than 32,768 pixels a side, 2²⁸ in all,
// or 2²⁷ in several scans (progressive).
Tensor<uint8_t> read_jpeg(const InputFile& file);
// What the header contains.
struct JpegSize {
  int width, height, channels;
  int orientation = 1;  // of EXIF, 1 to 8: how a viewer would turn the stored pixels
};
JpegSize read_jpeg_size(const InputFile& file);

}  // namespace traceflow
