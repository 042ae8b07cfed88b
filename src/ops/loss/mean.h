#pragma once

#include "base/tensor.h"

namespace traceflow::loss {

// A term as it was computed: its value, and how many things it is the mean of.
struct Mean {
  double value;
  double count;
};

// Where a term leaves its mean: a place in a list that lies on the device of the term's inputs. Nobody waits
// for it until the list is read.
struct MeanSlot {
  Tensor<Mean>& list;
  int64_t place;

  // Its address there.
  Mean* on(Device device) const {
    require(list.device() == device && place >= 0 && place < list.size(),
            "a term's slot lies where its inputs are", list.shape().to_string());
    return list.data() + place;
  }
};

// The value of one term at once, for which the host waits. term(slot) computes it on the device.
template <class F>
double value_of(Device device, F&& term) {
  Tensor<Mean> list({1}, device);
  term(MeanSlot{list, 0});
  return list.on(Device::cpu)[0].value;
}

// Leaves a value that the host has.
inline void put(const Mean& mean, const MeanSlot& slot) {
  const Device device = slot.list.device();
  memory::copy(device, slot.on(device), Device::cpu, &mean, sizeof(mean));
}

}  // namespace traceflow::loss
