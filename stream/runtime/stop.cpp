#include "stream/runtime/stop.h"

#include <atomic>
#include <csignal>
#include <cstdint>
#include <ctime>

#include "octree/error.h"
#include "stream/files/fault.h"
#include "stream/files/job_scope.h"

namespace tessera {
namespace {

std::atomic<int> received_signal{0};
std::atomic<std::int64_t> received_at{0};
static_assert(std::atomic<int>::is_always_lock_free && std::atomic<std::int64_t>::is_always_lock_free,
              "a signal handler may not lock");
constexpr std::int64_t kPatienceSeconds = 2;

/// Supervisors often send a signal to the process and to its group, so that it comes twice at once; a second
/// one by a user who does not want to wait comes later and kills.
extern "C" void note_signal(int number) {
  timespec now = {};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  if (received_signal.load() == 0) {
    received_at.store(now.tv_sec);
    received_signal.store(number);
  } else if (now.tv_sec - received_at.load() >= kPatienceSeconds) {
    std::signal(number, SIG_DFL);
    std::raise(number);
  }
}

}  // namespace

void catch_stop_signals() {
  struct sigaction action = {};
  action.sa_handler = note_signal;
  sigemptyset(&action.sa_mask);
  action.sa_flags = SA_RESTART;
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

int stop_signal() {
  if (const int received = received_signal.load(); received != 0) return received;
  const auto job = current_job();
  return job == nullptr ? 0 : job->stop.load();
}

void request_stop(int signal) {
  received_signal.store(signal);
}

void throw_if_stopped() {
  fault_point(FaultPoint::kStop);
  if (stop_signal() != 0) throw StoppedError("stopped by a signal");
}

}  // namespace tessera
