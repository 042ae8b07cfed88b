#include "eval/report_page.h"

#include <span>

#include "base/embedded_file.h"
#include "eval/figures_json.h"

namespace traceflow::eval {

std::span<const EmbeddedFile> embedded_files();

namespace {

using Json = nlohmann::ordered_json;

constexpr size_t page_cap = 15'000'000;
constexpr std::string_view place = R"(id="report">null</script>)";
constexpr std::string_view before_data = R"(id="report">)";

// In JSON, `<` occurs only in strings.
std::string text_of(const Json& json) {
  const std::string plain = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  std::string text;
  text.reserve(plain.size());
  for (const char c : plain) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  return text;
}

Json machine_json(const Machine& machine) {
  return {{"processor", machine.processor},
          {"threads", machine.threads},
          {"memory_bytes", machine.memory_bytes},
          {"system", machine.system},
          {"gpu", machine.gpu}};
}

Json phase_json(const LoggedPhase& phase) {
  Json steps = Json::array();
  for (const profile::Entry& step : phase.steps)
    steps.push_back({{"name", step.name}, {"calls", step.calls}, {"seconds", step.seconds}});
  return {{"name", phase.name},
          {"first", phase.first},
          {"last", phase.last},
          {"seconds", phase.seconds},
          {"steps", std::move(steps)}};
}

Json picture_json(const ReportPicture& p) {
  return {{"id", p.id},           {"width", p.width},
          {"height", p.height},   {"photograph", p.photograph},
          {"rgb", p.rgb},         {"difference", p.difference},
          {"diffuse", p.diffuse}, {"specular", p.specular},
          {"normal", p.normal},   {"depth", p.depth}};
}

// Everything except the pictures.
Json page_json(const ReportPage& page) {
  const Report& report = page.report;
  Json json = {{"version", page.version},
               {"made", page.made},
               {"run", page.run},
               {"capture", report.capture},
               {"split", report.split},
               {"downscale", report.downscale},
               {"device", report.device},
               {"machine", machine_json(page.machine)},
               {"iterations", report.iterations},
               {"train_seconds", report.train_seconds},
               {"render_fps", figure_json(report.render_fps)},
               {"surfels", surfels_json(report)}};
  put_figures(mean_of(report), json["mean"] = Json::object());
  if (report.aligned) put_figures(*report.aligned, json["mean_aligned"] = Json::object());
  json["motion"] = motion_json(report.motion);
  Json& views = json["views"] = Json::array();
  for (const ViewReport& view : report.views) {
    views.push_back({{"id", view.id}, {"time", view.time}});
    put_figures(view.metrics, views.back());
  }
  Json& settings = json["settings"] = Json::array();
  for (const Setting& s : page.settings) {
    settings.push_back(
        {{"path", s.path}, {"value", s.value}, {"default", s.usual}, {"unit", s.unit}, {"help", s.help}});
  }
  Json& phases = json["phases"] = Json::array();
  for (const LoggedPhase& phase : page.phases) phases.push_back(phase_json(phase));
  Json& events = json["events"] = Json::array();
  for (const std::string& line : page.events) {
    Json event = Json::parse(line, nullptr, false);
    if (event.is_object()) events.push_back(std::move(event));
  }
  return json;
}

}  // namespace

std::string report_page(const ReportPage& page, std::string_view html) {
  const size_t found = html.find(place);
  require(found != std::string_view::npos && html.find(place, found + 1) == std::string_view::npos,
          "the report's template has one place for its data");
  const size_t begin = found + before_data.size();
  std::string data = text_of(page_json(page));
  // Continues the object in place of its closing brace.
  data.back() = ',';
  data += R"("pictures":[)";
  size_t room = page_cap - std::min(page_cap, html.size() + data.size());
  bool first = true;
  for (const ReportPicture& picture : page.pictures) {
    const std::string text = (first ? "" : ",") + text_of(picture_json(picture));
    if (text.size() > room) break;
    room -= text.size();
    data += text;
    first = false;
  }
  data += "]}";
  return std::string(html.substr(0, begin)) + data +
         std::string(html.substr(begin + std::string_view("null").size()));
}

std::string report_page(const ReportPage& page) { return report_page(page, embedded_files().front().text()); }

}  // namespace traceflow::eval
