// Survey coordinates through every format that meshes are written in: the bytes that were written keep the bound that was
// printed, measured by code of its own, and the mesh in them is as sound as the one that was proven.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/temp_folder.h"

namespace big_coordinates_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;
const Double3 kSurvey = {500000, 5400000, 1e7};

double product(const Double3& a, const Double3& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

double square_to_segment(const Double3& p, const Double3& a, const Double3& b) {
  const Double3 along = b - a;
  const double length = product(along, along);
  const double t = length > 0.0 ? std::clamp(product(p - a, along) / length, 0.0, 1.0) : 0.0;
  const Double3 off = p - (a + along * t);
  return product(off, off);
}

/// To the plane where the foot lies inside, else to the three sides.
double square_to_triangle(const Double3& p, const std::array<Double3, 3>& t) {
  const Double3 n = cross(t[1] - t[0], t[2] - t[0]);
  const double area = product(n, n);
  bool inside = area > 0.0;
  double minimum = 1e300;
  for (std::size_t k = 0; k < 3; ++k) {
    const Double3 &a = t[k], &b = t[(k + 1) % 3];
    inside = inside && product(cross(b - a, p - a), n) >= 0.0;
    minimum = std::min(minimum, square_to_segment(p, a, b));
  }
  if (!inside) return minimum;
  const double height = product(p - t[0], n);
  return std::min(minimum, height * height / area);
}

std::array<Double3, 3> triangle(const WholeMesh& mesh, std::size_t f) {
  return {mesh.points[mesh.faces[f][0]] - kSurvey, mesh.points[mesh.faces[f][1]] - kSurvey,
          mesh.points[mesh.faces[f][2]] - kSurvey};
}

/// Farthest of some samples, the vertices among them, from the other mesh.
double farthest(const WholeMesh& from, const WholeMesh& to) {
  Random random(11);
  double worst = 0.0;
  for (std::size_t i = 0; i < 1500; ++i) {
    const auto t = triangle(from, random.below(from.faces.size()));
    double u = random.unit(), v = random.unit();
    if (u + v > 1.0) u = 1.0 - u, v = 1.0 - v;
    const Double3 p = i % 2 == 0 ? t[i % 3] : t[0] + (t[1] - t[0]) * u + (t[2] - t[0]) * v;
    double minimum = 1e300;
    for (std::size_t f = 0; f < to.faces.size(); ++f)
      minimum = std::min(minimum, square_to_triangle(p, triangle(to, f)));
    worst = std::max(worst, minimum);
  }
  return std::sqrt(worst);
}

/// Noisy hills of 10 cm edges, in doubles that no float holds.
fs::path write_survey(const fs::path& path, const Double3& at = kSurvey, double edge = 0.1, int side = 24) {
  Random random(3);
  WholeMesh mesh;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i)
      mesh.points.push_back(
          at + Double3{i + random.in(-0.2, 0.2), j + random.in(-0.2, 0.2),
                       2.0 * std::sin(0.3 * (i + (at[0] - kSurvey[0]) / edge)) + random.in(-0.1, 0.1)} *
                   edge);
  const auto number = [&](int i, int j) { return static_cast<std::uint64_t>(j * (side + 1) + i); };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      mesh.faces.push_back({number(i, j), number(i + 1, j), number(i + 1, j + 1)});
      mesh.faces.push_back({number(i, j), number(i + 1, j + 1), number(i, j + 1)});
    }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  mesh.header.double_positions = true;
  write_whole(path, mesh);
  return path;
}

/// The same mesh as text: OFF, or STL.
void write_text(const fs::path& path, const WholeMesh& mesh) {
  std::string text;
  const auto point = [&](const Double3& p) {
    char line[120];
    std::snprintf(line, sizeof line, "%.17g %.17g %.17g\n", p[0], p[1], p[2]);
    return std::string(line);
  };
  if (path.extension() == ".off") {
    text = "OFF\n" + std::to_string(mesh.points.size()) + " " + std::to_string(mesh.faces.size()) + " 0\n";
    for (const Double3& p : mesh.points) text += point(p);
    for (const MeshFace& f : mesh.faces)
      text += "3 " + std::to_string(f[0]) + " " + std::to_string(f[1]) + " " + std::to_string(f[2]) + "\n";
  } else {
    text = "solid survey\n";
    for (const MeshFace& f : mesh.faces) {
      text += "facet normal 0 0 1\nouter loop\n";
      for (const std::uint64_t v : f) text += "vertex " + point(mesh.points[v]);
      text += "endloop\nendfacet\n";
    }
    text += "endsolid survey\n";
  }
  spill(path, text);
}

