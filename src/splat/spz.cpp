#include "splat/spz.h"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "files/input_file.h"
#include "files/limits.h"
#include "math/activation.h"
#include "math/spherical_harmonics.h"
#include "splat/gaussians.h"

namespace traceflow {

namespace {

static_assert(std::endian::native == std::endian::little, "the file's byte order is the machine's");

constexpr uint32_t spz_magic = 0x5053474e;  // "NGSP"
constexpr uint32_t written_version = 3, zstd_version = 4;
constexpr int64_t gzip_header_bytes = 16, zstd_header_bytes = 32;
constexpr const char* spz_remedy = "write it with Niantic's spz, splat-transform or `traceflow export`";
// Of the format: the range of the colours, and the steps of log-scales and harmonics.
constexpr float colour_scale = 0.15F, scale_offset = 10, scale_steps = 16, harmonic_steps = 128;
constexpr float largest_component = 0.70710678F;  // of a unit quaternion, besides its largest one
constexpr uint32_t component_steps = 511;

struct SpzHeader {
  uint32_t magic = spz_magic;
  uint32_t version = written_version;
  uint32_t count = 0;
  uint8_t degree = 0;
  uint8_t fractional_bits = 0;
  uint8_t flags = 0;
  uint8_t streams = 0;  // of version 4
};
static_assert(sizeof(SpzHeader) == gzip_header_bytes);

// The attributes in the order of the file.
enum Part { positions, opacities, colours, scales, rotations, harmonics };
using Parts = std::array<std::vector<uint8_t>, 6>;

std::array<int64_t, 6> part_sizes(const SpzHeader& h) {
  const int64_t n = h.count;
  return {9 * n, n, 3 * n, 3 * n, (h.version == 2 ? 3 : 4) * n, 3 * (sh_coefficients(h.degree) - 1) * n};
}

constexpr std::array<uint8_t, 2> gzip_magic = {0x1f, 0x8b};
constexpr std::array<uint8_t, 4> zstd_spz_magic = {'N', 'G', 'S', 'P'};
bool begins_with(std::span<const uint8_t> bytes, std::span<const uint8_t> magic) {
  return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
}

uint8_t to_byte(float x) {
  // Not a number becomes 0.
  return x > 0 ? static_cast<uint8_t>(std::min(std::round(x), 255.0F)) : uint8_t{0};
}

// Unpacks a gzip stream piece by piece.
class GzipStream {
 public:
  explicit GzipStream(std::vector<uint8_t>& bytes) {
    stream_.next_in = bytes.data();
    // A stream of 4 GiB or more ends early here.
    stream_.avail_in = static_cast<uInt>(std::min<size_t>(bytes.size(), UINT32_MAX));
    require(inflateInit2(&stream_, 16 + MAX_WBITS) == Z_OK, "zlib starts");
  }
  ~GzipStream() { inflateEnd(&stream_); }
  GzipStream(const GzipStream&) = delete;
  GzipStream& operator=(const GzipStream&) = delete;

  // Whether the stream had enough bytes to fill `out`.
  bool fill(std::span<uint8_t> out) {
    while (!out.empty()) {
      const size_t asked = std::min<size_t>(out.size(), 1 << 30);
      stream_.next_out = out.data();
      stream_.avail_out = static_cast<uInt>(asked);
      const int result = inflate(&stream_, Z_NO_FLUSH);
      const size_t got = asked - stream_.avail_out;
      out = out.subspan(got);
      if (!out.empty() && (result != Z_OK || got == 0)) return false;
    }
    return true;
  }

 private:
  z_stream stream_{};
};

class SpzReader {
 public:
  explicit SpzReader(const std::filesystem::path& path) : file_(path) {
    bytes_.resize(static_cast<size_t>(file_.size()));
    file_.read_at(0, std::as_writable_bytes(std::span(bytes_)));
  }

  void read() {
    if (begins_with(bytes_, gzip_magic)) return read_gzip();
    if (begins_with(bytes_, zstd_spz_magic) && bytes_.size() >= zstd_header_bytes) return read_zstd();
    fail("first bytes", "neither a gzip stream nor \"NGSP\"", "an .spz of version 2, 3 or 4");
  }
  const SpzHeader& header() const { return header_; }
  const Parts& parts() const { return parts_; }

