#pragma once

#include <string>

#include "base/tensor.h"
#include "files/input_file.h"

namespace traceflow {

// A JPEG file's bytes. pixels: H×W (grey) or H×W×3, of 1 to 65,500 pixels a side (else InputError); quality:
// 1 to 100. From 90 on colours keep the full resolution, below they are halved and faster arithmetic is used.
std::string jpeg_bytes(const Tensor<uint8_t>& pixels, int quality);

// An image as stored, H×W×C with C = 1 (grey) or 3 (RGB). Throws InputError for what is not a JPEG, for data
// that are broken or cut short anywhere, for CMYK, and for more than 32,768 pixels a side, 2²⁸ in all,
// or 2²⁷ in several scans (progressive).
Tensor<uint8_t> read_jpeg(const InputFile& file);
// What the header alone says.
struct JpegSize {
  int width, height, channels;
  int orientation = 1;  // EXIF's, 1 to 8: how a viewer would turn the stored pixels
};
JpegSize read_jpeg_size(const InputFile& file);

}  // namespace traceflow
