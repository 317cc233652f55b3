// Signed distances measured cell by cell are those of brute force, whatever the memory and the threads.
#include <catch2/catch.hpp>

#include <bit>
#include <cmath>
#include <vector>

#include "kernels/mesh/signed_distance.h"
#include "stream/import/import_mesh.h"
#include "stream/survey/point_distances.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/surfaces.h"
#include "tests/helpers/temp_folder.h"

namespace point_distances_test {

using namespace tessera;
using namespace tessera::test;

namespace {

MeshStore store_of(const Surface& s, const TempFolder& folder) {
  WholeMesh mesh;
  mesh.points = s.position;
  for (const auto& f : s.faces) mesh.faces.push_back({f[0], f[1], f[2]});
  mesh.header.vertices = mesh.points.size(), mesh.header.faces = mesh.faces.size();
  mesh.header.double_positions = true;
  write_whole(folder / "mesh.ply", mesh);
  RunOptions run;
  run.memory_bytes = std::uint64_t{1} << 30, run.threads = 2;
  return import_mesh(folder / "mesh.ply", folder.path(), "store", run, [] {});
}

/// A closed surface of random bumps, seen whole from its middle, with sharp edges in and out.
Surface bumpy(int levels, const Double3& middle, double lowest, unsigned seed) {
  Surface s = sphere(levels, 1.0);
  Random random(seed);
  for (Double3& p : s.position) p = middle + p * random.in(lowest, 1.05);
  return s;
}

/// How often the surface winds around a point: solid angles of all faces (van Oosterom and Strackee, 1983).
double winding(const Double3& p, const Surface& s) {
  double sum = 0.0;
  for (const auto& f : s.faces) {
    const Double3 a = s.position[f[0]] - p, b = s.position[f[1]] - p, c = s.position[f[2]] - p;
    const double x = norm(a), y = norm(b), z = norm(c);
    sum += std::atan2(dot(a, cross(b, c)), x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y);
  }
  return sum / (2.0 * 3.14159265358979323846);
}

std::uint64_t bits_of(const PointDistance& d) {
  return std::bit_cast<std::uint64_t>(d.value);
}

struct Measured {
  std::vector<PointDistance> distances;
  std::uint64_t searched = 0;
};

Measured measure(const MeshStore& store, const std::vector<Double3>& points, double max_distance,
                 const TempFolder& folder, std::uint64_t memory = std::uint64_t{64} << 20, int threads = 2) {
  PointDistances distances(store, max_distance, folder.path(), memory);
  for (const Double3& p : points) distances.add(p);
  WorkerPool pool(threads);
  MemoryBudget budget(std::uint64_t{2} << 30, 0);
  distances.measure(pool, budget);
  Measured out;
  for (std::size_t i = 0; i < points.size(); ++i) out.distances.push_back(distances.next());
  out.searched = distances.searched();
  return out;
}

}  // namespace

TEST_CASE("point distances: brute force has the same distances and sides, near edges and corners and far off",
          "[property]") {
  const TempFolder folder;
  const Double3 middle = {500000.0, 5400000.0, 250.0};
  const Surface s = bumpy(4, middle, 0.75, 3);
  const MeshStore store = store_of(s, folder);
  Random random(7);
  std::vector<Double3> points;
  for (int i = 0; i < 4000; ++i)
    points.push_back(middle + Double3{random.in(-1.6, 1.6), random.in(-1.6, 1.6), random.in(-1.6, 1.6)});
  // Beside edges and corners: sides that the normal of one face gets wrong.
  while (points.size() < 10000) {
    const auto& f = s.faces[random.below(s.faces.size())];
    const double t = random.below(2) == 0 ? 0.0 : random.unit(), away = 0.02;
    const Double3 at = s.position[f[0]] * (1.0 - t) + s.position[f[1]] * t;
    points.push_back(at + Double3{random.in(-away, away), random.in(-away, away), random.in(-away, away)});
  }
  constexpr double kReach = 0.5;
  const Measured found = measure(store, points, kReach, folder);
  std::size_t far = 0, outside = 0, wrong_side = 0, wrong_distance = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double distance = surface_distance(points[i], s), value = found.distances[i].value;
    if (distance > kReach) {
      ++far;
      CHECK(std::isnan(value));
      continue;
    }
    if (!(std::abs(std::abs(value) - distance) < 1e-9)) ++wrong_distance;
    if (found.distances[i].border || i % 4 != 0) continue;
    const bool in = winding(points[i], s) > 0.5;
    outside += in ? 0 : 1;
    if (distance > 1e-6 && in != (value < 0.0)) ++wrong_side;
  }
  CHECK(wrong_distance == 0);
  CHECK(wrong_side == 0);
  CHECK(far > 300);
  CHECK(outside > 300);
}

