#pragma once

#include <string>

#include "arrays.h"
#include "math/camera.h"

namespace traceflow::python {

// dL/d(camera pose) as a dict: camera_from_world 3×3, position 3.
py::dict dict_of(const CameraGradient<float>& gradient);

// The usual matrix: element (i, j) of the array is in row i and column j, while glm counts columns first.
py::array matrix_of(const Mat3<float>& matrix);
py::array vector_of(const Vec3<float>& vector);

}  // namespace traceflow::python
