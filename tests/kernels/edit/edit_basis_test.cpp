// Basis functions: the same as solving directly, and motions of all handles are motions of all.
#include "kernels/edit/edit_basis.h"

#include <catch2/catch.hpp>
#include <cmath>

#include "octree/error.h"
#include "tests/helpers/random.h"
#include "tests/helpers/surfaces.h"

namespace edit_basis_test {

namespace {

using namespace tessera;
using namespace tessera::test;

/// A bumpy sphere whose caps are handles; `fixed` holds its back side.
struct Edit {
  Surface s = sphere(4, 1.0);
  Laplacian lap;
  EditRegions regions;
  explicit Edit(bool fixed) {
    Random random(3);
    for (Double3& p : s.position) p = p * random.in(0.98, 1.02);
    lap = laplacian({s.position, s.faces});
    regions.handles = {"top", "bottom"};
    for (const Double3& p : s.position)
      regions.role.push_back(p[2] > 0.6             ? 0
                             : p[2] < -0.6          ? 1
                             : fixed && p[0] < -0.8 ? kFixedVertex
                                                    : kSupportVertex);
  }
  EditBasis basis(int order) const {
    EditBasisReport report;
    return edit_basis({s.position, s.faces}, lap, regions, {.order = order}, report);
  }
};

double largest_distance(const std::vector<Double3>& a, const std::vector<Double3>& b) {
  double worst = 0.0;
  for (std::size_t v = 0; v < a.size(); ++v) worst = std::max(worst, norm(a[v] - b[v]));
  return worst;
}

const Placement kRigid = [] {
  Placement p = rotation(unit(Double3{1, 2, -1}), 70.0).about({0.3, 0.1, 0.2});
  p.shift = p.shift + Double3{0.5, -1.0, 2.0};
  return p;
}();
const Placement kAffine = {{1.5, 0.2, 0.0, -0.1, 0.7, 0.3, 0.2, 0.0, 2.0}, {1, 2, 3}};

}  // namespace

TEST_CASE("edit basis: poses are what a direct solution gives", "[unit]") {
  const Edit e(true);
  for (const int order : {1, 2, 3}) {
    const EditBasis basis = e.basis(order);
    CHECK(basis.width() == 3 + 4 * 2);
    const std::vector<Placement> pose = {kRigid, kAffine};
    const std::vector<Double3> posed = smooth_base(basis, e.s.position, pose);
    std::vector<std::uint8_t> free;
    std::vector<Double3> direct = e.s.position;
    for (std::size_t v = 0; v < direct.size(); ++v) {
      free.push_back(e.regions.role[v] == kSupportVertex);
      if (e.regions.role[v] >= 0)
        direct[v] = pose[static_cast<std::size_t>(e.regions.role[v])].apply(direct[v]);
    }
    BoundaryModel model(e.lap, free, {}, {.order = order});
    model.solve({direct.front().data(), 3 * direct.size()}, 3);
    CAPTURE(order);
    CHECK(largest_distance(posed, direct) < 1e-9);
  }
}

TEST_CASE("edit basis: where all handles go, the surface goes", "[unit]") {
  const Edit e(false);
  for (const int order : {1, 2, 3}) {
    CAPTURE(order);
    const EditBasis basis = e.basis(order);
    const std::vector<Double3> rest = rest_base(basis, e.s.position);
    for (const Placement& map : {kRigid, kAffine}) {
      const std::vector<Placement> pose = {map, map};
      const std::vector<Double3> posed = smooth_base(basis, e.s.position, pose);
      std::vector<Double3> want;
      for (const Double3& p : rest) want.push_back(map.apply(p));
      CHECK(largest_distance(posed, want) < 1e-9);
      if (map == kAffine) continue;
      want.clear();
      for (const Double3& p : e.s.position) want.push_back(map.apply(p));
      CHECK(largest_distance(posed_base(basis, e.s.position, pose_rotations(basis, pose), rest, posed),
                             want) < 1e-6);
    }
  }
}

TEST_CASE("edit basis: at rest every bit stays, what is fixed always", "[unit]") {
  const Edit e(true);
  const EditBasis basis = e.basis(2);
  const std::vector<Double3> rest = rest_base(basis, e.s.position);
  const std::vector<Placement> still(2), moved = {kRigid, Placement{}};
  const std::vector<Double3> same = smooth_base(basis, e.s.position, still);
  CHECK(posed_base(basis, e.s.position, pose_rotations(basis, still), rest, same) == e.s.position);
  const std::vector<Double3> posed = posed_base(basis, e.s.position, pose_rotations(basis, moved), rest,
                                                smooth_base(basis, e.s.position, moved));
  for (std::size_t v = 0; v < posed.size(); ++v) {
    if (e.regions.role[v] == kFixedVertex || e.regions.role[v] == 1) CHECK(posed[v] == e.s.position[v]);
    if (e.regions.role[v] == 0) CHECK(norm(posed[v] - kRigid.apply(e.s.position[v])) < 1e-14);
  }
}

TEST_CASE("edit basis: targets of single vertices", "[unit]") {
  Edit e(true);
  e.regions.target.resize(e.s.position.size());
  std::size_t count = 0;
  for (std::size_t v = 0; v < e.s.position.size(); ++v) {
    if (e.s.position[v][0] < 0.9) continue;
    e.regions.role[v] = kTargetVertex;
    e.regions.target[v] = e.s.position[v] * 1.5;
    ++count;
  }
  REQUIRE(count > 3);
  const EditBasis basis = e.basis(2);
  const std::vector<Placement> still(2);
  const std::vector<Double3> rest = rest_base(basis, e.s.position);
  const std::vector<Double3> posed = smooth_base(basis, e.s.position, still);
  double largest = 0.0;
  for (std::size_t v = 0; v < posed.size(); ++v) {
    if (e.regions.role[v] == kTargetVertex) {
      CHECK(posed[v] == e.regions.target[v]);
      CHECK(rest[v] == e.s.position[v]);
    }
    if (e.regions.role[v] == kSupportVertex) largest = std::max(largest, norm(posed[v] - rest[v]));
  }
  CHECK(largest > 0.1);
}

TEST_CASE("edit basis: a piece of the support that nothing holds follows, stays or is named", "[unit]") {
  Edit e(true);
  // A second sphere, all of it support.
  const std::size_t n = e.s.position.size();
  const Surface other = sphere(2, 1.0);
  for (const Double3& p : other.position) {
    e.s.position.push_back(p + Double3{10, 20, 30});
    e.regions.role.push_back(kSupportVertex);
  }
  for (auto f : other.faces) {
    for (std::uint32_t& v : f) v += static_cast<std::uint32_t>(n);
    e.s.faces.push_back(f);
  }
  e.lap = laplacian({e.s.position, e.s.faces});
  const std::vector<Placement> pose = {kRigid, kRigid};
  const auto moved = [&](std::span<const Placement> handles) {
    const EditBasis basis = e.basis(2);
    const std::vector<Double3> rest = rest_base(basis, e.s.position),
                               posed = smooth_base(basis, e.s.position, handles);
    return posed_base(basis, e.s.position, pose_rotations(basis, handles), rest, posed);
  };
  // Above the first one, over the handle at its top: it goes where that goes.
  for (std::size_t v = n; v < e.s.position.size(); ++v)
    e.s.position[v] = e.s.position[v] - Double3{10, 20, 27};
  const std::vector<Double3> followed = moved(pose);
  for (std::size_t v = n; v < followed.size(); ++v)
    CHECK(norm(followed[v] - kRigid.apply(e.s.position[v])) < 1e-9);
  CHECK(moved(std::vector<Placement>(2)) == e.s.position);
  // Beside the support: within a mean of the motions, and undistorted where the handles move alike.
  for (std::size_t v = n; v < e.s.position.size(); ++v) e.s.position[v] = e.s.position[v] + Double3{3, 0, -3};
  std::vector<Placement> shifts(2);
  shifts[0].shift = shifts[1].shift = {0, 0, 1};
  const std::vector<Double3> interpolated = moved(shifts);
  const Double3 by = interpolated[n] - e.s.position[n];
  CHECK(by[2] > 0.5);
  for (std::size_t v = n; v < interpolated.size(); ++v)
    CHECK(norm(interpolated[v] - e.s.position[v] - by) < 1e-9);
  e.regions.loose = LoosePieces::kFix;
  const std::vector<Double3> stayed = moved(pose);
  for (std::size_t v = n; v < stayed.size(); ++v) CHECK(stayed[v] == e.s.position[v]);
  e.regions.loose = LoosePieces::kRefuse;
  for (std::size_t v = n; v < e.s.position.size(); ++v)
    e.s.position[v] = e.s.position[v] + Double3{7, 20, 30};
  CHECK_THROWS_WITH(e.basis(2), Catch::Contains("1 piece of it, 66 vertices, the first near (11, 20, 30)"));
  CHECK_THROWS_AS(e.basis(2), InputError);
}

}  // namespace edit_basis_test
