#include "splat/webp.h"

#include <webp/encode.h>

#include <memory>

#include "base/error.h"

namespace traceflow {

namespace {

// Of libwebp's lossless mode, 0 (fast) to 9 (small).
constexpr int webp_effort = 6;

}  // namespace

std::string webp_bytes(const Tensor<uint8_t>& image) {
  require(image.shape().rank() == 3 && image.dim(2) == 4, "an image is H×W×4", image.shape().to_string());
  require(image.dim(0) <= WEBP_MAX_DIMENSION && image.dim(1) <= WEBP_MAX_DIMENSION,
          "a WebP image has at most 16,383 pixels a side", image.shape().to_string());
  WebPConfig config;
  WebPPicture picture;
  require(WebPConfigInit(&config) != 0 && WebPConfigLosslessPreset(&config, webp_effort) != 0 &&
              WebPPictureInit(&picture) != 0,
          "libwebp has the version that it was compiled with");
  config.exact = 1;
  picture.use_argb = 1;
  picture.width = static_cast<int>(image.dim(1));
  picture.height = static_cast<int>(image.dim(0));
  WebPMemoryWriter writer;
  WebPMemoryWriterInit(&writer);
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &writer;
  const bool encoded = WebPPictureImportRGBA(&picture, image.data(), 4 * picture.width) != 0 &&
                       WebPEncode(&config, &picture) != 0;
  std::string bytes(reinterpret_cast<const char*>(writer.mem), writer.size);
  WebPMemoryWriterClear(&writer);
  WebPPictureFree(&picture);
  require(encoded, "libwebp encodes an image", std::to_string(picture.error_code));
  return bytes;
}

}  // namespace traceflow
