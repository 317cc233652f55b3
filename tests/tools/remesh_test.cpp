// tessera remesh as a user runs it: the same bytes whatever must not matter, a proven distance, clear refusals.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "octree/portable_math.h"
#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/reconstruct_command.h"
#include "tests/helpers/seam_traces.h"
#include "tests/helpers/serial_job.h"
#include "tests/helpers/shell.h"

namespace remesh_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

constexpr int kSide = 250;  // two triangles a cell: several bricks, buckets and blocks of 8192 faces

/// Waves with a ridge, whose crest is a crease; `backwards` writes vertices and faces from the last to the first.
fs::path write_waves(const fs::path& path, bool backwards = false) {
  const auto wave = [](int i, int j) {
    // Scattered along the surface, but for crease and border: a lattice of squares would stay one.
    const bool line = i == 0 || i == kSide || j == 0 || j == kSide || i == 110 || i == 130 || i == 150;
    const auto off = [&](std::uint64_t axis) {
      return line ? 0.0
                  : 0.7 * (to_unit(random_bits(5, axis, static_cast<std::uint64_t>(j * 1000 + i))) - 0.5);
    };
    const double x = i + off(0), y = j + off(1), u = x / 40.0 - 3, v = y / 40.0 - 3;
    const double ridge = 20.0 - std::fabs(x - 130.0);
    Double3 p = {x, y, 2.0 * u * v - u * u + (ridge > 0.0 ? ridge : 0.0)};
    for (double& c : p) c = static_cast<double>(static_cast<float>(c));
    return p;
  };
  tessera::test::write_sheet(path, kSide, wave, backwards);
  return path;
}

std::vector<std::string> words(const fs::path& in, const fs::path& out,
                               const std::vector<std::string>& more) {
  std::vector<std::string> w = {"remesh", in.string(), "-o", out.string(), "--progress", "none", "-q"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}

MeshCheck checked(const fs::path& mesh) {
  MeshCheckOptions options;
  options.temp = mesh.parent_path();
  return check_mesh(*open_mesh_file(mesh), options);
}

Json report_of(const fs::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json"));
}

}  // namespace

TEST_CASE("remesh: same bytes over threads, memory, processes, order of the input and kills", "[property]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const std::vector<std::string> base = {"--edge", "1.8", "--tolerance", "0.1", "--block-faces", "16384"};
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
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(report.at("certificate").at("certified_max").get<double>() <= 0.1);
  const Json quality = report.at("quality");
  CHECK(quality.at("mean_angle_deviation_deg").get<double>() < 9.0);
  CHECK(quality.at("mean_edge_deviation").get<double>() < 0.15);
  CHECK(quality.at("share_below_25_deg").get<double>() < 0.01);
  CHECK(quality.at("angles_by_degree").size() == 180);
  CHECK(run(in, {"-t", "2", "--memory", "300M"}) == bytes);
  CHECK(run(in, {"-t", "5", "--memory", "2G", "--tile-size", "128"}) == bytes);
  CHECK(run(in, {"-t", "2", "--memory", "1G", "--processes"}) == bytes);
  CHECK(run(write_waves(folder.path() / "back.ply", true), {"-t", "2", "--memory", "1G"}) == bytes);

  const fs::path out = folder.path() / "killed.ply";
  std::vector<std::string> w = words(in, out, base);
  w.insert(w.end(), {"-t", "2", "--memory", "1G"});
  REQUIRE(resumed_after_kills(w).code == 0);
  CHECK(file_bytes(out) == bytes);
}

TEST_CASE("remesh: blocks leave no trace in the number and the shape of faces", "[property]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const auto quality = [&](const std::string& block) {
    const fs::path out = folder.path() / "out.ply";
    fs::remove(out);
    const CommandResult r = tessera_command(words(in, out, {"--edge", "1.8", "--block-faces", block}));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const MeshCheck check = checked(out);
    CHECK(check.nonmanifold_edges == 0);
    CHECK(check.components == 1);
    return report_of(out).at("quality");
  };
  const Json one = quality("1000000"), many = quality("16384");
  CHECK(many.at("faces").get<double>() == Approx(one.at("faces").get<double>()).epsilon(0.03));
  CHECK(many.at("mean_angle_deviation_deg").get<double>() ==
        Approx(one.at("mean_angle_deviation_deg").get<double>()).epsilon(0.15));
  CHECK(many.at("valence_six_share").get<double>() ==
        Approx(one.at("valence_six_share").get<double>()).epsilon(0.05));
}

