// What surfels see tells how a scene was scanned, and which side of them shows.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "kernels/points/visibility.h"
#include "tests/kernels/points/in_order.h"
#include "tests/kernels/points/job_surfels.h"

namespace visibility_test {

using namespace tessera;

namespace {

constexpr double kScale = 4096.0;

std::int64_t shown(const VisibilityVotes& v, std::uint32_t group) {
  for (const PatchVote& side : v.sides)
    if (side.a == group) return side.same - side.opposite;
  return 0;
}

}  // namespace

TEST_CASE("sight: a shell with even density is an object, one that is dense at one place a room", "[unit]") {
  const VisibilityVotes object = vote_by_visibility(ball(1.0f), kScale);
  CHECK(object.scene == SceneKind::kObject);
  CHECK(shown(object, 0) > 0);
  CHECK(object.shells > 0.9);
  CHECK(object.density_spread == Approx(1.0).margin(0.01));
  const VisibilityVotes room = vote_by_visibility(ball(100.0f), kScale);
  CHECK(room.scene == SceneKind::kRoom);
  CHECK(room.density_spread > 3.0);
  CHECK(room.pairs.empty());
  CHECK(shown(room, 0) < 0);
}

TEST_CASE(
    "sight: a small shell with a dense part is still an object, unless that is as dense as around a scanner",
    "[unit]") {
  const auto scene_of = [](float dense) {
    std::vector<JobSurfel> small = ball(dense);
    for (JobSurfel& s : small) s.surfels = 1;
    const VisibilityVotes v = vote_by_visibility(small, kScale);
    CAPTURE(v.density_spread);
    CHECK(v.density_spread > 2.5);
    return v.scene;
  };
  CHECK(scene_of(12.0f) == SceneKind::kObject);
  CHECK(scene_of(100.0f) == SceneKind::kRoom);
}

TEST_CASE(
    "sight: fronts that see each other make a room where a scanner stood among them, not where it did not",
    "[unit]") {
  // An open bowl, with another one around it of which less was seen.
  const auto scene_of = [](float dense, bool around, double& facing) {
    std::vector<JobSurfel> bowl = ball(dense);
    std::erase_if(bowl, [](const JobSurfel& s) { return s.position[2] > 242.0f; });
    const std::size_t inner = bowl.size();
    for (std::size_t i = 0; around && i < inner; ++i) {
      JobSurfel s = bowl[i];
      for (float& x : s.position) x = 200.0f + 1.15f * (x - 200.0f);
      s.surfels = 4;
      bowl.push_back(s);
    }
    const VisibilityVotes v = vote_by_visibility(bowl, kScale);
    CHECK(v.enclosed < 0.01);
    CHECK((v.shells > 0.2) == around);
    CHECK(v.density_spread < 3.0);
    CHECK((v.density_spread > 1.7) == (dense > 1.0f));
    facing = v.facing;
    return v.scene;
  };
  double facing = 0.0;
  CHECK(scene_of(6.0f, true, facing) == SceneKind::kRoom);
  CHECK(facing > 0.5);
  CHECK(scene_of(1.0f, true, facing) == SceneKind::kObject);
  CHECK(facing > 0.5);
  CHECK(scene_of(6.0f, false, facing) == SceneKind::kLand);
  CHECK(facing < 0.1);
}

TEST_CASE("sight: of few surfels that lie evenly fewer need be shut in to make an object", "[unit]") {
  std::size_t between = 0;
  for (double cut = -0.5; cut < 1.0; cut += 0.05) {
    std::vector<JobSurfel> bowl = ball();
    std::erase_if(bowl, [&](const JobSurfel& s) { return s.position[2] > 200.0 + 140.0 * cut; });
    const VisibilityVotes many = vote_by_visibility(bowl, kScale);
    for (JobSurfel& s : bowl) s.surfels = 1;
    const VisibilityVotes few = vote_by_visibility(bowl, kScale);
    CAPTURE(cut, many.shells, few.shells);
    if (few.shells <= 0.1) CHECK(few.scene == SceneKind::kLand);
    if (few.shells > 0.1) CHECK(few.scene == SceneKind::kObject);
    if (many.shells <= 0.2) CHECK(many.scene == SceneKind::kLand);
    between += few.shells > 0.1 && many.shells <= 0.2;
  }
  CHECK(between > 0);
}

TEST_CASE("sight: a wide bore through an object does not make it a room, however many surfels it has",
          "[unit]") {
  std::vector<JobSurfel> surfels;
  for (const double radius : {400.0, 500.0}) {
    const auto around = static_cast<int>(6.283185307179586 * radius / 4.0);
    for (int i = 0; i < around; ++i) {
      const double a = 6.283185307179586 * i / around;
      const auto x = static_cast<float>(std::cos(a)), y = static_cast<float>(std::sin(a));
      const auto r = static_cast<float>(radius);
      for (float z = 4.0f; z < 604.0f; z += 4.0f)
        surfels.push_back(surfel({600.0f + r * x, 600.0f + r * y, z}, {x, y, 0}, r > 450.0f ? 1 : 0, 10.0f));
    }
  }
  const VisibilityVotes v = vote_by_visibility(surfels, kScale);
  CHECK(v.enclosed < 0.002);
  CHECK(v.scene != SceneKind::kRoom);
}

TEST_CASE("sight: the same votes when few parts fit and few surfels look at once", "[unit]") {
  const SurfelParts parts = cut(ball(), 64.0f);
  SightRun run;
  run.for_each = in_order;
  const VisibilityVotes all = vote_by_visibility(parts, {0, 0, 1}, kScale, std::nullopt, run);
  run.bytes = 1, run.lookers = 200;
  const VisibilityVotes few = vote_by_visibility(parts, {0, 0, 1}, kScale, std::nullopt, run);
  const auto same = [](const std::vector<PatchVote>& l, const std::vector<PatchVote>& r) {
    return std::equal(l.begin(), l.end(), r.begin(), r.end(), [](const PatchVote& a, const PatchVote& b) {
      return a.a == b.a && a.b == b.b && a.same == b.same && a.opposite == b.opposite;
    });
  };
  CHECK(all.pairs.size() > 100);
  CHECK(same(all.pairs, few.pairs));
  CHECK(same(all.sides, few.sides));
  CHECK(all.enclosed == few.enclosed);
  CHECK(all.shells == few.shells);
  CHECK(all.scene == few.scene);
}

TEST_CASE("sight: groups of a room that look again see by what all looked before, whatever fits", "[unit]") {
  // A shut ball, 64 cells a part; every part turned the other way round than the last one.
  SurfelParts parts = cut(ball(), 64.0f);
  const auto load = parts.load;
  parts.load = [load](std::size_t p) {
    std::vector<JobSurfel> surfels = load(p);
    for (JobSurfel& s : surfels)
      if (p % 2 != 0) s.area = -s.area;
    return surfels;
  };
  SightRun run;
  run.for_each = in_order;
  const double sight = vote_by_visibility(parts, {0, 0, 1}, kScale, SceneKind::kRoom, run).sight;
  CHECK(sight > 20.0);
  const auto asked = [](std::uint32_t g) { return g % 3 == 0; };
  const std::vector<GroupView> all = look_from_groups(parts, {0, 0, 1}, asked, sight, run);
  run.bytes = 1, run.lookers = 200;
  const std::vector<GroupView> few = look_from_groups(parts, {0, 0, 1}, asked, sight, run);
  REQUIRE(all.size() == (parts.parts.size() + 2) / 3);  // each of them, and no other
  REQUIRE(few.size() == all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    CHECK(all[i].group == 3 * i);
    CHECK(few[i].lean == all[i].lean);
    CHECK((all[i].lean > 0.0) == (all[i].group % 2 != 0));  // the inside is what a room shows
    CHECK(std::fabs(all[i].lean) > 0.1);
  }
}

TEST_CASE("sight: of groups that look again every one sees, however many they are", "[unit]") {
  // A floor, 64 cells a part; more groups of one surfel than the looks over a whole job would be shared out to.
  constexpr std::uint32_t kSide = 184, kOf = 8 * kSide;
  SurfelParts parts;
  for (std::uint32_t p = 0; p < kSide / 8; ++p) parts.parts.push_back({kOf, p * kOf});
  parts.load = [](std::size_t p) {
    std::vector<JobSurfel> surfels;
    for (std::uint32_t i = 0; i < kOf; ++i) {
      const Float3 at = {static_cast<float>(64 * p + 8 * (i % 8) + 4), static_cast<float>(8 * (i / 8) + 4),
                         100.0f};
      surfels.push_back(surfel(at, {0, 0, 1}, static_cast<std::uint32_t>(p) * kOf + i));
    }
    return surfels;
  };
  SightRun run;
  run.for_each = in_order;
  const auto asked = [](std::uint32_t) { return true; };
  const std::vector<GroupView> views = look_from_groups(parts, {0, 0, 1}, asked, 50.0, run);
  REQUIRE(views.size() == kSide * kSide);
  run.bytes = 1, run.lookers = 5000;
  const std::vector<GroupView> again = look_from_groups(parts, {0, 0, 1}, asked, 50.0, run);
  REQUIRE(again.size() == views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    REQUIRE(views[i].group == i);
    REQUIRE(again[i].lean == views[i].lean);
  }
}

}  // namespace visibility_test
