#include <catch2/catch.hpp>

#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <fstream>

#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/check/truth.h"
#include "stream/check/truth_features.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"

namespace truth_test {

using namespace tessera;

namespace {

/// A mesh in memory.
class MemoryMesh final : public MeshReader {
 public:
  MeshHeader header_;
  std::vector<Double3> positions;
  std::vector<MeshFace> triangles;
  const MeshHeader& header() const override { return header_; }
  const std::string& format() const override { return format_; }
  void read_vertices(
      const std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>& sink) override {
    sink(positions, {});
  }
  void read_faces(const std::function<void(std::span<const MeshFace>)>& sink) override { sink(triangles); }

 private:
  std::string format_ = "memory";
};

/// Each side of the cube [-e, e]^3 as an n x n grid, corners of neighbouring sides shared.
MemoryMesh cube(double e, int n) {
  MemoryMesh mesh;
  std::vector<std::array<int, 3>> names;
  const auto vertex = [&](const std::array<int, 3>& name) {
    for (std::size_t i = 0; i < names.size(); ++i) {
      if (names[i] == name) return static_cast<std::uint64_t>(i);
    }
    names.push_back(name);
    Double3 p;
    for (std::size_t a = 0; a < 3; ++a) p[a] = e * (2.0 * name[a] / n - 1.0);
    mesh.positions.push_back(p);
    return static_cast<std::uint64_t>(names.size() - 1);
  };
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (const int side : {0, n}) {
      for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
          const auto at = [&](int u, int v) {
            std::array<int, 3> name{};
            name[axis] = side;
            name[(axis + 1) % 3] = u;
            name[(axis + 2) % 3] = v;
            return vertex(name);
          };
          const auto a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
          if (side) {
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({a, c, d});
          } else {
            mesh.triangles.push_back({a, c, b});
            mesh.triangles.push_back({a, d, c});
          }
        }
      }
    }
  }
  return mesh;
}

TruthFile cube_truth() {
  TruthFile truth;
  truth.scene = {"cube", 0, 1.0};
  truth.spacing = 0.1;
  return truth;
}

TruthOptions options_for(double h) {
  TruthOptions o;
  o.h = h;
  o.threads = 2;
  o.coverage_samples = 5000;
  return o;
}

}  // namespace

TEST_CASE("truth: the cube itself has no deviation and all its creases", "[unit]") {
  MemoryMesh mesh = cube(1.0, 10);
  const TruthReport r = compare_with_truth(mesh, cube_truth(), options_for(0.2));
  CHECK(r.vertices.count() == mesh.positions.size());
  CHECK(r.centres.count() == mesh.triangles.size());
  CHECK(r.vertices.max() < 1e-12);
  CHECK(r.centres.max() < 1e-12);
  REQUIRE(r.has_creases);
  CHECK(r.sharp_edges == 120);
  CHECK(r.sharp_vertices.max() < 1e-12);
  CHECK(r.corners.count() == 8);
  CHECK(r.corners.max() < 1e-12);
  CHECK(r.crease_recovered == 1.0);
  CHECK(r.normal_near_deg < 1e-6);
  CHECK(r.normal_away_deg < 1e-6);
  CHECK(r.coverage.max() < 1e-6);
}

TEST_CASE("truth: a cube that is too large is off by what it is too large", "[unit]") {
  MemoryMesh mesh = cube(1.01, 10);
  const TruthReport r = compare_with_truth(mesh, cube_truth(), options_for(0.2));
  CHECK(r.vertices.max() == Approx(std::sqrt(3.0) * 0.01));
  CHECK(r.centres.mean() == Approx(0.01).epsilon(0.1));
  CHECK(r.mean_signed > 0.0099);
  CHECK(r.vertices.share_beyond() == 1.0);  // 0.02 h is 0.004
  CHECK(r.sharp_vertices.mean() == Approx(std::sqrt(2.0) * 0.01).epsilon(0.05));
  CHECK(r.crease_recovered > 0.9);  // within h/10 = 0.02
  CHECK(r.coverage.mean() == Approx(0.01).epsilon(0.05));
  const double p95 = r.vertices.percentile(0.95);
  CHECK(p95 >= r.vertices.mean());
  CHECK(p95 <= r.vertices.max());
}

