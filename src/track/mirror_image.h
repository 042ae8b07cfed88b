#pragma once

#include "math/types.h"
#include "track/body_surface.h"

// How the image in a mirror moves over its surface.
namespace traceflow {

// The rotation ω, in radians about world axes, of a mirror image over a body between two views. It takes the
// places where the first view shows something distant to those where the second view shows it. Fitted by
// least squares to the normals at all pixels of the first view. It depends on the motion of the camera and of
// the body, not on the body's rotation. Zero if the view shows too little of the body.
//
// eye: of the second view. shift: translation of the body between the two.
Vec3<double> turn_of_mirror_image(const BodySurface& surface, int32_t body, const Vec3<double>& eye,
                                  const Vec3<double>& shift);

}  // namespace traceflow
