#include "splat/spz.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <zlib.h>
#include <zstd.h>

#include <cmath>

#include "math/activation.h"
#include "math/rotation.h"
#include "splat/gaussians.h"
#include "splat/random_surfels.h"
#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

using testing::HasSubstr;

std::string gunzipped(const std::filesystem::path& path) {
  gzFile file = gzopen(path.c_str(), "rb");
  std::string bytes(1 << 22, '\0');
  bytes.resize(static_cast<size_t>(gzread(file, bytes.data(), static_cast<unsigned>(bytes.size()))));
  gzclose(file);
  return bytes;
}

std::string gzipped_bytes(const std::string& bytes) {
  const TempFolder folder;
  gzFile file = gzopen((folder / "a").c_str(), "wb");
  gzwrite(file, bytes.data(), static_cast<unsigned>(bytes.size()));
  gzclose(file);
  return bytes_of(folder / "a");
}

std::string zstd_bytes(const std::string& bytes) {
  std::string packed(ZSTD_compressBound(bytes.size()), '\0');
  packed.resize(ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 3));
  return packed;
}

struct Header {
  uint32_t magic = 0x5053474e, version = 3, count = 1;
  uint8_t degree = 0, fractional_bits = 12, flags = 0, streams = 0;
};

std::string header_bytes(const Header& h) {
  return little_endian(h.magic, 4) + little_endian(h.version, 4) + little_endian(h.count, 4) +
         little_endian(h.degree, 1) + little_endian(h.fractional_bits, 1) + little_endian(h.flags, 1) +
         little_endian(h.streams, 1);
}

// One Gaussian by hand after the format's description: at (1, −2, 0.5), opacity 51/255, colour bytes 0, 128,
// 255, log-scales −10, 0, −2, a rotation of 90° about y.
const std::string at_one =
    std::string("\x00\x10\x00", 3) + std::string("\x00\xe0\xff", 3) + std::string("\x00\x08\x00", 3);
const std::string opacity_51 = "\x33";
const std::string colours = std::string("\x00\x80\xff", 3);
const std::string scales = std::string("\x00\xa0\x80", 3);
// Version 2 stores x, y, z; versions 3 and 4 three of ten bits each and, above them, which is left out: w
// (3).
const std::string rotation_v2 = "\x80\xda\x80";
const std::string rotation_v3 = little_endian(3U << 30 | 0U << 20 | 511U << 10 | 0U, 4);

Surfels read(const std::string& bytes) {
  const TempFolder folder;
  write_bytes(folder / "a.spz", bytes);
  return read_spz(folder / "a.spz");
}
std::string spz_refusal(const std::string& bytes) {
  return refusal_of([&] { read(bytes); });
}

void expect_the_gaussian(const Surfels& s, double rotation_error) {
  ASSERT_EQ(s.count(), 1);
  EXPECT_FLOAT_EQ(s.position(0, 0), 1);
  EXPECT_FLOAT_EQ(s.position(0, 1), -2);
  EXPECT_FLOAT_EQ(s.position(0, 2), 0.5F);
  EXPECT_NEAR(sigmoid(s.opacity_logit[0]), 0.2, 1e-6);
  EXPECT_NEAR(s.sh(0, 0, 0), -0.5 / 0.15, 1e-5);
  EXPECT_NEAR(s.sh(0, 0, 1), (128 / 255.0 - 0.5) / 0.15, 1e-5);
  EXPECT_NEAR(s.sh(0, 0, 2), 0.5 / 0.15, 1e-5);
  // The shortest axis is x, which 90° about y turns to −z. The others are y, which stays, and z, which
  // becomes x.
  EXPECT_FLOAT_EQ(s.log_scale(0, 0), 0);
  EXPECT_FLOAT_EQ(s.log_scale(0, 1), -2);
  const float* q = s.rotation.row(0);
  const Mat3<double> r = rotation_from_quaternion(Vec4<double>(q[0], q[1], q[2], q[3]));
  EXPECT_NEAR(r[0][1], 1, rotation_error);
  EXPECT_NEAR(r[1][0], 1, rotation_error);
  EXPECT_NEAR(r[2][2], -1, rotation_error);
}

TEST(Spz, ReadsVersions2And3And4) {
  Header h;
  expect_the_gaussian(
      read(gzipped_bytes(header_bytes(h) + at_one + opacity_51 + colours + scales + rotation_v3)), 0.003);
  h.version = 2;
  expect_the_gaussian(
      read(gzipped_bytes(header_bytes(h) + at_one + opacity_51 + colours + scales + rotation_v2)), 0.02);
  h.version = 4;
  h.streams = 5;
  std::string table, streams;
  for (const std::string& part : {at_one, opacity_51, colours, scales, rotation_v3}) {
    const std::string packed = zstd_bytes(part);
    table += little_endian(packed.size(), 8) + little_endian(part.size(), 8);
    streams += packed;
  }
  // Eight bytes of extensions before the table.
  const std::string version_4 =
      header_bytes(h) + little_endian(40, 4) + std::string(12, '\0') + "extended" + table;
  expect_the_gaussian(read(version_4 + streams), 0.003);

  EXPECT_THAT(spz_refusal(version_4 + streams.substr(0, streams.size() - 1)), HasSubstr("stream 4"));
  EXPECT_THAT(spz_refusal(version_4 + std::string(streams.size(), 'x')), HasSubstr("broken data"));
  EXPECT_THAT(spz_refusal(version_4), HasSubstr("stream 0"));
  EXPECT_THAT(spz_refusal(version_4.substr(0, 50)), HasSubstr("table of contents"));
  h.streams = 6;
  EXPECT_THAT(spz_refusal(header_bytes(h) + version_4.substr(16) + streams), HasSubstr("streams: found 6"));
}

