// What `decimate` and `reconstruct` certify, asked of points: no sample of either surface lies farther from the other than
// was proven. The distances are found by other code than that which proves.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/reconstruct_command.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace certificate_samples_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

Double3 minus(const Double3& a, const Double3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}
double product(const Double3& a, const Double3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
Double3 across(const Double3& a, const Double3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
Double3 between(const Double3& a, const Double3& b, double t) {
  return {a[0] + t * (b[0] - a[0]), a[1] + t * (b[1] - a[1]), a[2] + t * (b[2] - a[2])};
}

double square_to_segment(const Double3& p, const Double3& a, const Double3& b) {
  const Double3 ab = minus(b, a);
  const double length = product(ab, ab);
  const double t = length > 0.0 ? std::clamp(product(minus(p, a), ab) / length, 0.0, 1.0) : 0.0;
  const Double3 d = minus(p, between(a, b, t));
  return product(d, d);
}

/// To the plane where the foot lies inside, else to the three sides.
double square_to_triangle(const Double3& p, const std::array<Double3, 3>& t) {
  const Double3 n = across(minus(t[1], t[0]), minus(t[2], t[0]));
  const double area = product(n, n);
  bool inside = area > 0.0;
  double minimum = 1e300;
  for (std::size_t k = 0; k < 3; ++k) {
    const Double3 &a = t[k], &b = t[(k + 1) % 3];
    inside = inside && product(across(minus(b, a), minus(p, a)), n) >= 0.0;
    minimum = std::min(minimum, square_to_segment(p, a, b));
  }
  if (!inside) return minimum;
  const double height = product(minus(p, t[0]), n);
  return std::min(minimum, height * height / area);
}

/// Triangles by the cells of a grid that their boxes touch.
class Grid {
 public:
  Grid(const WholeMesh& mesh, double max_distance) : mesh_(mesh) {
    low_ = high_ = mesh.points.at(0);
    for (const Double3& p : mesh.points)
      for (std::size_t k = 0; k < 3; ++k)
        low_[k] = std::min(low_[k], p[k]), high_[k] = std::max(high_[k], p[k]);
    const Double3 size = minus(high_, low_);
    cell_ = std::max(max_distance, std::sqrt(product(size, size)) / 160.0);
    for (std::size_t k = 0; k < 3; ++k) count_[k] = static_cast<long>(size[k] / cell_) + 1;
    faces_.resize(static_cast<std::size_t>(count_[0] * count_[1] * count_[2]));
    for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
      const auto t = triangle(f);
      Double3 low = t[0], high = t[0];
      for (const Double3& p : t)
        for (std::size_t k = 0; k < 3; ++k)
          low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
      for_cells(low, high,
                [&](std::vector<std::uint32_t>& cell) { cell.push_back(static_cast<std::uint32_t>(f)); });
    }
  }

  std::array<Double3, 3> triangle(std::size_t f) const {
    const MeshFace& face = mesh_.faces[f];
    return {mesh_.points[face[0]], mesh_.points[face[1]], mesh_.points[face[2]]};
  }

  /// Right where it is at most `max_distance`; more, where it is more.
  double distance(const Double3& p, double max_distance) {
    Double3 low = p, high = p;
    for (std::size_t k = 0; k < 3; ++k) low[k] -= max_distance, high[k] += max_distance;
    double minimum = 1e300;
    for_cells(low, high, [&](const std::vector<std::uint32_t>& cell) {
      for (const std::uint32_t f : cell) minimum = std::min(minimum, square_to_triangle(p, triangle(f)));
    });
    return std::sqrt(minimum);
  }

 private:
  template <class Visit>
  void for_cells(const Double3& low, const Double3& high, Visit&& visit) {
    long first[3], last[3];
    for (std::size_t k = 0; k < 3; ++k) {
      first[k] = std::clamp(static_cast<long>(std::floor((low[k] - low_[k]) / cell_)), 0L, count_[k] - 1);
      last[k] = std::clamp(static_cast<long>(std::floor((high[k] - low_[k]) / cell_)), 0L, count_[k] - 1);
    }
    for (long z = first[2]; z <= last[2]; ++z)
      for (long y = first[1]; y <= last[1]; ++y)
        for (long x = first[0]; x <= last[0]; ++x)
          visit(faces_[static_cast<std::size_t>((z * count_[1] + y) * count_[0] + x)]);
  }

  const WholeMesh& mesh_;
  Double3 low_{}, high_{};
  double cell_ = 0.0;
  long count_[3] = {};
  std::vector<std::vector<std::uint32_t>> faces_;
};

/// Points spread evenly over the area of a mesh, one in each of so many equal parts of it; then its used vertices.
std::vector<Double3> samples_of(const WholeMesh& mesh, std::size_t count, Random& random) {
  std::vector<double> area;
  double all = 0.0;
  std::vector<Double3> out;
  for (const MeshFace& f : mesh.faces) {
    const Double3 &a = mesh.points[f[0]], &b = mesh.points[f[1]], &c = mesh.points[f[2]];
    const Double3 n = across(minus(b, a), minus(c, a));
    all += std::sqrt(product(n, n));
    area.push_back(all);
    out.push_back(a);
    out.push_back(b);
    out.push_back(c);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const double at = (static_cast<double>(i) + random.unit()) / static_cast<double>(count) * all;
    const auto f = static_cast<std::size_t>(std::lower_bound(area.begin(), area.end(), at) - area.begin());
    const MeshFace& face = mesh.faces[std::min(f, area.size() - 1)];
    const double r = std::sqrt(random.unit());
    out.push_back(
        between(mesh.points[face[0]], between(mesh.points[face[1]], mesh.points[face[2]], random.unit()), r));
  }
  return out;
}

double diagonal(const WholeMesh& mesh) {
  Double3 low = mesh.points.at(0), high = low;
  for (const MeshFace& f : mesh.faces)
    for (const std::uint64_t v : f)
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], mesh.points[v][k]);
        high[k] = std::max(high[k], mesh.points[v][k]);
      }
  const Double3 d = minus(high, low);
  return std::sqrt(product(d, d));
}

