#include "eval/carriers.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "ops/deform/deform.h"
#include "ops/motion/motion.h"
#include "ops/motion/nodes.h"
#include "scene/rows.h"

namespace traceflow::eval {

namespace {

// The selected surfels posed at a time, on the host.
Surfels posed_rows(const viz::Subject& subject, const std::vector<int32_t>& rows, float time) {
  if (rows.empty()) return {};
  RowEdit edit;
  for (const int32_t row : rows) edit.keep(row);
  const Scene& scene = subject.scene;
  Surfels stored = edited_rows(scene.main, PlacedEdit(edit, scene.device()));
  if (scene.main_nodes) nodes::bend(*scene.main_nodes, stored.body, time, stored);
  if (scene.main_motion) motion::move(*scene.main_motion, stored.body, time, stored);
  const bool moves = subject.request.deform_main && scene.main_field;
  return moves ? deform::displaced(stored, *scene.main_field, time, subject.render.precision).on(Device::cpu)
               : stored.on(Device::cpu);
}

Tensor<double> in_capture(const SceneNormalisation& normalisation, const Tensor<float>& in_scene) {
  Tensor<double> positions(in_scene.shape());
  for (int64_t i = 0; i < positions.size(); i += 3)
    store3(&positions[i], normalisation.in_capture(load3<double>(&in_scene[i])));
  return positions;
}

}  // namespace

Carriers carriers_of(const viz::Subject& subject) {
  std::vector<int32_t> rows(static_cast<size_t>(subject.scene.main.count()));
  for (size_t i = 0; i < rows.size(); ++i) rows[i] = static_cast<int32_t>(i);
  const Surfels all = posed_rows(subject, rows, 0);
  RowEdit opaque;
  for (int64_t i = 0; i < all.count(); ++i) {
    const Vec3<double> x = load3<double>(all.position.row(i));
    if (all.opacity_logit[i] > 0 && std::isfinite(dot(x, x))) opaque.keep(i);
  }
  Tensor<double> rest;
  if (opaque.count() > 0) {
    rest = in_capture(subject.scene.normalisation,
                      edited_rows(all.position, PlacedEdit(opaque, Device::cpu), false));
  }
  return {std::move(rest),
          [&subject, opaque_rows = std::move(opaque.source)](const std::vector<int32_t>& listed, float time) {
            std::vector<int32_t> chosen(listed.size());
            std::ranges::transform(listed, chosen.begin(),
                                   [&](int32_t i) { return opaque_rows[static_cast<size_t>(i)]; });
            return in_capture(subject.scene.normalisation, posed_rows(subject, chosen, time).position);
          }};
}

}  // namespace traceflow::eval
