#pragma once

#include "base/device.h"

// The depth with which the distortion compares hits (method §3.5): 0 at the near plane and 1 at the far
// plane, as in 2DGS.
namespace traceflow {

// m = far/(far - near) · (1 - near/z)
template <class T>
TRACEFLOW_HD T distortion_depth(T near_plane, T far_plane, T z) {
  return far_plane / (far_plane - near_plane) * (T(1) - near_plane / z);
}

// dm/dz
template <class T>
TRACEFLOW_HD T distortion_depth_slope(T near_plane, T far_plane, T z) {
  return far_plane * near_plane / ((far_plane - near_plane) * z * z);
}

}  // namespace traceflow
