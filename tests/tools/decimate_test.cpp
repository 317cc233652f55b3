// tessera decimate as a user runs it: the same bytes whatever must not matter, a proven tolerance, clear refusals.
#include <catch2/catch.hpp>

#include <cmath>
#include <cstdlib>
#include <string>
#include <vector>

#include "stream/check/mesh_check.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/serial_job.h"
#include "tests/helpers/shell.h"

namespace decimate_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

constexpr int kSide = 330;  // two triangles a cell: several bricks, buckets and blocks of 4096 faces

/// Hills with a step across them; `backwards` writes vertices and faces from the last to the first.
fs::path write_hills(const fs::path& path, bool backwards = false, double far = 0.0) {
  const auto hill = [&](int i, int j) -> Double3 {
    const double x = i / 32.0 - 5, y = j / 32.0 - 5;
    const double bowl = x * x - y * y / 2;
    return {i + far, j + 0.0, static_cast<double>(static_cast<float>(bowl + (i > 200 ? 8 : 0)))};
  };
  tessera::test::write_sheet(path, kSide, hill, backwards);
  return path;
}

std::vector<std::string> words(const fs::path& in, const fs::path& out,
                               const std::vector<std::string>& more) {
  std::vector<std::string> w = {"decimate", in.string(), "-o", out.string(), "--progress", "none", "-q"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}

Json report_of(const fs::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json"));
}

}  // namespace

