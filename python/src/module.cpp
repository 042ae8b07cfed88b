#include <algorithm>
#include <string>
#include <vector>

#include "arrays.h"
#include "base/device_memory.h"
#include "base/parallel.h"
#include "base/version.h"
#include "parts.h"
#include "primitives/gemm.h"
#include "primitives/instructions.h"

namespace traceflow::python {

namespace {

void limit_to(const std::string& name) {
  constexpr auto names = enum_names(Instructions{});
  const auto* const found = std::ranges::find(names, name);
  if (found == names.end())
    throw InputError("argument", "instructions", name, "automatic, sse4, avx2 or avx512");
  limit_instructions(static_cast<Instructions>(found - names.begin()));
}

void set_thread_count(int count) {
  if (count < 0 || count > 4096) throw InputError("argument", "count", std::to_string(count), "0 to 4096");
  set_threads(count);
}

// Whether an op reads an N×M×3 array where it is.
bool is_taken_as_it_is(const py::array& array) {
  return tensor_of_array<float>(array, "array", {'N', 'M', 3})->data() == array.data();
}

bool cuda_answers() {
  std::string why_not;
  return cuda::is_ready(why_not);
}

}  // namespace

PYBIND11_MODULE(_core, module) {
  module.doc() = "What the package traceflow consists of.";
  module.attr("__version__") = version();
  add_errors(module);
  module.def("set_threads", &set_thread_count, py::arg("count"),
             "The number of threads; 0: OMP_NUM_THREADS or all cores. Results do not depend on it.");
  module.def("thread_count", &thread_count, "The number of threads.");
  module.def("limit_instructions", &limit_to, py::arg("name"),
             "The highest level of vector instructions: automatic, sse4, avx2 or avx512. Call it before "
             "anything else.");
  module.def("cuda_is_ready", &cuda_answers, "Whether a CUDA device answers.");
  module.def("_is_taken_as_it_is", &is_taken_as_it_is, py::arg("array"));
  module.def("set_deterministic", &cuda::set_deterministic, py::arg("on"),
             "On CUDA: sum in a fixed order, which is somewhat slower. The CPU always does.");
  add_options(module);
  add_camera(module);
  add_capture(module);
  add_scene_parts(module);
  add_scene(module);
  add_training(module);
  add_pictures(module);
  auto metrics = module.def_submodule("metrics", "Compares renders with photographs.");
  add_metrics(metrics);
  auto ops = module.def_submodule("ops", "The differentiable steps, forward and backward.");
  add_pose_ops(ops);
  add_image_ops(ops);
  add_trace_ops(ops);
  add_loss_ops(ops);
  add_render_op(ops);
}

}  // namespace traceflow::python
