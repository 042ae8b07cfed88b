#include "files/png.h"

#include <png.h>

#include <csetjmp>
#include <new>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "files/limits.h"
#include "files/png_exit.h"

namespace traceflow {

namespace {

struct PngSink : PngExit {
  std::string bytes;
};

void write_bytes(png_structp png, png_bytep bytes, size_t count) {
  auto* sink = static_cast<PngSink*>(png_get_io_ptr(png));
  try {
    sink->bytes.append(reinterpret_cast<const char*>(bytes), count);
  } catch (const std::bad_alloc&) {
    sink->out_of_memory = true;
  }
  if (sink->out_of_memory) png_error(png, "out of memory");
}

bool encode(png_structp png, png_infop info, png_uint_32 width, png_uint_32 height, int bits, int colour_type,
            png_bytepp rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_user_limits(png, max_image_side, max_image_side);
  png_set_IHDR(png, info, width, height, bits, colour_type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  if (bits == 16) png_set_swap(png);  // PNG stores the high byte first
  png_write_image(png, rows);
  png_write_end(png, info);
  return true;
}

// where: names the image in errors.
template <class T>
std::string encoded(const std::string& where, const Tensor<T>& pixels) {
  const int rank = pixels.shape().rank();
  require(rank == 2 || (rank == 3 && pixels.dim(2) >= 1 && pixels.dim(2) <= 4),
          "an image is H×W or H×W×C, C ≤ 4", pixels.shape().to_string());
  require(!pixels.empty(), "an image has pixels", pixels.shape().to_string());
  constexpr int colour_types[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                  PNG_COLOR_TYPE_RGB_ALPHA};
  const int64_t channels = rank == 2 ? 1 : pixels.dim(2);
  std::vector<png_bytep> rows(static_cast<size_t>(pixels.dim(0)));
  for (size_t y = 0; y < rows.size(); ++y) {
    rows[y] = reinterpret_cast<png_bytep>(const_cast<T*>(pixels.row(static_cast<int64_t>(y))));
  }

  PngSink sink;
  PngExit* exit = &sink;
  png_structp png = png_create_write_struct_2(PNG_LIBPNG_VER_STRING, exit, PngExit::leave, PngExit::ignore,
                                              exit, PngExit::take_memory, PngExit::give_back);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr) {
    png_destroy_write_struct(&png, &info);
    throw std::bad_alloc();
  }
  png_set_write_fn(png, &sink, write_bytes, nullptr);
  const bool ok =
      encode(png, info, static_cast<png_uint_32>(pixels.dim(1)), static_cast<png_uint_32>(pixels.dim(0)),
             8 * static_cast<int>(sizeof(T)), colour_types[channels - 1], rows.data());
  png_destroy_write_struct(&png, &info);
  if (ok) return std::move(sink.bytes);
  sink.throw_if_out_of_memory();
  throw InputError(where, "", sink.text.data(), "an image of at most 32,768 pixels a side");
}

}  // namespace

void write_png(const std::filesystem::path& path, const Tensor<uint8_t>& pixels) {
  write_atomically(path, std::string_view(encoded(path.string(), pixels)));
}

void write_png(const std::filesystem::path& path, const Tensor<uint16_t>& pixels) {
  write_atomically(path, std::string_view(encoded(path.string(), pixels)));
}

std::string png_bytes(const Tensor<uint8_t>& pixels) { return encoded("PNG", pixels); }

Tensor<uint8_t> to_8bit(const Tensor<float>& image) {
  Tensor<uint8_t> result;
  result.resize(image.shape());
  for (int64_t i = 0; i < image.size(); ++i) result[i] = to_8bit(image[i]);
  return result;
}

Tensor<float> from_8bit(const Tensor<uint8_t>& image) {
  Tensor<float> result;
  result.resize(image.shape());
  for (int64_t i = 0; i < image.size(); ++i) result[i] = from_8bit(image[i]);
  return result;
}

}  // namespace traceflow
