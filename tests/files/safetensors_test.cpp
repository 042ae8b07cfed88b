#include "files/safetensors.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <thread>

#include "support/file_bytes.h"
#include "support/refusal.h"
#include "support/temp_folder.h"

namespace traceflow {
namespace {

using ::testing::HasSubstr;

std::filesystem::path scratch(const std::string& name) {
  static const TempFolder folder;
  return folder / (name + ".safetensors");
}

// A file with the given header text and data, its length field right.
std::string file_bytes(const std::string& header, const std::string& data) {
  std::string bytes(8, '\0');
  for (size_t i = 0; i < 8; ++i) bytes[i] = static_cast<char>(header.size() >> (8 * i) & 0xFFU);
  return bytes + header + data;
}

// What() of the InputError that reading these bytes must end in.
std::string refusal(const std::string& bytes) {
  const auto path = scratch("hostile");
  write_bytes(path, bytes);
  return refusal_of([&] { Safetensors::read(path); });
}

template <class T>
Tensor<T> tensor_of(const Shape& shape, const std::vector<T>& values) {
  Tensor<T> result(shape);
  std::copy(values.begin(), values.end(), result.data());
  return result;
}

template <class T>
bool same_bytes(const Tensor<T>& a, const Tensor<T>& b) {
  return a.shape() == b.shape() &&
         (a.empty() || std::memcmp(a.data(), b.data(), a.values().size_bytes()) == 0);
}

TEST(Safetensors, WidensEveryHalfByTheFormulaOfTheFormat) {
  std::string halves;
  for (uint32_t bits = 0; bits < 0x10000; ++bits)
    halves += {static_cast<char>(bits & 255), static_cast<char>(bits >> 8)};
  const auto path = scratch("halves");
  write_bytes(path, file_bytes(R"({"h":{"dtype":"F16","shape":[65536],"data_offsets":[0,131072]}})", halves));
  const Tensor<float> read = Safetensors::read(path).tensor<float>("h");
  for (uint32_t bits = 0; bits < 0x10000; ++bits) {
    const int exponent = static_cast<int>(bits >> 10 & 31);
    const double mantissa = (bits & 1023) / 1024.0;
    const double sign = (bits & 0x8000) != 0 ? -1 : 1;
    const float wide = read[bits];
    if (exponent == 31) {
      EXPECT_EQ(std::isnan(wide), mantissa != 0) << bits;
      EXPECT_EQ(std::isinf(wide), mantissa == 0) << bits;
    } else {
      const double expected =
          exponent == 0 ? std::ldexp(mantissa, -14) : std::ldexp(1 + mantissa, exponent - 15);
      EXPECT_EQ(wide, static_cast<float>(sign * expected)) << bits;
    }
    EXPECT_EQ(std::signbit(wide), sign < 0) << bits;
  }
}

TEST(Safetensors, WritesTheDocumentedLayout) {
  Safetensors file;
  file.metadata["format"] = "pt";
  file.add("a", tensor_of<uint8_t>({3}, {1, 2, 3}));
  file.add("b", tensor_of<float>({1, 2}, {1.5F, -2.0F}));
  const auto path = scratch("layout");
  file.write(path);

  // The wide type comes first although its name is second; the header is padded with spaces to a multiple
  // of 8. Checksums by Python's zlib.crc32: of b'U8[3]\x01\x02\x03', b'F32[1,2]…' and b'{"format":"pt"}'.
  std::string header =
      R"({"__metadata__":{"format":"pt","traceflow.crc32":"{\"metadata\":\"c1f700ee\",)"
      R"(\"tensors\":{\"a\":\"f03a7dec\",\"b\":\"ad997724\"}}"},"a":{"data_offsets":[8,11],"dtype":"U8","shape":[3]},)"
      R"("b":{"data_offsets":[0,8],"dtype":"F32","shape":[1,2]}})";
  header.resize((header.size() + 7) / 8 * 8, ' ');
  const std::string data("\x00\x00\xC0\x3F\x00\x00\x00\xC0\x01\x02\x03", 11);
  EXPECT_EQ(bytes_of(path), file_bytes(header, data));
}

TEST(Safetensors, KeepsEveryTypeShapeAndBit) {
  const auto nan = std::numeric_limits<float>::quiet_NaN();
  Safetensors file;
  file.metadata["note"] = "line\n\"quoted\" β";
  file.add("float", tensor_of<float>({2, 2}, {nan, -0.0F, std::numeric_limits<float>::infinity(), 1e-45F}));
  file.add("double", tensor_of<double>({1, 1, 1, 2}, {M_PI, -1e300}));
  file.add("int", tensor_of<int32_t>({2}, {INT32_MIN, INT32_MAX}));
  file.add("long", tensor_of<int64_t>({1}, {INT64_MIN}));
  file.add("byte", tensor_of<uint8_t>({5}, {0, 1, 2, 254, 255}));
  file.add("none", Tensor<float>(Shape{0, 3}));
  const auto path = scratch("types");
  file.write(path);

  const Safetensors back = Safetensors::read(path);
  EXPECT_EQ(back.metadata, file.metadata);
  EXPECT_EQ(back.names(), file.names());
  EXPECT_TRUE(same_bytes(back.tensor<float>("float"), file.tensor<float>("float")));
  EXPECT_TRUE(same_bytes(back.tensor<double>("double"), file.tensor<double>("double")));
  EXPECT_TRUE(same_bytes(back.tensor<int32_t>("int"), file.tensor<int32_t>("int")));
  EXPECT_TRUE(same_bytes(back.tensor<int64_t>("long"), file.tensor<int64_t>("long")));
  EXPECT_TRUE(same_bytes(back.tensor<uint8_t>("byte"), file.tensor<uint8_t>("byte")));
  EXPECT_EQ(back.tensor<float>("none").shape(), (Shape{0, 3}));
}

TEST(Safetensors, WidensHalvesAndReadsScalars) {
  const auto path = scratch("halves");
  write_bytes(path, file_bytes(R"({"h":{"dtype":"F16","shape":[2],"data_offsets":[0,4]},)"
                               R"("b":{"dtype":"BF16","shape":[1],"data_offsets":[4,6]},)"
                               R"("s":{"dtype":"F32","shape":[],"data_offsets":[6,10]}})",
                               std::string("\x00\x3C\x00\xC0\x80\x3F\x00\x00\x80\x3F", 10)));
  const Safetensors file = Safetensors::read(path);
  EXPECT_TRUE(same_bytes(file.tensor<float>("h"), tensor_of<float>({2}, {1, -2})));
  EXPECT_TRUE(same_bytes(file.tensor<float>("b"), tensor_of<float>({1}, {1})));
  EXPECT_TRUE(same_bytes(file.tensor<float>("s"), tensor_of<float>({1}, {1})));
}

TEST(Safetensors, NamesTheTensorThatIsMissingOrOfAnotherType) {
  const auto path = scratch("asked");
  Safetensors file;
  file.add("weight", Tensor<float>(Shape{2}));
  file.write(path);
  const Safetensors back = Safetensors::read(path);
  EXPECT_TRUE(back.has("weight"));
  EXPECT_FALSE(back.has("bias"));
  const auto message = [](auto&& f) -> std::string { return refusal_of([&] { f(); }); };
  EXPECT_THAT(message([&] { back.tensor<float>("bias"); }), HasSubstr(path.string() + ": tensor bias"));
  EXPECT_THAT(message([&] { back.tensor<double>("weight"); }), HasSubstr("found type F32, expected F64"));
}

TEST(Safetensors, RefusesWhatIsNotAFile) {
  EXPECT_THROW(Safetensors::read(scratch("missing")), InputError);
  EXPECT_THROW(Safetensors::read(testing::TempDir()), InputError);
}

// A value of two bytes takes many times as many when it is parsed.
TEST(Safetensors, RefusesMoreValuesThanAHeaderHas) {
  std::string list = "[0";
  for (int i = 0; i < 4'000'000; ++i) list += ",0";
  list += "]";
  EXPECT_THAT(refusal(file_bytes(R"({"a":)" + list + "}", "")),
              HasSubstr("header: found 4000003 values, expected at most 4000000"));
  const std::string checksums = R"({\"metadata\":\"\",\"tensors\":{},\"a\":)" + list + "}";
  EXPECT_THAT(refusal(file_bytes(R"({"__metadata__":{"traceflow.crc32":")" + checksums + R"("}})", "")),
              HasSubstr("metadata: found checksums that cannot be read"));
}

struct Hostile {
  const char* what;
  std::string header;
  size_t data_bytes;
  const char* expected;
};

TEST(Safetensors, RefusesHostileHeaders) {
  const std::vector<Hostile> cases{
      {"not JSON", "{", 0, "not JSON"},
      {"not UTF-8", "{\"\xFF\":1}", 0, "not JSON"},
      {"a list", "[]", 0, "a JSON object"},
      {"deep nesting", std::string(1'000'000, '['), 0, "nested too deep"},
      {"no dtype", R"({"a":{"shape":[1],"data_offsets":[0,4]}})", 4, "an object with dtype"},
      {"an unknown type", R"({"a":{"dtype":"F8","shape":[1],"data_offsets":[0,1]}})", 1, "dtype"},
      {"a type that is a number", R"({"a":{"dtype":4,"shape":[1],"data_offsets":[0,1]}})", 1, "dtype"},
      {"a negative dimension", R"({"a":{"dtype":"U8","shape":[-1],"data_offsets":[0,1]}})", 1,
       "not negative"},
      {"a broken dimension", R"({"a":{"dtype":"U8","shape":[1.5],"data_offsets":[0,1]}})", 1, "not negative"},
      {"five dimensions", R"({"a":{"dtype":"U8","shape":[1,1,1,1,1],"data_offsets":[0,1]}})", 1, "at most 4"},
      {"a product that overflows",
       R"({"a":{"dtype":"U8","shape":[4294967296,4294967296,2],"data_offsets":[0,1]}})", 1, "63 bits"},
      {"a byte count that overflows",
       R"({"a":{"dtype":"F64","shape":[2305843009213693952],"data_offsets":[0,0]}})", 0,
       "elements of 8 bytes"},
      {"a dimension beyond int64",
       R"({"a":{"dtype":"U8","shape":[18446744073709551615],"data_offsets":[0,1]}})", 1, "63 bits"},
      {"offsets past the end", R"({"a":{"dtype":"U8","shape":[8],"data_offsets":[0,8]}})", 4,
       "within 4 bytes"},
      {"offsets far past the end",
       R"({"a":{"dtype":"U8","shape":[8],"data_offsets":[18446744073709551608,18446744073709551615]}})", 4,
       "within 4 bytes"},
      {"offsets in the wrong order", R"({"a":{"dtype":"U8","shape":[1],"data_offsets":[2,1]}})", 4, "within"},
      {"one offset", R"({"a":{"dtype":"U8","shape":[1],"data_offsets":[1]}})", 4, "two numbers"},
      {"fewer bytes than the shape", R"({"a":{"dtype":"F32","shape":[2],"data_offsets":[0,4]}})", 4,
       "2 elements"},
      {"overlapping tensors",
       R"({"a":{"dtype":"U8","shape":[3],"data_offsets":[0,3]},"b":{"dtype":"U8","shape":[3],"data_offsets":[1,4]}})",
       4, "where the one before ends"},
      {"a hole", R"({"a":{"dtype":"U8","shape":[1],"data_offsets":[1,2]}})", 2, "where the one before ends"},
      {"bytes left over", R"({"a":{"dtype":"U8","shape":[1],"data_offsets":[0,1]}})", 2, "2 bytes of data"},
      {"a name twice",
       R"({"a":{"dtype":"U8","shape":[1],"data_offsets":[0,1]},"a":{"dtype":"U8","shape":[1],"data_offsets":[1,2]}})",
       2, "twice"},
      {"metadata that is no text", R"({"__metadata__":{"a":1}})", 0, "a string"},
      {"metadata that is a list", R"({"__metadata__":[]})", 0, "an object of strings"},
  };
  for (const Hostile& c : cases) {
    EXPECT_THAT(refusal(file_bytes(c.header, std::string(c.data_bytes, 'x'))), HasSubstr(c.expected))
        << c.what;
  }
}

TEST(Safetensors, RefusesHeaderLengthsThatTheFileDoesNotHold) {
  EXPECT_THAT(refusal(""), HasSubstr("0 bytes"));
  EXPECT_THAT(refusal("1234567"), HasSubstr("7 bytes"));
  EXPECT_THAT(refusal(std::string(8, '\xFF')), HasSubstr("header length: found 18446744073709551615"));
  EXPECT_THAT(refusal(std::string("\x03\0\0\0\0\0\0\0{}", 10)), HasSubstr("expected at most 2"));
}

// What() of the InputError that changing one byte of a sound file ends in.
std::string refusal_after(std::string bytes, size_t at, char change) {
  bytes[at] = static_cast<char>(bytes[at] ^ change);
  return refusal(bytes);
}

TEST(Safetensors, ADamagedSectionIsRefusedByItsName) {
  Safetensors file;
  file.metadata["iteration"] = "12";
  file.add("scene/position", tensor_of<float>({4}, {1, 2, 3, 4}));
  file.add("scene/seen", tensor_of<uint8_t>({3}, {7, 8, 9}));
  const auto path = scratch("sound");
  file.write(path);
  EXPECT_TRUE(Safetensors::read(path).has_checksums());
  const std::string bytes = bytes_of(path);
  const size_t data = bytes.size() - 19;
  for (size_t at = data; at < bytes.size(); ++at) {
    const std::string tensor = at < data + 16 ? "tensor scene/position" : "tensor scene/seen";
    for (const char change : {'\x01', '\x80'}) {
      EXPECT_THAT(
          refusal_after(bytes, at, change),
          testing::AllOf(HasSubstr(tensor + ": found bytes with the checksum "), HasSubstr("damaged")))
          << at;
    }
  }
  const auto at = [&](const std::string& text) { return bytes.find(text); };
  EXPECT_THAT(refusal_after(bytes, at("12\""), '\x01'), HasSubstr(": metadata: found"));
  EXPECT_THAT(refusal_after(bytes, at("iteration"), '\x01'), HasSubstr(": metadata: found"));
  EXPECT_THAT(refusal_after(bytes, at("F32"), '\x0F'), HasSubstr("tensor scene/position"));  // "I32"
  // A tensor whose name changed is missing under the old one.
  EXPECT_THAT(refusal_after(bytes, at("scene/seen\":{"), '\x01'),
              HasSubstr("tensor scene/seen: found nothing"));
  // The checksums themselves.
  EXPECT_THAT(refusal_after(bytes, at("tensors\\\""), '\x01'),
              HasSubstr("metadata: found checksums that cannot"));
}

// No byte of the whole file can change without being noticed or without effect.
TEST(Safetensors, NoBitFlipChangesWhatIsRead) {
  Safetensors file;
  file.metadata["iteration"] = "12";
  file.add("a", tensor_of<float>({2, 1}, {1, 2}));
  file.add("b", tensor_of<uint8_t>({3}, {7, 8, 9}));
  const auto path = scratch("flips"), again = scratch("again");
  file.write(path);
  const std::string bytes = bytes_of(path);
  for (size_t at = 0; at < bytes.size(); ++at) {
    for (int bit = 0; bit < 8; ++bit) {
      std::string changed = bytes;
      changed[at] = static_cast<char>(changed[at] ^ (1 << bit));
      write_bytes(path, changed);
      try {
        const Safetensors back = Safetensors::read(path);
        if (!back.has_checksums())
          continue;  // the name of the checksums' entry: what needs them refuses this
        back.write(again);
        EXPECT_EQ(bytes_of(again), bytes) << "byte " << at << ", bit " << bit;
      } catch (const InputError&) {
      }
    }
  }
}

TEST(Safetensors, FilesWithoutChecksumsAreRead) {
  const auto path = scratch("foreign");
  write_bytes(
      path,
      file_bytes(R"({"__metadata__":{"k":"v"},"b":{"dtype":"U8","shape":[1],"data_offsets":[0,1]}})", "x"));
  const Safetensors file = Safetensors::read(path);
  EXPECT_FALSE(file.has_checksums());
  EXPECT_EQ(file.text("k"), "v");
}

// As a checkpoint is replaced while somebody looks at a training.
TEST(Safetensors, AFileThatIsReplacedMeanwhileIsReadWhole) {
  const auto path = scratch("replaced"), other = scratch("other");
  Safetensors small, large;
  small.add("a", tensor_of<float>({1}, {1}));
  large.add("a", Tensor<float>(Shape{5000}));
  small.write(path);
  large.write(other);
  std::atomic<bool> over{false};
  std::thread writer([&] {
    while (!over) ::renameat2(AT_FDCWD, path.c_str(), AT_FDCWD, other.c_str(), RENAME_EXCHANGE);
  });
  for (int i = 0; i < 3000 && !HasFailure(); ++i)
    EXPECT_EQ(refusal_of([&] { Safetensors::read(path); }), "accepted");
  over = true;
  writer.join();
}

// A folder's name need not be UTF-8; what is written of it must still agree with its checksum.
TEST(Safetensors, MetadataThatIsNotUtf8IsReplacedAndReadAgain) {
  Safetensors file;
  file.metadata["capture_folder"] = "/home/caf\xE9";
  const auto path = scratch("latin");
  file.write(path);
  EXPECT_EQ(Safetensors::read(path).text("capture_folder"), "/home/caf\xEF\xBF\xBD");
}

TEST(Safetensors, MetadataAreReadAsTextAndNumbers) {
  Safetensors file;
  file.metadata = {{"iteration", "12"}, {"seconds", "1.5"}, {"minus", "-1"}, {"nan", "nan"}, {"word", "12a"}};
  EXPECT_EQ(file.number("iteration"), 12);
  EXPECT_EQ(file.number("seconds"), 1.5);
  for (const char* key : {"minus", "nan", "word", "none"}) EXPECT_THROW(file.number(key), InputError) << key;
  EXPECT_THROW(file.text("none"), InputError);
}

RC_GTEST_PROP(SafetensorsProperty, RoundTripKeepsBytesAndIsStable, ()) {
  Safetensors file;
  const auto count = *rc::gen::inRange(0, 6);
  for (int i = 0; i < count; ++i) {
    const Shape shape{*rc::gen::inRange<int64_t>(0, 5), *rc::gen::inRange<int64_t>(0, 5)};
    const auto name = *rc::gen::container<std::string>(rc::gen::inRange<char>(1, 127));
    RC_PRE(name != "__metadata__");
    const auto values = *rc::gen::container<std::vector<int64_t>>(static_cast<size_t>(shape.elements()),
                                                                  rc::gen::arbitrary<int64_t>());
    const Tensor<int64_t> wide = tensor_of<int64_t>(shape, values);
    switch (*rc::gen::inRange(0, 3)) {
      case 0:
        file.add(name, wide);
        break;
      case 1:
        file.add(name, convert<float>(wide));
        break;
      default:
        file.add(name, convert<uint8_t>(wide));
        break;
    }
  }
  file.metadata["key"] = *rc::gen::container<std::string>(rc::gen::inRange<char>(0, 127));

  const auto first = scratch("first");
  const auto second = scratch("second");
  file.write(first);
  const Safetensors back = Safetensors::read(first);
  back.write(second);
  RC_ASSERT(back.names() == file.names());
  RC_ASSERT(back.metadata == file.metadata);
  RC_ASSERT(bytes_of(first) == bytes_of(second));
  RC_ASSERT(bytes_of(first)[0] % 8 == 0);
}

RC_GTEST_PROP(SafetensorsProperty, DamagedFilesAreReadOrRefusedButNeverCrash, ()) {
  Safetensors file;
  file.metadata["key"] = "value";
  file.add("a", tensor_of<float>({2, 1}, {1, 2}));
  file.add("b", tensor_of<uint8_t>({3}, {7, 8, 9}));
  const auto path = scratch("damaged");
  file.write(path);
  std::string bytes = bytes_of(path);
  const auto changes = *rc::gen::inRange(1, 4);
  for (int i = 0; i < changes; ++i)
    bytes[*rc::gen::inRange<size_t>(0, bytes.size())] = *rc::gen::arbitrary<char>();
  if (*rc::gen::arbitrary<bool>()) bytes.resize(*rc::gen::inRange<size_t>(0, bytes.size()));
  write_bytes(path, bytes);
  try {
    const Safetensors back = Safetensors::read(path);
    for (const std::string& name : back.names()) RC_ASSERT(back.has(name));
  } catch (const InputError&) {
    RC_SUCCEED("refused");
  }
}

}  // namespace
}  // namespace traceflow
