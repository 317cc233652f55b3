#include "kernels/decimate/cost_queue.h"

#include <catch2/catch.hpp>

#include <vector>

namespace tessera::cost_queue_test {

TEST_CASE("cost queue: lowest class first, first in first out inside one, pushes in between count",
          "[unit]") {
  CostQueue<4> queue(6);
  std::uint32_t item = 0, cost = 0;
  CHECK_FALSE(queue.pop(item, cost));
  queue.push(5, 2);
  queue.push(1, 3);
  queue.push(4, 2);
  queue.push(0, 2);
  CHECK(queue.contains(4));
  CHECK_FALSE(queue.contains(2));
  std::vector<std::uint32_t> order;
  REQUIRE(queue.pop(item, cost));
  order.push_back(item);
  CHECK(cost == 2);
  queue.push(2, 1);  // cheaper than what is left
  queue.push(5, 2);  // again, now behind 0
  while (queue.pop(item, cost)) order.push_back(item);
  CHECK(order == std::vector<std::uint32_t>{5, 2, 4, 0, 5, 1});
  CHECK_FALSE(queue.contains(1));
}

TEST_CASE("cost class: eight to a factor of two, ascending, the ends shared", "[unit]") {
  CHECK(cost_class(0.0, 4000) == 0);
  CHECK(cost_class(-1.0, 4000) == 0);
  CHECK(cost_class(0x1p-200, 4000) == 0);
  CHECK(cost_class(0x1p-199, 4000) == 9);
  CHECK(cost_class(2.0, 4000) == cost_class(1.0, 4000) + 8);
  CHECK(cost_class(1.12, 4000) == cost_class(1.0, 4000));
  CHECK(cost_class(1.125, 4000) == cost_class(1.0, 4000) + 1);
  CHECK(cost_class(1e300, 100) == 99);
}

}  // namespace tessera::cost_queue_test
