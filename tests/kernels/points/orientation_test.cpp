// Signs of normals inside one brick, and the solver over patches, on shapes small enough to know every
// answer.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "kernels/points/normals.h"
#include "kernels/points/orientation.h"
#include "kernels/points/visibility.h"
#include "octree/morton.h"
#include "octree/vector.h"
#include "tests/kernels/points/job_surfels.h"

namespace orientation_test {

using namespace tessera;

namespace {

struct Sample {
  Double3 position;  ///< cells
  Float3 normal;     ///< true
};

double random_unit(std::uint64_t& state) {
  state = state * 6364136223846793005ull + 1442695040888963407ull;
  return static_cast<double>(state >> 33) / 2147483648.0;
}

struct Cloud {
  PointBlock block;
  std::vector<Float3> position, truth;
};

Cloud cloud_of(const std::vector<Sample>& samples) {
  struct Item {
    std::uint64_t code;
    Int3 q;
    Float3 normal;
  };
  std::vector<Item> items;
  for (const Sample& s : samples) {
    Int3 q;
    for (std::size_t a = 0; a < 3; ++a)
      q[a] = static_cast<std::int32_t>(std::floor(s.position[a] * kQuantaPerCell));
    const std::uint64_t code = morton_encode(
        static_cast<std::uint32_t>(q[0]), static_cast<std::uint32_t>(q[1]), static_cast<std::uint32_t>(q[2]));
    items.push_back({code, q, s.normal});
  }
  std::sort(items.begin(), items.end(), [](const Item& l, const Item& r) { return l.code < r.code; });
  Cloud cloud;
  cloud.block.cells = {kBrickCells, kBrickCells, kBrickCells};
  for (const Item& i : items) {
    const Float3 p = {static_cast<float>(i.q[0]) / kQuantaPerCell,
                      static_cast<float>(i.q[1]) / kQuantaPerCell,
                      static_cast<float>(i.q[2]) / kQuantaPerCell};
    cloud.block.x.push_back(p[0]), cloud.block.y.push_back(p[1]), cloud.block.z.push_back(p[2]);
    cloud.block.nx.push_back(0), cloud.block.ny.push_back(0), cloud.block.nz.push_back(0);
    cloud.position.push_back(p);
    cloud.truth.push_back(i.normal);
  }
  return cloud;
}

BrickOrientation orient(const Cloud& cloud) {
  std::vector<Float3> normal;
  std::vector<float> variation;
  for (const PointShape& s : estimate_shapes(cloud.block, {})) {
    normal.push_back(s.normal);
    variation.push_back(s.variation);
  }
  return orient_brick({cloud.position, normal, variation, cloud.truth, {}});
}

/// Share of points that agree with the truth once all patches are solved, up to one sign for the whole.
double agreement(const BrickOrientation& o) {
  std::vector<std::uint64_t> weight;
  for (const PatchStats& f : o.stats) weight.push_back(f.surfels);
  const SignSolution solution = solve_signs(weight, o.votes);
  double agree = 0.0, all = 0.0;
  for (std::size_t p = 0; p < o.stats.size(); ++p) {
    agree += solution.sign[p] > 0 ? o.stats[p].agree : o.stats[p].disagree;
    all += o.stats[p].agree + o.stats[p].disagree;
  }
  return std::max(agree, all - agree) / all;
}

std::vector<Sample> sphere(double radius, int count) {
  std::vector<Sample> samples;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - 2.0 * (i + 0.5) / count;
    const double r = std::sqrt(1.0 - z * z);
    const double a = 2.399963229728653 * i;
    const Double3 n = {r * std::cos(a), r * std::sin(a), z};
    samples.push_back({{32 + radius * n[0], 32 + radius * n[1], 32 + radius * n[2]},
                       {static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])}});
  }
  return samples;
}

/// The rectangle corner + u side + v up, two points a square cell.
void rectangle(const Double3& corner, const Double3& side, const Double3& up, const Float3& normal,
               std::uint64_t& state, std::vector<Sample>& out) {
  const int count = static_cast<int>(2.5 * norm(side) * norm(up));
  for (int i = 0; i < count; ++i) {
    const double u = random_unit(state), v = random_unit(state);
    out.push_back({{corner[0] + u * side[0] + v * up[0], corner[1] + u * side[1] + v * up[1],
                    corner[2] + u * side[2] + v * up[2]},
                   normal});
  }
}

}  // namespace

