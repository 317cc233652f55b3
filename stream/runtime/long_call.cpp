#include "stream/runtime/long_call.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <exception>
#include <memory>
#include <mutex>
#include <thread>
#include <utility>

#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::chrono::milliseconds kLook{50}, kPatience{500};

std::atomic<int> left_behind{0};

struct Call {
  std::mutex mutex;
  std::condition_variable changed;
  bool done = false, left = false;
  std::exception_ptr failure;
};

}  // namespace

void long_call(std::function<void()> work) {
  const auto call = std::make_shared<Call>();
  std::thread([call, work = std::move(work)]() mutable {
    std::exception_ptr failure;
    try {
      work();
    } catch (...) {
      failure = std::current_exception();
    }
    work = nullptr;  // what it owns goes before anybody is told
    const std::lock_guard lock(call->mutex);
    call->failure = failure;
    call->done = true;
    if (call->left) --left_behind;
    call->changed.notify_all();
  }).detach();
  std::unique_lock lock(call->mutex);
  std::chrono::milliseconds waited{0};
  while (!call->changed.wait_for(lock, kLook, [&] { return call->done; })) {
    if (stop_signal() == 0 || (waited += kLook) < kPatience) continue;
    call->left = true;
    ++left_behind;
    break;
  }
  if (call->left) throw_if_stopped();
  if (call->failure) std::rethrow_exception(call->failure);
}

bool work_left_behind() {
  return left_behind.load() > 0;
}

}  // namespace tessera
