#pragma once

#include "math/types.h"
#include "track/body_surface.h"

// How what a mirror shows moves over it.
namespace traceflow {

// The rotation, ω in radians about world axes, that takes the places of a body where a mirror image of what
// is far away is seen from one view to where it is seen from another: the mean over what the first view
// shows, by least squares on the normals of those places. It depends on where the camera and the body move,
// not on how the body turns. Zero where the view shows nothing of the body.
//
// eye: of the second view. shift: of the body between the two.
Vec3<double> turn_of_mirror_image(const BodySurface& surface, int32_t body, const Vec3<double>& eye,
                                  const Vec3<double>& shift);

}  // namespace traceflow
