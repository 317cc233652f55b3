// Work that cannot be asked to stop: waited for, its failures told, left behind once the user does not want to wait.
#include "stream/runtime/long_call.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <chrono>
#include <csignal>
#include <memory>
#include <thread>

#include "octree/error.h"
#include "stream/runtime/stop.h"

namespace long_call_test {

using namespace tessera;

TEST_CASE("long call: is waited for, and tells what failed", "[unit]") {
  const auto result = std::make_shared<int>(0);
  long_call([result] { *result = 7; });
  CHECK(*result == 7);
  CHECK_FALSE(work_left_behind());
  CHECK_THROWS_WITH(long_call([] { throw InputError("no such luck"); }), Catch::Contains("no such luck"));
}

TEST_CASE("long call: is left behind after a signal", "[unit]") {
  const auto release = std::make_shared<std::atomic<bool>>(false);
  std::thread user([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    request_stop(SIGTERM);
  });
  const auto start = std::chrono::steady_clock::now();
  CHECK_THROWS_AS(long_call([release] {
                    while (!*release) std::this_thread::sleep_for(std::chrono::milliseconds(5));
                  }),
                  StoppedError);
  CHECK(std::chrono::steady_clock::now() - start < std::chrono::seconds(10));
  CHECK(work_left_behind());
  *release = true;
  for (int look = 0; look < 1000 && work_left_behind(); ++look)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  CHECK_FALSE(work_left_behind());
  user.join();
  request_stop(0);
}

}  // namespace long_call_test
