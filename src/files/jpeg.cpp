#include "files/jpeg.h"

#include <turbojpeg.h>

#include <algorithm>
#include <array>
#include <csetjmp>
#include <cstdio>
#include <memory>
#include <new>
#include <span>
#include <string>

// libjpeg's header requires those above.
#include <jpeglib.h>
// The macros of its errors.
#include <jerror.h>

#include "base/error.h"
#include "files/exif.h"
#include "files/limits.h"

namespace traceflow {

namespace {

// An image in several scans holds all its coefficients at once, two bytes each, in addition to the pixels.
constexpr int64_t max_pixels_in_scans = int64_t{1} << 27;
// Images have a few scans; a file with thousands keeps a decoder busy for hours.
constexpr int max_scans = 500;

// Error handling for libjpeg, which leaves by longjmp and so skips destructors. Objects that own memory are
// outside the jump. The library passes back pointers to its own structs, so each is the first member of a
// struct of ours.
struct JpegExit {
  jpeg_error_mgr manager;
  std::jmp_buf jump;
  std::array<char, JMSG_LENGTH_MAX> text;

  // Directs the library's errors to this object and drops its messages.
  jpeg_error_mgr* prepare() {
    jpeg_std_error(&manager);
    manager.error_exit = [](j_common_ptr info) { leave(info); };
    manager.output_message = [](j_common_ptr) {};
    return &manager;
  }
  [[noreturn]] static void leave(j_common_ptr info) {
    auto* exit = reinterpret_cast<JpegExit*>(info->err);
    (*info->err->format_message)(info, exit->text.data());
    std::longjmp(exit->jump, 1);
  }
  [[noreturn]] static void leave(j_common_ptr info, const char* text) {
    auto* exit = reinterpret_cast<JpegExit*>(info->err);
    std::snprintf(exit->text.data(), exit->text.size(), "%s", text);
    std::longjmp(exit->jump, 1);
  }

  // Call after a jump. Throws if the cause was a lack of memory.
  void throw_if_out_of_memory() const {
    if (manager.msg_code == JERR_OUT_OF_MEMORY) throw std::bad_alloc();
  }
};

struct Source {
  jpeg_source_mgr manager;
  const InputFile* file;
  int64_t offset;
  std::array<JOCTET, 1 << 16> buffer;
  int orientation = 1;                 // from EXIF, so far
  std::array<JOCTET, 0xffff> segment;  // the last APP1 segment
};

Source* source_of(j_decompress_ptr info) { return reinterpret_cast<Source*>(info->src); }

// The library would continue with invented pixels where data are broken or missing.
void on_message(j_common_ptr info, int level) {
  if (level >= 0) return;
  const int code = info->err->msg_code;
  if (code == JWRN_ADOBE_XFORM || code == JWRN_JFIF_MAJOR || code == JWRN_EXTRANEOUS_DATA) return;
  JpegExit::leave(info);
}

void begin(j_decompress_ptr) {}
void end(j_decompress_ptr) {}

bool try_read(Source& source, size_t count) noexcept {
  try {
    source.file->read_at(source.offset, std::as_writable_bytes(std::span(source.buffer).first(count)));
  } catch (const std::exception&) {
    return false;
  }
  return true;
}

boolean on_empty(j_decompress_ptr info) {
  Source* source = source_of(info);
  const int64_t left = source->file->size() - source->offset;
  const auto whole = static_cast<int64_t>(source->buffer.size());
  const auto count = static_cast<size_t>(std::min(left, whole));
  if (left <= 0) JpegExit::leave(reinterpret_cast<j_common_ptr>(info), "a file that is cut short");
  if (!try_read(*source, count))
    JpegExit::leave(reinterpret_cast<j_common_ptr>(info), "a file that cannot be read");
  source->offset += static_cast<int64_t>(count);
  source->manager.next_input_byte = source->buffer.data();
  source->manager.bytes_in_buffer = count;
  return TRUE;
}

void on_skip(j_decompress_ptr info, long count) {
  Source* source = source_of(info);
  if (count <= 0) return;
  const auto skipped = static_cast<size_t>(count);
  const size_t here = std::min(skipped, source->manager.bytes_in_buffer);
  source->manager.next_input_byte += here;
  source->manager.bytes_in_buffer -= here;
  source->offset += static_cast<int64_t>(skipped - here);
}

JOCTET take_byte(j_decompress_ptr info) {
  jpeg_source_mgr& manager = source_of(info)->manager;
  if (manager.bytes_in_buffer == 0) on_empty(info);
  --manager.bytes_in_buffer;
  return *manager.next_input_byte++;
}

// The library's own handler keeps every segment, and a file may hold gigabytes of them.
boolean on_exif(j_decompress_ptr info) {
  Source* source = source_of(info);
  const size_t high = take_byte(info), length = high << 8 | take_byte(info);
  // The length includes its own two bytes.
  const size_t count = length < 2 ? 0 : length - 2;
  if (source->orientation != 1) {
    on_skip(info, static_cast<long>(count));
    return TRUE;
  }
  for (size_t i = 0; i < count; ++i) source->segment[i] = take_byte(info);
  source->orientation = exif_orientation(std::as_bytes(std::span(source->segment).first(count)));
  return TRUE;
}

void on_progress(j_common_ptr info) {
  const auto* jpeg = reinterpret_cast<j_decompress_ptr>(info);
  if (jpeg->input_scan_number > max_scans) JpegExit::leave(info, "more than 500 scans");
}

class JpegReader {
 public:
  explicit JpegReader(const InputFile& file) {
    source_.file = &file;
    jpeg_.err = error_.prepare();
    error_.manager.emit_message = on_message;
  }
  ~JpegReader() { jpeg_destroy_decompress(&jpeg_); }
  JpegReader(const JpegReader&) = delete;
  JpegReader& operator=(const JpegReader&) = delete;