Json report_of(const fs::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json"));
}

void check_sound(const fs::path& path) {
  const auto reader = open_mesh_file(path, {true});
  const MeshCheck check = check_mesh(*reader, {});
  INFO(path);
  CHECK(check.nonmanifold_edges == 0);
  CHECK(check.zero_area_faces == 0);
  CHECK(check.degenerate_faces == 0);
  CHECK(check.boundary_loops == 1);
}

/// Runs a job and holds what it wrote against the bound in its report.
Json proven(const std::vector<std::string>& words, const fs::path& in, const fs::path& out) {
  std::vector<std::string> all = words;
  all.insert(all.end(), {"-o", out.string(), "--progress", "none", "-q", "--no-html"});
  const CommandResult r = tessera_command(all);
  INFO(out << ": " << r.errors);
  REQUIRE(r.code == 0);
  Json report = report_of(out);
  const double bound = report.at("certificate").at("certified_max").get<double>();
  const WholeMesh given = read_whole(in), result = read_whole(out);
  CHECK(farthest(result, given) <= bound + 1e-12);
  CHECK(farthest(given, result) <= bound + 1e-12);
  check_sound(out);
  return report;
}

}  // namespace

TEST_CASE("survey coordinates: what decimate, remesh and resample write keeps the bound, in every format",
          "[property]") {
  const TempFolder folder;
  const fs::path in = write_survey(folder.path() / "in.ply");
  const std::string extension = GENERATE("ply", "obj", "stl", "glb", "STL", "GLB", "PLY");
  CAPTURE(extension);
  const Json small =
      proven({"decimate", in.string(), "--tolerance", "0.02"}, in, folder.path() / ("d." + extension));
  CHECK(small.at("certificate").at("certified_max").get<double>() <= 0.02);
  const bool floats = extension.size() == 3 && (extension[0] == 's' || extension[0] == 'g' ||
                                                extension[0] == 'S' || extension[0] == 'G');
  CHECK(small.at("certificate").contains("rounding") == floats);
  CHECK(small.at("mesh").contains("origin") == floats);
  const bool stl = extension == "stl" || extension == "STL";
  CHECK(fs::exists(folder.path() / ("d." + extension + ".shift")) == stl);
  CHECK(small.at("warnings").size() == (stl ? 1u : 0u));
  if (extension.find_first_of("SGP") == 0) return;  // the rest once for each format
  proven({"remesh", in.string(), "--edge", "0.12"}, in, folder.path() / ("r." + extension));
  const Json even = proven({"remesh", in.string(), "--edge", "0.12", "--tolerance", "0.03"}, in,
                           folder.path() / ("t." + extension));
  CHECK(even.at("certificate").at("certified_max").get<double>() <= 0.03);
  proven({"resample", in.string(), "--tolerance", "0.01"}, in, folder.path() / ("s." + extension));
}

TEST_CASE("survey coordinates: text meshes are read with all their digits", "[property]") {
  const TempFolder folder;
  const WholeMesh mesh = read_whole(write_survey(folder.path() / "in.ply"));
  for (const char* name : {"a.off", "a.stl"}) {
    write_text(folder.path() / name, mesh);
    const WholeMesh back = read_whole(folder.path() / name);
    REQUIRE(back.faces.size() == mesh.faces.size());
    for (std::size_t f = 0; f < mesh.faces.size(); ++f)
      for (std::size_t k = 0; k < 3; ++k)
        REQUIRE(back.points[back.faces[f][k]] == mesh.points[mesh.faces[f][k]]);
    proven({"decimate", (folder.path() / name).string(), "--tolerance", "0.02"}, folder.path() / "in.ply",
           folder.path() / (std::string(name) + ".glb"));
  }
}