 private:
  [[noreturn]] void fail(const std::string& field, const std::string& found,
                         const std::string& expected) const {
    throw InputError(file_.path().string(), field, found, expected, spz_remedy);
  }

  // Before memory is allocated: neither gzip nor Zstandard makes real data this much smaller.
  void check_header(uint32_t first_version, uint32_t last_version) const {
    if (header_.magic != spz_magic) fail("magic number", std::to_string(header_.magic), "\"NGSP\"");
    if (header_.version < first_version || header_.version > last_version) {
      fail("version", std::to_string(header_.version),
           first_version == last_version ? std::to_string(last_version) : "2 or 3 in a gzip stream");
    }
    if (header_.degree > 3) fail("degree of the harmonics", std::to_string(header_.degree), "0 to 3");
    if (header_.fractional_bits > 24)
      fail("fractional bits", std::to_string(header_.fractional_bits), "0 to 24");
    int64_t promised = 0;
    for (const int64_t size : part_sizes(header_)) promised += size;
    if (promised / max_inflation > file_.size()) {
      fail("number of Gaussians", std::to_string(header_.count),
           "as many as " + std::to_string(file_.size()) + " bytes can hold");
    }
  }

  void read_gzip() {
    GzipStream stream(bytes_);
    bool whole = stream.fill({reinterpret_cast<uint8_t*>(&header_), gzip_header_bytes});
    if (whole) {
      check_header(2, 3);
      const auto sizes = part_sizes(header_);
      for (size_t p = 0; p < parts_.size() && whole; ++p) {
        parts_[p].resize(static_cast<size_t>(sizes[p]));
        whole = stream.fill(parts_[p]);
      }
    }
    if (!whole) fail("", "a gzip stream that is broken or ends early", "a whole .spz");
  }

  void read_zstd() {
    std::memcpy(&header_, bytes_.data(), sizeof header_);
    check_header(zstd_version, zstd_version);
    uint32_t table = 0;
    std::memcpy(&table, bytes_.data() + 16, sizeof table);
    const auto sizes = part_sizes(header_);
    const auto size = static_cast<uint64_t>(bytes_.size());
    const size_t streams = header_.degree == 0 ? 5 : 6;
    if (header_.streams != streams) fail("streams", std::to_string(header_.streams), std::to_string(streams));
    uint64_t at = uint64_t{table} + 16 * streams;
    if (table < zstd_header_bytes || at > size) {
      fail("table of contents", "offset " + std::to_string(table), "one within the file");
    }
    for (size_t p = 0; p < streams; ++p) {
      uint64_t packed = 0, unpacked = 0;
      std::memcpy(&packed, bytes_.data() + table + 16 * p, sizeof packed);
      std::memcpy(&unpacked, bytes_.data() + table + 16 * p + 8, sizeof unpacked);
      if (packed > size - at || unpacked != static_cast<uint64_t>(sizes[p])) {
        fail("stream " + std::to_string(p), std::to_string(packed) + " bytes for " + std::to_string(unpacked),
             std::to_string(sizes[p]) + " unpacked, within the file");
      }
      parts_[p].resize(static_cast<size_t>(unpacked));
      const size_t got = ZSTD_decompress(parts_[p].data(), parts_[p].size(), bytes_.data() + at, packed);
      if (ZSTD_isError(got) != 0 || got != parts_[p].size())
        fail("stream " + std::to_string(p), "broken data", "a whole Zstandard stream");
      at += packed;
    }
  }