/// Asks samples of both surfaces whether they lie within what was proven. \param samples  of each
void ask_samples(const std::string& name, const WholeMesh& given, const WholeMesh& result, double proven,
                 std::size_t samples) {
  double worst = 0.0;
  std::size_t beyond = 0;
  Random random(19);
  for (const bool back : {false, true}) {
    const WholeMesh &from = back ? given : result, &to = back ? result : given;
    Grid grid(to, proven);
    // The file holds floats: as far as the last bit of the largest coordinate.
    for (const Double3& p : samples_of(from, samples, random)) {
      const double d = grid.distance(p, proven * 1.0001);
      worst = std::max(worst, d);
      beyond += d > proven * 1.0001;
    }
  }
  std::printf("%s: %zu -> %zu faces, proven %.4g, farthest sample %.3f of it, %zu beyond\n", name.c_str(),
              given.faces.size(), result.faces.size(), proven, worst / proven, beyond);
  CHECK(beyond == 0);
  CHECK(worst > 0.3 * proven);  // else the proof would be idle, or the samples
}

/// Decimates each mesh and asks samples of both surfaces. \param samples  of each
void check_samples(const std::vector<fs::path>& meshes, std::size_t samples) {
  const TempFolder folder;
  for (const fs::path& path : meshes) {
    INFO(path);
    const WholeMesh given = read_whole(path);
    const std::string said = std::to_string(2e-3 * diagonal(given));
    const double tolerance = std::stod(said);
    const fs::path out = folder.path() / "out.ply";
    const CommandResult r = tessera_command({"decimate", path.string(), "-o", out.string(), "--tolerance",
                                             said, "--progress", "none", "-q", "--no-html", "--force"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const auto report = parse_json(file_bytes(out.string() + ".report.json"));
    const double proven = report.at("certificate").at("certified_max").get<double>();
    REQUIRE(proven > 0.0);
    REQUIRE(proven <= tolerance);
    const WholeMesh result = read_whole(out);
    REQUIRE(result.faces.size() < given.faces.size());
    ask_samples(path.filename(), given, result, proven, samples);
  }
}

}  // namespace

TEST_CASE("certificate samples: triangles and grid agree with distances known by hand", "[unit]") {
  const std::array<Double3, 3> t = {{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}}};
  CHECK(square_to_triangle({0.5, 0.5, 3.0}, t) == Approx(9.0));
  CHECK(square_to_triangle({-3.0, 0.5, 4.0}, t) == Approx(25.0));
  CHECK(square_to_triangle({2.0, 2.0, 0.0}, t) == Approx(2.0));
  CHECK(square_to_triangle({3.0, -1.0, 0.0}, t) == Approx(2.0));
  WholeMesh mesh;
  mesh.points = {t[0], t[1], t[2], {50, 50, 50}, {51, 50, 50}, {50, 51, 50}};
  mesh.faces = {{0, 1, 2}, {3, 4, 5}};
  Grid grid(mesh, 0.1);
  CHECK(grid.distance({0.5, 0.5, 0.05}, 0.1) == Approx(0.05));
  CHECK(grid.distance({50.2, 50.2, 50.07}, 0.1) == Approx(0.07));
  CHECK(grid.distance({25.0, 25.0, 25.0}, 0.1) > 0.1);
}

