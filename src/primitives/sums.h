#pragma once

#include <cstdint>

#include "base/parallel.h"

namespace traceflow {

namespace cuda {
// The sum of f(i) over [0, n) by kernels. Defined in primitives/sum_kernels.h; the .cu file beside the
// functors instantiates it.
template <class T, class F, class G>
TRACEFLOW_WITH_CUDA void sum_each_index(const char* description, int64_t n, const F& f, const G& finish);
}  // namespace cuda

// Sum of f(i) over [0, n) in a fixed order, on any device. finish(sum) is called once, on that device, so
// that the host need not wait for results that remain there. f and finish are functors of plain numbers and
// addresses with a TRACEFLOW_HD operator(). T is a number, or a struct of such that starts at zeros and has a
// +=.
template <class T, class F, class G>
void ordered_sum(Device device, const char* description, int64_t n, const F& f, const G& finish,
                 int64_t grain) {
  if (device == Device::cpu) {
    finish(ordered_sum<T>(description, n, f, grain));
    return;
  }
  void (*const sum)(const char*, int64_t, const F&, const G&) = &cuda::sum_each_index<T, F, G>;
  require(sum != nullptr, "a sum has code for the CUDA device", description);
  sum(description, n, f, finish);
}

// A `finish` that stores the sum.
template <class T>
struct StoreSum {
  T* to;
  TRACEFLOW_HD void operator()(const T& sum) const { *to = sum; }
};

// A sum and the number of its terms.
struct CountedSum {
  double sum = 0;
  int64_t count = 0;
  TRACEFLOW_HD CountedSum& operator+=(const CountedSum& other) {
    sum += other.sum;
    count += other.count;
    return *this;
  }
};

}  // namespace traceflow
