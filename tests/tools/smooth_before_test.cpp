// --smooth of reconstruct and decimate: smoothing, decimation and one certificate in one job.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "octree/vector.h"
#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/runtime/report.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace smooth_before_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

std::string scan(const TempFolder& folder, const std::string& noise, const std::string& points = "30000") {
  const std::string path = (folder / "scan.ply").string();
  REQUIRE(tessera_command({"synth", "--scene", "terrain", "--points", points, "--normals", "--noise", noise,
                           "-o", path, "--force"})
              .code == 0);
  return path;
}

std::vector<std::string> words(const std::string& command, const std::string& in, const fs::path& out,
                               const std::vector<std::string>& more) {
  std::vector<std::string> w = {command, in, "-o", out.string(), "--progress", "none", "-q"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}

Json run(const std::string& command, const std::string& in, const fs::path& out,
         const std::vector<std::string>& more) {
  const CommandResult r = tessera_command(words(command, in, out, more));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  CHECK_FALSE(fs::exists(out.string() + ".tessera"));
  return parse_json(file_bytes(out.string() + ".report.json"));
}

/// Surface of a cube of edge 1, 80 squares a side, with Gaussian noise.
fs::path write_noisy_cube(const fs::path& path, double noise) {
  MeshBlock cube = cube_block(80);
  std::mt19937 random(7);
  std::normal_distribution<double> normal(0.0, noise);
  WholeMesh mesh;
  for (Double3& p : cube.position) {
    for (double& x : p) x = static_cast<double>(static_cast<float>(x + normal(random)));
    mesh.points.push_back(p);
  }
  for (const auto& f : cube.faces) mesh.faces.push_back({f[0], f[1], f[2]});
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(path, mesh);
  return path;
}

/// The largest distance of random points on the faces of `from` to `to`.
double largest_distance(const WholeMesh& from, const WholeMesh& to, int samples) {
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (const MeshFace& f : to.faces)
    faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                     static_cast<std::uint32_t>(f[2])});
  const ClosestFaces closest(to.points, faces, Double3{0, 0, 0});
  std::mt19937 random(5);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  double maximum = 0.0;
  for (int i = 0; i < samples; ++i) {
    const MeshFace& f = from.faces[random() % from.faces.size()];
    double s = share(random), t = share(random);
    if (s + t > 1.0) s = 1.0 - s, t = 1.0 - t;
    const Double3 a = from.points[f[0]];
    const Double3 p = a + (from.points[f[1]] - a) * s + (from.points[f[2]] - a) * t;
    maximum = std::max(maximum, closest.closest(p, 1e30, ClosestFaces::kNone).square);
  }
  return std::sqrt(maximum);
}

std::vector<std::string> defects(const fs::path& file, const TempFolder& folder) {
  MeshCheckOptions options;
  options.temp = folder.path();
  return check_mesh(*open_mesh_file(file), options).defects();
}

}  // namespace

TEST_CASE("reconstruct --smooth: same bytes over tiles, threads, caps, processes and kills", "[property]") {
  const TempFolder folder;
  const std::string in = scan(folder, "0.3s");
  const std::string method = GENERATE("implicit", "denoise");
  const std::vector<std::string> base = {"--tolerance", "1.5", "--smooth", method};
  const auto bytes = [&](std::vector<std::string> more) {
    const fs::path out = folder / "out.ply";
    fs::remove(out);
    more.insert(more.end(), base.begin(), base.end());
    const Json report = run("reconstruct", in, out, more);
    CHECK(report.at("certificate").at("proven") == true);
    CHECK(report.at("certificate").at("tolerance") == 1.5);
    CHECK(report.at("smoothing").at("method") == method);
    CHECK(report.at("smoothing").at("largest_move").get<double>() <= 0.75);
    return file_bytes(out);
  };
  const std::string want = bytes({"-t", "1", "--tile-size", "64", "--memory", "2G"});
  CHECK(bytes({"-t", "2", "--tile-size", "256", "--memory", "2G"}) == want);
  CHECK(bytes({"-t", "3", "--memory", "300M"}) == want);
  CHECK(bytes({"-t", "2", "--processes"}) == want);

  const fs::path out = folder / "killed.ply";
  std::vector<std::string> line = words("reconstruct", in, out, base);
  line.insert(line.end(), {"-t", "2"});
  REQUIRE(resumed_after_kills(line).code == 0);
  CHECK(file_bytes(out) == want);
}

