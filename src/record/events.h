#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "base/machine.h"
#include "base/profile.h"

// What happens during training, told as it happens. The progress bar, the JSON-lines log and the web viewer
// listen; training itself prints nothing and knows none of them. Events come from the training thread, in
// order.
namespace traceflow::events {

struct SurfelCounts {
  int64_t main = 0;
  int64_t environment = 0;
};

// A named number, such as one term of the loss.
struct Term {
  std::string name;
  double value = 0;
};

// First of all events, and again after --resume.
struct Started {
  std::string capture;
  std::filesystem::path run;
  int64_t iteration = 0;   // already done: 0, or where a resumed run goes on
  int64_t iterations = 0;  // in all
  std::string device = "cpu";
  int threads = 1;
  uint64_t seed = 0;
  SurfelCounts surfels;
  int64_t forecast_bytes = 0;  // memory that the run takes at most, by its shapes
  std::string version;         // of the program
  Machine machine;
  // The capture's finite points, and those that some training view sees: main surfels started at these, or
  // at random where there are none.
  int64_t points = 0, points_in_view = 0;
};

// One iteration is done.
struct Step {
  int64_t iteration = 0;  // done so far, this one included
  int64_t iterations = 0;
  std::string phase;
  double loss = 0;          // weighted sum of the terms
  std::vector<Term> terms;  // unweighted
  double psnr = 0;          // dB, of this iteration's view, smoothed over the last ones
  double seconds = 0;       // of steps and saves so far, earlier sessions of a resumed run included
  double rate = 0;          // steps a second, over the last ones
  SurfelCounts surfels;
  int64_t memory_bytes = 0;  // in use: resident, or on the device where training is on CUDA
};

// Density control has run on one set. Counts are split by cause.
struct DensityChanged {
  int64_t iteration = 0;
  std::string set;  // "main" or "environment"
  int64_t cloned = 0;
  int64_t split = 0;
  int64_t added = 0;  // for surface that came into view
  int64_t pruned_transparent = 0;
  int64_t pruned_large = 0;
  bool opacity_reset = false;
  bool at_cap = false;  // would have grown further but for the cap
  int64_t count = 0;    // surfels of the set from now on
};

// Whether bodies are followed has been decided (TrackOptions::still).
struct FollowingDecided {
  int64_t iteration = 0;
  bool follows = false;
  double silhouettes = 0;  // mean misfit at rest, a share of the masks' area
};

// Parts of bodies have become bodies of their own (track/body_parts.h).
struct BodiesParted {
  int64_t iteration = 0;
  int64_t added = 0;
  int64_t bodies = 0;  // from now on
};

// Whether a body bends has been decided (train/options.h, BendOptions).
struct BendingDecided {
  int64_t iteration = 0;
  int64_t body = 0;
  bool bends = false;
  double silhouettes = 0;             // mean misfit, of all bodies, over that of the first view
  std::optional<double> photographs;  // what differs of them with nodes, over without; of textured bodies
};

// The bias of normal priors in masks has been measured, and is undone from now on (track/prior_bias.h).
struct PriorsTurned {
  int64_t iteration = 0;
  double degrees = 0;
};

struct PhaseEntered {
  int64_t iteration = 0;
  std::string phase;
};

// Means over views that training does not see.
struct Evaluated {
  int64_t iteration = 0;
  std::string split;
  int64_t views = 0;
  double psnr = 0;
  double ssim = 0;
  double seconds = 0;  // that the evaluation took
};

struct Warning {
  int64_t iteration = 0;
  std::string text;  // one line
};

// Somebody who watches has stopped the training for a while, or lets it go on.
struct Paused {
  int64_t iteration = 0;
  bool paused = false;
};

// The state of the run is on disk.
struct Saved {
  int64_t iteration = 0;
  std::filesystem::path path;
  double seconds = 0;  // that saving took
};

// Where the time of the iterations since the last of these went. On the CPU all are measured; on CUDA, where
// measuring waits for every kernel, one in a hundred.
struct Measured {
  int64_t iteration = 0;
  std::string phase;                  // that they were of
  int64_t iterations = 0;             // measured
  std::vector<profile::Entry> steps;  // of those alone
};

enum class Ending {
  completed,
  interrupted,
  diverged,
  out_of_memory,
  no_input,  // a photograph that could no longer be read
};

// Last of all events.
struct Finished {
  Ending ending = Ending::completed;
  int64_t iteration = 0;
  double seconds = 0;  // of steps and saves, earlier sessions of a resumed run included
  double psnr = 0;     // as in the last Step
  SurfelCounts surfels;
  std::string reason;  // one line where the ending is not `completed`
};

using Event = std::variant<Started, Step, DensityChanged, FollowingDecided, BodiesParted, BendingDecided,
                           PriorsTurned, PhaseEntered, Evaluated, Warning, Paused, Saved, Measured, Finished>;
using Listener = std::function<void(const Event&)>;

// Hands every event to every listener, in the order in which they were added.
class Stream {
 public:
  void listen(Listener listener) { listeners_.push_back(std::move(listener)); }
  void emit(const Event& event) const {
    for (const Listener& listener : listeners_) listener(event);
  }

 private:
  std::vector<Listener> listeners_;
};

}  // namespace traceflow::events
