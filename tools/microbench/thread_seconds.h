/// \file thread_seconds.h
/// The clock of the small programs.
#pragma once
#include <ctime>

namespace tessera {

/// Processor time of this thread: other jobs on the machine do not count.
inline double thread_seconds() {
  timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return static_cast<double>(t.tv_sec) + 1e-9 * static_cast<double>(t.tv_nsec);
}

}  // namespace tessera
