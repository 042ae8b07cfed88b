#include "track/body_centre.h"

#include "math/rotation.h"

namespace traceflow {

void move_centre(int32_t body, const Vec3<double>& centre, Motion& motion) {
  const Vec3<double> arm = centre - load3<double>(motion.centre.row(body));
  store3(motion.centre.row(body), centre);
  for (int64_t key = 0; key < motion.keys(); ++key) {
    const Vec3<double> turned = rotation_from_quaternion(load4<double>(&motion.rotation(body, key, 0))) * arm;
    float* const shift = &motion.shift(body, key, 0);
    store3(shift, load3<double>(shift) + turned - arm);
  }
}

}  // namespace traceflow
