#include "files/png.h"

#include <png.h>

#include <array>
#include <bit>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <new>
#include <span>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "base/error.h"
#include "files/limits.h"

namespace traceflow {

namespace {

// Error handling for libpng, which leaves by longjmp and so skips destructors. Objects that own memory are
// outside the jump.
struct PngExit {
  std::array<char, 200> text{};
  bool out_of_memory = false;

  [[noreturn]] static void leave(png_structp png, png_const_charp text) {
    auto* exit = static_cast<PngExit*>(png_get_error_ptr(png));
    std::snprintf(exit->text.data(), exit->text.size(), "%s", text);
    png_longjmp(png, 1);
  }
  static void ignore(png_structp, png_const_charp) {}
  // Allocates for libpng, so that a lack of memory can be told from a broken image.
  static png_voidp take_memory(png_structp png, png_alloc_size_t size) {
    void* memory = ::operator new(size, std::nothrow);
    if (memory == nullptr) static_cast<PngExit*>(png_get_mem_ptr(png))->out_of_memory = true;
    return memory;
  }
  static void give_back(png_structp, png_voidp memory) { ::operator delete(memory); }

  // Call after a jump. Throws if the cause was a lack of memory.
  void throw_if_out_of_memory() const {
    if (out_of_memory) throw std::bad_alloc();
  }
};

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