TEST_CASE("orientation: one patch on a sphere inside a brick", "[unit]") {
  const BrickOrientation o = orient(cloud_of(sphere(24.0, 20000)));
  REQUIRE(o.patches == 1);
  CHECK((o.stats[0].agree == 0 || o.stats[0].disagree == 0));
  CHECK(o.stats[0].points == 20000);
}

TEST_CASE("orientation: given normals far from the plane's axis are counted apart", "[unit]") {
  std::vector<Sample> samples = sphere(24.0, 20000);
  std::size_t tilted = 0;
  for (Sample& s : samples) {
    if (s.normal[2] < 0.8f) continue;
    s.normal = {0.95f, 0.0f, 0.3122499f};  // 72 degrees from the pole
    ++tilted;
  }
  const BrickOrientation o = orient(cloud_of(samples));
  const PatchStats& f = o.stats[0];
  CHECK(f.agree + f.disagree == 20000);
  CHECK(f.agree_near + f.disagree_near > 20000 - tilted);
  CHECK(f.agree_near + f.disagree_near < 20000 - tilted / 2);
  CHECK(f.agree_near <= f.agree);
  CHECK(f.disagree_near <= f.disagree);
}

TEST_CASE("orientation: a torus keeps one side through its hole", "[unit]") {
  std::vector<Sample> samples;
  std::uint64_t state = 1;
  for (int i = 0; i < 18000; ++i) {
    const double a = 6.283185307 * random_unit(state), b = 6.283185307 * random_unit(state);
    const Double3 n = {std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), std::sin(b)};
    samples.push_back({{32 + 20 * std::cos(a) + 8 * n[0], 32 + 20 * std::sin(a) + 8 * n[1], 32 + 8 * n[2]},
                       {static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])}});
  }
  CHECK(agreement(orient(cloud_of(samples))) == 1.0);
}

TEST_CASE("orientation: creases, from outside and from inside", "[unit]") {
  const double at = GENERATE(20.0, 20.7, 21.3);
  std::vector<Sample> box;
  std::uint64_t state = 7;
  const double to = 64.0 - at, size = to - at;
  for (std::size_t a = 0; a < 3; ++a)
    for (const double side : {at, to}) {
      Double3 corner = {at, at, at}, u{}, v{};
      corner[a] = side, u[(a + 1) % 3] = size, v[(a + 2) % 3] = size;
      Float3 n{};
      n[a] = side == at ? -1.0f : 1.0f;
      rectangle(corner, u, v, n, state, box);
    }
  // Points on an edge itself have no side of their own. A room is the same box, with one other sign for the
  // whole.
  CHECK(agreement(orient(cloud_of(box))) > 0.998);
}

TEST_CASE("orientation: two parallel sheets close together do not decide for each other", "[unit]") {
  const double gap = GENERATE(3.0, 5.0);
  std::vector<Sample> sheets;
  std::uint64_t state = 3;
  rectangle({10, 10, 30}, {40, 0, 0}, {0, 40, 0}, {0, 0, -1}, state, sheets);
  rectangle({10, 10, 30 + gap}, {40, 0, 0}, {0, 40, 0}, {0, 0, 1}, state, sheets);
  const BrickOrientation o = orient(cloud_of(sheets));
  std::uint32_t mixed = 0;
  for (const PatchStats& f : o.stats) mixed += std::min(f.agree, f.disagree);
  CHECK(mixed < sheets.size() / 1000);
}

TEST_CASE("orientation: the arc rule carries a sign around an edge and not across a step", "[unit]") {
  Surfel top, side;
  top.normal = {0, 0, 1};
  side.normal = {1, 0, 0};
  CHECK(link_vote(top, side, {1, 0, -1}) > 0);  // convex edge, both outward
  side.normal = {-1, 0, 0};
  CHECK(link_vote(top, side, {1, 0, -1}) < 0);  // the same edge with one side flipped
  CHECK(link_vote(top, side, {1, 0, 1}) > 0);   // concave edge
  const Surfel above = top;
  CHECK(link_vote(top, above, {0, 0, 1}) == 0);  // one sheet over the other says nothing
  CHECK(link_vote(top, above, {1, 0, 0.1f}) > kVoteScale / 2);
  CHECK(link_vote(top, above, {1, 0, 0.6f}) == 0);
}

TEST_CASE("orientation: of two sheets in a voxel each follows its own", "[unit]") {
  std::vector<Surfel> here(2), ahead(2);
  for (auto* v : {&here, &ahead}) {
    (*v)[0].position = {0, 0, 0}, (*v)[0].normal = {0, 0, -1};
    (*v)[1].position = {0, 0, 0.9f}, (*v)[1].normal = {0, 0, 1};
  }
  std::vector<SurfelLink> links;
  link_voxels(here, ahead, {2, 0, 0}, links);
  REQUIRE(links.size() == 2);
  for (const SurfelLink& l : links) {
    CHECK(l.a == l.b);
    CHECK(l.vote > 0);
  }
}

