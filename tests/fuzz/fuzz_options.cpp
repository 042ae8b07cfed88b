// Bytes as settings: the first says whether they are a TOML file, a checkpoint's JSON, or assignments of the
// command line, one in each line.
#include <cmath>

#include "base/option_fields.h"
#include "cli/arguments/option_toml.h"
#include "files/options_json.h"
#include "fuzz/scratch_file.h"
#include "math/types.h"

using namespace traceflow;
using fuzz::promise;

namespace {

enum class Order { centre, hit };
constexpr std::array<std::string_view, 2> enum_names(Order) { return {"centre", "hit"}; }

struct Group {
  float weight = 0.5F;
  Order order = Order::hit;
  template <class Visitor>
  void visit(Visitor& v) {
    v.field("weight", weight, "", "");
    v.field("order", order, "", "");
  }
};

// A field of every kind, and groups in one another.
struct Settings {
  bool on = true;
  int count = 3;
  int64_t bytes = int64_t{1} << 40;
  double number = 0.25;
  std::string text = "word";
  Vec3<float> background{0};
  Group loss;
  template <class Visitor>
  void visit(Visitor& v) {
    v.field("on", on, "", "");
    v.field("count", count, "", "");
    v.field("bytes", bytes, "", "");
    v.field("number", number, "", "");
    v.field("text", text, "", "");
    v.field("background", background, "", "");
    v.group("loss", loss);
  }
};

void assign(Settings& settings, std::string_view lines) {
  const std::vector<OptionField> fields = option_fields(settings);
  while (!lines.empty()) {
    const std::string_view line = lines.substr(0, lines.find('\n'));
    lines.remove_prefix(std::min(lines.size(), line.size() + 1));
    set_option_assignment(fields, std::string(line), "--set");
  }
}

bool is_finite(const Settings& s) {
  return std::isfinite(s.number) && std::isfinite(s.loss.weight) && std::isfinite(s.background.x) &&
         std::isfinite(s.background.y) && std::isfinite(s.background.z);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < 1) return 0;
  static const fuzz::ScratchFolder folder;
  const std::string_view text = fuzz::text_of(data + 1, size - 1);
  Settings settings;
  if (data[0] == 't') {
    const auto path = folder.write("a.toml", text);
    fuzz::accepts(path.string(), [&] { cli::options_from_toml(path, option_fields(settings)); });
  } else if (data[0] == 'j') {
    fuzz::accepts("checkpoint",
                  [&] { options_from_json(std::string(text), option_fields(settings), "checkpoint"); });
  } else {
    fuzz::accepts("--set", [&] { assign(settings, text); });
  }
  promise(is_finite(settings), "numbers are finite");
  Settings again;
  const std::string json = options_to_json(settings);
  options_from_json(json, option_fields(again), "checkpoint");
  promise(options_to_json(again) == json, "settings that are kept are the same settings");
  return 0;
}
