// The copy of a mesh that a page shows, and the figures of all its faces: against each face measured by itself.
#include <catch2/catch.hpp>

#include <cmath>
#include <map>

#include "octree/vector.h"
#include "stream/page/preview_mesh.h"
#include "tests/helpers/icosphere.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace preview_mesh_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr std::uint64_t kMemory = std::uint64_t{256} << 20;

/// A ball, stretched, so that faces differ, and faces without size, area or number.
WholeMesh stretched_ball(int level) {
  WholeMesh mesh;
  const Icosphere ball = icosphere(level);
  for (const Double3& p : ball.positions) {
    const Double3 at = {40.0 * p[0] + 700.0, p[1], 9.0 * p[2] * p[2] * p[2]};
    mesh.points.push_back({static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])});
  }
  for (const auto& f : ball.faces) mesh.faces.push_back({f[0], f[1], f[2]});
  mesh.points.push_back(mesh.points[5]);
  mesh.points.push_back({std::nan(""), 0.0, 0.0});
  const std::uint64_t same = mesh.points.size() - 2;
  mesh.faces.push_back({5, same, 7});
  mesh.faces.push_back({5, same, 5});
  mesh.faces.push_back({5, same + 1, 7});
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  return mesh;
}

/// The smallest angle of each face in steps of 5 degrees, and its sides by half octaves, as preview_mesh.h says.
struct Measured {
  std::array<std::uint64_t, 12> angles{};
  std::map<int, std::uint64_t> lengths;
  explicit Measured(const WholeMesh& mesh) {
    for (const MeshFace& f : mesh.faces) {
      std::array<Double3, 3> p;
      for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.points[f[k]] - mesh.points.front();
      if (!std::isfinite(p[0][0] + p[1][0] + p[2][0])) continue;
      double least = M_PI;
      for (std::size_t k = 0; k < 3; ++k) {
        const Double3 u = p[(k + 1) % 3] - p[k], v = p[(k + 2) % 3] - p[k];
        if (norm(u) > 0.0) ++lengths[static_cast<int>(std::floor(2.0 * std::log2(norm(u))))];
        least = std::min(least, norm(u) * norm(v) > 0.0 ? std::atan2(norm(cross(u, v)), dot(u, v)) : 0.0);
      }
      ++angles[std::min<std::size_t>(static_cast<std::size_t>(least * 180.0 / M_PI / 5.0), 11)];
    }
  }
};

}  // namespace

TEST_CASE("preview: figures are those of every face, of copies and of clustered meshes", "[unit]") {
  const int level = GENERATE(3, 7);
  const TempFolder folder;
  const WholeMesh mesh = stretched_ball(level);
  write_whole(folder.path() / "m.ply", mesh);
  const PreviewMesh preview = make_preview(folder.path() / "m.ply", folder.path(), kMemory);
  CHECK(preview.mesh_faces == mesh.faces.size());
  CHECK((preview.cell > 0.0) == (mesh.faces.size() > kMaxPreviewFaces));
  const Measured want(mesh);
  std::uint64_t off = 0;  // faces whose angle lies on the border of two steps
  for (std::size_t i = 0; i < 12; ++i)
    off += static_cast<std::uint64_t>(
        std::abs(static_cast<double>(preview.smallest_angle[i]) - static_cast<double>(want.angles[i])));
  CHECK(off <= 2);
  REQUIRE(preview.edge_length.size() ==
          static_cast<std::size_t>(want.lengths.rbegin()->first - want.lengths.begin()->first + 1));
  CHECK(preview.shortest_edge_bin == Approx(std::exp2(0.5 * want.lengths.begin()->first)));
  for (const auto& [bin, count] : want.lengths)
    CHECK(preview.edge_length[static_cast<std::size_t>(bin - want.lengths.begin()->first)] == count);
}

TEST_CASE("preview: of millions of faces a sample tells figures and shape, the same from memory and disk",
          "[unit]") {
  constexpr std::uint64_t kWide = 1'700, kLong = 750;  // 2.55 M faces: every other one is taken
  const auto height = [](double x, double y) { return 9.0 * std::sin(0.01 * x) * std::cos(0.013 * y); };
  const TempFolder folder;
  WholeMesh mesh;
  for (std::uint64_t j = 0; j <= kLong; ++j)
    for (std::uint64_t i = 0; i <= kWide; ++i) {
      const double x = static_cast<double>(i), y = (1.0 + 0.001 * x) * static_cast<double>(j);
      mesh.points.push_back({x, y, height(x, y)});
    }
  for (std::uint64_t j = 0; j < kLong; ++j)
    for (std::uint64_t i = 0; i < kWide; ++i) {
      const std::uint64_t a = j * (kWide + 1) + i, b = a + kWide + 1;
      mesh.faces.push_back({a, a + 1, b + 1});
      mesh.faces.push_back({a, b + 1, b});
    }
  for (Double3& p : mesh.points)
    for (double& x : p) x = static_cast<double>(static_cast<float>(x));
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(folder.path() / "m.ply", mesh);
  const PreviewMesh preview = make_preview(folder.path() / "m.ply", folder.path(), kMemory);
  CHECK(preview.mesh_faces == mesh.faces.size());

  const Measured want(mesh);
  std::uint64_t taken = 0;
  for (const std::uint64_t n : preview.smallest_angle) taken += n;
  CHECK(taken == Approx(0.5 * static_cast<double>(mesh.faces.size())).epsilon(0.001));
  for (std::size_t i = 0; i < 12; ++i)
    CHECK(static_cast<double>(preview.smallest_angle[i]) / static_cast<double>(taken) ==
          Approx(static_cast<double>(want.angles[i]) / static_cast<double>(mesh.faces.size())).margin(0.001));
  double farthest = 0.0;
  for (const Float3& p : preview.position) {
    const Double3 at = preview.origin + Double3{p[0], p[1], p[2]};
    farthest = std::max(farthest, std::abs(at[2] - height(at[0], at[1])));
  }
  CHECK(farthest < 0.05);  // cells are about 4 wide
  CHECK(preview.faces.size() > kMaxPreviewFaces / 2);

  const PreviewMesh again =
      make_preview(folder.path() / "m.ply", folder.path(), preview_bytes() + (std::uint64_t{8} << 20));
  CHECK(again.position == preview.position);
  CHECK(again.faces == preview.faces);
  CHECK(again.smallest_angle == preview.smallest_angle);
  CHECK(again.edge_length == preview.edge_length);
}

TEST_CASE("preview: a clustered mesh has about as many faces as it may, and is near the mesh", "[unit]") {
  const int level = GENERATE(7, 8);
  const TempFolder folder;
  const WholeMesh mesh = stretched_ball(level);
  write_whole(folder.path() / "m.ply", mesh);
  const PreviewMesh preview = make_preview(folder.path() / "m.ply", folder.path(), kMemory);
  REQUIRE(preview.cell > 0.0);
  CHECK(preview.faces.size() <= kMaxPreviewFaces);
  CHECK(preview.faces.size() > kMaxPreviewFaces / 2);
  double farthest = 0.0;  // from the ball that was stretched
  for (const Float3& p : preview.position) {
    const Double3 at = preview.origin + Double3{p[0], p[1], p[2]};
    const Double3 unstretched = {(at[0] - 700.0) / 40.0, at[1], std::cbrt(at[2] / 9.0)};
    farthest = std::max(farthest, std::abs(norm(unstretched) - 1.0));
  }
  CHECK(farthest < 0.1);
}

}  // namespace preview_mesh_test
