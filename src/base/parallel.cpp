#include "base/parallel.h"

#include <omp.h>

namespace traceflow {

namespace {
int chosen_threads = 0;
}  // namespace

void set_threads(int count) { chosen_threads = std::max(0, count); }

int thread_count() { return chosen_threads > 0 ? chosen_threads : omp_get_num_procs(); }

}  // namespace traceflow
