/// \file single_thread.h
/// Holds the BLAS and OpenMP inside the libraries to the calling thread while it lives.
#pragma once

namespace tessera::test {

/// OpenMP regions entered by this thread run on it alone; OpenBLAS, if that is the BLAS, uses one thread from
/// now on.
class SingleThread {
 public:
  SingleThread();
  ~SingleThread();
  SingleThread(const SingleThread&) = delete;
  SingleThread& operator=(const SingleThread&) = delete;

 private:
  int levels_;
};

}  // namespace tessera::test
