#pragma once

#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <string>

namespace traceflow {

template <class T>
T number_at(const std::string& bytes, size_t place) {
  T value{};
  EXPECT_LE(place + sizeof value, bytes.size());
  if (place + sizeof value <= bytes.size()) std::memcpy(&value, bytes.data() + place, sizeof value);
  return value;
}

// A .glb taken apart by the rules of the format.
struct GlbFile {
  nlohmann::json document;
  std::string binary;

  explicit GlbFile(const std::string& bytes) {
    EXPECT_EQ(bytes.substr(0, 4), "glTF");
    EXPECT_EQ(number_at<uint32_t>(bytes, 4), 2U);
    EXPECT_EQ(number_at<uint32_t>(bytes, 8), bytes.size());
    const auto length = number_at<uint32_t>(bytes, 12);
    EXPECT_EQ(length % 4, 0U);
    EXPECT_EQ(bytes.substr(16, 4), "JSON");
    document = nlohmann::json::parse(bytes.substr(20, length));
    const size_t next = 20 + length;
    const auto binary_length = number_at<uint32_t>(bytes, next);
    EXPECT_EQ(binary_length % 4, 0U);
    EXPECT_EQ(bytes.substr(next + 4, 4), std::string("BIN\0", 4));
    binary = bytes.substr(next + 8);
    EXPECT_EQ(binary.size(), binary_length);
    EXPECT_EQ(document.at("buffers").at(0).at("byteLength"), binary.size());
  }

  const nlohmann::json& primitive() const { return document.at("meshes").at(0).at("primitives").at(0); }
  // The place of an accessor's first element, after checks of its type, size and alignment.
  size_t place_of(int accessor, int component, const std::string& type, size_t count, size_t element) const {
    const nlohmann::json& a = document.at("accessors").at(static_cast<size_t>(accessor));
    const nlohmann::json& view = document.at("bufferViews").at(a.at("bufferView").get<size_t>());
    EXPECT_EQ(a.at("componentType"), component);
    EXPECT_EQ(a.at("type"), type);
    EXPECT_EQ(a.at("count"), count);
    EXPECT_EQ(view.at("byteLength"), count * element);
    const auto offset = view.at("byteOffset").get<size_t>();
    EXPECT_EQ(offset % 4, 0U);
    EXPECT_EQ(element % 4, 0U);
    EXPECT_LE(offset + count * element, binary.size());
    return offset;
  }
};

}  // namespace traceflow
