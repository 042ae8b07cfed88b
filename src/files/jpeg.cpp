#include "files/jpeg.h"

#include <algorithm>

#include "base/error.h"
#include "files/jpeg_exit.h"

namespace traceflow {

namespace {

// From this quality on colours keep the full resolution, so that edges between them stay sharp.
constexpr int fine_quality = 90;

struct Sink {
  jpeg_destination_mgr manager;
  std::string bytes;
};

Sink* sink_of(j_compress_ptr info) { return reinterpret_cast<Sink*>(info->dest); }

bool grow(std::string& bytes, size_t size) noexcept {
  try {
    bytes.resize(size);
  } catch (const std::exception&) {
    return false;
  }
  return true;
}

// Lets the library write from byte `used` on, after at least doubling the buffer.
void give_room(j_compress_ptr info, size_t used) {
  Sink* sink = sink_of(info);
  if (!grow(sink->bytes, std::max<size_t>(2 * used, 1 << 15))) ERREXIT1(info, JERR_OUT_OF_MEMORY, 0);
  sink->manager.next_output_byte = reinterpret_cast<JOCTET*>(sink->bytes.data()) + used;
  sink->manager.free_in_buffer = sink->bytes.size() - used;
}

void begin(j_compress_ptr info) { give_room(info, 0); }
boolean on_full(j_compress_ptr info) {
  give_room(info, sink_of(info)->bytes.size());
  return TRUE;
}
void end(j_compress_ptr info) {
  Sink* sink = sink_of(info);
  // Shrinking allocates no memory.
  sink->bytes.resize(sink->bytes.size() - sink->manager.free_in_buffer);
}

struct Encoder {
  JpegExit error{};
  Sink sink{};
  jpeg_compress_struct jpeg{};

  // Returns false and sets error.text if the library failed.
  bool encode(const Tensor<uint8_t>& pixels, int quality) {
    jpeg.err = error.prepare();
    if (setjmp(error.jump) != 0) return false;
    jpeg_create_compress(&jpeg);
    jpeg.dest = &sink.manager;
    sink.manager.init_destination = begin;
    sink.manager.empty_output_buffer = on_full;
    sink.manager.term_destination = end;
    jpeg.image_height = static_cast<JDIMENSION>(pixels.dim(0));
    jpeg.image_width = static_cast<JDIMENSION>(pixels.dim(1));
    jpeg.input_components = pixels.shape().rank() == 2 ? 1 : 3;
    jpeg.in_color_space = jpeg.input_components == 1 ? JCS_GRAYSCALE : JCS_RGB;
    jpeg_set_defaults(&jpeg);
    jpeg_set_quality(&jpeg, quality, TRUE);
    jpeg.dct_method = quality >= fine_quality ? JDCT_ISLOW : JDCT_IFAST;
    if (quality >= fine_quality) jpeg.comp_info[0].h_samp_factor = jpeg.comp_info[0].v_samp_factor = 1;
    jpeg_start_compress(&jpeg, TRUE);
    while (jpeg.next_scanline < jpeg.image_height) {
      auto* row = const_cast<JSAMPROW>(pixels.row(jpeg.next_scanline));
      jpeg_write_scanlines(&jpeg, &row, 1);
    }
    jpeg_finish_compress(&jpeg);
    return true;
  }
  ~Encoder() { jpeg_destroy_compress(&jpeg); }
};

}  // namespace

std::string jpeg_bytes(const Tensor<uint8_t>& pixels, int quality) {
  const int rank = pixels.shape().rank();
  require(rank == 2 || (rank == 3 && pixels.dim(2) == 3), "a JPEG's pixels are H×W or H×W×3",
          pixels.shape().to_string());
  require(quality >= 1 && quality <= 100, "a JPEG's quality is 1 to 100", std::to_string(quality));
  Encoder encoder;
  if (encoder.encode(pixels, quality)) return std::move(encoder.sink.bytes);
  encoder.error.throw_if_out_of_memory();
  throw InputError("JPEG", "", pixels.shape().to_string() + ": " + encoder.error.text.data(),
                   "a picture of 1 to 65,500 pixels a side");
}

}  // namespace traceflow
