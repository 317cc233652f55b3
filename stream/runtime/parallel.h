/// \file parallel.h
/// The one place where threads come from. Workers sleep when there is nothing to do; results belong to
/// indices, never to threads; of several failures the one with the lowest index is reported.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "stream/runtime/memory_budget.h"

namespace tessera {

/// Calls body(i) for every i of [0, count), each once, on the threads of the enclosing WorkerPool (on the
/// calling thread alone where there is none). May be nested: the caller works along and never takes up
/// unrelated work meanwhile. Indices start in ascending order; after a failure or a stop signal no further
/// one starts, those running end, and the failure of the lowest index is thrown (lower indices had all been
/// started, so it is always the same). \throws what body throws; StoppedError after a stop signal
void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body);

/// Calls make(i) for every i of [0, count) as parallel_for does, and use(i) after it, in ascending order and one at a
/// time; then `after(i)`, if there is one, in the same way, beside use() of later ones. make(i) begins when all is done with
/// i - window: the results on their way fit a ring of `window` slots. \pre window >= 1
void parallel_in_order(std::size_t count, std::size_t window, const std::function<void(std::size_t)>& make,
                       const std::function<void(std::size_t)>& use,
                       const std::function<void(std::size_t)>& after = {});

/// Hardware threads, at least 1.
int core_count();

/// A number of threads and a budget. One per job.
class WorkerPool {
 public:
  /// \param threads  0 = all cores; also limits the libraries that use TBB
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  int threads() const;

  /// Runs body(k) for every k of [0, count), in ascending order of start, at most `threads` at once, each with
  /// bytes(k) of the budget reserved. The calling thread waits; idle threads help loops inside running bodies.
  /// Failures as in parallel_for.
  /// \throws ResourceError when bytes(k) exceeds budget.capacity() for some k
  void run_tasks(std::size_t count, const std::function<std::uint64_t(std::size_t)>& bytes,
                 MemoryBudget& budget, const std::function<void(std::size_t)>& body);
  /// Runs body here, with parallel loops on the pool's threads.
  void run_here(const std::function<void()>& body);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
