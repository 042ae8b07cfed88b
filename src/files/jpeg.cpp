#include "files/jpeg.h"

#include <turbojpeg.h>

#include <memory>
#include <new>

#include "base/error.h"

namespace traceflow {

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
