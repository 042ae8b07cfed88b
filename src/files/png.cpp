#include "files/png.h"

#include <png.h>

#include <cmath>
#include <csetjmp>
#include <cstring>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "files/input_file.h"

namespace traceflow {

namespace {

constexpr png_uint_32 max_side = 32768;
// Deflate cannot grow data by more than this; a header that promises more than the file can hold is refused
// before its memory is taken.
constexpr int64_t max_inflation = 1032;

// libpng leaves by longjmp, which skips destructors: everything that owns memory lives here, outside the
// jump.
struct PngSource {
  explicit PngSource(const std::filesystem::path& path) : file(path) {}
  InputFile file;
  int64_t offset = 0;
  std::string error;
};

void on_error(png_structp png, png_const_charp text) {
  static_cast<PngSource*>(png_get_error_ptr(png))->error = text;
  png_longjmp(png, 1);
}
void on_warning(png_structp, png_const_charp) {}

void read_bytes(png_structp png, png_bytep bytes, size_t count) {
  auto* source = static_cast<PngSource*>(png_get_io_ptr(png));
  if (source->offset + static_cast<int64_t>(count) > source->file.size())
    png_error(png, "the file is cut short");
  bool ok = true;
  try {
    source->file.read_at(source->offset, std::as_writable_bytes(std::span(bytes, count)));
  } catch (const std::exception&) {
    ok = false;
  }
  if (!ok) png_error(png, "the file cannot be read");
  source->offset += static_cast<int64_t>(count);
}

class PngReader {
 public:
  explicit PngReader(const std::filesystem::path& path) : source_(path) {
    png_ = png_create_read_struct(PNG_LIBPNG_VER_STRING, &source_, on_error, on_warning);
    if (png_ != nullptr) info_ = png_create_info_struct(png_);
    if (info_ == nullptr) {
      png_destroy_read_struct(&png_, &info_, nullptr);
      throw std::bad_alloc();
    }
  }
  ~PngReader() { png_destroy_read_struct(&png_, &info_, nullptr); }
  PngReader(const PngReader&) = delete;
  PngReader& operator=(const PngReader&) = delete;

  PngSize read_header() {
    if (!try_header()) fail();
    return {static_cast<int>(png_get_image_width(png_, info_)),
            static_cast<int>(png_get_image_height(png_, info_)),
            static_cast<int>(png_get_channels(png_, info_))};
  }
  Tensor<uint8_t> read_pixels(const PngSize& size) {
    const int64_t row_bytes = int64_t{size.width} * size.channels;
    if (stored_row_bytes_ * size.height / max_inflation > source_.file.size()) {
      source_.error = "the file is too short for an image of " + std::to_string(size.width) + "×" +
                      std::to_string(size.height);
      fail();
    }
    Tensor<uint8_t> pixels({size.height, size.width, size.channels});
    std::vector<png_bytep> rows(static_cast<size_t>(size.height));
    for (size_t y = 0; y < rows.size(); ++y) rows[y] = pixels.data() + static_cast<int64_t>(y) * row_bytes;
    if (!try_pixels(rows.data())) fail();
    return pixels;
  }

 private:
  bool try_header() {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_read_fn(png_, &source_, read_bytes);
    png_set_user_limits(png_, max_side, max_side);
    png_set_chunk_cache_max(png_, 128);
    png_set_chunk_malloc_max(png_, 8U << 20);
    png_read_info(png_, info_);
    stored_row_bytes_ = static_cast<int64_t>(png_get_rowbytes(png_, info_));
    png_set_expand(png_);
    png_set_strip_16(png_);
    png_set_interlace_handling(png_);
    png_read_update_info(png_, info_);
    return true;
  }
  bool try_pixels(png_bytepp rows) {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_read_image(png_, rows);
    png_read_end(png_, nullptr);
    return true;
  }
  [[noreturn]] void fail() const {
    throw InputError(source_.file.path().string(), "", source_.error,
                     "a PNG image of at most 32,768 pixels a side", "write or copy the file again");
  }

  PngSource source_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  int64_t stored_row_bytes_ = 0;  // before palettes and small depths are expanded
};

struct PngSink {
  std::string bytes;
  std::string error;
};

void on_write_error(png_structp png, png_const_charp text) {
  static_cast<PngSink*>(png_get_error_ptr(png))->error = text;
  png_longjmp(png, 1);
}

void write_bytes(png_structp png, png_bytep bytes, size_t count) {
  auto* sink = static_cast<PngSink*>(png_get_io_ptr(png));
  bool ok = true;
  try {
    sink->bytes.append(reinterpret_cast<const char*>(bytes), count);
  } catch (const std::exception&) {
    ok = false;
  }
  if (!ok) png_error(png, "out of memory");
}

bool encode(png_structp png, png_infop info, png_uint_32 width, png_uint_32 height, int colour_type,
            png_bytepp rows) {
  if (setjmp(png_jmpbuf(png)) != 0) return false;
  png_set_user_limits(png, max_side, max_side);
  png_set_IHDR(png, info, width, height, 8, colour_type, PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT,
               PNG_FILTER_TYPE_DEFAULT);
  png_write_info(png, info);
  png_write_image(png, rows);
  png_write_end(png, info);
  return true;
}

// where: for errors.
std::string encoded(const std::string& where, const Tensor<uint8_t>& pixels) {
  const int rank = pixels.shape().rank();
  require(rank == 2 || (rank == 3 && pixels.dim(2) >= 1 && pixels.dim(2) <= 4),
          "an image is H×W or H×W×C, C ≤ 4", pixels.shape().to_string());
  require(!pixels.empty(), "an image has pixels", pixels.shape().to_string());
  constexpr int colour_types[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                  PNG_COLOR_TYPE_RGB_ALPHA};
  const int64_t channels = rank == 2 ? 1 : pixels.dim(2);
  std::vector<png_bytep> rows(static_cast<size_t>(pixels.dim(0)));
  for (size_t y = 0; y < rows.size(); ++y) {
    rows[y] = const_cast<png_bytep>(pixels.row(static_cast<int64_t>(y)));
  }

  PngSink sink;
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, &sink, on_write_error, on_warning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr) {
    png_destroy_write_struct(&png, &info);
    throw std::bad_alloc();
  }
  png_set_write_fn(png, &sink, write_bytes, nullptr);
  const bool ok = encode(png, info, static_cast<png_uint_32>(pixels.dim(1)),
                         static_cast<png_uint_32>(pixels.dim(0)), colour_types[channels - 1], rows.data());
  png_destroy_write_struct(&png, &info);
  if (!ok) throw InputError(where, "", sink.error, "an image of at most 32,768 pixels a side");
  return std::move(sink.bytes);
}

}  // namespace

Tensor<uint8_t> read_png(const std::filesystem::path& path) {
  PngReader reader(path);
  return reader.read_pixels(reader.read_header());
}

PngSize read_png_size(const std::filesystem::path& path) { return PngReader(path).read_header(); }

void write_png(const std::filesystem::path& path, const Tensor<uint8_t>& pixels) {
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
