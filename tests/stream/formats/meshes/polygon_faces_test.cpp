#include "stream/formats/meshes/polygon_faces.h"

#include <algorithm>

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::polygon_faces_test {
namespace {

using Catch::Contains;
using test::read_whole;
using test::TempFolder;
using test::WholeMesh;
using Polygons = std::vector<std::vector<int>>;

/// A mesh of polygons in the text of a format: .obj, .off or .ply (ascii), or .ply in binary.
std::string text_of(const std::string& name, const std::vector<Double3>& points, const Polygons& faces) {
  const auto number = [](double v) { return std::to_string(v); };
  const bool is_obj = name.ends_with(".obj");
  std::string text;
  const auto counts = std::to_string(points.size()) + " ";
  if (name.ends_with(".off")) text = "OFF\n" + counts + std::to_string(faces.size()) + " 0\n";
  if (name.ends_with(".ply"))
    text = "ply\nformat ascii 1.0\nelement vertex " + counts +
           "\nproperty double x\nproperty double y\nproperty double z\nelement face " +
           std::to_string(faces.size()) + "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Double3& p : points)
    text += (is_obj ? "v " : "") + number(p[0]) + " " + number(p[1]) + " " + number(p[2]) + "\n";
  for (const auto& f : faces) {
    text += is_obj ? "f" : std::to_string(f.size());
    for (const int v : f) text += " " + std::to_string(is_obj ? v + 1 : v);
    text += "\n";
  }
  return text;
}

MeshCheck check(const std::filesystem::path& path) {
  MeshCheckOptions options;
  options.weld = true;
  return check_mesh(*open_mesh_file(path), options);
}

/// What stands between two copies of an outline, `height` apart along z.
void extrude(std::vector<Double3>& points, Polygons& faces, double height, const Polygons& rings) {
  const auto n = static_cast<int>(points.size());
  for (int i = 0; i < n; ++i) points.push_back({points[i][0], points[i][1], height});
  const Polygons low = faces;
  for (std::vector<int> f : low) {
    for (int& v : f) v += n;
    faces.push_back(f);
  }
  for (std::size_t i = 0; i < low.size(); ++i) std::reverse(faces[i].begin(), faces[i].end());
  for (const auto& ring : rings)
    for (std::size_t i = 0; i < ring.size(); ++i) {
      const int a = ring[i], b = ring[(i + 1) % ring.size()];
      faces.push_back({a, b, b + n, a + n});
    }
}

TEST_CASE("polygon faces: concave ends of a prism have their area in every format", "[unit]") {
  const TempFolder folder;
  for (const std::string name : {"a.obj", "a.off", "a.ply"})
    for (int first = 0; first < 6; ++first) {
      CAPTURE(name, first);
      std::vector<Double3> points = {{0, 0, 0}, {2, 0, 0}, {2, 1, 0}, {1, 1, 0}, {1, 2, 0}, {0, 2, 0}};
      std::vector<int> ring;
      for (int i = 0; i < 6; ++i) ring.push_back((first + i) % 6);
      Polygons faces = {ring};
      extrude(points, faces, 2.0, {{0, 1, 2, 3, 4, 5}});
      const MeshCheck c = check(folder.write(name, text_of(name, points, faces)));
      CHECK(c.volume == Approx(6.0));
      CHECK(c.area == Approx(2 * 3.0 + 8.0 * 2.0));
      CHECK(c.boundary_edges == 0);
      CHECK(c.defects().empty());
    }
}

TEST_CASE("polygon faces: the window of a wall stays open", "[unit]") {
  const TempFolder folder;
  for (const std::string name : {"a.obj", "a.off", "a.ply"}) {
    CAPTURE(name);
    std::vector<Double3> points = {{0, 0, 0}, {10, 0, 0}, {10, 6, 0}, {0, 6, 0},
                                   {3, 2, 0}, {3, 4, 0},  {7, 4, 0},  {7, 2, 0}};
    Polygons faces = {{0, 1, 2, 3, 0, 4, 5, 6, 7, 4}};
    extrude(points, faces, 0.3, {{0, 1, 2, 3}, {4, 5, 6, 7}});
    const MeshCheck c = check(folder.write(name, text_of(name, points, faces)));
    CHECK(c.volume == Approx((60.0 - 8.0) * 0.3));
    CHECK(c.area == Approx(2 * 52.0 + (32.0 + 12.0) * 0.3));
    CHECK(c.boundary_edges == 0);
    CHECK(c.defects().empty());
  }
}

TEST_CASE("polygon faces: quads keep the diagonal from their first corner, darts get the other one",
          "[unit]") {
  const TempFolder folder;
  const std::vector<Double3> points = {{0, 0, 0}, {2, -1, 0}, {0.5, 0, 0}, {2, 1, 0}, {3, 0, 0}};
  const WholeMesh mesh = read_whole(folder.write(
      "a.obj", text_of("a.obj", points, {{0, 1, 4, 3}, {0, 1, 2, 3}, {1, 2, 3, 0}, {3, 0, 1, 2}})));
  CHECK(mesh.faces ==
        std::vector<MeshFace>{
            {0, 1, 4}, {0, 4, 3}, {0, 1, 2}, {0, 2, 3}, {0, 1, 2}, {3, 0, 2}, {2, 3, 0}, {1, 2, 0}});
}

TEST_CASE("polygon faces: corners repeated in a file make no faces, a polygon of none but those is kept",
          "[unit]") {
  const TempFolder folder;
  const std::vector<Double3> points = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}};
  const WholeMesh mesh = read_whole(folder.write(
      "a.obj", text_of("a.obj", points, {{0, 1, 2, 2}, {0, 0, 1, 2, 3, 0}, {0, 1, 0, 2, 3}, {1, 2, 2, 1}})));
  CHECK(mesh.faces ==
        std::vector<MeshFace>{{0, 1, 2}, {0, 1, 2}, {0, 2, 3}, {2, 3, 0}, {1, 2, 2}, {1, 2, 1}});
}