TEST_CASE("signs: many weak ties outweigh the strongest one", "[unit]") {
  // 0-1 and 2-3 are firm; one tie of 50 says opposite, three ties of 30 say same.
  const std::vector<PatchVote> votes = {{0, 1, 100, 0}, {0, 2, 0, 50}, {0, 3, 30, 0},
                                        {1, 2, 30, 0},  {1, 3, 30, 0}, {2, 3, 100, 0}};
  const std::vector<std::uint64_t> weight = {1, 1, 1, 1, 1};
  const SignSolution s = solve_signs(weight, votes);
  CHECK(s.sign == std::vector<std::int8_t>{1, 1, 1, 1, 1});
  CHECK(s.component == std::vector<std::uint32_t>{0, 0, 0, 0, 4});
  CHECK(s.frustrated_votes == 50);
  CHECK(s.total_votes == 340);
}

TEST_CASE("signs: votes that cancel join nothing and end", "[unit]") {
  const std::vector<PatchVote> votes = {{0, 1, 10, 10}, {2, 3, 0, 7}};
  const std::vector<std::uint64_t> weight = {1, 1, 1, 5};
  const SignSolution s = solve_signs(weight, votes);
  CHECK(s.component == std::vector<std::uint32_t>{0, 1, 3, 3});
  CHECK(s.sign[2] * s.sign[3] == -1);
}

TEST_CASE("signs: a join by split votes leaves no doubt where enough others speak for it", "[unit]") {
  // 1 joins 0 by split votes, and 2 hangs on it; each of the others joins 0 and speaks for 1 too, more weakly than 0 does.
  const auto solve = [](std::uint32_t others) {
    std::vector<PatchVote> votes = {{0, 1, 700, 400}, {1, 2, 70, 0}};
    for (std::uint32_t k = 3; k < 3 + others; ++k)
      votes.push_back({0, k, 60, 0}), votes.push_back({1, k, 55, 0});
    merge_votes(votes);
    return solve_signs(std::vector<std::uint64_t>(3 + others, 1), votes);
  };
  const SignSolution few = solve(8), enough = solve(10);
  CHECK(few.uncertain[1] == 1);
  CHECK(few.uncertain[2] == 1);
  CHECK(few.uncertain[3] == 0);
  CHECK(std::count(enough.uncertain.begin(), enough.uncertain.end(), 1) == 0);
  CHECK(enough.sign == std::vector<std::int8_t>(13, 1));
}

TEST_CASE("signs: what a flip tears off is in doubt unless decided ones speak for it", "[unit]") {
  // 1 and 2 join at once; then what both say of 3 turns 2 around, against a tie of 60 that was clear.
  const std::vector<PatchVote> votes = {
      {0, 1, 100, 0}, {1, 2, 60, 0}, {0, 2, 0, 20}, {2, 3, 0, 50}, {0, 3, 55, 0}};
  const SignSolution s = solve_signs(std::vector<std::uint64_t>{9, 1, 1, 1}, votes);
  REQUIRE(s.sign == std::vector<std::int8_t>{1, 1, -1, 1});
  CHECK(s.uncertain == std::vector<std::uint8_t>{0, 0, 1, 0});
}

TEST_CASE("signs: decided ones tell one after the other, unless what stays open outweighs them", "[unit]") {
  // 0 tells 1, and that 2 (the tie between 1 and 2 is open at first); 3 is told three to two, 4 by less than its tie to what
  // stays open, 5 and 6 by each other alone.
  const std::vector<PatchVote> votes = {{1, 2, 80, 0}, {0, 1, 100, 10}, {0, 3, 30, 20},
                                        {0, 4, 50, 0}, {4, 7, 0, 50},   {5, 6, 90, 0}};
  std::vector<std::uint8_t> decided = {1, 0, 0, 0, 0, 0, 0};
  decide_told(votes, decided);
  CHECK(decided == std::vector<std::uint8_t>{1, 1, 1, 0, 0, 0, 0});
}

