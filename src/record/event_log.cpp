#include "record/event_log.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <nlohmann/json.hpp>
#include <system_error>

#include "base/error.h"

namespace traceflow {

namespace {

// Keeps the fields in the order of the code below.
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
          {"machine", to_json(e.machine)},
          {"points", e.points},
          {"points_in_view", e.points_in_view}};
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
          {"added", e.added},
          {"pruned_transparent", e.pruned_transparent},
          {"pruned_large", e.pruned_large},
          {"opacity_reset", e.opacity_reset},
          {"at_cap", e.at_cap},
          {"count", e.count}};
}

Json to_json(const events::FollowingDecided& e) {
  return {{"event", "following_decided"},
          {"iteration", e.iteration},
          {"follows", e.follows},
          {"silhouettes", e.silhouettes}};
}

Json to_json(const events::BodiesParted& e) {
  return {{"event", "bodies_parted"}, {"iteration", e.iteration}, {"added", e.added}, {"bodies", e.bodies}};
}

Json to_json(const events::BendingDecided& e) {
  Json json = {{"event", "bending_decided"},
               {"iteration", e.iteration},
               {"body", e.body},
               {"bends", e.bends},
               {"silhouettes", e.silhouettes}};
  if (e.photographs) json["photographs"] = *e.photographs;
  return json;
}

Json to_json(const events::PriorsTurned& e) {
  return {{"event", "priors_turned"}, {"iteration", e.iteration}, {"degrees", e.degrees}};
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
    case events::Ending::no_input:
      return "no_input";
  }
  return "unknown";
}

Json to_json(const events::Finished& e) {
  return {{"event", "finished"},  {"ending", name(e.ending)}, {"iteration", e.iteration},
          {"seconds", e.seconds}, {"psnr", e.psnr},           {"surfels", to_json(e.surfels)},
          {"reason", e.reason}};
}

// If this fails an incomplete line remains; readers skip it.
void cut_to(int descriptor, int64_t size) {
  [[maybe_unused]] const int refused = ::ftruncate(descriptor, size);
}

// The position after the last complete line.
int64_t end_of_lines(int descriptor, int64_t size) {
  std::array<char, 4096> block{};
  for (int64_t end = size; end > 0;) {
    const int64_t begin = std::max<int64_t>(0, end - static_cast<int64_t>(block.size()));
    const ssize_t n = ::pread(descriptor, block.data(), static_cast<size_t>(end - begin), begin);
    if (n != end - begin) return size;
    for (ssize_t i = n; i > 0; --i) {
      if (block[static_cast<size_t>(i - 1)] == '\n') return begin + i;
    }
    end = begin;
  }
  return 0;
}

}  // namespace

std::string to_json_line(const events::Event& event) {
  const Json json = std::visit([](const auto& e) { return to_json(e); }, event);
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

EventLog::EventLog(const std::filesystem::path& path, int64_t step_interval)
    // O_NOFOLLOW: the run folder may come from someone else, and a link may lead to any file.
    : descriptor_(::open(path.c_str(), O_RDWR | O_APPEND | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644)),
      step_interval_(step_interval) {
  if (descriptor_ < 0) {
    if (errno == ELOOP)
      throw InputError(path.string(), "", "a link", "a place to write the log", "remove it");
    throw InputError(path.string(), "", std::generic_category().message(errno), "a place to write the log");
  }
  const int64_t size = ::lseek(descriptor_, 0, SEEK_END), whole = end_of_lines(descriptor_, size);
  if (whole < size && ::ftruncate(descriptor_, whole) != 0) {
    throw InputError(path.string(), "", std::generic_category().message(errno), "a place to write the log");
  }
}

EventLog::~EventLog() { ::close(descriptor_); }

bool EventLog::write(const std::string& line) {
  const int64_t before = ::lseek(descriptor_, 0, SEEK_END);
  for (size_t written = 0; written < line.size();) {
    const ssize_t n = ::write(descriptor_, line.data() + written, line.size() - written);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) {
      if (written > 0) cut_to(descriptor_, before);
      return false;
    }
    written += static_cast<size_t>(n);
  }
  return true;
}

void EventLog::operator()(const events::Event& event) {
  const auto* step = std::get_if<events::Step>(&event);
  if (step != nullptr && step->iteration % step_interval_ != 0 && step->iteration != step->iterations) return;
  if (missing_ > 0) {
    const events::Warning gap{0, std::to_string(missing_) + (missing_ == 1 ? " line" : " lines") +
                                     " of the log could not be written here"};
    if (write(to_json_line(gap) + '\n')) missing_ = 0;
  }
  if (!write(to_json_line(event) + '\n')) ++missing_;
}

}  // namespace traceflow
