#include "serve/audience/messages.h"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace traceflow::serve {

namespace {

using Json = nlohmann::json;

constexpr int64_t largest_id = int64_t{1} << 53;
constexpr int look_side = 4096;
constexpr int still_side = 8192;
constexpr size_t longest_word = 64;

// An object of the message; every error names the field.
class Fields {
 public:
  Fields(const Json& json, std::string name) : json_(json), name_(std::move(name)) {
    if (!json.is_object()) throw InputError("message", name_, json.type_name(), "an object");
  }

  bool has(const char* key) const { return json_.contains(key) && !json_[key].is_null(); }
  Fields object(const char* key) const { return {at(key), place(key)}; }

  double number(const char* key, double low, double high) const {
    return number_of(at(key), place(key), low, high);
  }
  int64_t whole(const char* key, int64_t low, int64_t high) const {
    const double value = number(key, static_cast<double>(low), static_cast<double>(high));
    if (value != std::floor(value)) fail(key, "a fraction", "a whole number");
    return static_cast<int64_t>(value);
  }
  bool yes(const char* key) const {
    if (!at(key).is_boolean()) fail(key, at(key).type_name(), "true or false");
    return at(key).get<bool>();
  }
  std::string word(const char* key) const {
    const Json& value = at(key);
    if (!value.is_string()) fail(key, value.type_name(), "a word");
    if (value.get_ref<const std::string&>().size() > longest_word) fail(key, "a long text", "a word");
    return value.get<std::string>();
  }
  Vec3<double> vector(const char* key) const { return vector_of(at(key), place(key)); }
  // world_from_camera, given as three rows.
  Mat3<double> rotation(const char* key) const {
    const Json& rows = at(key);
    if (!rows.is_array() || rows.size() != 3) fail(key, rows.type_name(), "three rows of three numbers");
    const Mat3<double> transposed(vector_of(rows[0], place(key)), vector_of(rows[1], place(key)),
                                  vector_of(rows[2], place(key)));
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        if (std::abs(dot(transposed[i], transposed[j]) - (i == j ? 1 : 0)) > 1e-3)
          fail(key, "rows that are not orthonormal", "a rotation");
      }
    }
    if (!(determinant(transposed) > 0)) fail(key, "a mirrored frame", "a rotation");
    return transpose(transposed);
  }
  std::string text_of(const char* key) const { return at(key).dump(); }

  [[noreturn]] void fail(const char* key, const std::string& found, const std::string& expected) const {
    throw InputError("message", place(key), found, expected);
  }

 private:
  const Json& at(const char* key) const {
    if (!has(key)) fail(key, "nothing", "a value");
    return json_[key];
  }
  std::string place(const char* key) const { return name_.empty() ? key : name_ + "." + key; }

  static double number_of(const Json& value, const std::string& place, double low, double high) {
    if (!value.is_number()) throw InputError("message", place, value.type_name(), "a number");
    const double number = value.get<double>();
    if (!(number >= low && number <= high))
      throw InputError("message", place, fmt::format("{}", number), fmt::format("{} to {}", low, high));
    return number;
  }
  static Vec3<double> vector_of(const Json& value, const std::string& place) {
    if (!value.is_array() || value.size() != 3)
      throw InputError("message", place, value.type_name(), "three numbers");
    constexpr double far = 1e15;
    return {number_of(value[0], place, -far, far), number_of(value[1], place, -far, far),
            number_of(value[2], place, -far, far)};
  }

  const Json& json_;
  std::string name_;
};

PhotoRef photo_of(const Fields& fields) {
  const std::string split = fields.word("split");
  if (split != "train" && split != "test") fields.fail("split", split, "train or test");
  return {split == "test", fields.whole("index", 0, 1'000'000)};
}

Look look_of(const Fields& fields) {
  Look look;
  look.id = fields.whole("id", 0, largest_id);
  if (fields.has("photo")) {
    look.camera = photo_of(fields.object("photo"));
  } else {
    const Fields camera = fields.object("camera");
    look.camera =
        FreeCamera{camera.vector("position"), camera.rotation("rotation"), camera.number("fov_y", 0.1, 170)};
  }
  look.time = static_cast<float>(fields.number("time", 0, 1));
  look.width = static_cast<int>(fields.whole("width", 1, look_side));
  look.height = static_cast<int>(fields.whole("height", 1, look_side));
  look.layer = fields.word("layer");
  look.exposure = static_cast<float>(fields.number("exposure", -10, 10));
  look.map = fields.word("map");
  look.moving = fields.yes("moving");
  return look;
}

Still still_of(const Fields& fields) {
  return {fields.whole("id", 0, largest_id), static_cast<int>(fields.whole("width", 1, still_side)),
          static_cast<int>(fields.whole("height", 1, still_side))};
}

Command command_of(const Fields& fields) {
  const std::string word = fields.word("do");
  if (word == "pause") return {Do::pause};
  if (word == "resume") return {Do::resume};
  if (word == "save") return {Do::save};
  if (word == "stop") return {Do::stop};
  fields.fail("do", word, "pause, resume, save or stop");
}

}  // namespace

Request parse_request(std::string_view text) {
  const Json json = Json::parse(text.begin(), text.end(), nullptr, false);
  if (json.is_discarded()) throw InputError("message", "", "text that is not JSON", "an object");
  const Fields fields(json, "");
  const std::string type = fields.word("type");
  if (type == "look") return look_of(fields);
  if (type == "sleep") return Sleep{};
  if (type == "seen") return Seen{fields.whole("frame", 0, largest_id)};
  if (type == "probe") {
    return Probe{fields.whole("id", 0, largest_id), fields.number("x", 0, 1), fields.number("y", 0, 1)};
  }
  if (type == "still") return still_of(fields);
  if (type == "photo") return Photo{photo_of(fields), static_cast<int>(fields.whole("width", 1, look_side))};
  if (type == "path") return Path{fields.whole("id", 0, largest_id), fields.text_of("path")};
  if (type == "command") return command_of(fields);
  fields.fail("type", type, "look, sleep, seen, probe, still, photo, path or command");
}

}  // namespace traceflow::serve