TEST_CASE("truth: chamfers are not creases and cost normals", "[unit]") {
  MemoryMesh mesh = cube(1.0, 10);
  // Pulls everything on an edge 0.03 towards the centre line: corners get two obtuse edges instead of one.
  for (auto& p : mesh.positions) {
    int on = 0;
    for (const double v : p) on += std::fabs(std::fabs(v) - 1.0) < 1e-9;
    if (on < 2) continue;
    for (double& v : p) {
      if (std::fabs(std::fabs(v) - 1.0) < 1e-9) v *= 0.92;
    }
  }
  const TruthReport r = compare_with_truth(mesh, cube_truth(), options_for(0.2));
  CHECK(r.crease_recovered < 0.1);
  CHECK(r.normal_near_deg > 5.0);
  CHECK(r.corners.mean() > 0.1);
}

TEST_CASE("truth: shift of the scan and of the file are taken out, threads change nothing", "[property]") {
  MemoryMesh mesh = cube(1.0, 8);
  TruthFile truth = cube_truth();
  truth.shift = {1000, -2000, 30};
  mesh.header_.shift = {1000, -2000, 30};
  for (auto& p : mesh.positions) p[0] += 0.01 * p[1] * p[2];
  TruthOptions o = options_for(0.2);
  const Json first = to_json(compare_with_truth(mesh, truth, o));
  CHECK(first.at("vertices").at("max").get<double>() < 0.011);
  o.threads = 1;
  CHECK(to_json(compare_with_truth(mesh, truth, o)) == first);
  mesh.header_.shift = {0, 0, 0};
  for (auto& p : mesh.positions) p = {p[0] + 1000, p[1] - 2000, p[2] + 30};
  CHECK(compare_with_truth(mesh, truth, o).vertices.max() < 0.011);
}

TEST_CASE("truth: coverage finds what is missing", "[unit]") {
  MemoryMesh mesh = cube(1.0, 8);
  mesh.triangles.resize(mesh.triangles.size() - 128);  // one side of six
  const TruthReport r = compare_with_truth(mesh, cube_truth(), options_for(0.1));
  CHECK(r.coverage.share_beyond() == Approx(0.9 * 0.9 / 6.0).epsilon(0.1));
  CHECK(r.coverage.max() == Approx(0.3));
}

TEST_CASE("truth: distance to a triangle by brute force", "[property]") {
  const Double3 a{0, 0, 0}, b{1, 0.2, 0}, c{0.3, 0.9, 0.4};
  for (std::uint64_t i = 0; i < 200; ++i) {
    const auto u = [&](std::uint64_t s) { return 3.0 * to_unit(random_bits(1, s, i)) - 1.0; };
    const Double3 p{u(1), u(2), u(3)};
    double brute = 1e9;
    for (int s = 0; s <= 100; ++s) {
      for (int t = 0; s + t <= 100; ++t) {
        const Double3 q = a + (b - a) * (s / 100.0) + (c - a) * (t / 100.0);
        brute = std::min(brute, norm(p - q));
      }
    }
    const double d = std::sqrt(squared_distance(p, a, b, c));
    CHECK(d <= brute + 1e-12);
    CHECK(d > brute - 0.01);
  }
}

TEST_CASE("truth: a damaged sidecar is named", "[unit]") {
  std::string name = (std::filesystem::temp_directory_path() / "tessera-truth-XXXXXX").string();
  const int fd = ::mkstemp(name.data());
  REQUIRE(fd >= 0);
  ::close(fd);
  for (const std::string text : {"", "{", "{}", "[1]", R"({"schema":1,"scene":"cube"})", R"({"schema":9})"}) {
    CAPTURE(text);
    std::ofstream(name) << text;
    CHECK_THROWS_AS(read_truth(name), InputError);
  }
  std::filesystem::remove(name);
  CHECK_THROWS_AS(read_truth(name), InputError);
}

}  // namespace truth_test