// Oracle: the steps of the format.
TEST(Spz, RoundTripIsWithinTheStepsOfTheFormat) {
  for (const int64_t coefficients : {1, 4, 9, 16}) {
    Surfels s = random_surfels(2000, coefficients, true);
    for (float& v : s.sh.values()) v = std::clamp(0.4F * v, -0.99F, 0.98F);
    for (float& v : s.position.values()) v *= 100;
    const TempFolder folder;
    write_spz(folder / "a.spz", s);
    const Surfels back = read_spz(folder / "a.spz");
    ASSERT_EQ(back.count(), s.count());
    ASSERT_EQ(back.sh.shape(), s.sh.shape());
    EXPECT_FALSE(back.has_tint());
    float farthest = 0;
    for (const float v : s.position.values()) farthest = std::max(farthest, std::abs(v));
    for (int64_t i = 0; i < s.count(); ++i) {
      for (int a = 0; a < 3; ++a) EXPECT_NEAR(back.position(i, a), s.position(i, a), farthest * 0x1p-22);
      EXPECT_NEAR(sigmoid(back.opacity_logit[i]), sigmoid(s.opacity_logit[i]), 0.003);
      for (int a = 0; a < 2; ++a) EXPECT_NEAR(back.log_scale(i, a), s.log_scale(i, a), 1 / 32.0 + 1e-5);
      const auto axes = [](const float* q) {
        return rotation_from_quaternion(Vec4<double>(q[0], q[1], q[2], q[3]));
      };
      const Mat3<double> a = axes(s.rotation.row(i)), b = axes(back.rotation.row(i));
      EXPECT_GT(dot(a[2], b[2]), 1 - 2e-5);
      EXPECT_GT(dot(a[0], b[0]), 1 - 2e-5);
      for (int64_t c = 0; c < 3 * coefficients; ++c)
        EXPECT_NEAR(back.sh.row(i)[c], s.sh.row(i)[c], (c < 3 ? 0.5 / 255 / 0.15 : 0.5 / 128) + 1e-5);
    }
  }
}

TEST(Spz, WritesAGzipStreamOfVersion3WithAllBytes) {
  const TempFolder folder;
  const Surfels s = random_surfels(100, 16, true);
  write_spz(folder / "a.spz", s);
  const std::string bytes = gunzipped(folder / "a.spz");
  EXPECT_EQ(bytes.size(), size_t{16 + 100 * (9 + 1 + 3 + 3 + 4 + 45)});
  EXPECT_EQ(bytes.substr(0, 8), "NGSP" + little_endian(3, 4));
  EXPECT_EQ(bytes.substr(8, 5), little_endian(100, 4) + '\x03');
}

TEST(Spz, NumbersThatAreNotFiniteDoNoHarm) {
  Surfels s = random_surfels(3, 4, false);
  s.position(0, 0) = INFINITY;
  s.position(1, 1) = NAN;
  s.rotation(1, 0) = NAN;
  s.log_scale(2, 0) = -INFINITY;
  s.sh(2, 0, 0) = NAN;
  for (int c = 0; c < 4; ++c) s.rotation(2, c) = 0;
  const TempFolder folder;
  write_spz(folder / "a.spz", s);
  read_spz(folder / "a.spz").for_each([](const std::string& name, const Tensor<float>& t) {
    for (const float v : t.values()) EXPECT_TRUE(std::isfinite(v)) << name;
  });
}

TEST(Spz, RefusesWhatItCannotRead) {
  EXPECT_THAT(spz_refusal(""), HasSubstr("first bytes"));
  EXPECT_THAT(spz_refusal("ply\nformat"), HasSubstr("neither a gzip stream"));
  EXPECT_THAT(spz_refusal(gzipped_bytes("NGSP")), HasSubstr("ends early"));
  Header h;
  const std::string body = at_one + opacity_51 + colours + scales + rotation_v3;
  EXPECT_THAT(spz_refusal(gzipped_bytes(header_bytes(h) + body.substr(1))), HasSubstr("ends early"));
  std::string cut = gzipped_bytes(header_bytes(h) + body);
  EXPECT_THAT(spz_refusal(cut.substr(0, cut.size() / 2)), HasSubstr("ends early"));
  h.magic = 7;
  EXPECT_THAT(spz_refusal(gzipped_bytes(header_bytes(h) + body)), HasSubstr("magic number"));
  h = {};
  h.version = 5;
  EXPECT_THAT(spz_refusal(gzipped_bytes(header_bytes(h) + body)), HasSubstr("version: found 5"));
  h = {};
  h.degree = 4;
  EXPECT_THAT(spz_refusal(gzipped_bytes(header_bytes(h) + body)),
              HasSubstr("degree of the harmonics: found 4"));
  h = {};
  h.fractional_bits = 25;
  EXPECT_THAT(spz_refusal(gzipped_bytes(header_bytes(h) + body)), HasSubstr("fractional bits: found 25"));
  h = {};
  h.count = 0xffffffff;
  EXPECT_THAT(spz_refusal(gzipped_bytes(header_bytes(h) + body)), HasSubstr("number of Gaussians"));
}

}  // namespace
}  // namespace traceflow