  JpegSize read_header() {
    if (!try_header()) fail();
    JpegSize size{static_cast<int>(jpeg_.image_width), static_cast<int>(jpeg_.image_height),
                  jpeg_.num_components == 1 ? 1 : 3, source_.orientation};
    check(size);
    return size;
  }

  Tensor<uint8_t> read_pixels(const JpegSize& size) {
    if (fewest_bytes() > source_.file->size()) fail("a file too short for an image of " + size_text(size));
    Tensor<uint8_t> pixels;
    pixels.resize({size.height, size.width, size.channels});
    if (!try_pixels(pixels)) fail();
    return pixels;
  }

 private:
  static std::string size_text(const JpegSize& size) {
    return std::to_string(size.width) + "×" + std::to_string(size.height);
  }

  bool try_header() {
    if (setjmp(error_.jump) != 0) return false;
    jpeg_create_decompress(&jpeg_);
    jpeg_.src = &source_.manager;
    source_.manager.init_source = begin;
    source_.manager.fill_input_buffer = on_empty;
    source_.manager.skip_input_data = on_skip;
    source_.manager.resync_to_restart = jpeg_resync_to_restart;
    source_.manager.term_source = end;
    progress_.progress_monitor = on_progress;
    jpeg_.progress = &progress_;
    jpeg_set_marker_processor(&jpeg_, JPEG_APP0 + 1, on_exif);
    jpeg_read_header(&jpeg_, TRUE);
    return true;
  }

  bool try_pixels(Tensor<uint8_t>& pixels) {
    if (setjmp(error_.jump) != 0) return false;
    jpeg_.out_color_space = jpeg_.num_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_start_decompress(&jpeg_);
    while (jpeg_.output_scanline < jpeg_.output_height) {
      JSAMPROW row = pixels.row(jpeg_.output_scanline);
      jpeg_read_scanlines(&jpeg_, &row, 1);
    }
    jpeg_finish_decompress(&jpeg_);
    return true;
  }