TEST_CASE(
    "remesh: faces near seams of blocks are shaped like faces elsewhere, where seams of passes cross too",
    "[property]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply"), out = folder.path() / "out.ply";
  REQUIRE(tessera_command(words(in, out, {"--edge", "1.1", "--block-faces", "8192", "--keep"})).code == 0);
  const std::vector<SeamTrace> traces = seam_traces(out.string() + ".tessera");
  CHECK(traces.size() == 8);
  for (const SeamTrace& t : traces) {
    if (t.seam_faces < 200) continue;
    for (std::size_t i = 0; i < t.distance.size(); ++i) {
      CAPTURE(t.where, t.seam_faces, FaceShapes::kNames[i], t.distance[i], t.critical, t.among[i]);
      CHECK(t.distance[i] < t.critical + 0.05);
    }
  }
}

TEST_CASE("remesh: the shape told is that of all faces, also where rounds of the proof keep blocks",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply"), out = folder.path() / "out.ply";
  REQUIRE(tessera_command(words(in, out, {"--edge", "3", "--tolerance", "0.0004", "--block-faces", "16384"}))
              .code == 0);
  const Json report = report_of(out);
  CHECK(report.at("certificate").at("rounds_again").get<int>() > 0);
  CHECK(report.at("quality").at("faces") == report.at("mesh").at("faces"));
}

