#include "files/npy.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <cstring>

#include "base/error.h"
#include "base/random.h"
#include "support/file_bytes.h"
#include "support/temp_folder.h"
#include "support/zip_writer.h"

namespace traceflow {
namespace {

// A .npy as numpy writes it, byte by byte.
std::string npy(const std::string& dictionary, const std::string& data, int version = 1) {
  std::string header = dictionary + "\n";
  std::string bytes = "\x93NUMPY";
  bytes += {static_cast<char>(version), '\0', static_cast<char>(header.size() & 0xff),
            static_cast<char>(header.size() >> 8)};
  if (version > 1) bytes += {'\0', '\0'};
  return bytes + header + data;
}
std::string dictionary(const std::string& type, const std::string& shape, bool fortran = false) {
  return "{'descr': '" + type + "', 'fortran_order': " + (fortran ? "True" : "False") +
         ", 'shape': " + shape + ", }";
}
template <class T>
std::string raw(std::initializer_list<T> values) {
  return {reinterpret_cast<const char*>(values.begin()), values.size() * sizeof(T)};
}

RC_GTEST_PROP(Npy, write_then_read_is_the_same_array, ()) {
  const TempFolder folder;
  const auto dims = *rc::gen::container<std::vector<int64_t>>(4, rc::gen::inRange<int64_t>(0, 6));
  const int rank = *rc::gen::inRange(1, 5);
  const Shape shape = rank == 1   ? Shape{dims[0]}
                      : rank == 2 ? Shape{dims[0], dims[1]}
                      : rank == 3 ? Shape{dims[0], dims[1], dims[2]}
                                  : Shape{dims[0], dims[1], dims[2], dims[3]};
  Tensor<float> array(shape);
  Random random(*rc::gen::arbitrary<uint64_t>());
  for (float& v : array.values()) v = static_cast<float>(random.normal());
  write_npy(folder / "a.npy", array);
  const Tensor<float> read = read_npy(folder / "a.npy");
  RC_ASSERT(read.shape() == shape);
  RC_ASSERT(std::equal(read.data(), read.data() + read.size(), array.data()));
}

TEST(Npy, written_header_is_numpys) {
  const TempFolder folder;
  write_npy(folder / "a.npy", Tensor<float>({2, 3}));
  const std::string bytes = bytes_of(folder / "a.npy");
  EXPECT_EQ(bytes.size(), 128U + 24U);
  EXPECT_EQ(bytes.substr(10, 57), "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3),");
  EXPECT_EQ(bytes[127], '\n');
  write_npy(folder / "b.npy", Tensor<float>({5}));
  EXPECT_NE(bytes_of(folder / "b.npy").find("'shape': (5,)"), std::string::npos);
}

TEST(Npy, integers_are_written_as_integers) {
  const TempFolder folder;
  Tensor<int32_t> array({3});
  array[0] = 7;
  array[1] = -2;
  array[2] = 1 << 24;
  write_npy(folder / "a.npy", array);
  const std::string bytes = bytes_of(folder / "a.npy");
  EXPECT_EQ(bytes.substr(10, 55), "{'descr': '<i4', 'fortran_order': False, 'shape': (3,),");
  EXPECT_EQ(bytes.substr(128), raw<int32_t>({7, -2, 1 << 24}));
  EXPECT_TRUE(std::ranges::equal(read_npy(folder / "a.npy").values(), array.values()));
}

TEST(Npy, every_type_widens_to_float) {
  const TempFolder folder;
  const std::vector<std::pair<std::string, std::string>> cases = {
      {"<f2", raw<uint16_t>({0x3c00, 0xc000, 0x0001, 0x7bff})},
      {"<f4", raw<float>({1, -2, 3.5F, 1e9F})},
      {"<f8", raw<double>({1, -2, 3.5, 1e9})},
      {"|b1", raw<uint8_t>({1, 0, 1, 1})},
      {"|i1", raw<int8_t>({1, -2, 127, -128})},
      {"|u1", raw<uint8_t>({1, 2, 127, 255})},
      {"<i2", raw<int16_t>({1, -2, 300, -30000})},
      {"<u2", raw<uint16_t>({1, 2, 300, 65535})},
      {"<i4", raw<int32_t>({1, -2, 300, -70000})},
      {"<u4", raw<uint32_t>({1, 2, 300, 4294967295U})},
      {"<i8", raw<int64_t>({1, -2, 300, -70000})},
      {"<u8", raw<uint64_t>({1, 2, 300, 1ULL << 63})}};
  const std::vector<std::vector<float>> expected = {
      {1, -2, 0x1p-24F, 65504}, {1, -2, 3.5F, 1e9F},  {1, -2, 3.5F, 1e9F},  {1, 0, 1, 1},
      {1, -2, 127, -128},       {1, 2, 127, 255},     {1, -2, 300, -30000}, {1, 2, 300, 65535},
      {1, -2, 300, -70000},     {1, 2, 300, 0x1p32F}, {1, -2, 300, -70000}, {1, 2, 300, 0x1p63F}};
  for (size_t i = 0; i < cases.size(); ++i) {
    write_bytes(folder / "a.npy", npy(dictionary(cases[i].first, "(4,)"), cases[i].second));
    const Tensor<float> read = read_npy(folder / "a.npy");
    ASSERT_EQ(read.shape(), (Shape{4})) << cases[i].first;
    for (int k = 0; k < 4; ++k) EXPECT_EQ(read[k], expected[i][static_cast<size_t>(k)]) << cases[i].first;
  }
}

TEST(Npy, names_of_an_archives_arrays) {
  const TempFolder folder;
  const Tensor<float> array({2});
  write_npz(folder / "a.npz", {{"tracks", &array}, {"visibility", &array}});
  EXPECT_EQ(names_in_npz(folder / "a.npz"), (std::vector<std::string>{"tracks", "visibility"}));
  write_npy(folder / "a.npy", array);
  EXPECT_THROW(names_in_npz(folder / "a.npy"), InputError);
}

TEST(Npy, versions_two_and_three_scalars_and_python_2_shapes) {
  const TempFolder folder;
  for (const int version : {1, 2, 3}) {
    write_bytes(folder / "a.npy", npy(dictionary("<f4", "(2L, 1L)"), raw<float>({4, 5}), version));
    EXPECT_EQ(read_npy(folder / "a.npy").shape(), (Shape{2, 1}));
  }
  write_bytes(folder / "scalar.npy", npy(dictionary("<f4", "()"), raw<float>({4})));
  EXPECT_EQ(read_npy(folder / "scalar.npy").shape(), (Shape{1}));
  EXPECT_EQ(read_npy(folder / "scalar.npy")[0], 4);
}

TEST(Npy, fortran_order_is_transposed) {
  const TempFolder folder;
  // numpy: asfortranarray([[1, 2, 3], [4, 5, 6]]) stands in the file column by column.
  write_bytes(folder / "a.npy", npy(dictionary("<f4", "(2, 3)", true), raw<float>({1, 4, 2, 5, 3, 6})));
  const Tensor<float> read = read_npy(folder / "a.npy");
  for (int i = 0; i < 6; ++i) EXPECT_EQ(read[i], static_cast<float>(i + 1));
  EXPECT_THROW(NpyFile(folder / "a.npy").slice(0), InputError);
}

TEST(Npy, slices_are_rows_of_the_whole) {
  const TempFolder folder;
  Tensor<float> array({5, 3, 2, 3});
  for (int64_t i = 0; i < array.size(); ++i) array[i] = static_cast<float>(i);
  write_npy(folder / "a.npy", array);
  write_bytes(folder / "stored.npz", zip_archive({{"depth.npy", bytes_of(folder / "a.npy")}}, false));
  write_bytes(folder / "deflated.npz", zip_archive({{"depth.npy", bytes_of(folder / "a.npy")}}, true));
  for (const char* name : {"a.npy", "stored.npz", "deflated.npz"}) {
    const NpyFile file(folder / name);
    ASSERT_EQ(file.shape(), array.shape()) << name;
    for (int64_t i = 0; i < 5; ++i) {
      const Tensor<float> slice = file.slice(i);
      ASSERT_EQ(slice.shape(), (Shape{3, 2, 3})) << name;
      EXPECT_TRUE(std::equal(slice.data(), slice.data() + slice.size(), array.row(i))) << name;
    }
  }
}

TEST(Npz, members_are_found_by_name) {
  const TempFolder folder;
  const std::string a = npy(dictionary("<f4", "(1,)"), raw<float>({1}));
  const std::string b = npy(dictionary("<f4", "(1,)"), raw<float>({2}));
  for (const bool deflate_them : {false, true}) {
    for (const bool zip64 : {false, true}) {
      write_bytes(folder / "two.npz", zip_archive({{"a.npy", a}, {"b.npy", b}}, deflate_them, zip64));
      EXPECT_EQ(read_npz(folder / "two.npz", "a")[0], 1);
      EXPECT_EQ(read_npz(folder / "two.npz", "b.npy")[0], 2);
      EXPECT_THROW(read_npz(folder / "two.npz"), InputError);
      EXPECT_THROW(read_npz(folder / "two.npz", "c"), InputError);
    }
  }
}

TEST(NpyHostile, headers_that_lie_are_refused) {
  const TempFolder folder;
  const std::string data = raw<float>({1, 2, 3, 4});
  const std::string bad[] = {
      npy(dictionary("<f4", "(5,)"), data),
      npy(dictionary("<f4", "(99999999999999,)"), data),
      npy(dictionary("<f4", "(4294967296, 4294967296, 4294967296)"), data),
      npy(dictionary("<f4", "(99999999999999999999999,)"), data),
      npy(dictionary("<f4", "(4294967296, 4294967296, 0)"), data),
      npy(dictionary("<f4", "(-1,)"), data),
      npy(dictionary("<f4", "(1, 1, 1, 1, 4)"), data),
      npy(dictionary("<f4", "(x,)"), data),
      npy(dictionary("<f4", "4"), data),
      npy(dictionary("<f4", "(4,"), data),
      npy(dictionary("|O", "(1,)"), data),
      npy(dictionary("<M8[ns]", "(1,)"), data),
      npy(dictionary(">f4", "(4,)"), data),
      npy(dictionary("<f3", "(4,)"), data),
      npy(dictionary("<c8", "(2,)"), data),
      npy(dictionary("", "(2,)"), data),
      npy("{'descr': [('x', '<f4')], 'fortran_order': False, 'shape': (4,), }", data),
      npy("{'fortran_order': False, 'shape': (4,), }", data),
      npy("{'descr': '<f4', 'fortran_order': False}", data),
      npy("", data),
      npy("{'descr'", data),
      npy("{'descr':", data),
      npy(dictionary("<f4", "(4,)"), data, 9),
      "\x93NUMPY\x02" + std::string("\0\xff\xff\xff\x7f", 5) + data,
      "",
      "\x93NUMPY",
      "PK",
  };
  for (const std::string& bytes : bad) {
    write_bytes(folder / "bad.npy", bytes);
    EXPECT_THROW(read_npy(folder / "bad.npy"), InputError) << bytes;
  }
}

TEST(NpyHostile, any_number_of_empty_rows_is_nothing_to_do) {
  const TempFolder folder;
  write_bytes(folder / "a.npy", npy(dictionary("<f4", "(1099511627776, 0)", true), ""));
  EXPECT_EQ(read_npy(folder / "a.npy").shape(), (Shape{1099511627776, 0}));
}

TEST(NpyHostile, truncated_files_are_refused) {
  const TempFolder folder;
  const std::string whole = npy(dictionary("<f4", "(2, 2)"), raw<float>({1, 2, 3, 4}));
  for (size_t length = 0; length < whole.size(); ++length) {
    write_bytes(folder / "cut.npy", whole.substr(0, length));
    EXPECT_THROW(read_npy(folder / "cut.npy"), InputError) << length;
  }
}

TEST(NpzHostile, truncations_and_flipped_bytes_never_crash) {
  const TempFolder folder;
  const std::string member = npy(dictionary("<f4", "(2, 2)"), raw<float>({1, 2, 3, 4}));
  for (const bool deflate_them : {false, true}) {
    const std::string whole = zip_archive({{"a.npy", member}}, deflate_them);
    for (size_t at = 0; at < whole.size(); ++at) {
      write_bytes(folder / "cut.npz", whole.substr(0, at));
      EXPECT_THROW(read_npz(folder / "cut.npz"), InputError) << at;
      for (const int flip : {0x01, 0x80, 0xff}) {
        std::string broken = whole;
        broken[at] = static_cast<char>(broken[at] ^ flip);
        write_bytes(folder / "broken.npz", broken);
        try {
          EXPECT_LE(read_npz(folder / "broken.npz").size(), 4);
        } catch (const InputError&) {
        }
      }
    }
  }
}

}  // namespace
}  // namespace traceflow
