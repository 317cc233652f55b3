#include "kernels/blends/resample_blend.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <set>

#include "kernels/decimate/decimate.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/portable_math.h"
#include "tests/helpers/blend_search.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/filleted.h"
#include "tests/helpers/mesh_checks.h"

namespace resample_blend_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr double kEdge = 1.18;

MeshChecks checks_of(const MeshBlock& b) {
  IndexedMesh m;
  m.position = b.position;
  m.faces = b.faces;
  return check_mesh(m);
}

/// The block with what resampling changed.
MeshBlock patched(const MeshBlock& block, const ResampledBlend& blend) {
  std::vector<std::uint8_t> keep(block.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    const auto& t = block.faces[f];
    std::array<std::uint64_t, 3> c = {block.key[t[0]], block.key[t[1]], block.key[t[2]]};
    std::sort(c.begin(), c.end());
    keep[f] = !std::binary_search(blend.removed.begin(), blend.removed.end(), c);
  }
  const MeshBlock rest = select_faces(block, keep);
  const MeshBlock* const pieces[2] = {&rest, &blend.added};
  return merge_blocks(pieces, {});
}

/// About so many faces, in the order of quadrics.
MeshBlock decimated_to(const MeshBlock& block, std::size_t faces) {
  DecimateOptions o;
  o.sweep = false;
  std::uint32_t low = 0, high = kCostClasses - 1;
  MeshBlock best = block;
  while (low < high) {
    o.max_cost_class = (low + high) / 2;
    best = block;
    decimate(best, block, o);
    if (best.faces.size() > faces) {
      low = o.max_cost_class + 1;
    } else {
      high = o.max_cost_class;
    }
  }
  return best;
}

BlendOptions exact_options() {
  BlendOptions o;
  o.tolerance = 0.25;
  o.float_positions = false;
  o.first_key = std::uint64_t{1} << 63;
  return o;
}

ResampledBlend resample_only(const MeshBlock& block, const BlendOptions& options) {
  const std::vector<BlendCurve> curves = search_blends(block, 4.0 * kEdge, kEdge);
  REQUIRE(curves.size() == 1);
  return resample_blend(block, curves[0], options, kEdge);
}

void check_stitched(const MeshBlock& block, const ResampledBlend& r) {
  REQUIRE(r.report.outcome == BlendOutcome::kChanged);
  const MeshChecks was = checks_of(block), is = checks_of(patched(block, r));
  CHECK(is.defects() == 0);
  CHECK(is.boundary_edges == was.boundary_edges);
  CHECK(is.components == was.components);
  CHECK(is.euler == was.euler);
}

}  // namespace

TEST_CASE("resample blend: on an exact cylinder no normal jump varies beyond rounding", "[unit]") {
  Swept s;
  s.convex = GENERATE(true, false);
  s.arc_deg = GENERATE(60.0, 90.0, 120.0);
  CAPTURE(s.convex, s.arc_deg);
  const MeshBlock block = swept_block(s);
  const ResampledBlend r = resample_only(block, exact_options());
  check_stitched(block, r);
  CHECK(r.report.radius == Approx(3.0).epsilon(1e-5));
  CHECK(r.report.arc_angle == Approx(s.arc_deg * kPi / 180.0).epsilon(1e-3));
  CHECK(r.report.distance <= 0.25);
  CHECK(r.report.before.across.variance > 1e-3);
  CHECK(r.report.after.across.edges > 30);
  CHECK(r.report.after.across.variance < 1e-10);
  CHECK(r.report.after.along.variance < 1e-10);
  CHECK(r.report.after.along.mean < 1e-5);
  // New vertices of the arc lie on it.
  std::size_t on = 0;
  for (std::size_t v = 0; v < r.added.key.size(); ++v)
    if (r.added.key[v] >> 63 && std::fabs(r.added.position[v][0]) < 1.0) {
      CHECK(std::fabs(off_arc(s, r.added.position[v])) < 1e-5);
      ++on;
    }
  CHECK(on > 20);
}

TEST_CASE("resample blend: noise goes from along and across, far below decimation at as many faces",
          "[unit]") {
  Swept s;
  s.noise = 0.04;
  s.convex = GENERATE(true, false);
  s.edge = 0.6;
  const MeshBlock block = swept_block(s);
  const std::vector<BlendCurve> curves = search_blends(block, 2.8, 0.7);
  REQUIRE(curves.size() == 1);
  BlendOptions o = exact_options();
  o.spacing = 1.0;
  const ResampledBlend r = resample_blend(block, curves[0], o, 0.7);
  check_stitched(block, r);
  const MeshBlock small =
      decimated_to(block, block.faces.size() * r.report.faces_added / r.report.faces_removed);
  Fishbone bone;
  std::vector<Double3> normal(block.key.size(), Double3{});
  for (const auto& f : block.faces)
    for (const std::uint32_t v : f)
      normal[v] =
          normal[v] + triangle_normal(block.position[f[0]], block.position[f[1]], block.position[f[2]]);
  for (Double3& n : normal) n = unit_or_zero(n);
  REQUIRE(fit_fishbone(block.position, normal, curves[0], {1.0, 0.7, 0.0}, bone) == FishboneOutcome::kFound);
  const NormalJumps decimated = normal_jumps(bone, small.position, small.faces);
  CAPTURE(decimated.along.variance, decimated.across.variance, r.report.before.along.variance);
  CHECK(decimated.across.edges > 20);
  CHECK(r.report.after.along.variance * 20.0 < decimated.along.variance);
  CHECK(r.report.after.across.variance * 20.0 < decimated.across.variance);
  CHECK(r.report.radius == Approx(3.0).epsilon(0.03));
}

