/// \file parallel.h
/// The one place where threads come from. Workers sleep when there is nothing to do; results belong to
/// indices, never to threads; of several failures the one with the lowest index is reported.
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

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
/// i - window: the results on their way fit a ring of `window` slots. Of failures of several indices at once any may be the one
/// that is thrown. \pre window >= 1
void parallel_in_order(std::size_t count, std::size_t window, const std::function<void(std::size_t)>& make,
                       const std::function<void(std::size_t)>& use,
                       const std::function<void(std::size_t)>& after = {});

/// Hardware threads, at least 1.
int core_count();

/// Which tasks begin before others.
enum class TaskOrder {
  kIndex,         ///< in ascending order
  kLargestFirst,  ///< as start_order() says
};
/// The order in which tasks of so many bytes begin, so that no thread is left with a large one when the others are done: on
/// three threads and more the largest first, ties by index. Where there are many tasks for each thread, that holds of the
/// smallest alone, which come last: neighbours find in memory what they share. On one or two, where nothing is gained, by index.
std::vector<std::size_t> start_order(std::span<const std::uint64_t> bytes, int threads);

/// A number of threads and a budget. One per job.
class WorkerPool {
 public:
  /// \param threads  0 = all cores; also limits the libraries that use TBB
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  int threads() const;

  /// Runs body(k) for every k of [0, count), at most `threads` at once, each with bytes(k) of the budget reserved. The
  /// calling thread waits; idle threads help loops inside running bodies. After a failure lower indices alone still start,
  /// so that of the lowest of all is thrown in any order; after a stop signal none does.
  /// \param order  of starts; kLargestFirst asks for all bytes before the first
  /// \throws ResourceError when bytes(k) exceeds budget.capacity() for some k
  void run_tasks(std::size_t count, const std::function<std::uint64_t(std::size_t)>& bytes,
                 MemoryBudget& budget, const std::function<void(std::size_t)>& body,
                 TaskOrder order = TaskOrder::kIndex);
  /// Runs body here, with parallel loops on the pool's threads.
  void run_here(const std::function<void()>& body);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace tessera