TEST_CASE("reconstruct --smooth: the certificate is against the surface as it was, and samples agree",
          "[property]") {
  const TempFolder folder;
  const std::string in = scan(folder, "0.3s");
  const fs::path plain = folder / "plain.ply", out = folder / "out.ply";
  const std::string border = GENERATE("raw", "smooth");  // both ways to the mesh of full resolution
  const std::vector<std::string> base = {"--tolerance", "1.5", "--border", border, "--keep-raw"};
  run("reconstruct", in, plain, base);
  std::vector<std::string> more = base;
  more.insert(more.end(), {"--smooth", "auto"});
  const Json report = run("reconstruct", in, out, more);
  CHECK(report.at("smoothing").at("method") == "denoise");
  const auto noise = report.at("smoothing").at("noise");
  CHECK(noise.at("after").get<double>() < 0.4 * noise.at("before").get<double>());
  CHECK(file_bytes(folder / "out.raw.ply") == file_bytes(folder / "plain.raw.ply"));
  CHECK(defects(out, folder).empty());
  const WholeMesh raw = read_whole(folder / "out.raw.ply"), result = read_whole(out);
  CHECK(largest_distance(result, raw, 200000) <= 1.5);
  CHECK(largest_distance(raw, result, 200000) <= 1.5);
  CHECK(tessera_command(
            {"check", out.string(), "--reference", (folder / "out.raw.ply").string(), "--tolerance", "1.5"})
            .code == 0);
}

TEST_CASE("decimate --smooth: a noisy cube keeps its edges and corners", "[pipeline]") {
  const TempFolder folder;
  const double noise = 0.0025, tolerance = 0.0125;  // a fifth of an edge, and an edge
  const fs::path in = write_noisy_cube(folder / "in.ply", noise);
  const fs::path plain = folder / "plain.ply", out = folder / "out.ply";
  const std::string e = dump_json(Json(tolerance));
  run("decimate", in.string(), plain, {"--tolerance", e});
  const Json report = run("decimate", in.string(), out, {"--tolerance", e, "--smooth", "auto"});
  CHECK(report.at("smoothing").at("method") == "denoise");
  CHECK(report.at("smoothing").at("noise").at("before").get<double>() == Approx(noise).epsilon(0.3));
  CHECK(report.at("smoothing").at("noise").at("after").get<double>() < 0.3 * noise);
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(defects(out, folder).empty());
  const WholeMesh given = read_whole(in), result = read_whole(out);
  CHECK(largest_distance(result, given, 200000) <= tolerance);
  CHECK(largest_distance(given, result, 200000) <= tolerance);
  CHECK(result.faces.size() < read_whole(plain).faces.size());

  // Noise leaves no edge of the cube sharp; each comes out within a fraction of the noise.
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (const MeshFace& f : result.faces)
    faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                     static_cast<std::uint32_t>(f[2])});
  const ClosestFaces closest(result.points, faces, Double3{0, 0, 0});
  std::vector<double> off;
  for (int axis = 0; axis < 3; ++axis)
    for (int corner = 0; corner < 4; ++corner)
      for (int i = 0; i <= 50; ++i) {
        Double3 p{};
        p[static_cast<std::size_t>(axis)] = i / 50.0;
        p[static_cast<std::size_t>((axis + 1) % 3)] = corner & 1;
        p[static_cast<std::size_t>((axis + 2) % 3)] = corner >> 1;
        off.push_back(std::sqrt(closest.closest(p, 1e30, ClosestFaces::kNone).square));
      }
  std::sort(off.begin(), off.end());
  CHECK(off[off.size() / 2] < noise);
  CHECK(off.back() < tolerance);
  // And its sides are flat: by area, how far normals are from an axis.
  double area = 0.0, straight = 0.0;
  for (const MeshFace& f : result.faces) {
    const Double3 n =
        cross(result.points[f[1]] - result.points[f[0]], result.points[f[2]] - result.points[f[0]]);
    const double size = norm(n);
    area += size;
    const double along = std::max({std::abs(n[0]), std::abs(n[1]), std::abs(n[2])});
    if (along > 0.9962 * size) straight += size;  // 5 degrees
  }
  CHECK(straight > 0.9 * area);
}

TEST_CASE(
    "reconstruct --smooth: auto takes a plate where there is next to no noise, and hardly moves anything",
    "[pipeline]") {
  const TempFolder folder;
  const Json report = run("reconstruct", scan(folder, "0", "50000"), folder / "out.ply",
                          {"--tolerance", "1.5", "--smooth", "auto"});
  const auto& smoothing = report.at("smoothing");
  CHECK(smoothing.at("method") == "implicit");
  CHECK(smoothing.at("noise").at("before").get<double>() <
        0.01 * smoothing.at("noise").at("edge").get<double>());
  CHECK(smoothing.at("rms_move").get<double>() < 0.005 * smoothing.at("noise").at("edge").get<double>());
}

