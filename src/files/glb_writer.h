#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "base/tensor.h"

namespace traceflow {

// What the vertices of a GlbWriter's primitive are joined to; the values are glTF's modes.
enum class GlbPrimitive { lines = 1, triangles = 4 };

// Writes one primitive as binary glTF 2.0. Captures have y down and z forward, glTF has y up: the root node
// turns the primitive by 180° about x, and its vertices stay in the capture's coordinates. The material is
// matt and has two sides. The tensors are on the host and outlive the writer.
class GlbWriter {
 public:
  // positions: N×3, with N > 0.
  explicit GlbWriter(const Tensor<float>& positions);
  ~GlbWriter();
  GlbWriter(const GlbWriter&) = delete;
  GlbWriter& operator=(const GlbWriter&) = delete;

  // N×3, unit.
  void set_normals(const Tensor<float>& normals);
  // N×3, sRGB, 0 to 1. They become linear, as glTF wants them, in 16 bits.
  void set_colours(const Tensor<float>& colours);
  // Writes the file atomically. indices: of the vertices, two for each line or three for each triangle.
  // Throws InputError if the file would be larger than the format's 4 GiB, or cannot be written.
  void write(const std::filesystem::path& path, GlbPrimitive primitive, const Tensor<int32_t>& indices);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace traceflow
