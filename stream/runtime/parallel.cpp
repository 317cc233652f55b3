#include "stream/runtime/parallel.h"

#include <time.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <mutex>
#include <numeric>
#include <thread>
#include <utility>
#include <vector>

#include <tbb/global_control.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "stream/files/job_scope.h"
#include "stream/runtime/commit.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::chrono::milliseconds kStopCheck{100};

/// Held while a task is handed to the library, and when it begins and ends: so a checker of threads, which does not see what
/// the library orders, knows who may read it. Nobody's member: the task need not be read to find it.
std::mutex handover;
void show_order() {
  const std::lock_guard lock(handover);
}

/// Tasks of a pool that this thread is in.
thread_local int tasks_here = 0;
struct InTask {
  InTask() { ++tasks_here; }
  ~InTask() { --tasks_here; }
  InTask(const InTask&) = delete;
  InTask& operator=(const InTask&) = delete;
};

/// The failure of the lowest index.
class FirstFailure {
 public:
  void note(std::size_t index) {
    const std::lock_guard lock(mutex_);
    if (failure_ != nullptr && index >= index_.load()) return;
    failure_ = std::current_exception();
    index_.store(index);
  }
  bool failed() const { return index_.load() != kNone; }
  /// Whether a failure of this index would be the one to report.
  bool concerns(std::size_t index) const { return index < index_.load(); }
  /// \pre nobody calls note() any more
  void rethrow() const {
    if (failure_ != nullptr) std::rethrow_exception(failure_);
  }

 private:
  static constexpr std::size_t kNone = ~std::size_t{0};
  std::mutex mutex_;
  std::exception_ptr failure_;
  std::atomic<std::size_t> index_{kNone};
};