TEST_CASE("signs: no more votes are broken than by the signs that most votes were made from", "[property]") {
  std::uint64_t state = 11;
  const std::size_t n = 400;
  std::vector<PatchVote> votes;
  std::int64_t lies = 0;
  for (std::uint32_t a = 0; a < n; ++a)
    for (int k = 0; k < 5; ++k) {
      const auto b = static_cast<std::uint32_t>(random_unit(state) * n);
      if (a == b) continue;
      const auto w = static_cast<std::int64_t>(1 + random_unit(state) * 1000);
      const bool lie = random_unit(state) < 0.1;
      lies += lie ? w : 0;
      const bool same = ((a ^ b) & 1u) == 0;
      votes.push_back({std::min(a, b), std::max(a, b), same != lie ? w : 0, same != lie ? 0 : w});
    }
  merge_votes(votes);
  const std::vector<std::uint64_t> weight(n, 1);
  const SignSolution s = solve_signs(weight, votes);
  CHECK(s.frustrated_votes <= static_cast<std::uint64_t>(lies));
  CHECK(std::all_of(s.component.begin(), s.component.end(),
                    [&](std::uint32_t c) { return c == s.component[0]; }));
}

namespace {

/// Surfels of a sphere around (500, 500, 500 + up), area vectors outwards or inwards.
void add_sphere(std::vector<JobSurfel>& surfels, double radius, std::uint32_t patch, float side,
                float up = 0.0f) {
  const int count = static_cast<int>(12.566 * radius * radius / 40.0);
  for (const Sample& s : sphere(radius, count)) {
    JobSurfel j;
    for (std::size_t a = 0; a < 3; ++a) {
      j.position[a] = static_cast<float>(s.position[a]) + 500.0f;
      j.area[a] = side * 40.0f * s.normal[a];
    }
    j.position[2] += up;
    j.patch = patch;
    j.surfels = 10;
    surfels.push_back(j);
  }
}

/// Votes for the side that a group shows, less those for the other, over all.
double shown(const std::vector<PatchVote>& votes, std::uint32_t group) {
  for (const PatchVote& v : votes)
    if (v.a == group)
      return static_cast<double>(v.same - v.opposite) / static_cast<double>(v.same + v.opposite);
  return 0.0;
}

}  // namespace

TEST_CASE("sight: an object shows outwards, whichever way it was turned", "[unit]") {
  const float side = GENERATE(1.0f, -1.0f);
  std::vector<JobSurfel> surfels;
  add_sphere(surfels, 200.0, 0, side);
  add_sphere(surfels, 40.0, 1, -side, 260.0f);
  const VisibilityVotes votes = vote_by_visibility(surfels, 1000.0);
  CHECK(votes.enclosed < 0.001);
  CHECK(shown(votes.sides, 0) * side == 1.0);
  CHECK(shown(votes.sides, 1) * side == -1.0);
  // They see each other's outsides: turned against each other, so opposite.
  REQUIRE(votes.pairs.size() == 1);
  CHECK(votes.pairs[0].opposite > 5 * votes.pairs[0].same);
}

TEST_CASE("sight: what stands inside tells a room from an object", "[unit]") {
  const float side = GENERATE(1.0f, -1.0f);
  std::vector<JobSurfel> surfels;
  add_sphere(surfels, 200.0, 0, side);
  add_sphere(surfels, 40.0, 1, side, 60.0f);
  const VisibilityVotes votes = vote_by_visibility(surfels, 1000.0);
  CHECK(votes.enclosed > 0.03);
  CHECK(shown(votes.sides, 0) * side == -1.0);  // the room is free space, the furniture is not
  CHECK(shown(votes.sides, 1) * side == 1.0);
}

TEST_CASE("sight: layers of one surface do not enclose each other", "[unit]") {
  std::vector<JobSurfel> surfels;
  for (const double radius : {198.0, 200.0, 203.0}) add_sphere(surfels, radius, 0, 1.0f);
  const VisibilityVotes votes = vote_by_visibility(surfels, 1000.0);
  CHECK(votes.enclosed < 0.001);
  CHECK(shown(votes.sides, 0) == 1.0);
}

TEST_CASE("sight: of several sensors those vote that nothing hides", "[unit]") {
  std::vector<JobSurfel> surfels;
  add_sphere(surfels, 200.0, 0, 1.0f);
  // One inside; one outside, which looks through a gap here and there.
  const Float3 inside = {510.0f, 490.0f, 505.0f}, outside = {500.0f, -900.0f, 503.0f};
  CHECK(shown(vote_by_sensors(surfels, {outside}, 1000.0), 0) > 0.5);
  CHECK(shown(vote_by_sensors(surfels, {inside}, 1000.0), 0) < -0.9);
}

}  // namespace orientation_test
