#include <fmt/format.h>
#include <pybind11/stl/filesystem.h>

#include <atomic>
#include <filesystem>
#include <optional>
#include <thread>

#include "capture.h"
#include "errors.h"
#include "options.h"
#include "parts.h"
#include "record/event_log.h"
#include "runs/run_training.h"
#include "scene.h"

namespace traceflow::python {

namespace {

// The error of a signal's handler, such as KeyboardInterrupt, if one has come. Needs the GIL.
std::exception_ptr signal_error() {
  if (PyErr_CheckSignals() == 0) return nullptr;
  return std::make_exception_ptr(py::error_already_set());
}

// An event as the log has it.
py::object event_as_dict(const events::Event& event) {
  static const py::object& loads = *new py::object(py::module_::import("json").attr("loads"));
  return loads(to_json_line(event));
}

py::dict dict_of_loss(const LossValues& loss) {
  py::dict terms, result;
  for (const LossValue& term : loss.terms) terms[py::str(std::string(term.name))] = term.value;
  result["loss"] = loss.total;
  result["terms"] = terms;
  result["psnr"] = loss.psnr ? py::cast(*loss.psnr) : py::none();
  return result;
}

class HeldTrainer {
 public:
  HeldTrainer(const py::object& capture, const py::object& options, const std::filesystem::path& folder,
              bool resume, const std::string& device, const py::object& searching)
      : run_(folder, resume) {
    const Device where = device_of(device);
    TrainOptions chosen = options_from(options, resume);
    const std::filesystem::path path = capture_path(capture, chosen);
    run_.check(chosen);
    RunTraining::ObjectSearch objects;
    std::exception_ptr error;
    {
      const py::gil_scoped_release others_run;
      // A capture of its own: trainings give masks to views and take them away.
      Capture own = load_capture(path, chosen.capture);
      objects = run_.objects_for(own, chosen, [&](int64_t done, int64_t all) {
        const py::gil_scoped_acquire held;
        error = call(searching, py::make_tuple(done, all));
        return !error;
      });
      if (!error) trainer_ = run_.trainer(chosen, std::move(own), where, objects);
    }
    if (error) std::rethrow_exception(error);
    trainer_->stream().listen([this](const events::Event& event) { on_event(event); });
    const InUse in_use(*this);
    run_.begin(*trainer_);
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  }

  // Returns the last event. Throws what the callback threw, KeyboardInterrupt after Ctrl-C, or an Error if
  // the training could not go on; the state is saved first.
  py::object run(const py::object& callback) {
    const InUse in_use(*this);
    callback_ = callback;
    error_ = nullptr;
    stop_ = false;
    std::optional<events::Finished> end;
    {
      const py::gil_scoped_release others_run;
      end = trainer_->run(stop_);
    }
    callback_ = py::none();
    if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    if (end->ending == events::Ending::diverged || end->ending == events::Ending::out_of_memory ||
        end->ending == events::Ending::no_input)
      throw TrainingEnded(fmt::format("ended at iteration {}: {}", end->iteration, end->reason));
    return event_as_dict(*end);
  }

  py::dict step() {
    const InUse in_use(*this);
    LossValues loss;
    {
      const py::gil_scoped_release others_run;
      loss = trainer_->step();
    }
    if (std::exception_ptr error = signal_error()) std::rethrow_exception(error);
    return dict_of_loss(loss);
  }

  void save() {
    const InUse in_use(*this);
    const py::gil_scoped_release others_run;
    trainer_->save();
  }

  void stop() { stop_ = true; }

  // A copy: training resizes its tensors.
  std::shared_ptr<HeldScene> scene() {
    const InUse in_use(*this);
    auto held = std::make_shared<HeldScene>();
    held->iteration = trainer_->iteration();
    const py::gil_scoped_release others_run;
    viz::Subject& subject = held->loaded.subject;
    subject.scene = trainer_->scene();
    subject.render = picture_render(trainer_->options(), trainer_->iteration());
    subject.request = picture_request(trainer_->options(), trainer_->iteration());
    return held;
  }

  TrainOptions options() const { return trainer_->options(); }
  int iteration() const { return trainer_->iteration(); }

