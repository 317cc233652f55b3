// Which points of patches in doubt count as such.
#include "stream/stages/scan/orient_tally.h"

#include <catch2/catch.hpp>
#include <vector>

namespace tessera::orient_tally_test {
namespace {

constexpr std::uint16_t kMany = 20;

/// Of two patches, the first in doubt: on a surface, strewn, among strewn ones, an outlier; then one that is decided.
const std::vector<PointOverlayRecord> kPoints = {
    {1, kMany, 0}, {1, kMany | kVolumetric, 0}, {1, kMany | kAmongVolumetric, 0}, {1, 2, 0},
    {1, kMany, 1}, {1, kMany, kNoPatch}};

std::pair<std::uint64_t, std::uint64_t> doubtful(VolumetricUse use) {
  OverlayDecisions decisions;
  decisions.min_supporters = 3, decisions.volumetric = use;
  const std::vector<std::uint8_t> decided = {kPatchUncertain | kPatchFlip, kPatchFlip};
  OrientationTally tally;
  tally.add_doubt(kPoints, decided, decisions);
  Json entry;
  tally.write(10, entry);
  CHECK(entry.at("uncertain_fraction").get<double>() ==
        Approx(entry.at("uncertain_points").get<double>() / 10.0));
  return {entry.at("uncertain_points").get<std::uint64_t>(),
          entry.at("uncertain_strewn_points").get<std::uint64_t>()};
}

}  // namespace

TEST_CASE("orient tally: what shows no side is not in doubt, and strewn points are told apart", "[unit]") {
  CHECK(doubtful(VolumetricUse::kSurface) == std::pair<std::uint64_t, std::uint64_t>{2, 1});
  CHECK(doubtful(VolumetricUse::kDrop) == std::pair<std::uint64_t, std::uint64_t>{2, 0});
  CHECK(doubtful(VolumetricUse::kTop) == std::pair<std::uint64_t, std::uint64_t>{2, 0});
  CHECK(doubtful(VolumetricUse::kBodies) == std::pair<std::uint64_t, std::uint64_t>{1, 0});
}

}  // namespace tessera::orient_tally_test
