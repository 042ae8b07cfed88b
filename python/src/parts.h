#pragma once

#include <pybind11/pybind11.h>

// The parts of the module traceflow._core, one in each file of this folder.
namespace traceflow::python {

void add_errors(pybind11::module_& module);
void add_options(pybind11::module_& module);
void add_camera(pybind11::module_& module);
void add_capture(pybind11::module_& module);
void add_scene_parts(pybind11::module_& module);
void add_scene(pybind11::module_& module);
void add_training(pybind11::module_& module);
void add_metrics(pybind11::module_& module);
void add_pictures(pybind11::module_& module);
void add_pose_ops(pybind11::module_& ops);
void add_image_ops(pybind11::module_& ops);
void add_trace_ops(pybind11::module_& ops);
void add_loss_ops(pybind11::module_& ops);
void add_render_op(pybind11::module_& ops);

}  // namespace traceflow::python
