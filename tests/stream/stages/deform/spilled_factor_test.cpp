// A factor that memory holds in part: what is read does not depend on what is held, and only what is not goes to disk.
#include "stream/stages/deform/spilled_factor.h"

#include <catch2/catch.hpp>
#include <numeric>

#include "octree/error.h"
#include "tests/helpers/temp_folder.h"

namespace spilled_factor_test {

namespace {

using namespace tessera;

constexpr std::size_t kRun = 1000, kRuns = 20, kAll = kRun * kRuns;

}  // namespace

TEST_CASE("spilled factor: the same numbers whatever is held", "[unit]") {
  const test::TempFolder folder;
  std::vector<double> numbers(kAll);
  std::iota(numbers.begin(), numbers.end(), 0.5);
  // None, some runs and a bit, all.
  const auto [held, spilled] =
      GENERATE(table<std::size_t, std::size_t>({{0, kAll}, {3500, kAll - 3000}, {kAll, 0}}));
  CAPTURE(held);
  SpilledFactor factor(folder.path(), 8 * held);
  factor.reserve(kAll);
  for (std::size_t run = 0; run < kRuns; ++run) factor.append(std::span(numbers).subspan(run * kRun, kRun));
  CHECK(factor.size() == kAll);
  CHECK(factor.spilled_bytes() == 8 * spilled);
  // Forwards, backwards, and across the place where memory ends.
  for (const std::size_t size : {std::size_t{1}, kRun - 1, kRun, 3 * kRun})
    for (const bool backwards : {false, true})
      for (std::size_t k = 0; (k + 1) * size <= kAll; k += size == 1 ? 97 : 1) {
        const std::size_t first = backwards ? kAll - (k + 1) * size : k * size;
        std::vector<double> buffer(size);
        const std::span<const double> read = factor.read(first, buffer);
        REQUIRE(std::vector<double>(read.begin(), read.end()) ==
                std::vector<double>(numbers.begin() + static_cast<std::ptrdiff_t>(first),
                                    numbers.begin() + static_cast<std::ptrdiff_t>(first + size)));
      }
}

TEST_CASE("spilled factor: a folder is asked for only where memory does not do", "[fault]") {
  const test::TempFolder folder;
  const std::vector<double> numbers(10, 1.0);
  SpilledFactor fits(folder.path() / "none", 80), spills(folder.path() / "none", 79);
  fits.append(numbers);
  CHECK_THROWS_AS(spills.append(numbers), ResourceError);
}

}  // namespace spilled_factor_test