  InputFile file_;
  std::vector<uint8_t> bytes_;
  SpzHeader header_;
  Parts parts_;
};

// Numbers (x, y, z, w) from a file's rotation, to (w, x, y, z).
void unpack_rotation(const uint8_t* bytes, bool is_version_2, float* rotation) {
  std::array<float, 4> q{};
  float rest = 1;
  size_t left_out = 3;
  if (is_version_2) {
    for (size_t c = 0; c < 3; ++c) q[c] = static_cast<float>(bytes[c]) / 127.5F - 1;
  } else {
    uint32_t packed = 0;
    std::memcpy(&packed, bytes, sizeof packed);
    left_out = packed >> 30;
    for (size_t c = 4; c-- > 0;) {
      if (c == left_out) continue;
      const float size = largest_component * static_cast<float>(packed & component_steps) / component_steps;
      q[c] = (packed >> 9 & 1) != 0 ? -size : size;
      packed >>= 10;
    }
  }
  for (size_t c = 0; c < 4; ++c) {
    if (c != left_out) rest -= q[c] * q[c];
  }
  q[left_out] = std::sqrt(std::max(0.0F, rest));
  rotation[0] = q[3];
  std::copy(q.begin(), q.begin() + 3, rotation + 1);
}

uint32_t packed_rotation(const float* rotation) {
  std::array<double, 4> q = {rotation[1], rotation[2], rotation[3], rotation[0]};
  double length = 0;
  for (const double v : q) length += v * v;
  length = std::sqrt(length);
  if (!(length > 0)) q = {0, 0, 0, length = 1};
  uint32_t largest = 0;
  for (uint32_t c = 1; c < 4; ++c) {
    if (std::abs(q[c]) > std::abs(q[largest])) largest = c;
  }
  uint32_t packed = largest;
  for (uint32_t c = 0; c < 4; ++c) {
    if (c == largest) continue;
    const double size = std::abs(q[c]) / length / largest_component;
    const auto steps = static_cast<uint32_t>(std::min(std::round(size * component_steps), 511.0));
    packed = packed << 10 | ((q[c] < 0) != (q[largest] < 0) ? 1U : 0U) << 9 | steps;
  }
  return packed;
}

// The most fractional bits, up to 20, with which the farthest surfel fits into 24 bits.
uint8_t fractional_bits_for(const Tensor<float>& position) {
  float farthest = 0;
  for (const float v : position.values()) {
    if (std::isfinite(v)) farthest = std::max(farthest, std::abs(v));
  }
  int bits = 20;
  while (bits > 0 && std::ldexp(farthest, bits) > 0x7fffff) --bits;
  return static_cast<uint8_t>(bits);
}

std::vector<uint8_t> packed_bytes(const Surfels& s) {
  const int64_t n = s.count(), k = s.sh.dim(1);
  SpzHeader header;
  require(n <= UINT32_MAX, "an .spz holds at most 2³² Gaussians", std::to_string(n));
  header.count = static_cast<uint32_t>(n);
  header.degree = static_cast<uint8_t>(sh_degree(k));
  header.fractional_bits = fractional_bits_for(s.position);

  std::vector<uint8_t> bytes(sizeof header);
  std::memcpy(bytes.data(), &header, sizeof header);
  const float steps = std::ldexp(1.0F, header.fractional_bits);
  for (const float v : s.position.values()) {
    const float place = std::isfinite(v) ? v * steps : 0;
    const auto fixed = static_cast<int32_t>(std::round(std::clamp(place, -8388608.0F, 8388607.0F)));
    for (const int shift : {0, 8, 16}) bytes.push_back(static_cast<uint8_t>(fixed >> shift & 0xff));
  }
  for (const float v : s.opacity_logit.values()) bytes.push_back(to_byte(255 * sigmoid(v)));
  for (int64_t i = 0; i < n; ++i) {
    for (int c = 0; c < 3; ++c) bytes.push_back(to_byte(255 * (colour_scale * s.sh.row(i)[c] + 0.5F)));
  }
  for (int64_t i = 0; i < n; ++i) {
    for (const float v : {s.log_scale(i, 0), s.log_scale(i, 1), log_thickness(s, i)})
      bytes.push_back(to_byte((v + scale_offset) * scale_steps));
  }
  for (int64_t i = 0; i < n; ++i) {
    const uint32_t rotation = packed_rotation(s.rotation.row(i));
    for (const int shift : {0, 8, 16, 24}) bytes.push_back(static_cast<uint8_t>(rotation >> shift & 0xff));
  }
  for (int64_t i = 0; i < n; ++i) {
    for (int64_t c = 3; c < 3 * k; ++c) bytes.push_back(to_byte((s.sh.row(i)[c] + 1) * harmonic_steps));
  }
  return bytes;
}

std::vector<std::byte> gzipped(const std::vector<uint8_t>& bytes) {
  z_stream stream{};
  require(
      deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, 16 + MAX_WBITS, 9, Z_DEFAULT_STRATEGY) == Z_OK,
      "zlib starts", "no memory");
  std::vector<std::byte> packed(deflateBound(&stream, bytes.size()));
  stream.next_in = const_cast<Bytef*>(bytes.data());
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(packed.data());
  stream.avail_out = static_cast<uInt>(packed.size());
  const int result = deflate(&stream, Z_FINISH);
  packed.resize(packed.size() - stream.avail_out);
  deflateEnd(&stream);
  require(result == Z_STREAM_END, "zlib packs everything at once", std::to_string(result));
  return packed;
}

}  // namespace