 private:
  // While one thread is in the trainer, only what it calls may be, such as a callback of it.
  class InUse {
   public:
    explicit InUse(HeldTrainer& trainer) : trainer_(trainer), outer_(trainer.user_) {
      const std::thread::id me = std::this_thread::get_id();
      if (outer_ != std::thread::id() && outer_ != me)
        throw InputError("Trainer", "", "a call while another thread trains",
                         "one thread at a time; stop() alone may come from any");
      trainer_.user_ = me;
    }
    ~InUse() { trainer_.user_ = outer_; }
    InUse(const InUse&) = delete;
    InUse& operator=(const InUse&) = delete;

   private:
    HeldTrainer& trainer_;
    std::thread::id outer_;
  };

  TrainOptions options_from(const py::object& options, bool resume) const {
    if (!options.is_none()) return py::cast<TrainOptions>(options);
    return resume ? run_.checkpoint().options : TrainOptions(preset("paper"));
  }

  // Where the capture is. A Capture's options become the run's.
  std::filesystem::path capture_path(const py::object& capture, TrainOptions& options) const {
    if (py::isinstance<HeldCapture>(capture)) {
      const auto& held = py::cast<const HeldCapture&>(capture);
      options.capture = held.options;
      return held.capture.folder;
    }
    if (!capture.is_none()) return py::cast<std::filesystem::path>(capture);
    if (run_.checkpoint().capture_folder.empty())
      throw InputError("argument", "capture", "nothing", "a Capture, a folder or a zip archive");
    return run_.checkpoint().capture_folder;
  }

  // Calls a callback, if there is one, and looks for signals. Returns the error of either. Needs the GIL.
  static std::exception_ptr call(const py::object& callback, const py::tuple& arguments) {
    try {
      if (!callback.is_none()) callback(*arguments);
    } catch (const py::error_already_set&) {
      return std::current_exception();
    }
    return signal_error();
  }

  void on_event(const events::Event& event) {
    const py::gil_scoped_acquire held;
    if (error_) return;
    const bool tells = !callback_.is_none();
    error_ = call(callback_, tells ? py::make_tuple(event_as_dict(event)) : py::tuple());
    if (error_) stop_ = true;
  }

  RunTraining run_;
  std::unique_ptr<Trainer> trainer_;
  py::object callback_ = py::none();
  std::exception_ptr error_;  // of the callback or a signal, until run() ends
  std::atomic<bool> stop_{false};
  std::thread::id user_;  // guarded by the GIL
};

}  // namespace

void add_training(py::module_& module) {
  py::class_<HeldTrainer, std::shared_ptr<HeldTrainer>>(
      module, "Trainer",
      "One training in a run's folder, as the program's `train` does it, to the same bytes. No second "
      "training can use the folder while this object exists.")
      .def(py::init<const py::object&, const py::object&, const std::filesystem::path&, bool,
                    const std::string&, const py::object&>(),
           py::arg("capture"), py::arg("options"), py::arg("run"), py::kw_only(), py::arg("resume") = false,
           py::arg("device") = "auto", py::arg("searching") = py::none(),
           "capture: a Capture, whose options then count, or a path. options: TrainOptions. run: the folder; "
           "a new one unless `resume` continues the run there, for which capture and options may be None: "
           "those of the run. searching: called with (done, all) iterations while moving objects are sought "
           "in a capture without masks.")
      .def("run", &HeldTrainer::run, py::arg("callback") = py::none(),
           "Trains to the last iteration, saves, and returns the last event. callback: called with each "
           "event, a dict with the fields of the run's log (docs/train.md), such as {'event': 'step', "
           "'iteration': 10, 'psnr': 21.3, …}. If it raises, or at Ctrl-C, the training saves its state and "
           "the exception goes on; run() or resume then continue. Other Python threads run meanwhile.")
      .def("step", &HeldTrainer::step,
           "One iteration, without events or saving. Returns {'loss', 'terms', 'psnr'}: the weighted sum, "
           "the terms before their weights, and dB.")
      .def("save", &HeldTrainer::save, "Writes a checkpoint.")
      .def("stop", &HeldTrainer::stop,
           "Ends run() after the current iteration. May be called from any thread.")
      .def("scene", &HeldTrainer::scene,
           "A copy of the scene as it is now. In a callback it shows the training live.")
      .def_property_readonly("options", &HeldTrainer::options, "A copy of the options.")
      .def_property_readonly("iteration", &HeldTrainer::iteration, "Iterations done.");
}

}  // namespace traceflow::python