TEST_CASE("remesh: no angle below the one asked for, proven, the same whatever must not matter",
          "[property]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply"), out = folder.path() / "out.ply";
  const auto run = [&](const fs::path& from, std::vector<std::string> more) {
    fs::remove(out);
    more.insert(more.end(), {"--edge", "1.8", "--tolerance", "0.1", "--block-faces", "16384"});
    const CommandResult r = tessera_command(words(from, out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  const std::string bytes = run(in, {"--min-angle", "30", "-t", "1", "--memory", "1G"});
  const Json report = report_of(out), angles = report.at("small_angles");
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(report.at("certificate").at("certified_max").get<double>() <= 0.1);
  CHECK(angles.at("below_before").get<int>() > 20);
  CHECK(angles.at("below") == 0);
  CHECK(report.at("quality").at("smallest_angle_deg").get<double>() >= 30.0);
  CHECK(checked(out).defects().empty());
  CHECK(run(in, {"--min-angle", "30", "-t", "3", "--memory", "300M", "--tile-size", "128"}) == bytes);
  CHECK(run(write_waves(folder.path() / "back.ply", true),
            {"--min-angle", "30", "-t", "2", "--memory", "1G"}) == bytes);
  CHECK(run(in, {"-t", "2", "--memory", "1G"}) != bytes);
  CHECK_FALSE(report_of(out).contains("small_angles"));
}

TEST_CASE("remesh: lengths that adapt are evened, what is left is told, the same whatever must not matter",
          "[property]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply"), out = folder.path() / "out.ply";
  const auto run = [&](const fs::path& from, std::vector<std::string> more) {
    fs::remove(out);
    more.insert(more.end(), {"--tolerance", "0.05", "--adaptive", "--block-faces", "16384"});
    const CommandResult r = tessera_command(words(from, out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  const std::string bytes = run(in, {"-t", "1", "--memory", "1G"});
  const Json report = report_of(out), ratios = report.at("length_ratios"), quality = report.at("quality");
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(ratios.at("asked") == 1.5);
  const auto count = [&](const char* key) { return ratios.at(key).get<double>(); };
  CHECK(count("beyond_before") > 20);
  CHECK(count("beyond") < 0.25 * count("beyond_before"));  // creases and borders of the waves keep some
  CHECK(count("held") + count("at_lines") + count("at_tolerance") <= count("beyond"));
  CHECK(count("edges") > 0.9 * 1.5 * report.at("mesh").at("faces").get<double>());
  CHECK(quality.at("uneven_edge_share").get<double>() == Approx(count("beyond") / count("edges")));
  CHECK(checked(out).defects().empty());
  CHECK(run(in, {"-t", "3", "--memory", "400M", "--tile-size", "128"}) == bytes);
  CHECK(run(write_waves(folder.path() / "back.ply", true), {"-t", "2", "--memory", "1G"}) == bytes);
  fs::remove(out);
  REQUIRE(tessera_command(words(in, out, {"--edge", "3"})).code == 0);
  CHECK_FALSE(report_of(out).contains("length_ratios"));
  CHECK(report_of(out).at("quality").at("largest_length_ratio").get<double>() > 1.0);
}

TEST_CASE("remesh: even angles or even areas, at the other's expense", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const auto quality = [&](const std::string& even) {
    const fs::path out = folder.path() / (even + ".ply");
    const CommandResult r = tessera_command(words(in, out, {"--edge", "1.8", "--even", even, "--no-html"}));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return report_of(out).at("quality");
  };
  const auto angles = [](const Json& q) { return q.at("mean_angle_deviation_deg").get<double>(); };
  const auto areas = [](const Json& q) { return q.at("mean_voronoi_area_deviation").get<double>(); };
  const Json a = quality("angles"), both = quality("both"), c = quality("areas");
  CHECK(angles(a) < angles(both));
  CHECK(angles(both) < angles(c));
  CHECK(areas(c) < 0.8 * areas(both));
  CHECK(areas(both) < areas(a));
  // Botsch's thesis, 3.2.3: 13 % at 4.0 degrees, or 4 % at 5.6, edges 21 % off.
  CHECK(angles(a) < 4.0);
  CHECK(areas(a) < 0.13);
  CHECK(angles(c) < 5.6);
  CHECK(areas(c) < 0.04);
  for (const Json& q : {a, c}) CHECK(q.at("mean_edge_deviation").get<double>() < 0.21);
}

TEST_CASE("remesh: edges that follow the surface keep within a tenth of their length, others as they can",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const auto run = [&](const std::vector<std::string>& more) {
    const fs::path out = folder.path() / "out.ply";
    const CommandResult r = tessera_command(words(in, out, more));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    const Json report = report_of(out);
    const bool closely = stage_result(report, "sizing").at("follows_closely").get<bool>();
    return std::pair{closely, report.at("certificate").at("certified_max").get<double>() /
                                  report.at("quality").at("edge").get<double>()};
  };
  const auto [follows, distance] = run({"--edge", "2", "--no-html", "--force"});
  CHECK(follows);
  CHECK(distance <= 0.1);
  const auto [may_follow, of_angles] = run({"--edge", "2", "--even", "angles", "--no-html", "--force"});
  CHECK_FALSE(may_follow);
  CHECK(of_angles > 0.1);
  CHECK_FALSE(run({"--edge", "200", "--no-html", "--force"}).first);
}

TEST_CASE("remesh: creases that bend get shorter edges, the same whatever must not matter", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const fs::path out = folder.path() / "out.ply";
  const auto bytes_with = [&](const std::vector<std::string>& more) {
    std::vector<std::string> all = {"--edge", "6", "--block-faces", "16384", "--no-html", "--force"};
    all.insert(all.end(), more.begin(), more.end());
    const CommandResult r = tessera_command(words(in, out, all));
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  const std::string graded = bytes_with({"--creases", "graded"});
  CHECK(bytes_with({}) != graded);
  CHECK(bytes_with({"--creases", "graded", "-t", "2", "--memory", "400M", "--processes"}) == graded);
}

TEST_CASE("remesh: a number of faces with needles for shapes is no result", "[pipeline]") {
  const TempFolder folder;
  // Strips a hundred times as long as wide, apart from each other: no edge of any length makes sound faces of them.
  WholeMesh strips;
  for (std::uint64_t i = 0; i < 100; ++i) {
    const double y = 2.0 * static_cast<double>(i);
    strips.points.insert(strips.points.end(), {{0, y, 0}, {10, y, 0}, {10, y + 0.02, 0}, {0, y + 0.02, 0}});
    strips.faces.insert(strips.faces.end(), {{4 * i, 4 * i + 1, 4 * i + 2}, {4 * i, 4 * i + 2, 4 * i + 3}});
  }
  strips.header.vertices = strips.points.size();
  strips.header.faces = strips.faces.size();
  const fs::path in = folder.path() / "strips.ply", out = folder.path() / "out.ply";
  write_whole(in, strips);
  const CommandResult refused = tessera_command(words(in, out, {"--faces", "600"}));
  CHECK(refused.code == 6);
  CHECK(refused.errors.find("--faces 600 cannot be had") != std::string::npos);
  CHECK(refused.errors.find("give --edge") != std::string::npos);
  CHECK_FALSE(fs::exists(out));
  CHECK(tessera_command(words(in, out, {"--edge", "1", "--force"})).code == 0);
}

TEST_CASE("remesh: a number of faces, or a tolerance alone, says how long edges are", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const fs::path out = folder.path() / "out.ply";
  REQUIRE(tessera_command(words(in, out, {"--faces", "40000"})).code == 0);
  CHECK(report_of(out).at("mesh").at("faces").get<double>() == Approx(40000).epsilon(0.1));
  fs::remove(out);
  REQUIRE(tessera_command(words(in, out, {"--tolerance", "0.05"})).code == 0);
  CHECK(report_of(out).at("certificate").at("proven") == true);
  CHECK(report_of(out).at("quality").at("edge").get<double>() > 2.0);
  fs::remove(out);
  const std::vector<std::string> adaptive = {"--tolerance", "0.05", "--adaptive", "--block-faces", "16384"};
  REQUIRE(tessera_command(words(in, out, adaptive)).code == 0);
  CHECK(report_of(out).at("certificate").at("proven") == true);
  const std::string bytes = file_bytes(out);
  fs::remove(out);
  std::vector<std::string> other = adaptive;
  other.insert(other.end(), {"-t", "2", "--memory", "400M", "--processes"});
  REQUIRE(tessera_command(words(in, out, other)).code == 0);
  CHECK(file_bytes(out) == bytes);
}

TEST_CASE("remesh: far more faces than asked for are no result, unless edges or a tolerance ask for them",
          "[pipeline]") {
  const TempFolder folder;
  // Faces apart from each other: none can go.
  WholeMesh crumbs;
  for (std::uint64_t i = 0; i < 2000; ++i) {
    const double x = 3.0 * static_cast<double>(i % 50), y = 3.0 * static_cast<double>(i / 50);
    crumbs.points.insert(crumbs.points.end(), {{x, y, 0}, {x + 1, y, 0}, {x, y + 1, 0}});
    crumbs.faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
  }
  crumbs.header.vertices = crumbs.points.size();
  crumbs.header.faces = crumbs.faces.size();
  const fs::path in = folder.path() / "crumbs.ply", out = folder.path() / "out.ply";
  write_whole(in, crumbs);
  const CommandResult refused = tessera_command(words(in, out, {"--faces", "300"}));
  CHECK(refused.code == 6);
  CHECK(refused.errors.find("keep 2000 faces") != std::string::npos);
  CHECK(refused.errors.find("give --edge") != std::string::npos);
  CHECK_FALSE(fs::exists(out));
  CHECK(tessera_command(words(in, out, {"--faces", "1700", "--force"})).code == 0);
  CHECK(tessera_command(words(in, out, {"--edge", "2.4", "--force"})).code == 0);
  CHECK(tessera_command(words(in, out, {"--faces", "300", "--tolerance", "0.5", "--force"})).code == 0);
}

TEST_CASE("remesh: edges get longer where creases and borders keep far more faces than asked for",
          "[pipeline]") {
  const TempFolder folder;
  // Four triangles: halved again and again, their borders have a power of two of edges.
  WholeMesh pyramid;
  pyramid.points = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}, {0, 0, 0.7}};
  pyramid.faces = {{0, 1, 4}, {1, 2, 4}, {2, 3, 4}, {3, 0, 4}};
  pyramid.header.vertices = pyramid.points.size();
  pyramid.header.faces = pyramid.faces.size();
  const fs::path in = folder.path() / "pyramid.ply", out = folder.path() / "out.ply";
  write_whole(in, pyramid);
  std::vector<std::string> plain = words(in, out, {"--faces", "3000"});
  const CommandResult r = tessera_command(plain);
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json report = report_of(out);
  CHECK(stage_result(report, "pass-3").at("less_near") == true);
  CHECK(stage_result(report, "again-1-pass-3").at("longer_edge").get<double>() ==
        Approx(report.at("quality").at("edge").get<double>()));
  CHECK(stage_result(report, "sizing").at("edge").get<double>() <
        report.at("quality").at("edge").get<double>());
  CHECK(report.at("mesh").at("faces") <= 3600);
  CHECK(report.at("mesh").at("faces") >= 1800);
  CHECK(report.at("certificate").at("certified_max").get<double>() > 0.0);
  const std::string bytes = file_bytes(out);
  fs::remove(out);
  plain.insert(plain.end(), {"-t", "2", "--processes"});
  REQUIRE(tessera_command(plain).code == 0);
  CHECK(file_bytes(out) == bytes);
  fs::remove(out);
  plain.resize(plain.size() - 3);
  CHECK(resumed_after_kills(plain).code == 0);
  CHECK(file_bytes(out) == bytes);
}

TEST_CASE("remesh: options and inputs that make no sense are refused with one sentence", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_waves(folder.path() / "in.ply");
  const fs::path out = folder.path() / "out.ply";
  const auto refused = [&](int code, const fs::path& from, const std::vector<std::string>& more) {
    const CommandResult r = tessera_command(words(from, out, more));
    CAPTURE(more, r.errors);
    CHECK(r.code == code);
    CHECK(r.errors.find("error") != std::string::npos);
    CHECK_FALSE(fs::exists(out));
    fs::remove_all(out.string() + ".tessera");
  };
  refused(2, in, {});
  refused(2, in, {"--edge", "-1"});
  refused(2, in, {"--edge", "1", "--faces", "1000"});
  refused(2, in, {"--tolerance", "1e6"});
  refused(2, in, {"--adaptive"});
  refused(2, in, {"--adaptive", "--tolerance", "0.1", "--edge", "1"});
  refused(2, in, {"--edge", "1", "--max-edge", "2"});
  refused(2, in, {"--adaptive", "--tolerance", "0.1", "--min-edge", "2", "--max-edge", "1"});
  // Keys of new vertices tell eight passes apart.
  refused(2, in, {"--adaptive", "--tolerance", "0.1", "--passes", "7"});
  refused(2, in, {"--edge", "1", "--min-angle", "30", "--passes", "7"});
  refused(2, in, {"--adaptive", "--tolerance", "0.1", "--min-angle", "30", "--passes", "5"});
  refused(2, in, {"--edge", "1e-9"});
  refused(4, in, {"--edge", "0.02", "--memory", "300M"});
  spill(folder.path() / "points.off", "OFF 3 1 0\n0 0 0\n0 0 0\n1 0 0\n3 0 1 2\n");
  refused(5, folder.path() / "points.off", {"--edge", "1"});
  spill(folder.path() / "cut.off", "OFF 3 1 0\n0 0 0\n");
  refused(3, folder.path() / "cut.off", {"--edge", "1"});
}

TEST_CASE("remesh: a tolerance that takes countless faces is refused before any pass", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder.path() / "in.ply", out = folder.path() / "out.ply";
  tessera::test::write_sheet(in, 30, [](int i, int j) {
    return Double3{i * 1.0, j * 1.0, (i - 15) * (i - 15) / 64.0 + (j - 15) * (j - 15) / 32.0};
  });
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{"--tolerance", "1e-7"}, {"--tolerance", "1e-7", "--adaptive"}}) {
    const CommandResult r = tessera_command(words(in, out, more));
    INFO(r.errors);
    CHECK(r.code == 6);
    CHECK(std::count(r.errors.begin(), r.errors.end(), '\n') == 1);
    CHECK(r.errors.find("faces: the least --tolerance that can do is ") != std::string::npos);
    CHECK_FALSE(fs::exists(out));
    CHECK_FALSE(fs::exists(out.string() + ".tessera/pass-1"));
    fs::remove_all(out.string() + ".tessera");
  }
  // With a length what cannot be within the tolerance stays as it is.
  REQUIRE(tessera_command(words(in, out, {"--edge", "0.7", "--tolerance", "1e-7"})).code == 0);
  CHECK(report_of(out).at("certificate").at("certified_max").get<double>() <= 1e-7);
}

TEST_CASE("remesh: SIGTERM ends a long block in its midst", "[fault]") {
  const TempFolder folder;
  // Two faces, one brick, one block: nothing but the kernel looks for a stop.
  const fs::path in = folder.write("in.off", "OFF 4 2 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n");
  const fs::path out = folder.path() / "out.ply";
  // The job ends long before so many looks where the kernel has none.
  const CommandResult stopped =
      tessera_command(words(in, out, {"--edge", "0.0015", "--no-html"}), 0, "TESSERA_FAULT=stop:2000");
  INFO(stopped.errors);
  CHECK(stopped.code == 128 + SIGTERM);
  CHECK_FALSE(fs::exists(out));
  CHECK(fs::exists(out.string() + ".tessera"));
}

TEST_CASE("remesh: defects, islands and edges longer than the mesh leave a sound mesh", "[pipeline]") {
  const TempFolder folder;
  const fs::path out = folder.path() / "out.off";
  // Three faces on an edge, a face twice, one without area, and an island of one triangle.
  spill(folder.path() / "in.off",
        "OFF 9 7 0\n0 0 0\n1 0 0\n0 1 0\n0 -1 0\n0 0 1\n5 5 5\n6 5 5\n5 6 5\n0.5 0 0\n"
        "3 0 1 2\n3 1 0 3\n3 0 1 4\n3 0 1 2\n3 0 8 1\n3 5 6 7\n3 2 0 4\n");
  for (const std::string edge : {"0.1", "0.9", "100"}) {
    CAPTURE(edge);
    const fs::path ply = folder.path() / ("out" + edge + ".ply");
    const CommandResult r = tessera_command(words(folder.path() / "in.off", ply, {"--edge", edge}));
    CAPTURE(r.errors);
    REQUIRE(r.code == 0);
    const MeshCheck check = checked(ply);
    CHECK(check.nonmanifold_edges == 0);
    CHECK(check.faces >= 5);
  }
}

namespace {

/// A box from the origin, two faces a side.
WholeMesh box_mesh(const Double3& size, const Double3& at) {
  WholeMesh m;
  for (std::uint32_t v = 0; v < 8; ++v)
    m.points.push_back(
        {at[0] + (v & 1 ? size[0] : 0.0), at[1] + (v & 2 ? size[1] : 0.0), at[2] + (v & 4 ? size[2] : 0.0)});
  m.faces = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
             {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  m.header.vertices = m.points.size();
  m.header.faces = m.faces.size();
  m.header.double_positions = true;
  return m;
}

std::size_t kept_points(const WholeMesh& of, const WholeMesh& in) {
  std::size_t kept = 0;
  for (const Double3& p : of.points)
    kept += std::find(in.points.begin(), in.points.end(), p) != in.points.end();
  return kept;
}

}  // namespace

TEST_CASE("remesh: corners of what is thinner than an edge keep their place", "[pipeline]") {
  const TempFolder folder;
  // Plates down to a 40th of the edge, a blade, rods: two and four corners within a needle's width of each other.
  for (const Double3& size :
       {Double3{1, 1, 0.005}, Double3{1, 1, 0.01}, Double3{1, 1, 0.02}, Double3{1, 1, 0.05},
        Double3{1, 0.5, 0.03}, Double3{1, 0.02, 0.02}, Double3{1, 0.05, 0.01}})
    for (const double far : {0.0, 5e6})
      for (const std::string edge : {"0.1", "0.2"}) {
        CAPTURE(size[0], size[1], size[2], far, edge);
        const WholeMesh box = box_mesh(size, {far, far, 0});
        write_whole(folder / "in.ply", box);
        const CommandResult r =
            tessera_command(words(folder / "in.ply", folder / "out.ply", {"--edge", edge, "--force"}));
        INFO(r.errors);
        REQUIRE(r.code == 0);
        CHECK(kept_points(box, read_whole(folder / "out.ply")) == 8);
        CHECK(checked(folder / "out.ply").defects().empty());
      }
}

TEST_CASE("remesh: corners of the border of a narrow strip keep their place", "[pipeline]") {
  const TempFolder folder;
  WholeMesh strip;
  strip.points = {{0, 0, 0}, {1, 0, 0}, {1, 0.02, 0}, {0, 0.02, 0}};
  strip.faces = {{0, 1, 2}, {0, 2, 3}};
  strip.header.vertices = 4, strip.header.faces = 2;
  strip.header.double_positions = true;
  write_whole(folder / "in.ply", strip);
  REQUIRE(tessera_command(words(folder / "in.ply", folder / "out.ply", {"--edge", "0.1"})).code == 0);
  CHECK(kept_points(strip, read_whole(folder / "out.ply")) == 4);
}

}  // namespace remesh_test
