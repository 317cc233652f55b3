// The factor of a coarse system in a file: what is read does not depend on what is held.
#include "stream/stages/smooth/factor_file.h"

#include <catch2/catch.hpp>
#include <numeric>

#include "octree/error.h"
#include "tests/helpers/temp_folder.h"

namespace factor_file_test {

namespace {

using namespace tessera;

constexpr std::size_t kRun = 1000, kRuns = 20;

/// All runs forwards, then backwards.
std::vector<double> all_of(FactorFile& file) {
  std::vector<double> buffer(kRun), out;
  const auto take = [&](std::size_t run) {
    const std::span<const double> values = file.read(run * kRun, buffer);
    out.insert(out.end(), values.begin(), values.end());
  };
  for (std::size_t run = 0; run < kRuns; ++run) take(run);
  for (std::size_t run = kRuns; run-- > 0;) take(run);
  return out;
}

}  // namespace

TEST_CASE("factor file: the same numbers whatever is held, while it is new and later", "[unit]") {
  const test::TempFolder folder;
  std::vector<double> expected(kRun * kRuns);
  std::iota(expected.begin(), expected.end(), 0.5);
  const std::vector<double> forwards = expected;
  for (std::size_t run = kRuns; run-- > 0;)
    for (std::size_t i = 0; i < kRun; ++i) expected.push_back(forwards[run * kRun + i]);
  // None, some runs and a bit, all.
  const std::uint64_t cached = GENERATE(0, 8 * 3500, 8 * kRun * kRuns);
  CAPTURE(cached);
  FactorFile file = FactorFile::create(folder.path() / "new.factor", cached);
  file.reserve(kRun * kRuns);
  for (std::size_t run = 0; run < kRuns; ++run) file.append(std::span(forwards).subspan(run * kRun, kRun));
  CHECK(file.size() == kRun * kRuns);
  CHECK(all_of(file) == expected);
  CHECK(file.finish() == 8 * kRun * kRuns);
  FactorFile again = FactorFile::open(folder.path() / "new.factor", cached);
  CHECK(again.size() == kRun * kRuns);
  CHECK(all_of(again) == expected);
}

TEST_CASE("factor file: one that is not there, or too short, is an error", "[fault]") {
  const test::TempFolder folder;
  CHECK_THROWS_AS(FactorFile::open(folder.path() / "none.factor", 0), InputError);
  FactorFile file = FactorFile::create(folder.path() / "short.factor", 0);
  const std::vector<double> values(10, 1.0);
  file.append(values);
  std::vector<double> buffer(11);
  CHECK_THROWS_AS(file.read(0, buffer), InputError);
}

}  // namespace factor_file_test
