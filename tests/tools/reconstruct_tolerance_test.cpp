// reconstruct --tolerance: the first pass runs on patches in memory, and nothing of how it runs shows in the result.
#include <catch2/catch.hpp>

#include <string>
#include <vector>

#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/reconstruct_command.h"
#include "tests/helpers/serial_job.h"

namespace reconstruct_tolerance_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

std::string scan(const fs::path& folder, const std::string& scene, const std::string& points,
                 std::vector<std::string> more = {}) {
  const std::string path = (folder / (scene + ".ply")).string();
  std::vector<std::string> words = {"synth", "--scene", scene, "--points", points, "--normals", "-o", path};
  words.insert(words.end(), more.begin(), more.end());
  REQUIRE(tessera_command(words).code == 0);
  return path;
}

}  // namespace

TEST_CASE("reconstruct --tolerance auto: a fifth of h or the noise, and the same bytes as that number",
          "[pipeline]") {
  const TempFolder folder;
  const std::string noise = GENERATE("0.1s", "0.5s");
  const std::string in = scan(folder.path(), "terrain", "60000", {"--noise", noise});
  const fs::path out = folder.path() / "out.ply", given = folder.path() / "given.ply";
  const std::string border = noise == "0.1s" ? "auto" : "smooth";  // both ways to the mesh of full resolution
  const Json report =
      reconstructed(in, out, {"--tolerance", "auto", "--border", border, "--resolution", "4"});
  const Json& tolerance = report.at("tolerance");
  const auto taken = tolerance.at("taken").get<double>();
  CHECK(tolerance.at("h") == 4.0);
  CHECK(taken == std::max(0.8, tolerance.at("noise").get<double>()));
  CHECK((taken > 0.8) == (noise == "0.5s"));
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(report.at("certificate").at("tolerance").get<double>() == taken);
  reconstructed(in, given, {"--tolerance", dump_json(Json(taken)), "--border", border, "--resolution", "4"});
  CHECK(file_bytes(given) == file_bytes(out));
}

TEST_CASE("reconstruct --tolerance: same bytes over tiles, threads, caps, processes and kills",
          "[property]") {
  const TempFolder folder;
  const std::string in = scan(folder.path(), "terrain", "150000");
  const std::vector<std::string> base = {"--resolution", "3.9", "--tolerance", "0.4"};
  const auto bytes = [&](std::vector<std::string> more) {
    const fs::path out = folder.path() / "out.ply";
    fs::remove(out);
    more.insert(more.end(), base.begin(), base.end());
    const Json report = reconstructed(in, out, more);
    CHECK_FALSE(fs::exists(out.string() + ".tessera"));
    CHECK(report.at("certificate").at("proven") == true);
    CHECK(report.at("certificate").at("certified_max").get<double>() <= 0.4);
    CHECK(report.at("mesh").at("faces").get<int>() * 10 < report.at("raw_mesh").at("faces").get<int>());
    return file_bytes(out);
  };
  const std::string want = bytes({"-t", "1", "--tile-size", "64", "--memory", "2G"});
  CHECK(bytes({"-t", "2", "--tile-size", "128", "--memory", "2G"}) == want);
  CHECK(bytes({"-t", "5", "--tile-size", "256", "--memory", "2G"}) == want);
  CHECK(bytes({"-t", "2", "--memory", "256M"}) == want);
  CHECK(bytes({"-t", "2", "--processes"}) == want);

  const fs::path out = folder.path() / "killed.ply";
  const std::vector<std::string> words =
      reconstruct_words(in, out, {"--resolution", "3.9", "--tolerance", "0.4", "-t", "2"});
  REQUIRE(resumed_after_kills(words).code == 0);
  CHECK(file_bytes(out) == want);
}

TEST_CASE("reconstruct --tolerance: the bound holds against the mesh that the job without it writes",
          "[property]") {
  const TempFolder folder;
  const std::string scene = GENERATE("fandisk", "terrain");
  const std::string in = scan(folder.path(), scene, "60000", {"--outliers", "0.001"});
  const fs::path raw = folder.path() / "raw.ply", small = folder.path() / "small.ply";
  const std::string border = GENERATE("raw", "smooth");
  const Json full = reconstructed(in, raw, {"--border", border});
  const std::string tolerance = dump_json(Json(0.2 * stage_result(full, "surface").at("h").get<double>()));
  const Json report = reconstructed(in, small, {"--tolerance", tolerance, "--keep-raw", "--border", border});
  CHECK(report.at("raw_mesh").at("faces") == full.at("mesh").at("faces"));
  for (const char* key : {"components", "largest_component_faces", "islands_dropped", "island_faces_dropped"})
    CHECK(report.at("mesh").at(key) == full.at("mesh").at(key));
  const fs::path kept = folder.path() / "small.raw.ply";
  const MeshCheck a = checked(kept, folder.path()), b = checked(raw, folder.path());
  CHECK(a.vertices == b.vertices);
  CHECK(a.faces == b.faces);
  CHECK(a.boundary_edges == b.boundary_edges);
  CHECK(a.boundary_loops == b.boundary_loops);
  CHECK(a.total_genus == b.total_genus);
  CHECK(checked(small, folder.path()).defects().empty());
  const auto proven = [&](const fs::path& mesh, const fs::path& reference, const std::string& e) {
    return tessera_command({"check", mesh.string(), "--reference", reference.string(), "--tolerance", e})
        .code;
  };
  CHECK(proven(kept, raw, "1e-9") == 0);
  CHECK(proven(small, raw, tolerance) == 0);
}