TEST_CASE("survey coordinates: convert keeps the mesh or refuses, and tells what it moved", "[property]") {
  const TempFolder folder;
  const fs::path in = write_survey(folder.path() / "in.ply");
  const WholeMesh given = read_whole(in);
  for (const char* name : {"a.obj", "a.stl", "a.glb", "a.ply"}) {
    const fs::path out = folder.path() / name;
    REQUIRE(tessera_command({"convert", in.string(), "-o", out.string()}).code == 0);
    check_sound(out);
    const WholeMesh back = read_whole(out);
    double moved = 0.0;
    for (std::size_t f = 0; f < given.faces.size(); ++f)
      for (std::size_t k = 0; k < 3; ++k)
        moved = std::max(moved, norm(back.points[back.faces[f][k]] - given.points[given.faces[f][k]]));
    CHECK(moved <= (out.extension() == ".stl" || out.extension() == ".glb" ? 1e-6 : 0.0));
    // There and back through STL and GLB, too.
    const fs::path again = folder.path() / (std::string(name) + ".ply");
    REQUIRE(tessera_command({"convert", out.string(), "-o", again.string()}).code == 0);
    check_sound(again);
  }
  CHECK(file_bytes(folder.path() / "a.stl.shift") == "500001 5400001 10000000\n");
  const CommandResult shifted =
      tessera_command({"convert", in.string(), "-o", (folder.path() / "b.stl").string()});
  CHECK_THAT(shifted.errors, Catch::Contains("500001 5400001 10000000") && Catch::Contains("b.stl.shift"));
  // Floats that would fold it are refused; where they do no harm they are written.
  const CommandResult floats =
      tessera_command({"convert", in.string(), "-o", (folder.path() / "f.ply").string(), "--float"});
  CHECK(floats.code == 6);
  CHECK_THAT(floats.errors, Catch::Contains("floats of 32 bits") && Catch::Contains("faces without area"));
  CHECK_FALSE(fs::exists(folder.path() / "f.ply"));
  const fs::path local = write_survey(folder.path() / "local.ply", {10, 20, 30});
  CHECK(tessera_command({"convert", local.string(), "-o", (folder.path() / "l.ply").string(), "--float"})
            .code == 0);
  check_sound(folder.path() / "l.ply");
  // What an earlier file of that name had beside it does not misplace the next one.
  for (const char* command : {"convert", "decimate"}) {
    const std::string out = (folder.path() / (std::string(command) + ".stl")).string();
    std::vector<std::string> words = {command, in.string(), "-o", out, "--force"};
    if (words[0] == "decimate") words.insert(words.end(), {"--tolerance", "0.01", "--no-html", "-q"});
    REQUIRE(tessera_command(words).code == 0);
    CHECK(fs::exists(out + ".shift"));
    words[1] = local.string();
    REQUIRE(tessera_command(words).code == 0);
    CHECK_FALSE(fs::exists(out + ".shift"));
  }
}

TEST_CASE("survey coordinates: where no origin helps, exit code 6 says so before any work", "[fault]") {
  const TempFolder folder;
  // 1 km posts over 24 km at 1e7: a float is 1 mm there.
  const fs::path in = write_survey(folder.path() / "in.ply", kSurvey, 1000.0);
  for (const std::string command : {"decimate", "remesh", "smooth", "resample"}) {
    const fs::path out = folder.path() / (command + ".stl");
    const CommandResult r = tessera_command({command, in.string(), "-o", out.string(), "--tolerance", "0.001",
                                             "--progress", "none", "-q", "--no-html"});
    INFO(command << ": " << r.errors);
    CHECK(r.code == 6);
    CHECK_THAT(r.errors, Catch::Contains("STL holds floats of 32 bits"));
    CHECK_FALSE(fs::exists(out));
  }
}

