#pragma once

#include <embree3/rtcore.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "base/error.h"
#include "math/blend.h"
#include "math/rotation.h"
#include "math/spherical_harmonics.h"
#include "ops/trace/trace.h"

namespace traceflow::bench {

// How surfels are traced elsewhere: Embree, a quad per surfel, a buffer of the k nearest hits filled in the
// filter callback, traced again from the last hit until the ray has ended. Where the buffer is full, a hit
// behind all of it is accepted, which shortens the ray.
template <int nearest>
class EmbreeTracer {
 public:
  EmbreeTracer(const PosedSurfels& surfels, const trace::Options& options)
      : surfels_(surfels),
        options_(options),
        rules_{options.alpha_min, options.alpha_max, options.transmittance_min},
        device_(rtcNewDevice("threads=1,set_affinity=0")),
        scene_(rtcNewScene(device_)) {
    require(surfels.sh.dim(1) == 1 || surfels.sh.dim(1) == 16, "SH of degree 0 or 3");
    RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_QUAD);
    fill(geometry);
    rtcSetGeometryIntersectFilterFunction(geometry, &on_hit);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene_, geometry);
    rtcReleaseGeometry(geometry);
    rtcSetSceneFlags(scene_, RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION);
    rtcCommitScene(scene_);
  }
  ~EmbreeTracer() {
    rtcReleaseScene(scene_);
    rtcReleaseDevice(device_);
  }
  EmbreeTracer(const EmbreeTracer&) = delete;
  EmbreeTracer& operator=(const EmbreeTracer&) = delete;

  void forward(const Tensor<float>& origins, const Tensor<float>& directions, trace::Output& output) const {
    const int64_t rays = origins.dim(0);
    output.colour.resize({rays, 3});
    output.alpha.resize({rays});
    output.distance.resize({rays});
    for (int64_t r = 0; r < rays; ++r) trace(r, origins.row(r), directions.row(r), output);
  }

 private:
  struct Hit {
    float t, alpha;
    uint32_t surfel;
    bool before(const Hit& other) const { return t < other.t || (t == other.t && surfel < other.surfel); }
  };
  struct Context {
    RTCIntersectContext embree;  // first: Embree hands back its address
    const EmbreeTracer* tracer;
    std::array<Hit, nearest> hits;
    int count;
    Hit last;  // of the pass before
  };

  void fill(RTCGeometry geometry) {
    const auto n = static_cast<size_t>(surfels_.count());
    auto* vertex = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0,
                                                               RTC_FORMAT_FLOAT3, 3 * sizeof(float), 4 * n));
    auto* index = static_cast<uint32_t*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0,
                                                                 RTC_FORMAT_UINT4, 4 * sizeof(uint32_t), n));
    radius_.resize(n);
    for (size_t i = 0; i < n; ++i) {
      const auto s = static_cast<int64_t>(i);
      const Mat3<float> rotation = rotation_from_quaternion(load4<float>(surfels_.rotation.row(s)));
      radius_[i] = std::sqrt(cutoff_radius2(rules_, surfels_.opacity[s]));
      const Vec3<float> a = radius_[i] * surfels_.scale(s, 0) * rotation[0];
      const Vec3<float> b = radius_[i] * surfels_.scale(s, 1) * rotation[1];
      const Vec3<float> p = load3<float>(surfels_.position.row(s));
      const Vec3<float> corners[4] = {p - a - b, p + a - b, p + a + b, p - a + b};
      for (size_t k = 0; k < 4; ++k) {
        store3(vertex + 3 * (4 * i + k), corners[k]);
        index[4 * i + k] = static_cast<uint32_t>(4 * i + k);
      }
    }
  }

  static void on_hit(const RTCFilterFunctionNArguments* args) {
    auto& context = *reinterpret_cast<Context*>(args->context);
    const auto* ray = reinterpret_cast<const RTCRay*>(args->ray);
    const auto* at = reinterpret_cast<const RTCHit*>(args->hit);
    const EmbreeTracer& self = *context.tracer;
    args->valid[0] = 0;
    const float radius = self.radius_[at->primID];
    const float u = (2 * at->u - 1) * radius, v = (2 * at->v - 1) * radius;
    const float radius2 = u * u + v * v;
    if (radius2 > radius * radius) return;
    Hit hit{ray->tfar, 0, at->primID};
    if (!context.last.before(hit)) return;
    if (context.count == nearest && !hit.before(context.hits[nearest - 1])) {
      args->valid[0] = -1;
      return;
    }
    hit.alpha = blend_alpha(self.rules_, self.surfels_.opacity[hit.surfel], std::exp(-0.5F * radius2)).value;
    if (hit.alpha == 0) return;
    int place = context.count < nearest ? context.count++ : nearest - 1;
    for (; place > 0 && hit.before(context.hits[static_cast<size_t>(place) - 1]); --place) {
      context.hits[static_cast<size_t>(place)] = context.hits[static_cast<size_t>(place) - 1];
    }
    context.hits[static_cast<size_t>(place)] = hit;
  }

  Vec3<float> colour(uint32_t surfel, const float* basis) const {
    const float* sh = surfels_.sh.row(surfel);
    Vec3<float> c(0.5F);
    if (surfels_.sh.dim(1) == 1) {
      c += basis[0] * load3<float>(sh);
    } else {
      for (int k = 0; k < 16; ++k) c += basis[k] * load3<float>(sh + 3 * k);
    }
    return glm::max(c, Vec3<float>(0));
  }

  void trace(int64_t r, const float* origin, const float* direction, trace::Output& output) const {
    float basis[16];
    sh_basis(sh_degree(surfels_.sh.dim(1)), load3<float>(direction), basis);
    Context context{};
    rtcInitIntersectContext(&context.embree);
    context.embree.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    context.tracer = this;
    context.last = {options_.t_min, 0, 0};
    float transmittance = 1, alpha = 0, distance = 0;
    Vec3<float> sum(0);
    for (bool ended = false; !ended;) {
      context.count = 0;
      RTCRayHit ray{};
      ray.ray = {origin[0],
                 origin[1],
                 origin[2],
                 context.last.t,
                 direction[0],
                 direction[1],
                 direction[2],
                 0.0F,
                 std::numeric_limits<float>::infinity(),
                 ~0U,
                 0U,
                 0U};
      ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
      rtcIntersect1(scene_, &context.embree, &ray);
      for (int i = 0; i < context.count && !ended; ++i) {
        const Hit& hit = context.hits[static_cast<size_t>(i)];
        ended = blend_ends(rules_, transmittance, hit.alpha);
        if (ended) break;
        const float weight = hit.alpha * transmittance;
        sum += weight * colour(hit.surfel, basis);
        alpha += weight;
        distance += weight * hit.t;
        transmittance *= 1 - hit.alpha;
      }
      ended = ended || context.count < nearest;
      if (context.count > 0) context.last = context.hits[static_cast<size_t>(context.count) - 1];
    }
    store3(output.colour.row(r), sum + transmittance * options_.background);
    output.alpha[r] = alpha;
    output.distance[r] = alpha > 0 ? distance / alpha : 0;
  }

  const PosedSurfels& surfels_;
  trace::Options options_;
  BlendRules<float> rules_;
  std::vector<float> radius_;
  RTCDevice device_;
  RTCScene scene_;
};

}  // namespace traceflow::bench
