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

// The events of training. The progress bar, the JSON-lines log and the web viewer listen to them; training
// itself prints nothing and does not know the listeners. The training thread emits events in order.
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

// The first event, also after --resume.
struct Started {
  std::string capture;
  std::filesystem::path run;
  int64_t iteration = 0;   // already done: 0, or where a resumed run continues
  int64_t iterations = 0;  // in total
  std::string device = "cpu";
  int threads = 1;
  uint64_t seed = 0;
  SurfelCounts surfels;
  int64_t forecast_bytes = 0;  // upper bound on the memory of the run, computed from the sizes of its data
  std::string version;         // of the program
  Machine machine;
  // The capture's finite points, and those that at least one training view sees. Main surfels start at the
  // latter, or at random positions if there are none.
  int64_t points = 0, points_in_view = 0;
};

// One iteration is done.
struct Step {
  int64_t iteration = 0;  // done so far, including this one
  int64_t iterations = 0;
  std::string phase;
  double loss = 0;          // weighted sum of the terms
  std::vector<Term> terms;  // unweighted
  double psnr = 0;          // dB, of this iteration's view, smoothed over the last iterations
  double seconds = 0;       // of steps and saves so far, including earlier sessions of a resumed run
  double rate = 0;          // steps per second, over the last iterations
  SurfelCounts surfels;
  int64_t memory_bytes = 0;  // in use: resident, or on the device if training runs on CUDA
};

// Density control has changed one set. Counts are split by cause.
struct DensityChanged {
  int64_t iteration = 0;
  std::string set;  // "main" or "environment"
  int64_t cloned = 0;
  int64_t split = 0;
  int64_t added = 0;  // for newly visible surface
  int64_t pruned_transparent = 0;
  int64_t pruned_large = 0;
  bool opacity_reset = false;
  bool at_cap = false;  // the cap prevented further growth
  int64_t count = 0;    // surfels of the set afterwards
};

// Training has decided whether bodies are tracked (TrackOptions::still).
struct FollowingDecided {
  int64_t iteration = 0;
  bool follows = false;
  double silhouettes = 0;  // mean silhouette error at rest, a share of the masks' area
};

// Parts of bodies have become separate bodies (track/body_parts.h).
struct BodiesParted {
  int64_t iteration = 0;
  int64_t added = 0;
  int64_t bodies = 0;  // number afterwards
};

// Training has decided whether a body deforms (train/options.h, BendOptions).
struct BendingDecided {
  int64_t iteration = 0;
  int64_t body = 0;
  bool bends = false;
  double silhouettes = 0;             // mean silhouette error of all bodies, over that of the first view
  std::optional<double> photographs;  // photometric cost with nodes over that without; textured bodies only
};

// The bias of normal priors in masks has been measured. It is corrected from now on (track/prior_bias.h).
struct PriorsTurned {
  int64_t iteration = 0;
  double degrees = 0;
};

struct PhaseEntered {
  int64_t iteration = 0;
  std::string phase;
};

// Means over held-out views.
struct Evaluated {
  int64_t iteration = 0;
  std::string split;
  int64_t views = 0;
  double psnr = 0;
  double ssim = 0;
  double seconds = 0;  // of the evaluation
};

struct Warning {
  int64_t iteration = 0;
  std::string text;  // one line
};

// A viewer has paused or continued the training.
struct Paused {
  int64_t iteration = 0;
  bool paused = false;
};

// The state of the run is on disk.
struct Saved {
  int64_t iteration = 0;
  std::filesystem::path path;
  double seconds = 0;  // of saving
};

// How long the parts of the iterations took since the last such event. On the CPU all iterations are
// measured. On CUDA, where measuring waits for every kernel, one in a hundred is.
struct Measured {
  int64_t iteration = 0;
  std::string phase;                  // of these iterations
  int64_t iterations = 0;             // the number of measured ones
  std::vector<profile::Entry> steps;  // of the measured iterations only
};

enum class Ending {
  completed,
  interrupted,
  diverged,
  out_of_memory,
  no_input,  // a photograph can no longer be read
};

// The last event.
struct Finished {
  Ending ending = Ending::completed;
  int64_t iteration = 0;
  double seconds = 0;  // of steps and saves, including earlier sessions of a resumed run
  double psnr = 0;     // as in the last Step
  SurfelCounts surfels;
  std::string reason;  // one line unless the ending is `completed`
};

using Event = std::variant<Started, Step, DensityChanged, FollowingDecided, BodiesParted, BendingDecided,
                           PriorsTurned, PhaseEntered, Evaluated, Warning, Paused, Saved, Measured, Finished>;
using Listener = std::function<void(const Event&)>;

// Passes every event to every listener, in the order in which they were added.
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
