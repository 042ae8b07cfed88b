#include "train/event_log.h"

#include <nlohmann/json.hpp>

#include "base/error.h"

namespace traceflow {

namespace {

// Keeps the fields in the order in which they are written here.
using Json = nlohmann::ordered_json;

Json to_json(const events::SurfelCounts& counts) {
  return {{"main", counts.main}, {"environment", counts.environment}};
}

Json to_json(const Machine& machine) {
  return {{"processor", machine.processor},
          {"threads", machine.threads},
          {"memory_bytes", machine.memory_bytes},
          {"system", machine.system},
          {"gpu", machine.gpu}};
}

Json to_json(const events::Started& e) {
  return {{"event", "started"},
          {"capture", e.capture},
          {"run", e.run.string()},
          {"iteration", e.iteration},
          {"iterations", e.iterations},
          {"device", e.device},
          {"threads", e.threads},
          {"seed", e.seed},
          {"surfels", to_json(e.surfels)},
          {"forecast_bytes", e.forecast_bytes},
          {"version", e.version},
          {"machine", to_json(e.machine)}};
}

Json to_json(const events::Step& e) {
  Json terms = Json::object();
  for (const events::Term& term : e.terms) terms[term.name] = term.value;
  return {{"event", "step"},
          {"iteration", e.iteration},
          {"iterations", e.iterations},
          {"phase", e.phase},
          {"loss", e.loss},
          {"terms", std::move(terms)},
          {"psnr", e.psnr},
          {"seconds", e.seconds},
          {"rate", e.rate},
          {"surfels", to_json(e.surfels)},
          {"memory_bytes", e.memory_bytes}};
}

Json to_json(const events::DensityChanged& e) {
  return {{"event", "density_changed"},
          {"iteration", e.iteration},
          {"set", e.set},
          {"cloned", e.cloned},
          {"split", e.split},
          {"pruned_transparent", e.pruned_transparent},
          {"pruned_large", e.pruned_large},
          {"opacity_reset", e.opacity_reset},
          {"at_cap", e.at_cap},
          {"count", e.count}};
}

Json to_json(const events::PhaseEntered& e) {
  return {{"event", "phase_entered"}, {"iteration", e.iteration}, {"phase", e.phase}};
}

Json to_json(const events::Evaluated& e) {
  return {{"event", "evaluated"}, {"iteration", e.iteration}, {"split", e.split},    {"views", e.views},
          {"psnr", e.psnr},       {"ssim", e.ssim},           {"seconds", e.seconds}};
}

Json to_json(const events::Warning& e) {
  return {{"event", "warning"}, {"iteration", e.iteration}, {"text", e.text}};
}

Json to_json(const events::Paused& e) {
  return {{"event", "paused"}, {"iteration", e.iteration}, {"paused", e.paused}};
}

Json to_json(const events::Saved& e) {
  return {{"event", "saved"}, {"iteration", e.iteration}, {"path", e.path.string()}, {"seconds", e.seconds}};
}

Json to_json(const events::Measured& e) {
  Json steps = Json::array();
  for (const profile::Entry& step : e.steps) {
    steps.push_back({{"name", step.name}, {"calls", step.calls}, {"seconds", step.seconds}});
  }
  return {{"event", "measured"},
          {"iteration", e.iteration},
          {"phase", e.phase},
          {"iterations", e.iterations},
          {"steps", std::move(steps)}};
}

const char* name(events::Ending ending) {
  switch (ending) {
    case events::Ending::completed:
      return "completed";
    case events::Ending::interrupted:
      return "interrupted";
    case events::Ending::diverged:
      return "diverged";
    case events::Ending::out_of_memory:
      return "out_of_memory";
  }
  return "unknown";
}

Json to_json(const events::Finished& e) {
  return {{"event", "finished"},  {"ending", name(e.ending)}, {"iteration", e.iteration},
          {"seconds", e.seconds}, {"psnr", e.psnr},           {"surfels", to_json(e.surfels)},
          {"reason", e.reason}};
}

}  // namespace

std::string to_json_line(const events::Event& event) {
  const Json json = std::visit([](const auto& e) { return to_json(e); }, event);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

EventLog::EventLog(const std::filesystem::path& path, int64_t step_interval)
    : file_(path, std::ios::app), step_interval_(step_interval) {
  if (!file_) throw InputError(path.string(), "", "a file that cannot be opened", "a place to write the log");
}

void EventLog::operator()(const events::Event& event) {
  const auto* step = std::get_if<events::Step>(&event);
  if (step != nullptr && step->iteration % step_interval_ != 0 && step->iteration != step->iterations) return;
  file_ << to_json_line(event) << '\n' << std::flush;
}

}  // namespace traceflow