void write_spz(const std::filesystem::path& path, const Surfels& surfels) {
  const std::vector<uint8_t> bytes = packed_bytes(surfels);
  require(bytes.size() <= UINT32_MAX, "an .spz is smaller than 4 GiB unpacked", std::to_string(bytes.size()));
  write_atomically(path, gzipped(bytes));
}

bool is_spz(const std::filesystem::path& path) {
  const InputFile file(path);
  std::vector<uint8_t> bytes(static_cast<size_t>(std::min<int64_t>(file.size(), 4)));
  file.read_at(0, std::as_writable_bytes(std::span(bytes)));
  return begins_with(bytes, gzip_magic) || begins_with(bytes, zstd_spz_magic);
}

Surfels read_spz(const std::filesystem::path& path) {
  SpzReader reader(path);
  reader.read();
  const SpzHeader& header = reader.header();
  const Parts& parts = reader.parts();
  const int64_t n = header.count, k = sh_coefficients(header.degree);

  Surfels s{Tensor<float>(Shape{n, 3}),    Tensor<float>(),
            Tensor<float>(Shape{n, 4}),    Tensor<float>(Shape{n}),
            Tensor<float>(Shape{n, k, 3}), Tensor<float>()};
  Tensor<float> log_scales(Shape{n, 3});
  const float step = std::ldexp(1.0F, -header.fractional_bits);
  const int64_t rotation_bytes = header.version == 2 ? 3 : 4;
  for (int64_t i = 0; i < 3 * n; ++i) {
    const uint8_t* p = parts[positions].data() + 3 * i;
    const uint32_t high = uint32_t{p[0]} << 8 | uint32_t{p[1]} << 16 | uint32_t{p[2]} << 24;
    s.position.data()[i] = static_cast<float>(static_cast<int32_t>(high) >> 8) * step;
    log_scales.data()[i] =
        static_cast<float>(parts[scales][static_cast<size_t>(i)]) / scale_steps - scale_offset;
  }
  for (int64_t i = 0; i < n; ++i) {
    // Opacities 0 and 1 have no finite logit.
    const float opacity = static_cast<float>(parts[opacities][static_cast<size_t>(i)]) / 255;
    s.opacity_logit[i] = logit(std::clamp(opacity, 0.001F, 0.999F));
    unpack_rotation(parts[rotations].data() + rotation_bytes * i, header.version == 2, s.rotation.row(i));
    float* sh = s.sh.row(i);
    for (int64_t c = 0; c < 3; ++c)
      sh[c] =
          (static_cast<float>(parts[colours][static_cast<size_t>(3 * i + c)]) / 255 - 0.5F) / colour_scale;
    const uint8_t* rest = parts[harmonics].data() + 3 * (k - 1) * i;
    for (int64_t c = 3; c < 3 * k; ++c) sh[c] = static_cast<float>(rest[c - 3]) / harmonic_steps - 1;
  }
  flatten(log_scales, s);
  return s;
}

}  // namespace traceflow