TEST_CASE(
    "point distances: many cells and far points give what one index over all faces gives, to the bit on any "
    "memory",
    "[property]") {
  const TempFolder folder;
  const Surface s = bumpy(8, {0.0, 0.0, 0.0}, 1.04, 5);
  const MeshStore store = store_of(s, folder);
  constexpr double kReach = 0.45;
  const DistanceCells cells(store, kReach);
  REQUIRE(cells.cells().size() > 8);
  Random random(11);
  std::vector<Double3> points;
  for (int i = 0; i < 6000; ++i)
    points.push_back({random.in(-1.6, 1.6), random.in(-1.6, 1.6), random.in(-1.6, 1.6)});
  for (int i = 0; i < 14000; ++i) {
    const Double3 p = random_point(s, random.below(s.faces.size()), random);
    points.push_back(p + Double3{random.in(-0.01, 0.01), random.in(-0.01, 0.01), random.in(-0.01, 0.01)});
  }
  const Measured found = measure(store, points, kReach, folder);
  CHECK(found.searched > 100);
  std::vector<std::size_t> all(store.patches().size());
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = i;
  const SignedDistance whole(store.load(all), {0, 0, 0});
  std::size_t wrong = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const SignedDistance::Foot foot = whole.closest(points[i], kReach * kReach);
    const double value = found.distances[i].value;
    if (foot.face == SignedDistance::kNone) {
      wrong += std::isnan(value) ? 0 : 1;
      continue;
    }
    const double distance = std::sqrt(foot.square);
    wrong += std::abs(std::abs(value) - distance) < 1e-12 ? 0 : 1;
    // Where two faces are equally near rounding may choose, and their sides may differ at points this close alone.
    if (distance > 1e-6 && (value < 0.0) != (SignedDistance::signed_distance(points[i], foot) < 0.0)) ++wrong;
  }
  CHECK(wrong == 0);
  const Measured again = measure(store, points, kReach, folder, std::uint64_t{1} << 20, 1);
  std::size_t differ = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    differ += bits_of(again.distances[i]) != bits_of(found.distances[i]);
  CHECK(differ == 0);
}

TEST_CASE("point distances: a sheet tells which points lie beside its border", "[unit]") {
  const TempFolder folder;
  const MeshStore store = store_of(height_grid(4, 1.0, [](double, double) { return 0.0; }), folder);
  const Measured found =
      measure(store, {{0.3, 0.4, 0.1}, {0.3, 0.4, -0.2}, {1.3, 0.4, 0.1}, {0.3, 0.4, 2.5}, {NAN, 0.4, 0.1}},
              2.0, folder);
  CHECK(found.distances[0].value == Approx(0.1));
  CHECK_FALSE(found.distances[0].border);
  CHECK(found.distances[1].value == Approx(-0.2));
  CHECK(found.distances[2].border);
  CHECK(std::isnan(found.distances[3].value));
  CHECK(std::isnan(found.distances[4].value));
}

}  // namespace point_distances_test
