#include "tests/helpers/single_thread.h"

#include <omp.h>

// There when the BLAS is OpenBLAS. The reference BLAS has no threads and no such function.
extern "C" __attribute__((weak)) void openblas_set_num_threads(int count);

namespace tessera::test {

SingleThread::SingleThread() : levels_(omp_get_max_active_levels()) {
  // CHOLMOD asks for four threads by name, which omp_set_num_threads cannot overrule; no active level can.
  omp_set_max_active_levels(0);
  if (openblas_set_num_threads != nullptr) openblas_set_num_threads(1);
}

SingleThread::~SingleThread() {
  omp_set_max_active_levels(levels_);
}

}  // namespace tessera::test