TEST_CASE("decimate --tolerance auto: a fifth of the edges or the noise, and the same bytes as that number",
          "[pipeline]") {
  const TempFolder folder;
  const double edge = 0.0125, share = GENERATE(0.1, 0.4);
  const fs::path in = write_noisy_cube(folder / "in.ply", share * edge);
  const fs::path out = folder / "out.ply", given = folder / "given.ply";
  const std::vector<std::string> smooth =
      share > 0.2 ? std::vector<std::string>{"--smooth", "auto"} : std::vector<std::string>{};
  const auto with = [&](const std::string& tolerance) {
    std::vector<std::string> more = {"--tolerance", tolerance};
    more.insert(more.end(), smooth.begin(), smooth.end());
    return more;
  };
  const Json report = run("decimate", in.string(), out, with("auto"));
  const Json& tolerance = report.at("tolerance");
  const auto taken = tolerance.at("taken").get<double>();
  CHECK(report.at("options").at("tolerance") == "auto");
  CHECK(tolerance.at("noise").get<double>() == Approx(share * edge).epsilon(0.3));
  CHECK(tolerance.at("edge").get<double>() > edge);
  CHECK(taken == std::max(0.2 * tolerance.at("edge").get<double>(), tolerance.at("noise").get<double>()));
  CHECK((taken == tolerance.at("noise").get<double>()) == (share > 0.2));
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(report.at("certificate").at("tolerance").get<double>() == taken);
  CHECK(report.contains("smoothing") == !smooth.empty());
  run("decimate", in.string(), given, with(dump_json(Json(taken))));
  CHECK(file_bytes(given) == file_bytes(out));
}

TEST_CASE(
    "decimate --tolerance auto: a first look at the noise is enough where no tolerance would ask for it",
    "[pipeline]") {
  const TempFolder folder;
  const double edge = 0.0125, share = GENERATE(0.05, 0.3);
  const bool asked = share > 0.2;
  const fs::path in = write_noisy_cube(folder / "in.ply", share * edge);
  const Json report = run("decimate", in.string(), folder / "out.ply", {"--tolerance", "auto"});
  const Json look = result_of(report, "noise-look"), noise = result_of(report, "noise");
  std::uint64_t tasks = 0;
  for (const Json& stage : report.at("stages"))
    if (stage.at("name") == "noise") tasks = stage.at("tasks").natural();
  CHECK((tasks > 0) == asked);
  CHECK((noise.at("vertices").natural() > 2 * look.at("vertices").natural()) == asked);
  CHECK(noise.at("noise").get<double>() == Approx(share * edge).epsilon(0.3));
  // What both measured together is what a job measures that smooths, and does so without a look.
  const Json whole =
      run("decimate", in.string(), folder / "smooth.ply", {"--tolerance", "auto", "--smooth", "implicit"});
  CHECK_FALSE(result_of(whole, "noise-look").is_object());
  CHECK((result_of(whole, "noise") == noise) == asked);
}

TEST_CASE("decimate --smooth: without a bound of distance a number of faces says how far decimation goes",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_noisy_cube(folder / "in.ply", 0.0025);
  const Json report =
      run("decimate", in.string(), folder / "out.ply", {"--target-faces", "2000", "--smooth", "implicit"});
  CHECK(report.at("mesh").at("faces").get<int>() <= 2200);
  CHECK(report.at("smoothing").at("limited") == 0);
  CHECK(report.at("smoothing").at("rms_move").get<double>() > 0.001);
}

TEST_CASE("reconstruct --smooth: what makes no sense is refused in one sentence, before anything is read",
          "[pipeline]") {
  const TempFolder folder;
  const std::string nothing = (folder / "nothing.ply").string(), out = (folder / "out.ply").string();
  const auto refused = [&](const std::vector<std::string>& line, const std::string& sentence) {
    const CommandResult r = tessera_command(line);
    CHECK(r.code == 2);
    INFO(r.errors);
    CHECK(r.errors.find(sentence) != std::string::npos);
  };
  refused({"reconstruct", nothing, "-o", out, "--smooth", "denoise"},
          "--smooth: means something with --tolerance only");
  refused({"decimate", nothing, "-o", out, "--smooth", "denoise"}, "nothing says how far to go");
  refused({"decimate", nothing, "-o", out, "--tolerance", "1", "--smooth", "taubin"}, "--smooth");
}

}  // namespace smooth_before_test
