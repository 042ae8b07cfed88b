#pragma once

#include "base/tensor.h"

namespace traceflow::loss {

// The value of a term, and the count that it is the mean over.
struct Mean {
  double value;
  double count;
};

// Where a term writes its mean: an entry of a list on the device of the term's inputs. The host does not wait
// until it reads the list.
struct MeanSlot {
  Tensor<Mean>& list;
  int64_t place;

  // The entry's address on that device.
  Mean* on(Device device) const {
    require(list.device() == device && place >= 0 && place < list.size(),
            "a term's slot lies where its inputs are", list.shape().to_string());
    return list.data() + place;
  }
};

// Returns the value of one term, for which the host waits. term(slot) computes it on the device.
template <class F>
double value_of(Device device, F&& term) {
  Tensor<Mean> list({1}, device);
  term(MeanSlot{list, 0});
  return list.on(Device::cpu)[0].value;
}

// Writes a mean that the host knows.
inline void put(const Mean& mean, const MeanSlot& slot) {
  const Device device = slot.list.device();
  memory::copy(device, slot.on(device), Device::cpu, &mean, sizeof(mean));
}

}  // namespace traceflow::loss