TEST_CASE("resample blend: around a ring the grid closes, ribs never cross", "[unit]") {
  Swept s;
  s.sweep_radius = 20.0;
  s.closed = true;
  s.convex = GENERATE(true, false);
  const MeshBlock block = swept_block(s);
  const ResampledBlend r = resample_only(block, exact_options());
  check_stitched(block, r);
  CHECK(r.report.closed);
  CHECK(r.report.radius == Approx(3.0).epsilon(1e-4));
  CHECK(r.report.after.across.variance < 1e-8);
}

TEST_CASE("resample blend: the edges of a box are resampled one after the other, it stays closed", "[unit]") {
  MeshBlock box = filleted_box(14.0, 3.0, 28, 0.3, 0.02, 3);
  const std::vector<BlendCurve> curves = search_blends(box, 4.2, 1.1);
  REQUIRE(curves.size() == 12);
  BlendOptions o = exact_options();
  int changed = 0;
  for (const BlendCurve& t : curves) {
    const ResampledBlend r = resample_blend(box, t, o, 1.1);
    if (r.report.outcome != BlendOutcome::kChanged) continue;
    ++changed;
    box = patched(box, r);
    o.first_key += 1u << 20;
  }
  CHECK(changed == 12);
  const MeshChecks is = checks_of(box);
  CHECK(is.defects() == 0);
  CHECK(is.boundary_edges == 0);
  CHECK(is.euler == 2);
}

TEST_CASE("resample blend: where it runs beside a hole the rest of it is resampled", "[unit]") {
  Swept s;
  s.convex = GENERATE(true, false);
  const MeshBlock whole = swept_block(s);
  const std::vector<BlendCurve> curves = search_blends(whole, 4.0 * kEdge, kEdge);
  REQUIRE(curves.size() == 1);
  const ResampledBlend all = resample_blend(whole, curves[0], exact_options(), kEdge);
  // The faces around a vertex a quarter of the way along, on a flank, where the grid has its outer row.
  const auto off = [&](const Double3& p) {
    return (p[0] - 2.6) * (p[0] - 2.6) + (p[1] - 10.0) * (p[1] - 10.0);
  };
  std::uint32_t hole = 0;
  for (std::uint32_t v = 0; v < whole.position.size(); ++v)
    if (off(whole.position[v]) < off(whole.position[hole])) hole = v;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (const auto& f : whole.faces)
    if (f[0] != hole && f[1] != hole && f[2] != hole) faces.push_back(f);
  const MeshBlock block = make_block(whole.position, faces);
  const ResampledBlend r = resample_blend(block, curves[0], exact_options(), kEdge);
  check_stitched(block, r);
  CHECK(r.report.length < all.report.length - 5.0);
  CHECK(r.report.length > 0.5 * all.report.length);
  CHECK(r.report.after.across.variance < 1e-10);
}

TEST_CASE("resample blend: the noise of normal jumps leaves out what the blend itself does", "[unit]") {
  Swept s;
  s.sweep_radius = 20.0;
  s.closed = true;
  s.convex = GENERATE(true, false);
  const ResampledBlend r = resample_only(swept_block(s), exact_options());
  REQUIRE(r.report.outcome == BlendOutcome::kChanged);
  // Around a ring jumps fall with the cosine from flank to flank, on every rib alike.
  CHECK(r.report.after.along.variance > 1e-5);
  CHECK(r.report.after.along.noise < 1e-3 * r.report.after.along.variance);
  // Of scattered triangles nearly all of it is noise.
  CHECK(r.report.before.across.noise > 0.5 * r.report.before.across.variance);
  CHECK(r.report.before.along.noise > 0.5 * r.report.before.along.variance);
  CHECK(r.report.before.along.noise < 2.0 * r.report.before.along.variance);
}