double thread_seconds() {
  timespec now = {};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

struct LoopClock::Impl {
  Impl* outer = nullptr;
  std::mutex mutex;
  LoopSeconds seconds;
};

/// What one thread does of a loop, for the clock of the thread that began it. Without a clock nothing is measured.
struct LoopShare {
  static thread_local LoopClock::Impl* current;

  /// \param begun_here  by the thread that began the loop
  LoopShare(LoopClock::Impl* of, bool begun_here)
      : clock(of), here(begun_here), outer(current), start(of ? thread_seconds() : 0.0) {
    current = nullptr;
  }
  ~LoopShare() {
    current = outer;
    if (!clock) return;
    const double took = thread_seconds() - start;
    const std::lock_guard lock(clock->mutex);
    clock->seconds.all += took;
    if (here) clock->seconds.here += took;
  }
  LoopShare(const LoopShare&) = delete;
  LoopShare& operator=(const LoopShare&) = delete;

  LoopClock::Impl* clock;
  bool here;
  LoopClock::Impl* outer;
  double start;
};
thread_local LoopClock::Impl* LoopShare::current = nullptr;

LoopClock::LoopClock() : impl_(std::make_unique<Impl>()) {
  impl_->outer = std::exchange(LoopShare::current, impl_.get());
}
LoopClock::~LoopClock() {
  LoopShare::current = impl_->outer;
}
LoopSeconds LoopClock::seconds() const {
  const std::lock_guard lock(impl_->mutex);
  return impl_->seconds;
}

void parallel_for(std::size_t count, const std::function<void(std::size_t)>& body) {
  // Both show a checker of threads what happens before what: it does not see what the library orders.
  std::atomic<std::size_t> next{0}, left{0};
  next.store(0);
  FirstFailure failure;
  const std::shared_ptr<const JobContext> job = current_job();
  LoopClock::Impl* const clock = LoopShare::current;
  const std::thread::id beginner = std::this_thread::get_id();
  const auto work = [&](std::size_t) {
    const JobScope of_job(job);
    const LoopShare share(clock, std::this_thread::get_id() == beginner);
    while (!failure.failed()) {
      const std::size_t index = next.fetch_add(1);
      if (index >= count) break;
      try {
        throw_if_stopped();
        body(index);
      } catch (...) {
        failure.note(index);
      }
    }
    left.fetch_add(1);
  };
  const auto loops =
      std::min<std::size_t>(count, static_cast<std::size_t>(tbb::this_task_arena::max_concurrency()));
  // Isolated: while it waits for its last index, this thread must not begin another task of the job, whose
  // memory and time would pile up on this one.
  tbb::this_task_arena::isolate(
      [&] { tbb::parallel_for(std::size_t{0}, loops, work, tbb::simple_partitioner()); });
  left.load();
  failure.rethrow();
}

namespace {

/// What is made on any thread, then taken step by step, every step in order and by one thread at a time.
class OrderedSteps {
 public:
  OrderedSteps(std::size_t window, std::vector<const std::function<void(std::size_t)>*> bodies, bool timed)
      : timed_(timed), freed_(window), made_(window, 0) {
    for (const auto* body : bodies) steps_.push_back({body});
  }

  void run(std::size_t index, const std::function<void(std::size_t)>& make) {
    try {
      std::unique_lock lock(mutex_);
      // The lowest index that is under way never waits. A stop signal may keep it from being begun.
      while (!freed_[index % freed_.size()].wait_for(
          lock, kStopCheck, [&] { return index < steps_.back().next + freed_.size() || failed_; }))
        throw_if_stopped();
      if (failed_) return;
      lock.unlock();
      make(index);
      lock.lock();
      made_[index % made_.size()] = 1;
      // Who is at a step finds what was made for it meanwhile; what it leaves to the next step may wait for this thread.
      for (std::size_t k = 0; k < steps_.size() && !failed_;) k = take(k, lock) ? 0 : k + 1;
    } catch (...) {
      const std::lock_guard lock(mutex_);
      failed_ = true;
      for (std::condition_variable& slot : freed_) slot.notify_all();
      throw;
    }
  }

  /// Processor seconds of the step that took most: what no number of threads makes shorter.
  double longest_seconds() const {
    double longest = 0.0;
    for (const Step& step : steps_) longest = std::max(longest, step.seconds);
    return longest;
  }

 private:
  struct Step {
    const std::function<void(std::size_t)>* body;
    std::size_t next = 0;  ///< index to be taken
    double seconds = 0.0;
    bool busy = false;
  };

  bool is_ready(std::size_t k) const {
    return k == 0 ? made_[steps_[0].next % made_.size()] != 0 : steps_[k].next < steps_[k - 1].next;
  }

  /// Takes all that is ready for step k, unless another thread does. \returns whether there was anything
  bool take(std::size_t k, std::unique_lock<std::mutex>& lock) {
    Step& step = steps_[k];
    if (step.busy || !is_ready(k)) return false;
    step.busy = true;
    while (is_ready(k) && !failed_) {
      if (k == 0) made_[step.next % made_.size()] = 0;
      lock.unlock();
      const double start = timed_ ? thread_seconds() : 0.0;
      (*step.body)(step.next);
      const double took = timed_ ? thread_seconds() - start : 0.0;
      lock.lock();
      step.seconds += took;
      const std::size_t slot = step.next++ % freed_.size();
      if (k + 1 == steps_.size()) freed_[slot].notify_all();
    }
    step.busy = false;
    return true;
  }

  const bool timed_;
  std::mutex mutex_;
  std::vector<std::condition_variable> freed_;  ///< by slot: few are woken in vain
  std::vector<std::uint8_t> made_;              ///< by slot, until the first step takes it
  std::vector<Step> steps_;
  bool failed_ = false;
};

}  // namespace

void parallel_in_order(std::size_t count, std::size_t window, const std::function<void(std::size_t)>& make,
                       const std::function<void(std::size_t)>& use,
                       const std::function<void(std::size_t)>& after) {
  std::vector<const std::function<void(std::size_t)>*> bodies = {&use};
  if (after) bodies.push_back(&after);
  LoopClock::Impl* const clock = LoopShare::current;
  OrderedSteps steps(window, bodies, clock != nullptr);
  parallel_for(count, [&](std::size_t index) { steps.run(index, make); });
  if (!clock) return;
  const std::lock_guard lock(clock->mutex);
  clock->seconds.in_order += steps.longest_seconds();
}

int core_count() {
  return static_cast<int>(std::max(1u, std::thread::hardware_concurrency()));
}

std::vector<std::size_t> start_order(std::span<const std::uint64_t> bytes, int threads) {
  constexpr std::size_t kFewPerThread = 6, kLastPerThread = 3;
  std::vector<std::size_t> order(bytes.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  if (threads <= 2) return order;
  const auto of_all = static_cast<std::size_t>(threads);
  const auto larger = [&](std::size_t a, std::size_t b) { return bytes[a] > bytes[b]; };
  std::stable_sort(order.begin(), order.end(), larger);
  if (order.size() > kFewPerThread * of_all)
    std::sort(order.begin(), order.end() - static_cast<std::ptrdiff_t>(kLastPerThread * of_all));
  return order;
}

struct WorkerPool::Impl {
  explicit Impl(int count)
      : threads(count),
        // One more than the workers: the dispatching thread only waits.
        control(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(count) + 1),
        arena(count, 0) {}
  int threads;
  tbb::global_control control;
  tbb::task_arena arena;
};

WorkerPool::WorkerPool(int threads) : impl_(std::make_unique<Impl>(threads > 0 ? threads : core_count())) {}
WorkerPool::~WorkerPool() = default;

int WorkerPool::threads() const {
  return impl_->threads;
}

void WorkerPool::run_tasks(std::size_t count, const std::function<std::uint64_t(std::size_t)>& bytes,
                           MemoryBudget& budget, const std::function<void(std::size_t)>& body,
                           TaskOrder order) {
  if (tasks_here > 0) {
    // The one worker that there may be is this thread: what waited here for another one would wait for ever.
    for (std::size_t index = 0; index < count; ++index) {
      throw_if_stopped();
      const MemoryBudget::Reservation reservation = budget.reserve(bytes(index));
      run_here([&] { body(index); });
    }
    return;
  }
  std::mutex mutex;
  std::condition_variable changed;
  int running = 0;
  FirstFailure failure;
  const std::shared_ptr<const JobContext> job = current_job();
  std::vector<std::uint64_t> needs;
  std::vector<std::size_t> starts;
  if (order == TaskOrder::kLargestFirst) {
    for (std::size_t index = 0; index < count; ++index) needs.push_back(bytes(index));
    starts = start_order(needs, impl_->threads);
  }
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t index = starts.empty() ? k : starts[k];
    if (!failure.concerns(index)) continue;
    {
      std::unique_lock lock(mutex);
      changed.wait(lock, [&] { return running < impl_->threads; });
    }
    try {
      throw_if_stopped();
      // Waits here, not on a worker: workers stay free for the loops of what runs.
      auto reserved = std::make_unique<MemoryBudget::Reservation>(
          budget.reserve(needs.empty() ? bytes(index) : needs[index]));
      if (!failure.concerns(index)) continue;
      {
        const std::lock_guard lock(mutex);
        ++running;
      }
      const std::lock_guard given(handover);
      impl_->arena.enqueue([&, index, taken = reserved.release()]() {
        show_order();
        const InTask in_task;
        std::unique_ptr<MemoryBudget::Reservation> reservation(taken);
        const JobScope of_job(job);
        try {
          throw_if_stopped();
          body(index);
        } catch (...) {
          failure.note(index);
        }
        reservation.reset();
        {
          const std::lock_guard lock(mutex);
          --running;
          changed.notify_all();
        }
        show_order();
      });
    } catch (const StoppedError&) {
      failure.note(index);
      break;
    } catch (...) {
      failure.note(index);
    }
  }
  {
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return running == 0; });
  }
  failure.rethrow();
}

void WorkerPool::run_here(const std::function<void()>& body) {
  impl_->arena.execute([&body, job = current_job()] {  // on another thread where none is left here
    const JobScope of_job(job);
    body();
  });
}

}  // namespace tessera
