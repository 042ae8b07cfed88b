#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/folder_lock.h"
#include "train/found_masks.h"
#include "train/trainer.h"

namespace traceflow {

// A training with its folder, new or continued: what must happen around a Trainer, in this order.
//   RunTraining run(folder, resume);            // nobody else trains there
//   … options, capture (from run.checkpoint() if it is continued)
//   ObjectSearch objects = run.objects_for(capture, options, progress);
//   std::unique_ptr<Trainer> trainer = run.trainer(options, std::move(capture), device, objects);
//   … listeners
//   run.begin(*trainer);
//   trainer->run(stop);
class RunTraining {
 public:
  // What a continued run was trained with. Empty for a new one.
  struct Checkpoint {
    TrainOptions options;
    std::string capture_folder;
  };
  // Masks of moving objects where the capture lacks them; none if none are needed.
  struct ObjectSearch {
    std::optional<FoundObjects> found;
    bool stopped = false;  // `progress` has ended the search
  };

  // Locks the folder if it exists, and reads the checkpoint of a continued run. A new folder is created only
  // by trainer(), after all else is valid. Throws InputError if another training is there, if a new run would
  // replace one, and if there is none to continue.
  RunTraining(std::filesystem::path folder, bool resume);

  const Checkpoint& checkpoint() const { return checkpoint_; }
  // Throws InputError if a continued run cannot take these options.
  void check(const TrainOptions& options) const;

  // Leaves out implausible masks of a new run's capture, and finds objects if it has no masks. A continued
  // run has those that it was started with. progress: of the search; may end it.
  ObjectSearch objects_for(Capture& capture, const TrainOptions& options, const StepsDone& progress) const;

  // Makes the folder and the trainer, which writes its events to the run's log.
  std::unique_ptr<Trainer> trainer(const TrainOptions& options, Capture capture, Device device,
                                   const ObjectSearch& objects);
  // Warns if nothing keeps other trainings out of the folder, and reads a continued run's state.
  void begin(Trainer& trainer) const;

 private:
  void hold();

  RunFolder folder_;
  bool resume_;
  std::optional<FolderLock> lock_;
  Checkpoint checkpoint_;
};

}  // namespace traceflow
