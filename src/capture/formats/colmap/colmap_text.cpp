#include <algorithm>
#include <charconv>
#include <span>
#include <string_view>

#include "base/error.h"
#include "capture/formats/colmap/colmap_rows.h"

namespace traceflow {

namespace {

constexpr size_t longest_line = size_t{1} << 26;

// Reads successive lines and holds one piece of the file in memory at a time.
class Lines {
 public:
  explicit Lines(const InputFile& file) : file_(file) {}

  // Reads the next line and strips spaces around it; false at the end.
  bool next() {
    line_.clear();
    bool any = false;
    for (;;) {
      if (at_ == piece_.size() && !read_piece()) break;
      any = true;
      const size_t end = std::min(piece_.find('\n', at_), piece_.size());
      line_.append(piece_, at_, end - at_);
      if (line_.size() > longest_line) fail("", "a line of more than 64 MiB", "COLMAP's text");
      at_ = std::min(end + 1, piece_.size());
      if (end < piece_.size()) break;
    }
    number_ += any ? 1 : 0;
    const size_t first = line_.find_first_not_of(" \t\r"), last = line_.find_last_not_of(" \t\r");
    rest_ = first == std::string::npos ? std::string_view()
                                       : std::string_view(line_).substr(first, last + 1 - first);
    return any;
  }
  // Reads the next line that is neither empty nor a comment.
  bool next_row() {
    while (next()) {
      if (!rest_.empty() && rest_.front() != '#') return true;
    }
    return false;
  }

  // The next word of the line; empty at its end.
  std::string_view word() {
    const size_t begin = std::min(rest_.find_first_not_of(" \t"), rest_.size());
    rest_.remove_prefix(begin);
    const size_t end = std::min(rest_.find_first_of(" \t"), rest_.size());
    const std::string_view word = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return word;
  }
  // The rest of the line.
  std::string rest() const {
    const size_t begin = std::min(rest_.find_first_not_of(" \t"), rest_.size());
    return std::string(rest_.substr(begin));
  }
  template <class T>
  T number(const std::string& field) {
    const std::string_view text = word();
    T value{};
    const auto result = std::from_chars(text.data(), text.data() + text.size(), value);
    if (text.empty() || result.ec != std::errc() || result.ptr != text.data() + text.size()) {
      fail(field, text.empty() ? "the end of the line" : "\"" + std::string(text.substr(0, 40)) + "\"",
           "a number");
    }
    return value;
  }
  [[noreturn]] void fail(const std::string& field, const std::string& found,
                         const std::string& expected) const {
    throw InputError(file_.path().string(),
                     "line " + std::to_string(number_) + (field.empty() ? "" : ", " + field), found,
                     expected);
  }

 private:
  bool read_piece() {
    constexpr int64_t size = int64_t{1} << 18;
    piece_.resize(static_cast<size_t>(std::min(size, file_.size() - offset_)));
    file_.read_at(offset_, std::as_writable_bytes(std::span(piece_)));
    offset_ += static_cast<int64_t>(piece_.size());
    at_ = 0;
    return !piece_.empty();
  }

  const InputFile& file_;
  std::string piece_, line_;
  std::string_view rest_;
  size_t at_ = 0;
  int64_t offset_ = 0, number_ = 0;
};

std::string field_of(const char* list, size_t i) { return list + ("[" + std::to_string(i) + "]"); }

Vec3<double> take_vector(Lines& lines, const std::string& field) {
  const auto x = lines.number<double>(field), y = lines.number<double>(field),
             z = lines.number<double>(field);
  return {x, y, z};
}

// Counts the triples "x y id" of the line that have a point's id. A line with other content belongs to the
// next image.
int64_t count_points(Lines& lines, const std::string& field) {
  int64_t count = 0, words = 0;
  for (std::string_view word = lines.word(); !word.empty(); word = lines.word()) {
    count += ++words % 3 == 0 && word != "-1" ? 1 : 0;
  }
  if (words % 3 != 0) {
    lines.fail(field, std::to_string(words) + " words",
               "x, y and a point's id of each, in a line that may be empty");
  }
  return count;
}

}  // namespace

std::vector<ColmapCameraRow> read_colmap_cameras_text(const InputFile& file) {
  Lines lines(file);
  std::vector<ColmapCameraRow> rows;
  while (lines.next_row()) {
    const std::string field = field_of("cameras", rows.size());
    ColmapCameraRow& row = rows.emplace_back();
    row.id = lines.number<uint32_t>(field + ".id");
    row.model = lines.word();
    row.width = static_cast<double>(lines.number<uint64_t>(field + ".width"));
    row.height = static_cast<double>(lines.number<uint64_t>(field + ".height"));
    while (!lines.rest().empty()) row.parameters.push_back(lines.number<double>(field + ".params"));
  }
  return rows;
}

std::vector<ColmapImageRow> read_colmap_images_text(const InputFile& file) {
  Lines lines(file);
  std::vector<ColmapImageRow> rows;
  while (lines.next_row()) {
    const std::string field = field_of("images", rows.size());
    ColmapImageRow& row = rows.emplace_back();
    row.id = lines.number<uint32_t>(field + ".id");
    for (double& q : row.quaternion) q = lines.number<double>(field + ".qvec");
    row.translation = take_vector(lines, field + ".tvec");
    row.camera_id = lines.number<uint32_t>(field + ".camera_id");
    row.name = lines.rest();
    // The line after it may be empty or, in hand-written models, missing at the end.
    if (lines.next()) row.points_seen = count_points(lines, field + ".points2D");
  }
  return rows;
}

std::vector<ColmapPointRow> read_colmap_points_text(const InputFile& file, int64_t most) {
  Lines lines(file);
  std::vector<ColmapPointRow> rows;
  while (lines.next_row()) {
    if (static_cast<int64_t>(rows.size()) == most)
      lines.fail("", "one point more", "at most " + std::to_string(most));
    const std::string field = field_of("points3D", rows.size());
    ColmapPointRow& row = rows.emplace_back();
    row.id = static_cast<int64_t>(lines.number<uint64_t>(field + ".id"));
    row.position = take_vector(lines, field + ".xyz");
    for (int c = 0; c < 3; ++c) row.colour[c] = lines.number<uint8_t>(field + ".rgb");
    row.error = lines.number<double>(field + ".error");
    while (!lines.word().empty()) ++row.track_length;
    row.track_length /= 2;
  }
  return rows;
}

}  // namespace traceflow
