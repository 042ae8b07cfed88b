#include "runs/run_training.h"

#include "base/atomic_file.h"
#include "record/event_log.h"
#include "train/continuation.h"
#include "train/initialise.h"
#include "train/odd_masks.h"

namespace traceflow {

namespace {

constexpr int64_t iterations_between_logged_steps = 10;

}  // namespace

RunTraining::RunTraining(std::filesystem::path folder, bool resume)
    : folder_{std::move(folder)}, resume_(resume) {
  if (resume_ || std::filesystem::exists(folder_.folder)) hold();
  if (!resume_) return;
  std::string note;
  const Safetensors file = read_checkpoint(folder_, note);
  checkpoint_ = {options_in(file, folder_.checkpoint().string()), file.text("capture_folder")};
}

void RunTraining::hold() {
  if (!resume_) make_folder(folder_.folder);
  if (resume_ && !folder_.holds_a_run()) return;  // reading it reports the error
  lock_.emplace(folder_.lock(), folder_.folder, "training");
  if (resume_ || !folder_.holds_a_run()) return;
  throw InputError("--output", "", folder_.folder.string() + ", which holds a run", "a new folder",
                   "add --resume to continue it, or choose another");
}

void RunTraining::check(const TrainOptions& options) const {
  options.validate();
  if (resume_) refuse_reshaping(checkpoint_.options, options);
}

RunTraining::ObjectSearch RunTraining::objects_for(Capture& capture, const TrainOptions& options,
                                                   const StepsDone& progress) const {
  if (resume_) {
    FoundMasks kept = read_masks(folder_.masks(), capture);
    if (kept.empty()) return {};
    return {FoundObjects{std::move(kept), {}}};
  }
  if (follows_bodies(capture, options)) leave_out_odd_masks(capture);
  const int iterations = iterations_to_find_objects(capture, options);
  if (iterations == 0) return {};
  std::optional<FoundObjects> found = find_objects(capture, options, iterations, progress);
  const bool stopped = !found;
  return {std::move(found), stopped};
}

std::unique_ptr<Trainer> RunTraining::trainer(const TrainOptions& options, Capture capture, Device device,
                                              const ObjectSearch& objects) {
  if (objects.found) give_objects(*objects.found, capture);
  auto trainer = std::make_unique<Trainer>(options, std::move(capture), folder_.folder, device);
  if (!lock_) hold();
  if (objects.found) write_masks(objects.found->masks, folder_.masks());
  const auto log = std::make_shared<EventLog>(folder_.log(), iterations_between_logged_steps);
  trainer->stream().listen([log](const events::Event& event) { (*log)(event); });
  return trainer;
}

void RunTraining::begin(Trainer& trainer) const {
  if (!lock_ || !lock_->keeps_others_out()) {
    trainer.stream().emit(events::Warning{
        0, folder_.folder.string() + " is on a file system without locks: see that no second training writes "
                                     "there"});
  }
  if (resume_) trainer.resume();
}

}  // namespace traceflow
