// tessera smooth --method denoise on meshes whose noise is known.
#include <catch2/catch.hpp>

#include <array>
#include <cmath>

#include "kernels/mesh/closest_face.h"
#include "octree/vector.h"
#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace denoise_command_test {

using namespace tessera;
using namespace tessera::test;
namespace fs = std::filesystem;

namespace {

/// Denoises the mesh with noise of a fifth of its edges on it. \returns how many times nearer to the truth it is
double gain(const WholeMesh& clean, Json& figures) {
  const TempFolder folder;
  const fs::path in = folder.path() / "noisy.ply", out = folder.path() / "denoised.ply";
  std::vector<std::array<std::uint32_t, 3>> faces;
  double edges = 0.0;
  for (const MeshFace& f : clean.faces) {
    faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                     static_cast<std::uint32_t>(f[2])});
    for (std::size_t k = 0; k < 3; ++k) edges += norm(clean.points[f[k]] - clean.points[f[(k + 1) % 3]]);
  }
  const double deviation = 0.2 * edges / static_cast<double>(3 * faces.size());
  WholeMesh noisy = clean;
  Random random(7);
  for (Double3& p : noisy.points)
    for (double& x : p) x += deviation * random.gaussian();
  write_whole(in, noisy);
  const CommandResult r = tessera_command({"smooth", in.string(), "-o", out.string(), "--method", "denoise",
                                           "--progress", "none", "-q", "--no-html"});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const ClosestFaces truth(clean.points, faces, clean.points[0]);
  const auto distance = [&](const WholeMesh& mesh) {
    double sum = 0.0;
    for (const Double3& p : mesh.points)
      sum += std::sqrt(truth.closest(p - clean.points[0], 1e300, ClosestFaces::kNone).square);
    return sum / static_cast<double>(mesh.points.size());
  };
  figures = parse_json(file_bytes(out.string() + ".report.json")).at("mesh");
  return distance(noisy) / distance(read_whole(out));
}

}  // namespace

TEST_CASE("smooth: denoising brings a bracket several times nearer to the truth and turns faces back",
          "[property]") {
  Json mesh;
  CHECK(gain(made_bracket(30), mesh) > 3.9);
  const int before = mesh.at("turned_faces_before").get<int>();
  CHECK(before > 150);
  CHECK(5 * mesh.at("turned_faces").get<int>() < before);  // on creases, which stay
}

TEST_CASE(
    "smooth: denoising brings the rocker arm nearly four times nearer to the truth and turns faces back",
    "[property][.shared]") {
  if (!has_shared_data()) return;
  Json mesh;
  CHECK(gain(read_whole(kSharedData / "meshes/rocker-arm.ply"), mesh) > 3.9);
  CHECK(mesh.at("turned_faces_before").get<int>() > 1000);
  CHECK(mesh.at("turned_faces").get<int>() < 20);  // on creases, which stay
}

TEST_CASE("smooth: far more threads than the cap feeds take turns, and make the same bytes", "[pipeline]") {
  const TempFolder folder;
  const auto at = [&](const char* name) { return (folder.path() / name).string(); };
  REQUIRE(
      tessera_command({"synth", "--scene", "terrain", "--points", "60000", "--normals", "-o", at("scan.ply")})
          .code == 0);
  REQUIRE(tessera_command({"reconstruct", at("scan.ply"), "-o", at("mesh.ply"), "-q"}).code == 0);
  for (const auto& [threads, out] : {std::pair{"1", "one.ply"}, std::pair{"64", "many.ply"}}) {
    const CommandResult r = tessera_command({"smooth", at("mesh.ply"), "-o", at(out), "--method", "denoise",
                                             "--memory", "512M", "--threads", threads, "-q"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
  }
  CHECK(file_bytes(at("one.ply")) == file_bytes(at("many.ply")));
}

}  // namespace denoise_command_test
