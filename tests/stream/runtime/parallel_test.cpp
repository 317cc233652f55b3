#include "stream/runtime/parallel.h"

#include <algorithm>
#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <condition_variable>
#include <csignal>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "octree/error.h"
#include "stream/files/job_scope.h"
#include "stream/runtime/commit.h"
#include "stream/runtime/stop.h"

namespace parallel_test {

using namespace tessera;

namespace {

void pause_us(int us) {
  std::this_thread::sleep_for(std::chrono::microseconds(us));
}

/// Runs tasks that need one byte each.
void run_small(WorkerPool& pool, std::size_t count, const std::function<void(std::size_t)>& body) {
  MemoryBudget budget(1 << 20, 0);
  pool.run_tasks(
      count, [](std::size_t) { return std::uint64_t{1}; }, budget, body);
}

}  // namespace

TEST_CASE("parallel: a pool in a task of a pool runs its tasks, though there be one thread", "[unit]") {
  const int threads = GENERATE(1, 3);
  CAPTURE(threads);
  WorkerPool pool(threads);
  std::atomic<int> bodies{0}, loops{0};
  run_small(pool, 2, [&](std::size_t) {
    WorkerPool inner(threads);
    run_small(inner, 5, [&](std::size_t) {
      ++bodies;
      parallel_for(7, [&](std::size_t) { ++loops; });
    });
    CHECK_THROWS_AS(run_small(inner, 3,
                              [](std::size_t k) {
                                if (k == 1) throw EmptyError("one");
                              }),
                    EmptyError);
  });
  CHECK(bodies == 10);
  CHECK(loops == 70);
}

TEST_CASE("parallel: every index once, on any number of threads", "[unit]") {
  const int threads = GENERATE(1, 2, 5);
  CAPTURE(threads);
  WorkerPool pool(threads);
  std::vector<std::atomic<int>> tasks(97);
  std::vector<std::atomic<int>> loops(1000);
  run_small(pool, tasks.size(), [&](std::size_t k) { ++tasks[k]; });
  pool.run_here([&] { parallel_for(loops.size(), [&](std::size_t i) { ++loops[i]; }); });
  for (const auto& n : tasks) CHECK(n == 1);
  for (const auto& n : loops) CHECK(n == 1);
  run_small(pool, 0, [](std::size_t) { FAIL("no task"); });
  parallel_for(0, [](std::size_t) { FAIL("no index"); });
}

TEST_CASE("parallel: results are used in order, few at a time", "[unit]") {
  const int threads = GENERATE(1, 2, 5);
  const std::size_t window = GENERATE(1u, 3u, 8u);
  CAPTURE(threads, window);
  WorkerPool pool(threads);
  std::vector<std::size_t> ring(window), used;
  std::atomic<std::size_t> ended{0};
  pool.run_here([&] {
    parallel_in_order(
        200, window,
        [&](std::size_t i) {
          CHECK(i < ended + window);
          if (i % 7 == 0) pause_us(300);
          ring[i % window] = i * i;
        },
        [&](std::size_t i) {
          CHECK(ring[i % window] == i * i);
          used.push_back(i);
          ++ended;
        });
  });
  CHECK(used.size() == 200);
  CHECK(std::is_sorted(used.begin(), used.end()));
}

TEST_CASE("parallel: what follows a use keeps the order and the ring, beside the next use", "[unit]") {
  const int threads = GENERATE(1, 2, 5);
  const std::size_t window = GENERATE(1u, 3u, 8u);
  CAPTURE(threads, window);
  WorkerPool pool(threads);
  std::vector<std::size_t> ring(window), used, followed;
  std::atomic<std::size_t> uses{0}, ended{0};
  std::atomic<bool> beside{false};
  std::atomic<int> busy{0}, wrong{0};
  const auto slow = [&](std::size_t i) {
    if (++busy > 1) beside = true;
    if (i % 5 == 0) pause_us(300);
    --busy;
  };
  pool.run_here([&] {
    parallel_in_order(
        200, window,
        [&](std::size_t i) {
          wrong += i >= ended + window;
          ring[i % window] = i * i;
        },
        [&](std::size_t i) {
          slow(i);
          wrong += ring[i % window] != i * i;
          used.push_back(i);
          ++uses;
        },
        [&](std::size_t i) {
          wrong += uses <= i;
          slow(i);
          wrong += ring[i % window] != i * i;
          followed.push_back(i);
          ++ended;
        });
  });
  CHECK(wrong == 0);
  CHECK(used.size() == 200);
  CHECK(std::is_sorted(used.begin(), used.end()));
  CHECK(used == followed);
  if (threads == 5 && window == 8) CHECK(beside);
  if (threads == 1) CHECK_FALSE(beside);
}

TEST_CASE("parallel: a failure in order ends the loop, waiting threads too", "[fault]") {
  const int where = GENERATE(0, 1, 2);
  WorkerPool pool(5);
  const std::function<void(std::size_t)> fail_at = [](std::size_t i) {
    if (i == 20) throw std::runtime_error("20");
  };
  const std::function<void(std::size_t)> pass = [](std::size_t) {};
  CHECK_THROWS_WITH(pool.run_here([&] {
    parallel_in_order(1000, 2, where == 0 ? fail_at : pass, where == 1 ? fail_at : pass,
                      where == 2 ? fail_at : pass);
  }),
                    "20");
}

TEST_CASE("parallel: no more tasks at once than threads", "[property]") {
  for (const int threads : {1, 2, 3}) {
    WorkerPool pool(threads);
    std::atomic<int> running{0};
    std::atomic<int> maximum{0};
    run_small(pool, 60, [&](std::size_t) {
      const int now = ++running;
      for (int seen = maximum; now > seen && !maximum.compare_exchange_weak(seen, now);) {
      }
      pause_us(500);
      --running;
    });
    CHECK(maximum <= threads);
    CHECK(maximum >= 1);
  }
}

TEST_CASE("parallel: loops inside tasks use the idle threads", "[property]") {
  WorkerPool pool(4);
  std::set<std::thread::id> ids;
  std::mutex mutex;
  // A busy machine may take its time to begin a thread: the first index waits for another one.
  std::condition_variable joined;
  run_small(pool, 1, [&](std::size_t) {
    parallel_for(64, [&](std::size_t i) {
      std::unique_lock lock(mutex);
      ids.insert(std::this_thread::get_id());
      joined.notify_all();
      if (i == 0) joined.wait_for(lock, std::chrono::seconds(60), [&] { return ids.size() > 1; });
    });
  });
  CHECK(ids.size() > 1);
  CHECK(ids.size() <= 4);
}

TEST_CASE("parallel: a task waiting in its loop never begins another task on top", "[property]") {
  WorkerPool pool(3);
  thread_local int depth = 0;
  std::atomic<bool> nested{false};
  run_small(pool, 40, [&](std::size_t) {
    if (++depth > 1) nested = true;
    parallel_for(8, [](std::size_t i) { pause_us(i == 0 ? 1500 : 100); });
    --depth;
  });
  CHECK_FALSE(nested);
}

TEST_CASE("parallel: of many failures the lowest is reported, every time", "[property]") {
  WorkerPool pool(4);
  for (int round = 0; round < 30; ++round) {
    std::atomic<int> started{0};
    const auto body = [&](std::size_t i) {
      ++started;
      if (i >= 7) throw InputError("index " + std::to_string(i));
      pause_us(300);  // the low ones are late
    };
    CHECK_THROWS_WITH(run_small(pool, 500, body), "index 7");
    CHECK(started < 500);
    CHECK_THROWS_WITH(pool.run_here([&] { parallel_for(500, body); }), "index 7");
  }
}

TEST_CASE("parallel: large tasks begin first where there are few, the smallest last where there are many",
          "[unit]") {
  using Order = std::vector<std::size_t>;
  const std::vector<std::uint64_t> few = {3, 9, 3, 7, 9, 1};
  CHECK(start_order(few, 3) == Order{1, 4, 3, 0, 2, 5});
  CHECK(start_order(few, 2) == Order{0, 1, 2, 3, 4, 5});
  CHECK(start_order({}, 4).empty());
  std::vector<std::uint64_t> many(40);
  for (std::size_t k = 0; k < many.size(); ++k) many[k] = 100 + k * 7 % 40;  // all of them differ
  const Order order = start_order(many, 3);
  Order sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (std::size_t k = 0; k < sorted.size(); ++k) CHECK(sorted[k] == k);
  const auto last = std::is_sorted_until(order.begin(), order.end());
  CHECK(last - order.begin() >= 20);
  CHECK(order.end() - last >= 8);
  const auto larger = [&](std::size_t a, std::size_t b) { return many[a] > many[b]; };
  CHECK(std::is_sorted(last, order.end(), larger));
  for (auto k = order.begin(); k != last; ++k)
    if (many[*k] < many[*last]) CHECK(k + 1 == last);
}

TEST_CASE("parallel: with large tasks first the lowest failure is reported, and the budget is kept",
          "[property]") {
  for (const int threads : {1, 3, 4}) {
    CAPTURE(threads);
    WorkerPool pool(threads);
    MemoryBudget budget(3200, 0);  // capacity 3100
    std::vector<std::size_t> begun;
    std::mutex mutex;
    std::atomic<std::uint64_t> taken{0};
    std::atomic<bool> exceeded{false};
    const auto bytes = [](std::size_t k) { return std::uint64_t{100 + 200 * k}; };  // the last are largest
    const auto run = [&](const std::function<void(std::size_t)>& body) {
      begun.clear();
      pool.run_tasks(
          12, bytes, budget,
          [&](std::size_t k) {
            if ((taken += bytes(k)) > 3100) exceeded = true;
            {
              const std::lock_guard lock(mutex);
              begun.push_back(k);
            }
            pause_us(300);
            taken -= bytes(k);
            body(k);
          },
          TaskOrder::kLargestFirst);
    };
    run([](std::size_t) {});
    CHECK(begun.size() == 12);
    CHECK(begun.front() == (threads < 3 ? 0u : 11u));
    for (int round = 0; round < 10; ++round)
      CHECK_THROWS_WITH(run([](std::size_t k) {
                          if (k == 3 || k == 6 || k == 11) throw InputError("index " + std::to_string(k));
                        }),
                        "index 3");
    CHECK_THROWS_AS(run([&](std::size_t k) {
                      if (k == (threads < 3 ? 0u : 11u)) request_stop(SIGINT);
                    }),
                    StoppedError);
    CHECK(begun.size() < 12);
    request_stop(0);
    CHECK_FALSE(exceeded);
    CHECK(budget.reserved() == 0);
  }
}

TEST_CASE("parallel: a failure inside a loop inside a task comes out", "[unit]") {
  WorkerPool pool(2);
  CHECK_THROWS_AS(run_small(pool, 4,
                            [](std::size_t k) {
                              parallel_for(10, [k](std::size_t i) {
                                if (k == 2 && i == 5) throw ResourceError("full");
                              });
                            }),
                  ResourceError);
}

TEST_CASE("parallel: tasks over the budget run one after another, and none waits for ever", "[property]") {
  WorkerPool pool(4);
  MemoryBudget budget(3200, 0);  // capacity 3100
  std::atomic<std::uint64_t> taken{0};
  std::atomic<bool> exceeded{false};
  pool.run_tasks(
      50, [](std::size_t k) { return std::uint64_t{k % 5 == 0 ? 3100u : 900u}; }, budget,
      [&](std::size_t k) {
        const std::uint64_t need = k % 5 == 0 ? 3100 : 900;
        if ((taken += need) > 3100) exceeded = true;
        pause_us(300);
        taken -= need;
      });
  CHECK_FALSE(exceeded);
  CHECK(budget.reserved() == 0);
  CHECK_THROWS_AS(pool.run_tasks(
                      1, [](std::size_t) { return std::uint64_t{3101}; }, budget, [](std::size_t) {}),
                  ResourceError);
}

TEST_CASE("parallel: a stop signal ends the work between pieces", "[unit]") {
  WorkerPool pool(2);
  std::atomic<int> started{0};
  request_stop(SIGTERM);
  CHECK_THROWS_AS(run_small(pool, 100, [&](std::size_t) { ++started; }), StoppedError);
  CHECK(started == 0);
  request_stop(0);
  CHECK_THROWS_AS(run_small(pool, 100,
                            [&](std::size_t k) {
                              if (k == 5) request_stop(SIGINT);
                              ++started;
                            }),
                  StoppedError);
  CHECK(stop_signal() == SIGINT);
  CHECK(started >= 5);
  CHECK(started < 20);
  request_stop(0);
}

TEST_CASE("parallel: threads are of the job that they work for, and stop with it alone", "[unit]") {
  WorkerPool pool(3);
  const auto job = std::make_shared<JobContext>();
  std::atomic<int> others{0}, seen{0};
  const auto look = [&] {
    ++seen;
    others += current_job() != job;
  };
  {
    const JobScope of_job(job);
    run_small(pool, 20, [&](std::size_t) {
      look();
      parallel_for(5, [&](std::size_t) { look(); });
    });
    pool.run_here([&] { parallel_for(50, [&](std::size_t) { look(); }); });
    CHECK(seen == 20 + 100 + 50);
    CHECK(others == 0);
    const auto other = std::make_shared<JobContext>();
    job->stop = SIGINT;
    CHECK(stop_signal() == SIGINT);
    CHECK_THROWS_AS(run_small(pool, 1, [](std::size_t) {}), StoppedError);
    const JobScope of_other(other);
    CHECK(stop_signal() == 0);
    std::atomic<int> done{0};
    run_small(pool, 20, [&](std::size_t) { ++done; });
    CHECK(done == 20);
  }
  CHECK(current_job() == nullptr);
  run_small(pool, 20, [&](std::size_t) { others += current_job() != nullptr; });
  CHECK(others == 0);
}

TEST_CASE("parallel: a clock counts what loops take on all threads, loops inside loops once", "[unit]") {
  std::atomic<std::uint64_t> sum{0};
  const auto busy = [&](std::size_t) {
    for (int k = 0; k < 3000000; ++k) sum.fetch_add(static_cast<std::uint64_t>(k), std::memory_order_relaxed);
  };
  LoopSeconds loop, ordered;
  WorkerPool pool(3);
  pool.run_here([&] {
    const LoopClock clock;
    busy(0);
    CHECK(clock.seconds().all == 0.0);
    parallel_for(6, [&](std::size_t) { parallel_for(2, busy); });
    loop = clock.seconds();
    {
      const LoopClock inner;
      parallel_in_order(6, 3, busy, busy);
      ordered = inner.seconds();
    }
    CHECK(clock.seconds().all == loop.all);
  });
  CHECK(loop.all > 0.0);
  CHECK(loop.here <= loop.all);
  CHECK(loop.in_order == 0.0);
  CHECK(ordered.in_order > 0.0);
  CHECK(ordered.in_order < ordered.all);
}

}  // namespace parallel_test
