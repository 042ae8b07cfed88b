// Bytes as a JSON document, of which every place is asked for all that one can be asked for, and as the log
// of a run.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

#include "files/json_document.h"
#include "fuzz/scratch_file.h"
#include "record/log_history.h"

using namespace traceflow;
using fuzz::can_read;
using fuzz::promise;

namespace {

// What is asked for in vain is written out whole each time, to quote its beginning.
constexpr int most_places = 200;

bool is_near(double a, double b) { return std::abs(a - b) < 1e-9; }

class Asking {
 public:
  explicit Asking(std::string where) : where_(std::move(where)) {}

  void ask(const JsonField& field) {
    if (++places_ > most_places) return;
    ask_for_numbers(field);
    ask_for_rows(field);
    can_read(where_, [&] { promise(field.text(16).size() <= 16, "a string is no longer than it may be"); });
    promise(can_read(where_, [&] { (void)field.yes(); }) == field.json().is_boolean(), "truths are truths");
    promise(!can_read(where_, [&] { field.expect("something else"); }), "what is refused is refused");
    ask_for_members(field);
    ask_for_elements(field);
  }

 private:
  void ask_for_numbers(const JsonField& field) const {
    const bool is_number =
        can_read(where_, [&] { promise(std::isfinite(field.number()), "a number is finite"); });
    promise(is_number == field.json().is_number(), "numbers are numbers");
    can_read(where_, [&] {
      const double value = field.number(-1, 2);
      promise(value >= -1 && value <= 2, "a number is in its range");
    });
    can_read(where_, [&] { promise(field.positive() > 0, "a number is above zero"); });
    can_read(where_, [&] {
      const int64_t most = int64_t{1} << 53, value = field.whole(-3, most);
      promise(value >= -3 && value <= most, "a whole number is in its range");
      promise(static_cast<double>(value) == field.number(), "a whole number is the number");
    });
  }

  void ask_for_rows(const JsonField& field) const {
    can_read(where_, [&] {
      const std::vector<double> row = field.numbers(3);
      promise(row.size() == 3, "as many numbers as were asked for");
      for (const double x : row) promise(std::isfinite(x), "numbers are finite");
    });
    can_read(where_, [&] {
      const Vec3<double> v = field.vector();
      promise(std::abs(v.x) <= 1e15 && std::abs(v.y) <= 1e15 && std::abs(v.z) <= 1e15, "a vector is near");
    });
    can_read(where_, [&] {
      const Mat3<double> rotation = field.rotation(), product = transpose(rotation) * rotation;
      for (int i = 0; i < 9; ++i)
        promise(is_near(product[i / 3][i % 3], i % 4 == 0 ? 1 : 0), "a rotation keeps lengths");
      promise(is_near(determinant(rotation), 1), "a rotation mirrors nothing");
    });
  }

  void ask_for_members(const JsonField& field) {
    promise(!field.has("no such member") || field.json().contains("no such member"),
            "what is there is there");
    if (!field.json().is_object()) {
      promise(!can_read(where_, [&] { (void)field["a"]; }), "only objects have members");
      return;
    }
    for (const auto& member : field.json().items()) {
      const std::string& key = member.key();
      promise(field.has(key) == !member.value().is_null(), "null is nothing");
      promise(can_read(where_, [&] { ask(field[key]); }) == field.has(key), "what is there can be asked for");
    }
  }

  void ask_for_elements(const JsonField& field) {
    std::vector<JsonField> elements;
    promise(can_read(where_, [&] { elements = field.elements(); }) == field.json().is_array(),
            "only lists have elements");
    can_read(where_, [&] { promise(field.elements(2).size() == 2, "as many elements as were asked for"); });
    can_read(where_, [&] {
      promise(field.strings().size() == elements.size(), "as many strings as there are elements");
    });
    for (const JsonField& element : elements) ask(element);
  }

  const std::string where_;
  int places_ = 0;
};

JsonExtent extent_of(const nlohmann::json& json) {
  JsonExtent whole{json.is_structured() ? 1 : 0, 1};
  if (!json.is_structured()) return whole;
  for (const nlohmann::json& part : json) {
    const JsonExtent extent = extent_of(part);
    whole.depth = std::max(whole.depth, 1 + extent.depth);
    whole.values += extent.values;
  }
  return whole;
}

void read_document(const std::filesystem::path& path, std::string_view text) {
  fuzz::accepts(path.string(), [&] {
    const JsonFile file(path);
    const JsonExtent told = json_extent(text), found = extent_of(file.json());
    promise(found.depth <= told.depth && found.values <= told.values, "no more than was told before");
    Asking(path.string()).ask(file);
  });
}

void check(const LoggedEvent& event) {
  promise(!event.kind.empty() && event.iteration >= 0, "an event has a kind and a place");
  promise(event.line.find('\n') == std::string::npos && nlohmann::json::accept(event.line),
          "an event is a line of JSON");
  const std::optional<LoggedEvent> again = read_event(event.line);
  promise(
      again && again->kind == event.kind && again->iteration == event.iteration && again->line == event.line,
      "an event that is kept is the same event");
}

void read_log_of(std::string_view text) {
  std::istringstream log{std::string(text)};
  const std::vector<LoggedEvent> events = read_log(log);
  promise(events.size() <= text.size(), "no more events than the log can hold");
  for (const LoggedEvent& event : events) check(event);
  const std::vector<LoggedEvent> few = thinned(events, 3);
  promise(std::count_if(few.begin(), few.end(), [](const LoggedEvent& e) { return e.kind == "step"; }) <= 3,
          "no more steps than were asked for");
  for (const LoggedPhase& phase : phases_of(events))
    promise(phase.seconds >= 0 && std::isfinite(phase.seconds), "a phase takes its time");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const fuzz::ScratchFolder folder;
  const std::string_view text = fuzz::text_of(data, size);
  read_document(folder.write("a.json", text), text);
  read_log_of(text);
  return 0;
}