  void check(const JpegSize& size) {
    const J_COLOR_SPACE colours = jpeg_.jpeg_color_space;
    if (colours == JCS_CMYK || colours == JCS_YCCK) fail("CMYK colours");
    if (colours != JCS_GRAYSCALE && colours != JCS_YCbCr && colours != JCS_RGB)
      fail(std::to_string(jpeg_.num_components) + " colour components");
    // Its codes have no minimum number of bytes.
    if (jpeg_.arith_code != 0) fail("arithmetic coding");
    if (size.width > max_image_side || size.height > max_image_side ||
        int64_t{size.width} * size.height > max_image_pixels) {
      fail(size_text(size));
    }
    if (jpeg_has_multiple_scans(&jpeg_) != 0 && int64_t{size.width} * size.height > max_pixels_in_scans)
      fail(size_text(size) + " in several scans, of which 2²⁷ pixels are read");
  }

  // Each block of 8×8 numbers takes at least one bit.
  int64_t fewest_bytes() const {
    int64_t most_wide = 1, most_high = 1, blocks = 0;
    const std::span components(jpeg_.comp_info, static_cast<size_t>(jpeg_.num_components));
    for (const jpeg_component_info& c : components) {
      most_wide = std::max<int64_t>(most_wide, c.h_samp_factor);
      most_high = std::max<int64_t>(most_high, c.v_samp_factor);
    }
    for (const jpeg_component_info& c : components) {
      blocks += (int64_t{jpeg_.image_width} * c.h_samp_factor / (8 * most_wide)) *
                (int64_t{jpeg_.image_height} * c.v_samp_factor / (8 * most_high));
    }
    return blocks / 8;
  }

  [[noreturn]] void fail() const {
    error_.throw_if_out_of_memory();
    fail(error_.text.data());
  }
  [[noreturn]] void fail(const std::string& found) const {
    throw InputError(source_.file->path().string(), "", found,
                     "a JPEG image, grey or RGB, of at most 32,768 pixels a side and 2²⁸ in all",
                     "write or copy the file again");
  }

  JpegExit error_{};
  Source source_{};
  jpeg_progress_mgr progress_{};
  jpeg_decompress_struct jpeg_{};
};

}  // namespace

JpegSize read_jpeg_size(const InputFile& file) { return JpegReader(file).read_header(); }

Tensor<uint8_t> read_jpeg(const InputFile& file) {
  JpegReader reader(file);
  return reader.read_pixels(reader.read_header());
}

std::string jpeg_bytes(const Tensor<uint8_t>& pixels, int quality) {
  constexpr int64_t longest_side = 65500;
  // From this quality on colours keep the full resolution, so that edges between them stay sharp.
  constexpr int fine_quality = 90;
  const int rank = pixels.shape().rank();
  require(rank == 2 || (rank == 3 && pixels.dim(2) == 3), "a JPEG's pixels are H×W or H×W×3",
          pixels.shape().to_string());
  require(quality >= 1 && quality <= 100, "a JPEG's quality is 1 to 100", std::to_string(quality));
  const int64_t height = pixels.dim(0), width = pixels.dim(1);
  if (pixels.empty() || height > longest_side || width > longest_side)
    throw InputError("JPEG", "", pixels.shape().to_string(), "a picture of 1 to 65,500 pixels a side");

  const bool grey = rank == 2, fine = quality >= fine_quality;
  const std::unique_ptr<void, int (*)(tjhandle)> encoder(tjInitCompress(), tjDestroy);
  unsigned char* bytes = nullptr;
  unsigned long size = 0;
  const int status = encoder
                         ? tjCompress2(encoder.get(), pixels.data(), static_cast<int>(width), 0,
                                       static_cast<int>(height), grey ? TJPF_GRAY : TJPF_RGB, &bytes, &size,
                                       grey   ? TJSAMP_GRAY
                                       : fine ? TJSAMP_444
                                              : TJSAMP_420,
                                       quality, fine ? TJFLAG_ACCURATEDCT : TJFLAG_FASTDCT)
                         : -1;
  const std::unique_ptr<unsigned char, void (*)(unsigned char*)> owner(bytes, tjFree);
  // Nothing else can fail.
  if (status != 0) throw std::bad_alloc();
  return {reinterpret_cast<const char*>(bytes), size};
}

}  // namespace traceflow
