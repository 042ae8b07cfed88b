#pragma once

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include <jpeglib.h>

namespace traceflow {

// JPEG files of kinds that the program does not write, by libjpeg itself.
struct JpegKind {
  J_COLOR_SPACE stored = JCS_YCbCr;  // of as many components as the pixels have
  bool progressive = false;
  int luma_wide = 2, luma_high = 2;  // how much finer than chroma
  int restart_rows = 0;
  std::vector<jpeg_scan_info> scans = {};  // in place of libjpeg's choice
  std::string exif = {};                   // the content of an APP1 segment, before the picture
};

// pixels: height·width·components numbers.
inline std::string jpeg_of_kind(const JpegKind& kind, int width, int height, int components,
                                std::vector<unsigned char> pixels) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr error{};
  jpeg.err = jpeg_std_error(&error);
  jpeg_create_compress(&jpeg);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &bytes, &size);
  jpeg.image_width = static_cast<JDIMENSION>(width);
  jpeg.image_height = static_cast<JDIMENSION>(height);
  jpeg.input_components = components;
  jpeg.in_color_space = components == 1   ? JCS_GRAYSCALE
                        : components == 4 ? JCS_CMYK
                        : components == 3 ? JCS_RGB
                                          : JCS_UNKNOWN;
  jpeg_set_defaults(&jpeg);
  jpeg_set_colorspace(&jpeg, kind.stored);
  jpeg_set_quality(&jpeg, 95, TRUE);
  jpeg.comp_info[0].h_samp_factor = kind.luma_wide;
  jpeg.comp_info[0].v_samp_factor = kind.luma_high;
  jpeg.restart_in_rows = kind.restart_rows;
  if (kind.progressive) jpeg_simple_progression(&jpeg);
  if (!kind.scans.empty()) {
    jpeg.scan_info = kind.scans.data();
    jpeg.num_scans = static_cast<int>(kind.scans.size());
  }
  jpeg_start_compress(&jpeg, TRUE);
  if (!kind.exif.empty()) {
    jpeg_write_marker(&jpeg, JPEG_APP0 + 1, reinterpret_cast<const JOCTET*>(kind.exif.data()),
                      static_cast<unsigned>(kind.exif.size()));
  }
  while (jpeg.next_scanline < jpeg.image_height) {
    JSAMPROW row = pixels.data() + static_cast<size_t>(jpeg.next_scanline) * static_cast<size_t>(width) *
                                       static_cast<size_t>(components);
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  std::string result(reinterpret_cast<char*>(bytes), size);
  jpeg_destroy_compress(&jpeg);
  std::free(bytes);
  return result;
}

}  // namespace traceflow