TEST_CASE("decimate: same bytes over threads, memory, processes, order of the input and kills",
          "[property]") {
  const TempFolder folder;
  const fs::path in = write_hills(folder.path() / "in.ply");
  const std::vector<std::string> base = {"--tolerance", "0.05", "--block-faces", "8192"};
  const auto run = [&](const fs::path& from, std::vector<std::string> more) {
    const fs::path out = folder.path() / "out.ply";
    fs::remove(out);
    more.insert(more.end(), base.begin(), base.end());
    const CommandResult r = tessera_command(words(from, out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK_FALSE(fs::exists(out.string() + ".tessera"));
    return file_bytes(out);
  };
  const std::string bytes = run(in, {"-t", "1", "--memory", "1G"});
  const Json report = report_of(folder.path() / "out.ply");
  CHECK(report.at("mesh").at("faces").get<int>() < 2 * kSide * kSide / 10);
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(report.at("certificate").at("certified_max").get<double>() <= 0.05);
  CHECK(run(in, {"-t", "2", "--memory", "300M"}) == bytes);
  CHECK(run(in, {"-t", "5", "--memory", "2G", "--tile-size", "128"}) == bytes);
  CHECK(run(in, {"-t", "2", "--memory", "1G", "--processes"}) == bytes);
  CHECK(run(write_hills(folder.path() / "back.ply", true), {"-t", "2", "--memory", "1G"}) == bytes);

  const fs::path out = folder.path() / "killed.ply";
  std::vector<std::string> w = words(in, out, base);
  w.insert(w.end(), {"-t", "2", "--memory", "1G"});
  REQUIRE(resumed_after_kills(w).code == 0);
  CHECK(file_bytes(out) == bytes);
}

TEST_CASE("decimate: what the certificate sends back is made again until it is proven, with the same bytes",
          "[property]") {
  const TempFolder folder;
  const fs::path in = write_hills(folder.path() / "in.ply");
  // The step is a wall as wide as a cell: with half of the tolerance more than allowed its creases are over.
  const std::vector<std::string> base = {"--tolerance", "0.05",         "--block-faces",
                                         "8192",        "--loop-share", "1.3"};
  const auto run = [&](std::vector<std::string> more, bool killed = false) {
    const fs::path out = folder.path() / "out.ply";
    more.insert(more.end(), base.begin(), base.end());
    const std::vector<std::string> line = words(in, out, more);
    const CommandResult r = killed ? resumed_after_kills(line) : tessera_command(line);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const std::string bytes = file_bytes(out);
    const Json certificate = report_of(out).at("certificate");
    CHECK(certificate.at("proven") == true);
    CHECK(certificate.at("rounds_again").get<int>() >= 1);
    CHECK(certificate.at("cells_kept").get<int>() < certificate.at("cells").get<int>());
    fs::remove(out);
    return bytes;
  };
  const std::string bytes = run({"-t", "1", "--memory", "1G"});
  CHECK(run({"-t", "2", "--memory", "300M"}) == bytes);
  CHECK(run({"-t", "2", "--memory", "1G", "--processes"}) == bytes);
  CHECK(run({"-t", "2", "--memory", "1G"}, true) == bytes);
}

TEST_CASE("decimate: faces that close holes stay marked, and where they meet the data stays", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder.path() / "in.ply";
  constexpr int kGrid = 60;
  const auto closes = [](int i, int j) { return i >= 20 && i < 32 && j >= 25 && j < 40; };
  MeshHeader header;
  std::vector<Double3> position;
  std::vector<MeshFace> faces;
  std::vector<std::uint8_t> synthetic;
  for (int j = 0; j <= kGrid; ++j)
    for (int i = 0; i <= kGrid; ++i) position.push_back({i + 0.0, j + 0.0, 0.0});
  const auto at = [](int i, int j) { return static_cast<std::uint64_t>(j * (kGrid + 1) + i); };
  for (int j = 0; j < kGrid; ++j)
    for (int i = 0; i < kGrid; ++i) {
      faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
      synthetic.insert(synthetic.end(), 2, closes(i, j) ? 1 : 0);
    }
  header.vertices = position.size();
  header.faces = faces.size();
  header.synthetic = true;
  const auto file = create_mesh_file(in, header);
  file->vertices(position, {});
  file->faces(faces, synthetic);
  file->finish();
  const fs::path out = folder.path() / "out.ply";
  REQUIRE(tessera_command(words(in, out, {"--tolerance", "0.1"})).code == 0);
  const auto mesh = open_mesh_file(out);
  REQUIRE(mesh->has_synthetic());
  std::vector<Double3> decimated;
  mesh->read_vertices([&](std::span<const Double3> p, std::span<const std::uint32_t>) {
    decimated.insert(decimated.end(), p.begin(), p.end());
  });
  double marked = 0.0, all = 0.0;
  std::size_t count = 0;
  mesh->read_flagged_faces([&](std::span<const MeshFace> f, std::span<const std::uint8_t> flags) {
    for (std::size_t k = 0; k < f.size(); ++k, ++count) {
      const Double3 &a = decimated[f[k][0]], &b = decimated[f[k][1]], &c = decimated[f[k][2]];
      const double area = 0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
      all += area;
      if (flags[k]) marked += area;
    }
  });
  CHECK(count < 40);
  CHECK(all == Approx(kGrid * kGrid));
  CHECK(marked == Approx(12 * 15));
}

TEST_CASE("decimate: a number of faces, and both limits at once", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_hills(folder.path() / "in.ply");
  const fs::path out = folder.path() / "out.ply";
  REQUIRE(tessera_command(words(in, out, {"--target-faces", "20000"})).code == 0);
  const int faces = report_of(out).at("mesh").at("faces").get<int>();
  CHECK(faces > 16000);
  CHECK(faces < 24000);
  REQUIRE(
      tessera_command(words(in, out, {"--target-faces", "2000", "--tolerance", "0.001", "--force"})).code ==
      0);
  CHECK(report_of(out).at("mesh").at("faces").get<int>() > 2000);
  CHECK(report_of(out).at("certificate").at("certified_max").get<double>() <= 0.001);
}

TEST_CASE("decimate: options and inputs that make no sense are refused with one sentence", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_hills(folder.path() / "in.ply");
  const fs::path out = folder.path() / "out.ply";
  const auto refused = [&](const std::vector<std::string>& more, int code) {
    const CommandResult r = tessera_command(words(in, out, more));
    INFO(r.errors);
    CHECK(r.code == code);
    CHECK(std::count(r.errors.begin(), r.errors.end(), '\n') == 1);
    CHECK_FALSE(fs::exists(out));
  };
  refused({}, 2);
  refused({"--tolerance", "0"}, 2);
  refused({"--tolerance", "-1"}, 2);
  refused({"--tolerance", "nan"}, 2);
  refused({"--tolerance", "0.1", "--reference", (folder.path() / "none.ply").string()}, 3);
  const fs::path elsewhere = write_hills(folder.path() / "far.ply", false, 5000.0);
  refused({"--tolerance", "0.1", "--reference", elsewhere.string()}, 6);
}

TEST_CASE("decimate: a tolerance larger than the model leaves a sound mesh", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_hills(folder.path() / "in.ply");
  const fs::path out = folder.path() / "out.ply";
  const CommandResult r = tessera_command(words(in, out, {"--tolerance", "1e6"}));
  INFO(r.errors);
  REQUIRE(r.code == 0);
  MeshCheckOptions options;
  options.temp = folder.path();
  const MeshCheck check = check_mesh(*open_mesh_file(out), options);
  CHECK(check.faces >= 1);
  CHECK(check.faces < 200);
  CHECK(check.nonmanifold_edges == 0);
}

TEST_CASE("decimate: faces without area are taken out, whatever the blocks", "[pipeline]") {
  const TempFolder folder;
  // A box whose edges bear vertices that one side alone uses, as CAD programs write them; and a line far from it.
  std::string text = "v 0 0 0\nv 8 0 0\nv 8 8 0\nv 0 8 0\nv 0 0 8\nv 8 0 8\nv 8 8 8\nv 0 8 8\n";
  text += "f 1 4 3\nf 1 3 2\nf 5 6 7\nf 5 7 8\nf 2 3 7\nf 2 7 6\nf 3 4 8\nf 3 8 7\nf 4 1 5\nf 4 5 8\n";
  constexpr int kCuts = 7;  // of the edge from vertex 1 to 2: flat faces close it against the bottom
  for (int i = 1; i <= kCuts; ++i) text += "v " + std::to_string(i) + " 0 0\n";
  for (int i = 0; i < kCuts; ++i) {
    const std::string v = std::to_string(9 + i), next = i + 1 < kCuts ? std::to_string(10 + i) : "2";
    text += "f 1 " + next + " " + v + "\n" + "f 5 " + v + " " + next + "\n";
  }
  text += "f 5 1 9\nf 5 2 6\n";
  text += "v 20 0 0\nv 21 0 0\nv 23 0 0\nf 16 17 18\n";
  const fs::path in = folder.path() / "box.obj";
  spill(in, text);
  for (const std::vector<std::string>& more : {std::vector<std::string>{"--tolerance", "0.001"},
                                               {"--tolerance", "0.001", "--passes", "1"},
                                               {"--target-faces", "100"}}) {
    const fs::path out = folder.path() / "out.ply";
    std::vector<std::string> line = words(in, out, more);
    line.push_back("--force");
    const CommandResult r = tessera_command(line);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    MeshCheckOptions options;
    options.temp = folder.path();
    const MeshCheck check = check_mesh(*open_mesh_file(out), options);
    CHECK(check.zero_area_faces == 0);
    CHECK(check.boundary_edges == 0);
    CHECK(check.nonmanifold_edges == 0);
    CHECK(check.area == Approx(6 * 64.0));
  }
}

TEST_CASE("reconstruct --tolerance: the mesh shrinks within a proven distance, same bytes for any threads",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path scan = folder.path() / "scan.xyz";
  REQUIRE(tessera_command({"synth", "--scene", "sphere", "--points", "40000", "--normals", "-o",
                           scan.string(), "-t", "1"})
              .code == 0);
  std::string bytes;
  for (const char* threads : {"1", "2"}) {
    const fs::path out = folder.path() / (std::string("out") + threads + ".ply");
    const CommandResult r =
        tessera_command({"reconstruct", scan.string(), "-o", out.string(), "--progress", "none", "-q",
                         "--resolution", "0.02", "--tolerance", "0.01", "-t", threads});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const Json report = report_of(out);
    CHECK(report.at("certificate").at("proven") == true);
    CHECK(report.at("mesh").at("faces").get<int>() < report.at("raw_mesh").at("faces").get<int>() / 4);
    if (bytes.empty()) bytes = file_bytes(out);
    CHECK(file_bytes(out) == bytes);
    CHECK_FALSE(fs::exists(out.string() + ".tessera"));
  }
}

TEST_CASE(
    "reconstruct --tolerance: a noisy scan has the borders and fillings of its full mesh, an exact one "
    "neither",
    "[pipeline]") {
  const TempFolder folder;
  const auto run = [&](const fs::path& scan, const std::string& name, const std::vector<std::string>& more) {
    const fs::path out = folder.path() / (name + ".ply");
    std::vector<std::string> line = {"reconstruct", scan.string(), "-o", out.string(),
                                     "--progress",  "none",        "-q", "--no-html"};
    line.insert(line.end(), more.begin(), more.end());
    const CommandResult r = tessera_command(line);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return out;
  };
  const auto check_of = [&](const fs::path& mesh) {
    MeshCheckOptions options;
    options.temp = folder.path();
    return check_mesh(*open_mesh_file(mesh), options);
  };
  // A floor with slits narrower than the support of a sample, and a round hole.
  const auto floor = [&](const std::string& name, double noise) {
    Random random(5);
    std::string text = "x y z nx ny nz\n";
    const auto slit = [](double x, double y) { return std::abs(x) < 5.0 && std::abs(y) < 2.3; };
    for (int i = 0; i < 300 * 300; ++i) {
      const double x = 0.5 * (i % 300), y = 0.5 * (i / 300), z = random.in(-noise, noise);
      if (slit(x - 64, y - 64) || slit(x - 30, y - 100) || std::hypot(x - 100, y - 100) < 9.0) continue;
      text += std::to_string(x) + " " + std::to_string(y) + " " + std::to_string(z) + " 0 0 1\n";
    }
    write_durably(folder.path() / name, text);
    return folder.path() / name;
  };
  const fs::path noisy = floor("noisy.xyz", 0.3), exact = floor("exact.xyz", 0.0);
  const fs::path full = run(noisy, "full", {}), small = run(noisy, "small", {"--tolerance", "auto"}),
                 ragged = run(noisy, "ragged", {"--tolerance", "auto", "--border", "raw"});
  const Json report = report_of(small);
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(report.at("mesh").at("holes").at("filled") == report_of(full).at("mesh").at("holes").at("filled"));
  CHECK(report.at("mesh").at("holes").at("filled") == 2);
  CHECK(report.at("raw_mesh").at("faces") == report_of(full).at("mesh").at("faces"));
  CHECK(check_of(small).boundary_loops == check_of(full).boundary_loops);
  CHECK(check_of(ragged).boundary_loops >= check_of(small).boundary_loops);
  CHECK(file_bytes(small) == file_bytes(run(noisy, "smooth", {"--tolerance", "auto", "--border", "smooth"})));
  CHECK(file_bytes(small) ==
        file_bytes(run(noisy, "tiles", {"--tolerance", "auto", "--tile-size", "64", "-t", "1"})));
  CHECK_FALSE(file_bytes(small) == file_bytes(ragged));
  // An exact one makes no mesh of full resolution on disk.
  const fs::path fused = run(exact, "fused", {"--tolerance", "auto"});
  CHECK(file_bytes(fused) == file_bytes(run(exact, "raw", {"--tolerance", "auto", "--border", "raw"})));
  const Json told = report_of(fused);
  for (const Json& stage : told.at("stages"))
    if (stage.at("name") == "mesh-read") CHECK(stage.at("units") == 0);
}

}  // namespace decimate_test
