// `check --crossings` against CGAL: the same pairs of faces.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "stream/check/mesh_crossings.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/memory_mesh.h"
#include "tests/helpers/random.h"
#include "tests/helpers/temp_folder.h"

namespace crossings_oracle_test {
namespace {

using namespace tessera;
using test::MemoryMesh;

using FacePair = std::array<std::uint64_t, 2>;

struct Soup {
  std::vector<Double3> points;
  std::vector<MeshFace> faces;
  void add(const std::vector<Double3>& more, const std::vector<std::array<std::uint32_t, 3>>& corners,
           const Double3& by) {
    const std::uint64_t first = points.size();
    for (const Double3& p : more) points.push_back(p + by);
    for (const auto& f : corners) faces.push_back({first + f[0], first + f[1], first + f[2]});
  }
};

/// Spheres in a cube, so many that they cross; whole multiples of a step.
Soup spheres(std::size_t count, int level, double step, std::uint64_t seed) {
  test::Random random(seed);
  Soup soup;
  const test::Icosphere sphere = test::icosphere(level);
  for (std::size_t s = 0; s < count; ++s)
    soup.add(sphere.positions, sphere.faces, {random.in(0.0, 4.0), random.in(0.0, 4.0), random.in(0.0, 2.0)});
  if (step > 0.0)
    for (Double3& p : soup.points)
      for (double& x : p) x = std::round(x / step) * step;
  return soup;
}

/// A sheet of side x side squares at z(i, j), every vertex moved aside by up to `jitter`.
Soup sheet(int side, double jitter, const std::function<double(int, int)>& z) {
  test::Random random(7);
  std::vector<Double3> points;
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i)
      points.push_back({i + random.in(-jitter, jitter), j + random.in(-jitter, jitter), z(i, j)});
  const auto at = [&](int i, int j) { return static_cast<std::uint32_t>(j * (side + 1) + i); };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  Soup soup;
  soup.add(points, faces, {0, 0, 0});
  return soup;
}

std::vector<FacePair> of_cgal(const Soup& soup) {
  const test::TempFolder folder;
  const auto file = folder / "mesh.bin", out = folder / "pairs.txt";
  std::ofstream to(file, std::ios::binary);
  const std::array<std::uint64_t, 2> size = {soup.points.size(), soup.faces.size()};
  to.write(reinterpret_cast<const char*>(size.data()), sizeof size);
  to.write(reinterpret_cast<const char*>(soup.points.data()),
           static_cast<std::streamsize>(soup.points.size() * sizeof(Double3)));
  to.write(reinterpret_cast<const char*>(soup.faces.data()),
           static_cast<std::streamsize>(soup.faces.size() * sizeof(MeshFace)));
  to.close();
  const std::string line =
      std::string(TESSERA_CGAL_CROSSINGS) + " '" + file.string() + "' > '" + out.string() + "'";
  REQUIRE(std::system(line.c_str()) == 0);
  std::vector<FacePair> pairs;
  std::ifstream from(out);
  for (FacePair pair; from >> pair[0] >> pair[1];) pairs.push_back(pair);
  return pairs;
}

std::vector<FacePair> of_tessera(const Soup& soup) {
  MeshBlock block;
  block.position = soup.points;
  for (const MeshFace& f : soup.faces)
    block.faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                           static_cast<std::uint32_t>(f[2])});
  std::vector<std::uint32_t> number;
  std::vector<FacePair> pairs;
  block_contacts(contact_faces(block, &number), kAllSpace,
                 [&](std::uint32_t i, std::uint32_t j, FaceContact) {
                   pairs.push_back({std::min(number[i], number[j]), std::max(number[i], number[j])});
                 });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::uint64_t counted(const Soup& soup) {
  MemoryMesh mesh(soup.points, soup.faces);
  VertexStore positions({}, true, 1u << 20);
  positions.append(mesh.points());
  MeshCrossingOptions options;
  options.memory_bytes = 64u << 20;
  return find_crossings(mesh, positions, options).pairs();
}

}  // namespace

TEST_CASE("crossings: the same pairs as CGAL's, of spheres, sheets, folds and what merely touches",
          "[property]") {
  const auto compare = [](const Soup& soup, std::size_t at_least) {
    const std::vector<FacePair> cgal = of_cgal(soup), ours = of_tessera(soup);
    CHECK(ours.size() >= at_least);
    CHECK(ours == cgal);
    CHECK(counted(soup) == cgal.size());
  };
  compare(spheres(1, 3, 0.0, 1), 0);                           // nothing crosses
  compare(spheres(9, 3, 0.0, 2), 300);                         // cuts in general position
  compare(spheres(9, 2, 0.125, 3), 300);                       // much of it touches, in lattice planes
  compare(sheet(30, 0.9, [](int, int) { return 0.0; }), 300);  // flat, folded over: overlaps
  compare(sheet(30, 0.9, [](int i, int j) { return 0.2 * std::sin(i) * j / 9.0; }),
          50);  // the same with hills
  Soup far = spheres(6, 3, 0.0, 5);
  for (Double3& p : far.points) p = p + Double3{5e6, 4e5, 100.0};
  compare(far, 100);  // survey coordinates
}

}  // namespace crossings_oracle_test