TEST_CASE("certificate samples: points of bodies, needles and soups lie within what was proven",
          "[property]") {
  const TempFolder folder;
  const WholeMesh body = made_body(5);
  const std::pair<const char*, WholeMesh> made[] = {
      {"body.ply", body},
      {"open.glb", made_open_body(5)},
      {"cylinder.stl", made_cylinder(400, 1.0, 9.0)},
      {"crossing.ply", joined(body, body, {0.7, 0.2, 0.1})},
      {"torn.ply", joined(torn(made_body(3)), body, {2.5, 0, 0})}};
  std::vector<fs::path> meshes;
  for (const auto& [name, mesh] : made) write_whole(meshes.emplace_back(folder / name), mesh);
  check_samples(meshes, 50000);
}

TEST_CASE(
    "certificate samples: what reconstruct proves holds against the mesh that it writes without a tolerance",
    "[property]") {
  const TempFolder folder;
  const fs::path scan = folder / "scan.ply", raw = folder / "raw.ply", out = folder / "out.ply";
  const auto [scene, noise] = GENERATE(std::pair{"terrain", "0"}, std::pair{"terrain", "0.2s"},
                                       std::pair{"statue", "0"}, std::pair{"statue", "0.2s"});
  INFO(scene << " with noise of " << noise);
  REQUIRE(tessera_command({"synth", "--scene", scene, "--points", "30000", "--normals", "--noise", noise,
                           "-o", scan.string()})
              .code == 0);
  // A border is smoothed in the mesh of full resolution alone, where a scan is exact.
  for (const std::string border : {"raw", "auto"}) {
    if (border == "auto" && std::string(noise) == "0") continue;
    INFO("border " << border);
    reconstructed(scan, raw, {"--border", border, "--force"});
    const Json report = reconstructed(scan, out, {"--border", border, "--tolerance", "auto", "--force"});
    const Json& certificate = report.at("certificate");
    CHECK(certificate.at("proven") == true);
    ask_samples(std::string(scene) + ", noise " + noise + ", border " + border, read_whole(raw),
                read_whole(out), certificate.at("certified_max").get<double>(), 20000);
  }
}

TEST_CASE("certificate samples: a million points of twenty meshes lie within what was proven",
          "[property][.large][.shared]") {
  if (!has_shared_data()) return;
  std::vector<fs::path> meshes;
  for (const char* name : {"meshes/armadillo-100k.obj",
                           "meshes/block.obj",
                           "meshes/bunny.ply",
                           "meshes/casting-10k.off",
                           "meshes/face.obj",
                           "meshes/fandisk-52k.obj",
                           "meshes/gargo.ply",
                           "meshes/horse.ply",
                           "meshes/igea-tri.ply",
                           "meshes/laurana.ply",
                           "meshes/max-planck-20k.obj",
                           "meshes/mechanical1.obj",
                           "meshes/rocker-arm.ply",
                           "meshes/turbineblade.ply",
                           "dirty/abominevole.off",
                           "dirty/beetle-alt.obj",
                           "dirty/generic-twin-left.obj",
                           "dirty/self-intersect-a.obj",
                           "dirty/thingi-43149-soup.off",
                           "dirty/trumpet.obj"})
    meshes.push_back(kSharedData / name);
  check_samples(meshes, 500000);
}

}  // namespace certificate_samples_test