TEST_CASE("resample blend: rounding and sharpening reach the radius that is asked for", "[unit]") {
  Swept s;
  s.noise = GENERATE(0.0, 0.03);
  s.convex = GENERATE(true, false);
  s.radius = GENERATE(0.0, 3.0);
  const double radius = GENERATE(2.0, 4.5);
  CAPTURE(s.noise, s.convex, s.radius, radius);
  const MeshBlock block = swept_block(s);
  BlendOptions o = exact_options();
  o.edit = BlendEdit::kRound;
  o.radius = radius;
  const ResampledBlend r = resample_only(block, o);
  check_stitched(block, r);
  CHECK(r.report.new_radius == Approx(radius).epsilon(0.01));
  // Measured on the vertices themselves, against the fillet that there should be.
  Swept wanted = s;
  wanted.radius = radius;
  const double sign = s.convex ? 1.0 : -1.0, corner = (std::sqrt(2.0) - 1.0) * (s.radius - radius) * sign;
  std::size_t on = 0;
  for (std::size_t v = 0; v < r.added.key.size(); ++v) {
    Double3 p = r.added.position[v];
    if (!(r.added.key[v] >> 63) || p[1] < 14.0 || p[1] > 26.0 || std::fabs(p[0]) > 0.6 * radius) continue;
    p[2] -= corner;
    CHECK(std::fabs(off_arc(wanted, p)) < 0.01 * radius + s.noise);
    ++on;
  }
  CHECK(on > 20);
}

TEST_CASE("resample blend: sharpened to radius 0 the flanks meet in one crease", "[unit]") {
  Swept s;
  const MeshBlock block = swept_block(s);
  BlendOptions o = exact_options();
  o.edit = BlendEdit::kRound;
  const ResampledBlend r = resample_only(block, o);
  check_stitched(block, r);
  CHECK(r.report.sharp);
  const double height = 3.0 * (std::sqrt(2.0) - 1.0);
  std::size_t crease = 0;
  for (std::size_t v = 0; v < r.added.key.size(); ++v)
    if (r.added.vertex_class[v] == VertexClass::kCrease && r.added.position[v][1] > 14.0 &&
        r.added.position[v][1] < 26.0) {
      CHECK(r.added.position[v][2] == Approx(height).margin(1e-4));
      ++crease;
    }
  CHECK(crease > 8);
}

TEST_CASE("resample blend: a profile of knots replaces the arc", "[unit]") {
  Swept s;
  const MeshBlock block = swept_block(s);
  BlendOptions o = exact_options();
  o.edit = BlendEdit::kProfile;
  o.profile = {{{0.0, 0.0}, {1.0, 0.0}}, {{1.0, 0.0}, {1.0, 0.0}}};  // a chamfer
  const ResampledBlend r = resample_only(block, o);
  check_stitched(block, r);
  const double chord = -3.0 * (1.0 - std::sqrt(0.5));
  std::size_t on = 0;
  for (std::size_t v = 0; v < r.added.key.size(); ++v) {
    const Double3& p = r.added.position[v];
    if (!(r.added.key[v] >> 63) || p[1] < 14.0 || p[1] > 26.0 || std::fabs(p[0]) > 2.0) continue;
    CHECK(p[2] == Approx(chord).margin(1e-4));
    ++on;
  }
  CHECK(on > 20);
}

TEST_CASE("resample blend: what cannot be resampled stays, with its reason", "[unit]") {
  Swept s;
  SECTION("a tolerance that the chords of the mesh itself miss") {
    const MeshBlock block = swept_block(s);
    BlendOptions o = exact_options();
    o.tolerance = 0.01;
    const ResampledBlend r = resample_only(block, o);
    CHECK(r.report.outcome == BlendOutcome::kBeyondTolerance);
    CHECK(r.report.distance > 0.01);
    CHECK(r.removed.empty());
    CHECK(r.added.faces.empty());
  }
  SECTION("no flanks to roll a ball on") {
    s.flank = 1.0;
    const MeshBlock block = swept_block(s);
    BlendCurve t = curve_through(std::vector<Double3>{{0, 4, 0}, {0, 36, 0}}, false, kEdge);
    t.normal.assign(t.centre.size(), {0, 0, 1});
    t.convex = true;
    t.half_width = 2.2;
    const BlendOutcome o = resample_blend(block, t, exact_options(), kEdge).report.outcome;
    CHECK((o == BlendOutcome::kNoFlanks || o == BlendOutcome::kAtBorder));
  }
  SECTION("a sharp edge, unless it is to be another") {
    s.radius = 0.0;
    CHECK(resample_only(swept_block(s), exact_options()).report.outcome == BlendOutcome::kSharp);
  }
  SECTION("too short") {
    const MeshBlock block = swept_block(s);
    BlendCurve t = curve_through(std::vector<Double3>{{0, 20, 0}, {0, 22, 0}}, false, kEdge);
    t.normal.assign(t.centre.size(), {0, 0, 1});
    t.convex = true;
    t.half_width = 2.2;
    CHECK(resample_blend(block, t, exact_options(), kEdge).report.outcome == BlendOutcome::kTooShort);
  }
  SECTION("every reason has a sentence") {
    std::set<std::string_view> all;
    for (int o = 0; o <= static_cast<int>(BlendOutcome::kNoBetter); ++o)
      all.insert(sentence_of(static_cast<BlendOutcome>(o)));
    CHECK(all.size() == 10);
    CHECK(all.count("") == 0);
  }
}

}  // namespace resample_blend_test
