#include "files/image.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <string>

#include "base/error.h"
#include "files/jpeg.h"
#include "files/png.h"

namespace traceflow {

namespace {

enum class Kind { png, jpeg };

struct Signature {
  size_t offset;
  std::string_view bytes;
  const char* name;
};

// Common formats that are neither PNG nor JPEG.
constexpr std::array<Signature, 9> others = {{{0, "GIF8", "a GIF image"},
                                              {8, "WEBP", "a WebP image"},
                                              {0, "BM", "a BMP image"},
                                              {0, {"II*\0", 4}, "a TIFF or raw image"},
                                              {0, {"MM\0*", 4}, "a TIFF or raw image"},
                                              {4, "ftyphe", "a HEIC image"},
                                              {4, "ftypmif1", "a HEIC image"},
                                              {4, "ftypavif", "an AVIF image"},
                                              {0, "\x76\x2f\x31\x01", "an OpenEXR image"}}};

std::string printable(std::string_view bytes) {
  std::string text;
  for (const char c : bytes.substr(0, 8)) text += std::isprint(static_cast<unsigned char>(c)) != 0 ? c : '.';
  return text.empty() ? "an empty file" : "a file that begins with \"" + text + "\"";
}

Kind kind_of(const InputFile& file) {
  std::array<char, 12> start{};
  const auto count = static_cast<size_t>(std::min<int64_t>(file.size(), start.size()));
  file.read_at(0, std::as_writable_bytes(std::span(start).first(count)));
  const std::string_view bytes(start.data(), count);
  if (bytes.starts_with("\x89PNG")) return Kind::png;
  if (bytes.starts_with("\xff\xd8\xff")) return Kind::jpeg;
  const auto other = std::ranges::find_if(others, [&](const Signature& s) {
    return bytes.size() > s.offset && bytes.substr(s.offset).starts_with(s.bytes);
  });
  throw InputError(file.path().string(), "", other == others.end() ? printable(bytes) : other->name,
                   "a PNG or JPEG image", "convert it");
}

}  // namespace

std::string lower_extension(const std::filesystem::path& name) {
  std::string extension = name.extension().string();
  std::ranges::transform(extension, extension.begin(),
                         [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

bool has_image_name(const std::filesystem::path& name) {
  const std::string extension = lower_extension(name);
  return extension == ".png" || extension == ".jpg" || extension == ".jpeg";
}

ImageSize read_image_size(const InputFile& file) {
  if (kind_of(file) == Kind::png) {
    const PngSize size = read_png_size(file);
    return {size.width, size.height, size.channels, size.bits, 1};
  }
  const JpegSize size = read_jpeg_size(file);
  return {size.width, size.height, size.channels, 8, size.orientation};
}

Tensor<uint8_t> read_image(const InputFile& file) {
  return kind_of(file) == Kind::png ? read_png(file) : read_jpeg(file);
}

Tensor<uint16_t> read_image16(const InputFile& file) {
  return kind_of(file) == Kind::png ? read_png16(file) : in_16_bits(read_jpeg(file));
}

Tensor<uint16_t> in_16_bits(const Tensor<uint8_t>& pixels) {
  Tensor<uint16_t> wide;
  wide.resize(pixels.shape());
  std::ranges::transform(pixels.values(), wide.data(),
                         [](uint8_t v) { return static_cast<uint16_t>(v * 257); });
  return wide;
}

}  // namespace traceflow