TEST_CASE("reconstruct --tolerance: marks of closing faces survive", "[property]") {
  const TempFolder folder;
  const std::string in = scan(folder.path(), "sphere", "40000", {"--missing", "0.2"});
  const fs::path raw = folder.path() / "raw.ply", small = folder.path() / "small.ply";
  const Json full = reconstructed(in, raw, {"--holes", "close"});
  const std::string tolerance = dump_json(Json(0.3 * stage_result(full, "surface").at("h").get<double>()));
  const Json report = reconstructed(in, small, {"--holes", "close", "--tolerance", tolerance});
  const auto area = [](const fs::path& file, std::uint8_t mark) {
    const auto mesh = open_mesh_file(file);
    std::vector<Double3> position;
    mesh->read_vertices(
        [&](std::span<const Double3> p, auto) { position.insert(position.end(), p.begin(), p.end()); });
    double sum = 0.0;
    mesh->read_flagged_faces([&](std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
      REQUIRE(synthetic.size() == faces.size());
      for (std::size_t f = 0; f < faces.size(); ++f) {
        if (synthetic[f] != mark) continue;
        const Double3 &a = position[faces[f][0]], &b = position[faces[f][1]], &c = position[faces[f][2]];
        Double3 u, v;
        for (std::size_t k = 0; k < 3; ++k) u[k] = b[k] - a[k], v[k] = c[k] - a[k];
        const double x = u[1] * v[2] - u[2] * v[1], y = u[2] * v[0] - u[0] * v[2],
                     z = u[0] * v[1] - u[1] * v[0];
        sum += 0.5 * std::sqrt(x * x + y * y + z * z);
      }
    });
    return sum;
  };
  CHECK(report.at("mesh").at("synthetic_faces").get<int>() > 10);
  CHECK(report.at("mesh").at("synthetic_faces").get<int>() <
        full.at("mesh").at("synthetic_faces").get<int>());
  CHECK(checked(small, folder.path()).boundary_edges == 0);
  for (const std::uint8_t mark : {std::uint8_t{0}, std::uint8_t{1}})
    CHECK(area(small, mark) == Approx(area(raw, mark)).epsilon(0.02));
}

TEST_CASE(
    "reconstruct --reference points: what the points leave of the tolerance is used, nothing left is refused",
    "[property]") {
  const TempFolder folder;
  const std::string in = scan(folder.path(), "sphere", "40000", {"--noise", "0.3s"});
  const fs::path out = folder.path() / "out.ply";
  const double spacing = parse_json(file_bytes(in + ".truth.json")).at("spacing").get<double>();
  const auto words = [&](double tolerance) {
    return std::vector<std::string>{"--resolution", dump_json(Json(1.5 * spacing)),
                                    "--tolerance",  dump_json(Json(tolerance)),
                                    "--reference",  "points",
                                    "--outliers",   "off"};
  };
  // 0.3 spacings of noise: the farthest of 40,000 points lies at about four standard deviations.
  const CommandResult refused = tessera_command(reconstruct_words(in, out, words(0.4 * spacing)));
  CHECK(refused.code == 6);
  const std::string promise = "the least --tolerance that can do is ";
  const std::size_t at = refused.errors.find(promise);
  REQUIRE(at != std::string::npos);
  CHECK(refused.errors.find("from the surface of full resolution") != std::string::npos);
  CHECK_FALSE(fs::exists(out));
  // No pass has run.
  CHECK_FALSE(fs::exists(out.string() + ".tessera/pass-1"));
  fs::remove_all(out.string() + ".tessera");

  // What it names does, and a larger one leaves more to decimation.
  const double minimum = std::stod(refused.errors.substr(at + promise.size()));
  CHECK(minimum > 0.8 * spacing);
  CHECK(minimum < 2.0 * spacing);
  std::size_t faces[2];
  for (const int more : {0, 1}) {
    const double tolerance = minimum * (1 + more);
    const Json report = reconstructed(in, out, words(tolerance));
    const double noise = report.at("points_to_surface").at("certified_max").get<double>();
    CHECK(noise <= minimum);
    CHECK(report.at("samples").at("certified_max").get<double>() <= tolerance);
    CHECK(report.at("certificate").at("certified_max").get<double>() <= tolerance - noise);
    faces[more] = report.at("mesh").at("faces").get<std::size_t>();
    fs::remove(out);
  }
  CHECK(4 * faces[1] < faces[0]);

  // Exact points are as near as the surface is.
  const std::string exact = scan(folder.path(), "torus", "40000");
  const Json report = reconstructed(exact, out, words(0.4 * spacing));
  const Json& samples = report.at("samples");
  CHECK(samples.at("samples") == 40000);
  CHECK(samples.at("certified_max").get<double>() <= 0.4 * spacing);
  CHECK(samples.at("certified_max").get<double>() > 0.2 * spacing);
  CHECK(report.at("points_to_surface").at("certified_max").get<double>() < 0.1 * spacing);
}

}  // namespace reconstruct_tolerance_test
