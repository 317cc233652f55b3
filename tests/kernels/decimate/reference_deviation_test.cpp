#include "kernels/decimate/reference_deviation.h"

#include <catch2/catch.hpp>

#include "tests/helpers/block_meshes.h"

namespace tessera::reference_deviation_test {
namespace {

using Answer = ReferenceDeviation::Answer;

/// Squares over (0, 0) to (4, 4), the vertex in the middle raised.
struct Sheet {
  explicit Sheet(double raised)
      : mesh(test::grid_block(4, 4, [&](double x, double y) { return x == 2.0 && y == 2.0 ? raised : 0.0; }),
             Double3{}) {}
  std::uint32_t at(double x, double y) const {
    for (std::uint32_t v = 0; v < mesh.vertices(); ++v)
      if (mesh.at(v)[0] == x && mesh.at(v)[1] == y) return v;
    FAIL("no vertex there");
    return 0;
  }
  CollapseMesh mesh;
};

/// The square from (1, 1) to (3, 3), two triangles instead of what lies there.
LinkLoop square() {
  LinkLoop loop;
  for (const Double3& p : {Double3{0, 0, 0}, {2, 0, 0}, {2, 2, 0}, {0, 2, 0}}) loop.at[loop.size++] = p;
  return loop;
}
ReferenceDeviation::Query from_middle(const Sheet& sheet, double limit) {
  ReferenceDeviation::Query q;
  q.origin = {1, 1, 0};
  q.seed = sheet.at(2, 2);
  q.limit = limit;
  return q;
}

}  // namespace

TEST_CASE("reference deviation: the height of what the fan passes under, and no more", "[unit]") {
  const Sheet sheet(0.25);
  ReferenceDeviation reference(sheet.mesh);
  const auto result = reference.measure(square(), from_middle(sheet, 0.3));
  REQUIRE(result.answer == Answer::kWithin);
  CHECK(result.deviation >= 0.25);
  CHECK(result.deviation == Approx(0.25).epsilon(1e-4));
  CHECK(reference.walked() < 16);  // of 32: it ends around the square
}

TEST_CASE("reference deviation: beyond the limit it names the vertex, which refuses the next star alone",
          "[unit]") {
  const Sheet sheet(0.25);
  ReferenceDeviation reference(sheet.mesh);
  auto query = from_middle(sheet, 0.2);
  const auto result = reference.measure(square(), query);
  CHECK(result.answer == Answer::kBeyond);
  REQUIRE(result.witness == sheet.at(2, 2));
  const auto walked = reference.walked();
  query.witness = result.witness;
  CHECK(reference.measure(square(), query).answer == Answer::kBeyond);
  CHECK(reference.walked() == walked);
  query.limit = 0.3;
  CHECK(reference.measure(square(), query).answer == Answer::kWithin);
}

TEST_CASE("reference deviation: bounds of the reference's faces are added", "[unit]") {
  Sheet sheet(0.25);
  for (std::uint32_t f = 0; f < sheet.mesh.faces().size(); ++f) sheet.mesh.face(f).bound = 0.125f;
  ReferenceDeviation reference(sheet.mesh);
  const auto result = reference.measure(square(), from_middle(sheet, 0.5));
  REQUIRE(result.answer == Answer::kWithin);
  CHECK(result.deviation == Approx(0.375).epsilon(1e-4));
}

TEST_CASE("reference deviation: a reference turned over is no graph", "[unit]") {
  Sheet sheet(0.0);
  const auto query = from_middle(sheet, 1.0);
  sheet.mesh.node(query.seed).at = {3.5, 2.0, 0.0};  // past its ring
  ReferenceDeviation reference(sheet.mesh);
  CHECK(reference.measure(square(), query).answer == Answer::kFolded);
}

TEST_CASE("reference deviation: normals are asked where the query has a cosine", "[unit]") {
  const Sheet sheet(1.0);
  ReferenceDeviation reference(sheet.mesh, true);
  auto query = from_middle(sheet, 2.0);
  REQUIRE(reference.measure(square(), query).answer == Answer::kWithin);
  query.min_cosine = 0.95;
  query.limit = 1.01;  // half of it explains less than these triangles turn
  CHECK(reference.measure(square(), query).answer == Answer::kNormalDeviates);
  query.min_cosine = 0.5;
  CHECK(reference.measure(square(), query).answer == Answer::kWithin);
}

TEST_CASE("reference deviation: a border of the reference inside the star is beyond", "[unit]") {
  const Sheet sheet(0.0);
  ReferenceDeviation reference(sheet.mesh);
  LinkLoop loop = square();
  for (std::size_t i = 0; i < loop.size; ++i) loop.at[i] = loop.at[i] * 1.5;
  auto query = from_middle(sheet, 1.0);
  query.origin = {0.5, 0.5, 0};
  CHECK(reference.measure(loop, query).answer == Answer::kWithin);
  query.origin = {1.5, 1.5, 0};
  CHECK(reference.measure(loop, query).answer == Answer::kBeyond);
}

TEST_CASE("reference deviation: along a line the side of the flat edge is measured", "[unit]") {
  Sheet sheet(0.0);
  for (std::uint32_t c = 0; c < 4 * sheet.mesh.faces().size(); ++c) {
    if ((c & 3u) == 3u) continue;
    const Double3 &a = sheet.mesh.at(sheet.mesh.vertex(next_corner(c))),
                  &b = sheet.mesh.at(sheet.mesh.vertex(prev_corner(c)));
    if (a[1] == 2.0 && b[1] == 2.0) sheet.mesh.mark_crease(c);
  }
  sheet.mesh.node(sheet.at(2, 3)).at[2] = 0.25;  // on the left of the line, as one walks along x
  ReferenceDeviation reference(sheet.mesh);
  for (const bool left : {true, false}) {
    LinkLoop loop;
    const double y = left ? 2.0 : -2.0;
    if (left)
      for (const Double3& p : {Double3{0, 0, 0}, {2, 0, 0}, {2, y, 0}, {0, y, 0}}) loop.at[loop.size++] = p;
    else
      for (const Double3& p : {Double3{0, 0, 0}, {0, y, 0}, {2, y, 0}, {2, 0, 0}}) loop.at[loop.size++] = p;
    auto query = from_middle(sheet, 0.5);
    query.origin = {1, 2, 0};
    query.flat_edge = left ? 0 : 3;
    loop.creases = std::uint64_t{1} << query.flat_edge;
    const auto result = reference.measure(loop, query);
    REQUIRE(result.answer == Answer::kWithin);
    CHECK(result.deviation == Approx(left ? 0.25 : 0.0).margin(1e-4));
  }
}

}  // namespace tessera::reference_deviation_test