TEST_CASE("survey coordinates: smooth, merge, resurface and csg stand where they were", "[property]") {
  const TempFolder folder;
  const fs::path in = write_survey(folder.path() / "in.ply");
  const WholeMesh given = read_whole(in);
  const std::string extension = GENERATE("stl", "glb");
  const auto run = [&](std::vector<std::string> words, const std::string& name) {
    const fs::path out = folder.path() / (name + "." + extension);
    words.insert(words.end(), {"-o", out.string(), "--progress", "none", "-q", "--no-html"});
    const CommandResult r = tessera_command(words);
    INFO(name << ": " << r.errors);
    REQUIRE(r.code == 0);
    CHECK(report_of(out).at("mesh").contains("origin"));
    CHECK(report_of(out).at("mesh").at("rounding").get<double>() < 2e-6);
    return out;
  };
  const fs::path fair = run({"smooth", in.string(), "--tolerance", "0.01"}, "smooth");
  check_sound(fair);
  CHECK(farthest(read_whole(fair), given) <= 0.01);
  CHECK(report_of(fair).at("mesh").at("largest_move").get<double>() <= 0.01);
  const fs::path one = run(
      {"merge", in.string(), write_survey(folder.path() / "in2.ply", kSurvey + Double3{1.2, 0, 0}).string()},
      "merge");
  const auto merged = open_mesh_file(one, {true});
  CHECK(check_mesh(*merged, {}).nonmanifold_edges == 0);
  spill(folder.path() / "scene.json",
        R"({"difference": [{"box": [500000, 5400000, 1e7, 500004, 5400004, 10000004]},
                           {"sphere": [500002, 5400002, 10000004, 1]}]})");
  const fs::path solid = run({"csg", (folder.path() / "scene.json").string(), "--resolution", "0.2"}, "csg");
  const auto closed = open_mesh_file(solid, {true});
  const MeshCheck check = check_mesh(*closed, {});
  CHECK(check.solid());
  CHECK(check.volume == Approx(64.0 - 2.0 / 3.0 * 3.14159265).epsilon(0.01));
  CHECK(check.min[0] == Approx(500000.0).margin(1e-3));
  CHECK(check.max[2] == Approx(10000004.0).margin(1e-3));
  const fs::path again = run({"resurface", solid.string(), "--resolution", "0.2"}, "resurface");
  const auto reader = open_mesh_file(again, {true});
  CHECK(check_mesh(*reader, {}).volume == Approx(check.volume).epsilon(0.01));
}

TEST_CASE("survey coordinates: reconstruct writes what it proved, with and without a tolerance",
          "[property]") {
  const TempFolder folder;
  const std::string extension = GENERATE("stl", "glb", "ply");
  CAPTURE(extension);
  std::string scan = "ply\nformat ascii 1.0\nelement vertex 6400\n";
  for (const char* axis : {"x", "y", "z"}) scan += std::string("property double ") + axis + "\n";
  scan += "end_header\n";
  for (int i = 0; i < 6400; ++i) {
    const double x = i % 80 * 0.1, y = i / 80 * 0.1;
    char line[120];
    std::snprintf(line, sizeof line, "%.10f %.10f %.10f\n", kSurvey[0] + x, kSurvey[1] + y,
                  kSurvey[2] + 0.3 * std::sin(x));
    scan += line;
  }
  const fs::path in = folder.path() / "scan.ply";
  spill(in, scan);
  for (const std::string tolerance : {"0", "0.02"}) {
    const fs::path out = folder.path() / ("mesh" + tolerance + "." + extension);
    const CommandResult r =
        tessera_command({"reconstruct", in.string(), "-o", out.string(), "--resolution", "0.15", "--from",
                         "above", "--tolerance", tolerance, "--progress", "none", "-q"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const Json report = report_of(out);
    CHECK(report.at("mesh").contains("origin") == (extension != "ply"));
    CHECK(fs::exists(out.string() + ".shift") == (extension == "stl"));
    if (tolerance != "0") {
      CHECK(report.at("certificate").at("certified_max").get<double>() <= 0.02);
      CHECK(report.at("certificate").contains("rounding") == (extension != "ply"));
    }
    const auto reader = open_mesh_file(out, {true});
    const MeshCheck check = check_mesh(*reader, {});
    CHECK(check.nonmanifold_edges == 0);
    CHECK(check.zero_area_faces == 0);
    double worst = 0.0;
    for (const Double3& p : read_whole(out).points)
      worst = std::max(worst, std::fabs(p[2] - kSurvey[2] - 0.3 * std::sin(p[0] - kSurvey[0])));
    CHECK(worst < 0.03);
  }
}

}  // namespace big_coordinates_test
