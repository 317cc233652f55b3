#include "stream/stop.h"

#include <atomic>
#include <csignal>

#include "octree/error.h"

namespace tessera {
namespace {

std::atomic<int> received_signal{0};
static_assert(std::atomic<int>::is_always_lock_free, "a signal handler may not lock");

extern "C" void note_signal(int number) {
  received_signal.store(number);
}

}  // namespace

void catch_stop_signals() {
  struct sigaction action = {};
  action.sa_handler = note_signal;
  sigemptyset(&action.sa_mask);
  // RESETHAND: the second signal finds the default action, for a user who does not want to wait.
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

int stop_signal() {
  return received_signal.load();
}

void throw_if_stopped() {
  if (stop_signal() != 0) throw StoppedError("stopped by a signal");
}

}  // namespace tessera
