/// \file patient_call.h
/// Work that Python waits for: signals and progress reach the caller, readers run ahead of who takes from them.
#pragma once
#include <pybind11/pybind11.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <exception>
#include <functional>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

namespace tessera::python {

namespace py = pybind11;

/// Work on a thread of its own, while this one looks for signals of Python, and for what there is to tell.
class PatientCall {
 public:
  /// \param tell  called with the interpreter held, about ten times a second; what it throws stops the work
  /// \param stop  asks the work to end; any thread
  static void run(const std::function<void()>& work, const std::function<void()>& tell,
                  const std::function<void()>& stop) {
    std::mutex mutex;
    std::condition_variable ended;
    bool done = false;
    std::exception_ptr failure, thrown;
    std::thread worker([&] {
      try {
        work();
      } catch (...) {
        failure = std::current_exception();
      }
      const std::lock_guard lock(mutex);
      done = true;
      ended.notify_all();
    });
    for (;;) {
      {
        const py::gil_scoped_release free;
        std::unique_lock lock(mutex);
        if (ended.wait_for(lock, std::chrono::milliseconds(100), [&] { return done; })) break;
      }
      if (thrown) continue;
      try {
        if (PyErr_CheckSignals() != 0) throw py::error_already_set();
        tell();
      } catch (...) {
        thrown = std::current_exception();
        stop();
      }
    }
    {
      const py::gil_scoped_release free;
      worker.join();
    }
    if (thrown) std::rethrow_exception(thrown);
    if (failure) std::rethrow_exception(failure);
    tell();
  }
};

/// Pieces that a reader hands out, two ahead of who takes them.
template <class Piece>
class PieceQueue {
 public:
  explicit PieceQueue(std::function<void(const std::function<void(Piece&&)>&)> read)
      : worker_([this, read = std::move(read)] {
          try {
            read([this](Piece&& piece) { put(std::move(piece)); });
          } catch (const Closed&) {
          } catch (...) {
            failure_ = std::current_exception();
          }
          const std::lock_guard lock(mutex_);
          ended_ = true;
          changed_.notify_all();
        }) {}
  ~PieceQueue() {
    {
      const std::lock_guard lock(mutex_);
      closed_ = true;
      changed_.notify_all();
    }
    worker_.join();
  }
  /// The next one, nothing at the end.
  std::optional<Piece> take() {
    std::optional<Piece> piece;
    {
      const py::gil_scoped_release free;
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [&] { return ended_ || !waiting_.empty(); });
      if (!waiting_.empty()) {
        piece = std::move(waiting_.front());
        waiting_.pop_front();
        changed_.notify_all();
      }
    }
    if (!piece && failure_) std::rethrow_exception(std::exchange(failure_, nullptr));
    return piece;
  }

 private:
  struct Closed {};
  void put(Piece&& piece) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return closed_ || waiting_.size() < 2; });
    if (closed_) throw Closed();
    waiting_.push_back(std::move(piece));
    changed_.notify_all();
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<Piece> waiting_;
  bool ended_ = false, closed_ = false;
  std::exception_ptr failure_;
  std::thread worker_;
};

}  // namespace tessera::python
