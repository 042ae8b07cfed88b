#include <png.h>

#include <array>
#include <bit>
#include <csetjmp>
#include <cstring>
#include <new>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "files/limits.h"
#include "files/png.h"
#include "files/png_exit.h"

namespace traceflow {

namespace {

constexpr const char* remedy = "write or copy the file again";

struct PngSource : PngExit {
  explicit PngSource(const InputFile& from) : file(from) {}
  const InputFile& file;
  int64_t offset = 0;
};

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
  // bits: of each number in the result, 8 or 16.
  PngReader(const InputFile& file, int bits) : source_(file), bits_(bits) {
    PngExit* exit = &source_;
    png_ = png_create_read_struct_2(PNG_LIBPNG_VER_STRING, exit, PngExit::leave, PngExit::ignore, exit,
                                    PngExit::take_memory, PngExit::give_back);
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
    refuse_sides();
    if (!try_header()) fail();
    const PngSize size{static_cast<int>(png_get_image_width(png_, info_)),
                       static_cast<int>(png_get_image_height(png_, info_)),
                       static_cast<int>(png_get_channels(png_, info_)), stored_bits_};
    if (int64_t{size.width} * size.height > max_image_pixels) fail(size_text(size));
    return size;
  }
  template <class T>
  Tensor<T> read_pixels(const PngSize& size) {
    if (stored_row_bytes_ * size.height / max_inflation > source_.file.size())
      fail("a file too short for an image of " + size_text(size));
    Tensor<T> pixels;
    pixels.resize({size.height, size.width, size.channels});
    std::vector<png_bytep> rows(static_cast<size_t>(size.height));
    for (size_t y = 0; y < rows.size(); ++y) {
      rows[y] = reinterpret_cast<png_bytep>(pixels.row(static_cast<int64_t>(y)));
    }
    if (!try_pixels(rows.data())) fail();
    return pixels;
  }

 private:
  static std::string size_text(const PngSize& size) {
    return std::to_string(size.width) + "×" + std::to_string(size.height);
  }
  // Checked before libpng does: its message says neither which side is too large nor how large it is.
  void refuse_sides() const {
    std::array<png_byte, 24> start{};
    if (source_.file.size() < static_cast<int64_t>(start.size())) return;
    source_.file.read_at(0, std::as_writable_bytes(std::span(start)));
    if (png_sig_cmp(start.data(), 0, 8) != 0 || std::memcmp(&start[12], "IHDR", 4) != 0) return;
    refuse_side("width", png_get_uint_32(&start[16]));
    refuse_side("height", png_get_uint_32(&start[20]));
  }
  void refuse_side(const char* field, png_uint_32 pixels) const {
    if (pixels >= 1 && pixels <= max_image_side) return;
    throw InputError(source_.file.path().string(), field, std::to_string(pixels),
                     "1 to " + std::to_string(max_image_side) + " pixels",
                     pixels == 0 ? remedy : "scale the image down");
  }
  bool try_header() {
    if (setjmp(png_jmpbuf(png_)) != 0) return false;
    png_set_read_fn(png_, &source_, read_bytes);
    png_set_user_limits(png_, max_image_side, max_image_side);
    png_set_chunk_cache_max(png_, 128);
    png_set_chunk_malloc_max(png_, 8U << 20);
    // Text, profiles and the like are not needed, and each may unpack to those 8 MiB.
    png_set_keep_unknown_chunks(png_, PNG_HANDLE_CHUNK_NEVER, nullptr, -1);
    png_read_info(png_, info_);
    stored_row_bytes_ = static_cast<int64_t>(png_get_rowbytes(png_, info_));
    stored_bits_ = png_get_bit_depth(png_, info_);
    png_set_expand(png_);
    if (bits_ == 8) {
      png_set_scale_16(png_);
    } else {
      png_set_expand_16(png_);
      if (std::endian::native == std::endian::little) png_set_swap(png_);
    }
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
    source_.throw_if_out_of_memory();
    fail(source_.text.data());
  }
  [[noreturn]] void fail(const std::string& found) const {
    throw InputError(source_.file.path().string(), "", found,
                     "a PNG image of at most 32,768 pixels a side and 2²⁸ in all", remedy);
  }

  PngSource source_;
  const int bits_;
  png_structp png_ = nullptr;
  png_infop info_ = nullptr;
  int64_t stored_row_bytes_ = 0;  // before palettes and small depths are expanded
  int stored_bits_ = 8;
};

}  // namespace

PngSize read_png_size(const InputFile& file) { return PngReader(file, 8).read_header(); }
PngSize read_png_size(const std::filesystem::path& path) { return read_png_size(InputFile(path)); }

Tensor<uint8_t> read_png(const InputFile& file) {
  PngReader reader(file, 8);
  return reader.read_pixels<uint8_t>(reader.read_header());
}
Tensor<uint8_t> read_png(const std::filesystem::path& path) { return read_png(InputFile(path)); }

Tensor<uint16_t> read_png16(const InputFile& file) {
  PngReader reader(file, 16);
  return reader.read_pixels<uint16_t>(reader.read_header());
}

}  // namespace traceflow
