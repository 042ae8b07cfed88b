#include <algorithm>
#include <bit>
#include <cstring>
#include <span>

#include "base/error.h"
#include "capture/formats/colmap/colmap_lens.h"
#include "capture/formats/colmap/colmap_rows.h"

namespace traceflow {

namespace {

static_assert(std::endian::native == std::endian::little, "COLMAP's files are little endian");

constexpr size_t longest_name = 4096;
constexpr uint64_t no_point = ~uint64_t{0};

// Reads successive numbers and holds one piece of the file in memory at a time.
class Cursor {
 public:
  explicit Cursor(const InputFile& file) : file_(file), buffer_(size_t{1} << 18) {}

  template <class T>
  T take(const std::string& field) {
    need(sizeof(T), field);
    if (end_ - at_ < sizeof(T)) refill();
    T value;
    std::memcpy(&value, buffer_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  // Reads the count of elements that take at least `each` bytes.
  int64_t count(int64_t each, const std::string& field) {
    const auto value = take<uint64_t>(field);
    if (value > static_cast<uint64_t>(left() / each)) {
      fail(field, std::to_string(value) + " in the " + std::to_string(left()) + " bytes that follow",
           "as many as the file holds");
    }
    return static_cast<int64_t>(value);
  }
  void skip(int64_t bytes, const std::string& field) {
    need(bytes, field);
    const auto here = std::min(static_cast<size_t>(bytes), end_ - at_);
    at_ += here;
    offset_ += bytes - static_cast<int64_t>(here);
  }
  [[noreturn]] void fail(const std::string& field, const std::string& found,
                         const std::string& expected) const {
    throw InputError(file_.path().string(), field, found, expected);
  }
  void expect_end() const {
    if (left() > 0) fail("", std::to_string(left()) + " bytes after the last row", "the end of the file");
  }

 private:
  int64_t left() const { return file_.size() - offset_ + static_cast<int64_t>(end_ - at_); }
  void need(int64_t bytes, const std::string& field) const {
    if (bytes > left()) fail(field, "the end of the file", "a whole model; copy it again");
  }
  void refill() {
    std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(at_),
              buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
    end_ -= at_;
    at_ = 0;
    const auto more = static_cast<size_t>(
        std::min<int64_t>(static_cast<int64_t>(buffer_.size() - end_), file_.size() - offset_));
    file_.read_at(offset_, std::as_writable_bytes(std::span(buffer_).subspan(end_, more)));
    offset_ += static_cast<int64_t>(more);
    end_ += more;
  }

  const InputFile& file_;
  std::vector<char> buffer_;
  size_t at_ = 0, end_ = 0;
  int64_t offset_ = 0;  // of the bytes after the buffer, in the file
};

std::string take_name(Cursor& cursor, const std::string& field) {
  std::string name;
  for (char c = cursor.take<char>(field); c != '\0'; c = cursor.take<char>(field)) {
    name += c;
    if (name.size() > longest_name) cursor.fail(field, "more than 4,096 bytes", "an image's name");
  }
  return name;
}

Vec3<double> take_vector(Cursor& cursor, const std::string& field) {
  const auto x = cursor.take<double>(field), y = cursor.take<double>(field), z = cursor.take<double>(field);
  return {x, y, z};
}

std::string field_of(const char* list, int64_t i) { return list + ("[" + std::to_string(i) + "]"); }

}  // namespace

std::vector<ColmapCameraRow> read_colmap_cameras_binary(const InputFile& file) {
  constexpr int64_t fewest_bytes = 24;
  Cursor cursor(file);
  std::vector<ColmapCameraRow> rows(static_cast<size_t>(cursor.count(fewest_bytes, "the number of cameras")));
  for (size_t i = 0; i < rows.size(); ++i) {
    ColmapCameraRow& row = rows[i];
    const std::string field = field_of("cameras", static_cast<int64_t>(i));
    row.id = cursor.take<uint32_t>(field);
    const auto model_id = cursor.take<int32_t>(field);
    row.width = static_cast<double>(cursor.take<uint64_t>(field));
    row.height = static_cast<double>(cursor.take<uint64_t>(field));
    const ColmapLensModel* model = find_colmap_lens_model(model_id);
    if (model == nullptr) cursor.fail(field + ".model", std::to_string(model_id), "0 to 17");
    row.model = model->name;
    for (size_t p = 0; p < model->parameters; ++p) row.parameters.push_back(cursor.take<double>(field));
  }
  cursor.expect_end();
  return rows;
}

std::vector<ColmapImageRow> read_colmap_images_binary(const InputFile& file) {
  constexpr int64_t fewest_bytes = 73, point_bytes = 24;
  Cursor cursor(file);
  std::vector<ColmapImageRow> rows(static_cast<size_t>(cursor.count(fewest_bytes, "the number of images")));
  for (size_t i = 0; i < rows.size(); ++i) {
    ColmapImageRow& row = rows[i];
    const std::string field = field_of("images", static_cast<int64_t>(i));
    row.id = cursor.take<uint32_t>(field);
    for (double& q : row.quaternion) q = cursor.take<double>(field);
    row.translation = take_vector(cursor, field);
    row.camera_id = cursor.take<uint32_t>(field);
    row.name = take_name(cursor, field + ".name");
    const int64_t seen = cursor.count(point_bytes, field + ".points2D");
    for (int64_t p = 0; p < seen; ++p) {
      cursor.skip(point_bytes - 8, field);
      row.points_seen += cursor.take<uint64_t>(field) == no_point ? 0 : 1;
    }
  }
  cursor.expect_end();
  return rows;
}

std::vector<ColmapPointRow> read_colmap_points_binary(const InputFile& file, int64_t most) {
  constexpr int64_t fewest_bytes = 51, track_bytes = 8;
  Cursor cursor(file);
  const int64_t count = cursor.count(fewest_bytes, "the number of points");
  if (count > most)
    cursor.fail("the number of points", std::to_string(count), "at most " + std::to_string(most));
  std::vector<ColmapPointRow> rows(static_cast<size_t>(count));
  for (size_t i = 0; i < rows.size(); ++i) {
    ColmapPointRow& row = rows[i];
    const std::string field = field_of("points3D", static_cast<int64_t>(i));
    row.id = static_cast<int64_t>(cursor.take<uint64_t>(field));
    row.position = take_vector(cursor, field);
    for (int c = 0; c < 3; ++c) row.colour[c] = cursor.take<uint8_t>(field);
    row.error = cursor.take<double>(field);
    row.track_length = cursor.count(track_bytes, field + ".track");
    cursor.skip(track_bytes * row.track_length, field);
  }
  cursor.expect_end();
  return rows;
}

}  // namespace traceflow
