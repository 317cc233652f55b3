#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "kernels/smooth/crease_blunting.h"
#include "tests/helpers/random.h"

namespace crease_blunting_test {

using namespace tessera;

namespace {

constexpr std::uint32_t kWide = 24;  ///< quads across the folds
constexpr std::uint32_t kLong = 20;

/// A floor, a wall of eight quads between columns 8 and 16, and a floor above it: two folds of 90 degrees.
CreaseMesh terrace() {
  CreaseMesh mesh;
  for (std::uint32_t y = 0; y <= kLong; ++y)
    for (std::uint32_t i = 0; i <= kWide; ++i) {
      const double x = i < 8 ? i : i < 16 ? 8 : i - 8.0, z = i < 8 ? 0.0 : i < 16 ? i - 8.0 : 8.0;
      mesh.position.push_back({x, static_cast<double>(y), z});
      mesh.at_border.push_back(i == 0 || i == kWide || y == 0 || y == kLong);
    }
  const auto at = [](std::uint32_t i, std::uint32_t y) { return y * (kWide + 1) + i; };
  for (std::uint32_t y = 0; y < kLong; ++y)
    for (std::uint32_t i = 0; i < kWide; ++i) {
      mesh.faces.push_back({at(i, y), at(i + 1, y), at(i + 1, y + 1)});
      mesh.faces.push_back({at(i, y), at(i + 1, y + 1), at(i, y + 1)});
    }
  mesh.unseen.resize(mesh.faces.size());
  return mesh;
}

/// Smallest cosine between faces that meet along column i, away from the border.
double sharpest(const CreaseMesh& mesh, std::uint32_t column) {
  const auto normal = [&](std::uint32_t i, std::uint32_t y) {
    const auto& f = mesh.faces[2 * (y * kWide + i) + 0];
    const Double3& a = mesh.position[f[0]];
    return unit_or_zero(cross(mesh.position[f[1]] - a, mesh.position[f[2]] - a));
  };
  double smallest = 1.0;
  for (std::uint32_t y = 6; y < kLong - 6; ++y)
    smallest = std::min(smallest, dot(normal(column - 1, y), normal(column, y)));
  return smallest;
}

}  // namespace

TEST_CASE("crease blunting: folds near what nobody saw are rounded off, others stay", "[unit]") {
  CreaseMesh mesh = terrace();
  // Nobody saw the lower half of the wall.
  for (std::uint32_t y = 0; y < kLong; ++y)
    for (std::uint32_t i = 8; i < 11; ++i)
      mesh.unseen[2 * (y * kWide + i)] = mesh.unseen[2 * (y * kWide + i) + 1] = 1;
  const CreaseMesh before = mesh;
  REQUIRE(std::abs(sharpest(before, 8)) < 1e-12);
  CHECK(blunt_creases(mesh) > 0);
  CHECK(sharpest(mesh, 8) > 0.4);
  CHECK(std::abs(sharpest(mesh, 16)) < 1e-12);
  for (std::size_t v = 0; v < mesh.position.size(); ++v) {
    const double move = norm(mesh.position[v] - before.position[v]);
    CHECK(move <= 1.0 + 1e-12);
    if (mesh.at_border[v]) CHECK(move == 0.0);
  }
}

TEST_CASE("crease blunting: a border blunts what is near, nothing moves far from it", "[unit]") {
  CreaseMesh mesh = terrace();
  const CreaseMesh before = mesh;
  CHECK(blunt_creases(mesh) > 0);  // the ends of both folds
  std::size_t near = 0;
  for (std::size_t v = 0; v < mesh.position.size(); ++v) {
    if (mesh.position[v] == before.position[v]) continue;
    const double y = before.position[v][1];
    CHECK((y <= kBluntRings || y >= kLong - kBluntRings));
    ++near;
  }
  CHECK(near >= 4);
  std::fill(mesh.at_border.begin(), mesh.at_border.end(), std::uint8_t{0});
  mesh.position = before.position;
  CHECK(blunt_creases(mesh) == 0);  // the piece was cut out of a larger mesh
}

namespace {

/// The rounds as the header has them, all vertices and faces in each. \pre everything but the border may move
std::vector<Double3> blunted_plainly(const CreaseMesh& mesh) {
  std::vector<Double3> at = mesh.position;
  for (int round = 0; round < 6; ++round) {
    std::vector<Double3> normal;
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::size_t> face_at;
    for (const auto& f : mesh.faces) {
      normal.push_back(unit_or_zero(cross(at[f[1]] - at[f[0]], at[f[2]] - at[f[0]])));
      for (std::size_t k = 0; k < 3; ++k) face_at[{f[k], f[(k + 1) % 3]}] = normal.size() - 1;
    }
    std::vector<std::uint8_t> sharp(at.size(), 0);
    for (const auto& [edge, face] : face_at) {
      const auto other = face_at.find({edge.second, edge.first});
      if (other != face_at.end() && dot(normal[face], normal[other->second]) < 0.5)
        sharp[edge.first] = sharp[edge.second] = 1;
    }
    std::vector<Double3> sum(at.size());
    std::vector<double> count(at.size());
    for (const auto& f : mesh.faces)
      for (std::size_t k = 0; k < 3; ++k) {
        sum[f[k]] = sum[f[k]] + at[f[(k + 1) % 3]] + at[f[(k + 2) % 3]];
        count[f[k]] += 2.0;
      }
    for (std::size_t v = 0; v < at.size(); ++v) {
      if (!sharp[v] || mesh.at_border[v]) continue;
      const Double3 to = (at[v] + sum[v] * (1.0 / count[v])) * 0.5, move = to - mesh.position[v];
      at[v] = norm(move) > 1.0 ? mesh.position[v] + move * (1.0 / norm(move)) : to;
    }
  }
  return at;
}

}  // namespace

TEST_CASE("crease blunting: every round sees what moved in the round before", "[unit]") {
  CreaseMesh mesh = terrace();
  test::Random random(7);
  for (Double3& p : mesh.position)
    for (double& x : p) x += random.in(-0.45, 0.45);
  std::fill(mesh.unseen.begin(), mesh.unseen.end(), std::uint8_t{1});
  const std::vector<Double3> expected = blunted_plainly(mesh), before = mesh.position;
  std::size_t moved = 0;
  for (std::size_t v = 0; v < before.size(); ++v) moved += expected[v] != before[v];
  REQUIRE(moved > 50);
  CHECK(blunt_creases(mesh) == moved);
  CHECK(mesh.position == expected);
}

}  // namespace crease_blunting_test