TEST_CASE("polygon faces: outlines that cross themselves are told of", "[unit]") {
  const TempFolder folder;
  const auto path = folder.write(
      "a.obj", text_of("a.obj", {{0, 0, 0}, {4, 0, 0}, {4, 4, 0}, {1, -1, 0}, {0, 4, 0}}, {{0, 1, 2, 3, 4}}));
  const auto reader = open_mesh_file(path);
  for (int pass = 0; pass < 2; ++pass) {
    std::size_t faces = 0;
    reader->read_faces([&](auto batch) { faces += batch.size(); });
    CHECK(faces == 3);
  }
  REQUIRE(reader->warnings().size() == 1);
  CHECK_THAT(reader->warnings()[0], Contains("1 face crosses itself"));
}

TEST_CASE("polygon faces: positions beyond the memory come from a file, in any order", "[unit]") {
  // A strip of darts, their corners far apart in the file: every page is needed again and again.
  constexpr int kDarts = 120000;
  std::vector<Double3> points(4 * kDarts);
  for (int i = 0; i < kDarts; ++i) {
    const double x = 3.0 * i;
    const Double3 corners[] = {{x, 0, 0}, {x + 2, -1, 0}, {x + 0.5, 0, 0}, {x + 2, 1, 0}};
    for (int k = 0; k < 4; ++k) points[static_cast<std::size_t>(k * kDarts + i)] = corners[k];
  }
  REQUIRE(points.size() * sizeof(Double3) > PolygonFaces::kMemoryBytes);
  PolygonFaces faces(
      [&](const auto& sink) {
        for (std::size_t i = 0; i < points.size(); i += 5000)
          sink(std::span(points).subspan(i, std::min<std::size_t>(5000, points.size() - i)), {});
      },
      {});
  faces.begin();
  std::vector<std::array<std::uint64_t, 3>> triangles;
  for (int i = 0; i < kDarts; ++i) {
    const auto at = [&](int k) {
      return static_cast<std::uint64_t>((k % 4) * kDarts + (i * 7919LL) % kDarts);
    };
    const std::uint64_t corners[] = {at(1), at(2), at(3), at(0)};
    triangles.clear();
    faces.triangulate(corners, triangles);
    REQUIRE(triangles ==
            std::vector<std::array<std::uint64_t, 3>>{{at(0), at(1), at(2)}, {at(3), at(0), at(2)}});
  }
  CHECK(faces.warning().empty());
}

TEST_CASE("polygon faces: a face of more corners than are taken is refused", "[fault]") {
  const TempFolder folder;
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf";
  for (int i = 0; i < 140000; ++i) text += i % 3 == 0 ? " 1" : i % 3 == 1 ? " 2" : " 3";
  const auto path = folder.write("a.obj", text);
  CHECK_THROWS_WITH(read_whole(path), Contains("line 4") && Contains("131072 corners"));
  CHECK_THROWS_AS(read_whole(path), InputError);
}

}  // namespace
}  // namespace tessera::polygon_faces_test
