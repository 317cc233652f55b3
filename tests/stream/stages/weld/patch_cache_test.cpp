// What tasks keep of patches: as much as may be, and of it what was asked for last.
#include "stream/stages/weld/patch_cache.h"

#include <catch2/catch.hpp>

#include <vector>

namespace patch_cache_test {

using namespace tessera;

namespace {

struct Read {
  std::vector<char> held;
  std::uint64_t bytes() const { return held.size(); }
};

/// Asks for patches one by one. \returns those that were loaded
std::vector<std::size_t> loaded(PatchCache<Read>& cache, const std::vector<std::size_t>& asked) {
  std::vector<std::size_t> loads;
  for (const std::size_t patch : asked) {
    const Read& got = cache.get(patch, [&](Read& out) {
      loads.push_back(patch);
      out.held.assign(100, static_cast<char>(patch));
    });
    CHECK(got.held == std::vector<char>(100, static_cast<char>(patch)));
  }
  return loads;
}

}  // namespace

TEST_CASE("patch cache: what was not asked for the longest time goes first, whatever its number", "[unit]") {
  PatchCache<Read> cache(250);  // goes beyond by one: three
  CHECK(loaded(cache, {7, 5, 9, 5, 7}) == std::vector<std::size_t>{7, 5, 9});
  CHECK(loaded(cache, {1}) == std::vector<std::size_t>{1});  // 9 goes
  CHECK(cache.find(9) == nullptr);
  REQUIRE(cache.find(5) != nullptr);
  CHECK(cache.find(5)->held.front() == 5);
  CHECK(loaded(cache, {2, 5, 1}) == std::vector<std::size_t>{2});  // 7 goes: 5 was looked at
  CHECK(loaded(cache, {7}) == std::vector<std::size_t>{7});
}

TEST_CASE("patch cache: patches around a place are read once, however many lie ahead", "[unit]") {
  PatchCache<Read> cache(800);
  loaded(cache, {100, 101, 102, 103, 104, 105, 106, 107, 108});  // what comes later in the order of bricks
  std::vector<std::size_t> around;
  for (int round = 0; round < 5; ++round) around.insert(around.end(), {1, 2, 3, 4});
  CHECK(loaded(cache, around) == std::vector<std::size_t>{1, 2, 3, 4});
}

}  // namespace patch_cache_test
