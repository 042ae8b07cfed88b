#include "ops/lighting/lighting.h"

#include <algorithm>
#include <string>

#include "base/parallel.h"
#include "ops/lighting/lighting_kernels.h"
#include "primitives/group_by_key.h"
#include "primitives/sums.h"

namespace traceflow::lighting {

struct Saved {
  Tensor<Place> places;
  // Working memory of backward.
  Tensor<float> log_gradients;
  Tensor<int32_t> cells;
  cuda::KeyGroups lists;
};
void SavedDeleter::operator()(Saved* saved) const { delete saved; }
SavedPtr make_saved() { return SavedPtr(new Saved); }

namespace {

GridSize size_of(const Shape& brightness) { return {brightness[3], brightness[2], brightness[1]}; }

Grid grid_of(const Lighting& lighting, float time) {
  return {size_of(lighting.brightness.shape()), lighting.box.data(), lighting.time.data(),
          lighting.brightness.data(),           lighting.times(),    double{time}};
}

Bodies bodies_of(const Lighting& lighting) {
  return {lighting.centre.data(), lighting.radius.data(), lighting.body_brightness.data(), lighting.bodies()};
}

// Lists 0 to n − 1 by their keys, like cuda::group_by_key.
void group_by_key_on_host(const Tensor<int32_t>& key, int64_t keys, cuda::KeyGroups& lists) {
  lists.begin.reset({keys + 1});
  for (const int32_t k : key.values()) {
    if (k >= 0) ++lists.begin[k + 1];
  }
  for (int64_t k = 0; k < keys; ++k) lists.begin[k + 1] += lists.begin[k];
  lists.filled.resize({keys});
  std::copy_n(lists.begin.data(), keys, lists.filled.data());
  lists.entry.resize({lists.begin[keys]});
  for (int64_t i = 0; i < key.size(); ++i) {
    if (key[i] >= 0) lists.entry[lists.filled[key[i]]++] = static_cast<int32_t>(i);
  }
}

}  // namespace

void forward(const Lighting& lighting, const Tensor<int32_t>& body, float time, const Tensor<int32_t>& subset,
             PosedSurfels& posed, Saved& saved) {
  const int64_t count = posed.count();
  saved.places.place(lighting.device()).resize({count});
  if (count == 0) return;
  parallel_for(lighting.device(), "lighting: light", count,
               LightSurfel{grid_of(lighting, time),
                           bodies_of(lighting),
                           {body.empty() ? nullptr : body.data(), subset.empty() ? nullptr : subset.data()},
                           posed.position.data(),
                           posed.sh.data(),
                           posed.sh.row_size(),
                           saved.places.data()});
}

void backward(const Lighting& lighting, float time, const PosedSurfels& lit, Saved& saved,
              PosedSurfels& grad_posed, Lighting* grad_lighting) {
  const Device device = lighting.device();
  const int64_t count = lit.count();
  if (count == 0) return;
  require(saved.places.size() == count, "backward follows forward of the same surfels",
          std::to_string(count));
  const Grid grid = grid_of(lighting, time);
  saved.log_gradients.place(device).resize({count});
  saved.cells.place(device).resize({count});
  parallel_for(device, "lighting: gradients back", count,
               LightBack{grid, bodies_of(lighting), saved.places.data(), lit.sh.data(), lit.sh.row_size(),
                         grad_posed.sh.data(), grad_posed.position.data(), saved.log_gradients.data(),
                         saved.cells.data()});
  if (grad_lighting == nullptr) return;
  if (device == Device::cpu)
    group_by_key_on_host(saved.cells, grid.size.points(), saved.lists);
  else
    cuda::group_by_key(saved.cells.data(), count, grid.size.points(), saved.lists);
  parallel_for(device, "lighting: collect", grid.size.points(),
               CollectAtPoint{grid, saved.lists.begin.data(), saved.lists.entry.data(), saved.places.data(),
                              saved.log_gradients.data(), grad_lighting->brightness.data()});
  for (int64_t b = 0; b < lighting.bodies(); ++b) {
    ordered_sum<BodyGradient>(
        device, "lighting: collect on a body", count,
        BodyGradientOfSurfel{static_cast<int32_t>(b), saved.places.data(), saved.log_gradients.data()},
        AddBodyGradient{grid, grad_lighting->body_brightness.row(b)}, 1024);
  }
}

void light(const Lighting& lighting, const Tensor<int32_t>& body, float time, Surfels& surfels) {
  const int64_t count = surfels.count();
  if (count == 0) return;
  Tensor<Place> places;
  places.place(lighting.device()).resize({count});
  parallel_for(lighting.device(), "lighting: light", count,
               LightSurfel{grid_of(lighting, time),
                           bodies_of(lighting),
                           {body.empty() ? nullptr : body.data(), nullptr},
                           surfels.position.data(),
                           surfels.sh.data(),
                           surfels.sh.row_size(),
                           places.data()});
}

void resist(const Lighting& lighting, const Stiffness& weights, Lighting& gradient) {
  const GridSize size = size_of(lighting.brightness.shape());
  parallel_for(
      lighting.device(), "lighting: resist", lighting.times() * size.z * size.y,
      ResistAlongRow{size, lighting.times(), weights, lighting.brightness.data(), gradient.brightness.data()},
      64);
  parallel_for(lighting.device(), "lighting: resist on bodies", lighting.body_brightness.size(),
               ResistOnBody{lighting.times(), weights, lighting.body_brightness.data(),
                            gradient.body_brightness.data()});
}

}  // namespace traceflow::lighting
