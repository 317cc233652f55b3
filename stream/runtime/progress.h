/// \file progress.h
/// How far a job is: a bar, plain lines or JSON lines, written through a sink (only tools/ prints). Also
/// watches the memory of the process while a stage runs.
#pragma once
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>  // of the ticker: it draws while the workers are busy or asleep, and does none of their work

namespace tessera {

/// Where lines of progress go. An empty `write` means nowhere.
struct ProgressSink {
  std::function<void(const std::string&)> write;  ///< text as is, newlines included
  bool terminal = false;                          ///< a bar may be redrawn
};

/// How far a job is, for programs.
struct JobProgress {
  std::string stage;
  std::size_t stage_index = 0, stages = 0;  ///< from 0
  std::string unit;                         ///< of what follows: points, bricks, faces
  std::uint64_t done = 0, total = 0;        ///< total 0: not known
  double seconds = 0.0;                     ///< of this stage in this run
  bool stage_done = false;
};

/// As ProgressSink::write: every line of text is dropped, and `take` is called twenty times a second and at the end of every stage,
/// from a thread of the job, whatever the job's --progress says.
struct ProgressNotes {
  std::function<void(const JobProgress&)> take;
  void operator()(const std::string&) const {}
};

enum class ProgressMode { kNone, kBar, kPlain, kJson };
/// "auto" is a bar on a terminal, else plain lines; a bar needs a terminal. \throws UsageError for an unknown name
ProgressMode progress_mode(const std::string& name, bool terminal, int verbosity);

class Progress {
 public:
  Progress(ProgressMode mode, ProgressSink sink);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// \param index  of `count` stages, from 0; \param done  units that an earlier run had done
  void begin_stage(const std::string& name, std::size_t index, std::size_t count, const std::string& unit,
                   std::uint64_t total, std::uint64_t done);
  /// Any thread.
  void advance(std::uint64_t units) { done_.fetch_add(units, std::memory_order_relaxed); }
  /// Peak resident bytes seen since begin_stage(): exact when it is the highest so far, else sampled.
  std::uint64_t stage_peak_bytes();
  void end_stage();
  /// One line in between, in every mode but none.
  void say(const std::string& text);

 private:
  void watch();
  std::string line(double seconds, std::uint64_t done) const;
  void draw(bool last);

  ProgressMode mode_;
  ProgressSink sink_;
  std::atomic<std::uint64_t> done_{0};
  std::mutex mutex_;
  std::condition_variable wake_;
  bool active_ = false;
  bool quit_ = false;
  std::string name_, unit_;
  std::size_t index_ = 0, count_ = 0;
  std::uint64_t total_ = 0, before_ = 0;
  std::uint64_t peak_before_ = 0, sampled_peak_ = 0;
  std::chrono::steady_clock::time_point start_, next_line_;
  std::thread thread_;
};

}  // namespace tessera
