// tessera resample as a user runs it: the same bytes whatever must not matter, blends within the tolerance, all else as it was.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <string>
#include <vector>

#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/command.h"
#include "tests/helpers/filleted.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace resample_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;

fs::path write_block(const fs::path& path, const MeshBlock& block, bool backwards = false) {
  WholeMesh mesh;
  mesh.points = block.position;
  for (Double3& p : mesh.points)
    for (double& c : p) c = static_cast<double>(static_cast<float>(c));
  const std::uint64_t last = block.position.size() - 1;
  for (const auto& f : block.faces)
    mesh.faces.push_back(backwards ? MeshFace{last - f[0], last - f[1], last - f[2]}
                                   : MeshFace{f[0], f[1], f[2]});
  if (backwards) {
    std::reverse(mesh.points.begin(), mesh.points.end());
    std::reverse(mesh.faces.begin(), mesh.faces.end());
  }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(path, mesh);
  return path;
}
fs::path write_box(const fs::path& path, bool backwards = false) {
  return write_block(path, filleted_box(40.0, 5.0, 64, 0.3, 0.03, 2), backwards);
}

std::vector<std::string> words(const fs::path& in, const fs::path& out,
                               const std::vector<std::string>& more) {
  std::vector<std::string> w = {"resample",   in.string(), "-o", out.string(),
                                "--progress", "none",      "-q", "--no-html"};
  w.insert(w.end(), more.begin(), more.end());
  return w;
}
Json report_of(const fs::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json"));
}
MeshCheck checked(const fs::path& mesh) {
  MeshCheckOptions options;
  options.temp = mesh.parent_path();
  return check_mesh(*open_mesh_file(mesh), options);
}

}  // namespace

TEST_CASE("resample: same bytes over threads, memory, blocks, processes, order of the input and kills",
          "[property]") {
  const TempFolder folder;
  const fs::path in = write_box(folder.path() / "in.ply");
  const auto run = [&](const fs::path& from, const std::vector<std::string>& more) {
    const fs::path out = folder.path() / "out.ply";
    fs::remove(out);
    std::vector<std::string> w = words(from, out, more);
    w.insert(w.end(), {"--tolerance", "0.25"});
    const CommandResult r = tessera_command(w);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    CHECK_FALSE(fs::exists(out.string() + ".tessera"));
    return file_bytes(out);
  };
  const std::string bytes = run(in, {"-t", "1", "--memory", "1G"});
  const Json report = report_of(folder.path() / "out.ply");
  CHECK(report.at("resampled").at("changed") == 12);
  CHECK(report.at("certificate").at("proven") == true);
  CHECK(report.at("certificate").at("certified_max").get<double>() <= 0.25);
  CHECK(run(in, {"-t", "2", "--memory", "200M"}) == bytes);
  CHECK(run(in, {"-t", "5", "--memory", "2G", "--tile-size", "128"}) == bytes);
  CHECK(run(in, {"-t", "2", "--memory", "1G", "--processes"}) == bytes);
  CHECK(run(write_box(folder.path() / "back.ply", true), {"-t", "2", "--memory", "1G"}) == bytes);

  const fs::path out = folder.path() / "killed.ply";
  const std::vector<std::string> w = words(in, out, {"-t", "2", "--memory", "1G", "--tolerance", "0.25"});
  REQUIRE(resumed_after_kills(w).code == 0);
  CHECK(file_bytes(out) == bytes);
}

TEST_CASE("resample: blocks of the search leave no trace", "[property]") {
  const TempFolder folder;
  const fs::path in = write_box(folder.path() / "in.ply"), out = folder.path() / "out.ply";
  const auto run = [&](const std::string& faces) {
    fs::remove(out);
    REQUIRE(tessera_command(words(in, out, {"--tolerance", "0.25", "--block-faces", faces})).code == 0);
    return file_bytes(out);
  };
  CHECK(run("1024") == run("1000000"));
}

TEST_CASE("resample: a closed box stays closed, vertices that are left keep their bytes, noise goes",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_box(folder.path() / "in.ply"), out = folder.path() / "out.ply";
  REQUIRE(tessera_command(words(in, out, {"--tolerance", "0.25"})).code == 0);
  const MeshCheck check = checked(out);
  CHECK(check.nonmanifold_edges == 0);
  CHECK(check.nonmanifold_vertices == 0);
  CHECK(check.boundary_edges == 0);
  CHECK(check.components == 1);
  const WholeMesh was = read_whole(in), is = read_whole(out);
  const std::set<Double3> before(was.points.begin(), was.points.end());
  std::size_t kept = 0;
  for (const Double3& p : is.points) kept += before.count(p);
  const Json done = report_of(out).at("resampled");
  CHECK(kept > was.points.size() / 2);
  CHECK(was.faces.size() - done.at("faces_removed").get<std::size_t>() +
            done.at("faces_added").get<std::size_t>() ==
        is.faces.size());
  for (const Json& blend : done.at("blends")) {
    CAPTURE(dump_json(blend));
    REQUIRE(blend.at("changed") == true);
    CHECK(blend.at("radius").get<double>() == Approx(5.0).epsilon(0.05));
    for (const char* direction : {"along", "across"})
      CHECK(blend.at("jumps_after").at(direction).at("variance").get<double>() * 20.0 <
            blend.at("jumps_before").at(direction).at("variance").get<double>());
  }
}

TEST_CASE("resample: a radius that is asked for comes out within 1 %, sharp edges come out sharp",
          "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_box(folder.path() / "in.ply"), out = folder.path() / "out.ply";
  REQUIRE(tessera_command(words(in, out, {"--round", "7"})).code == 0);
  Json report = report_of(out);
  CHECK(report.at("resampled").at("changed").get<int>() >= 10);
  for (const Json& blend : report.at("resampled").at("blends"))
    if (blend.at("changed") == true) CHECK(blend.at("new_radius").get<double>() == Approx(7.0).epsilon(0.01));
  CHECK(checked(out).boundary_edges == 0);
  fs::remove(out);
  REQUIRE(tessera_command(words(in, out, {"--sharpen"})).code == 0);
  report = report_of(out);
  CHECK(report.at("resampled").at("changed").get<int>() >= 10);
  CHECK(checked(out).boundary_edges == 0);
  // In the middle of an edge the flanks meet where a box has its edge.
  double farthest = 0.0;
  for (const Double3& p : read_whole(out).points)
    if (std::fabs(p[2]) < 5.0) farthest = std::max(farthest, std::min(std::fabs(p[0]), std::fabs(p[1])));
  CHECK(farthest == Approx(40.0).margin(0.1));
}

TEST_CASE("resample: all edges of a bracket become fillets, the concave one too", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = folder.path() / "in.obj", out = folder.path() / "out.ply";
  write_whole(in, made_bracket(40));
  REQUIRE(tessera_command(words(in, out, {"--round", "0.06"})).code == 0);
  const Json done = report_of(out).at("resampled");
  CHECK(done.at("changed").get<int>() >= 18);
  std::size_t concave = 0;
  for (const Json& blend : done.at("blends")) {
    CAPTURE(dump_json(blend));
    if (blend.at("changed") == true)
      CHECK(blend.at("new_radius").get<double>() == Approx(0.06).epsilon(0.01));
    else
      CHECK_FALSE(blend.at("left_because").get<std::string>().empty());
    concave += blend.at("changed") == true && blend.at("convex") == false;
  }
  CHECK(concave == 1);
  const MeshCheck check = checked(out);
  CHECK(check.boundary_edges == 0);
  CHECK(check.nonmanifold_edges == 0);
  CHECK(check.nonmanifold_vertices == 0);
  CHECK(check.components == 1);
}

TEST_CASE(
    "resample: edges of a real part become fillets, and one that cannot is named with what is in its way",
    "[pipeline][.shared]") {
  if (!has_shared_data()) return;
  const TempFolder folder;
  const fs::path in = kSharedData / "meshes" / "fandisk-52k.obj", out = folder.path() / "out.ply";
  REQUIRE(tessera_command(words(in, out, {"--round", "0.006"})).code == 0);
  const Json done = report_of(out).at("resampled");
  CHECK(done.at("changed").get<int>() >= 20);
  for (const Json& blend : done.at("blends")) {
    CAPTURE(dump_json(blend));
    if (blend.at("changed") == true)
      CHECK(blend.at("new_radius").get<double>() == Approx(0.006).epsilon(0.01));
    else
      CHECK(blend.at("left_because").get<std::string>().find(" away, is longer") != std::string::npos);
  }
  const MeshCheck check = checked(out);
  CHECK(check.boundary_edges == 0);
  CHECK(check.nonmanifold_edges == 0);
  CHECK(check.nonmanifold_vertices == 0);
  CHECK(check.components == 1);
}

TEST_CASE("resample: blends by hand, and profiles", "[pipeline]") {
  const TempFolder folder;
  const fs::path out = folder.path() / "out.ply";
  Swept s;
  s.radius = 4.0;
  s.convex = GENERATE(true, false);
  const fs::path in = write_block(folder.path() / "in.ply", swept_block(s));
  spill(folder.path() / "blends.json",
        R"({"blends": [{"name": "rim", "points": [[0, 4, 0], [0.1, 20, 0], [0, 36, 0]], "width": 6}]})");
  spill(folder.path() / "chamfer.json",
        R"({"knots": [{"at": [0, 0], "way": [1, 0]}, {"at": [1, 0], "way": [1, 0]}]})");
  const std::string blends = (folder.path() / "blends.json").string();
  REQUIRE(tessera_command(words(in, out, {"--blends", blends, "--tolerance", "0.25"})).code == 0);
  const Json blend = report_of(out).at("resampled").at("blends").at(0);
  CHECK(blend.at("name") == "rim");
  CHECK(blend.at("changed") == true);
  CHECK(blend.at("convex") == s.convex);
  CHECK(blend.at("radius").get<double>() == Approx(4.0).epsilon(1e-3));
  fs::remove(out);
  REQUIRE(tessera_command(
              words(in, out, {"--blends", blends, "--profile", (folder.path() / "chamfer.json").string()}))
              .code == 0);
  CHECK(report_of(out).at("resampled").at("changed") == 1);
  std::size_t on = 0;
  const double chord = (s.convex ? -4.0 : 4.0) * (1.0 - std::sqrt(0.5));
  for (const Double3& p : read_whole(out).points)
    if (p[1] > 14.0 && p[1] < 26.0 && std::fabs(p[0]) < 2.7 && std::fabs(p[2] - chord) < 1e-3) ++on;
  CHECK(on > 20);
}

TEST_CASE("resample: where there is no blend the mesh is written as it is", "[pipeline]") {
  const TempFolder folder;
  const fs::path out = folder.path() / "out.ply";
  const fs::path in = write_block(folder.path() / "in.ply", swept_block({.radius = 80.0, .arc_deg = 20.0}));
  const CommandResult r = tessera_command(words(in, out, {}));
  CHECK(r.code == 0);
  CHECK(report_of(out).at("search").at("tracks") == 0);
  std::vector<Double3> was = read_whole(in).points, is = read_whole(out).points;
  std::sort(was.begin(), was.end());
  std::sort(is.begin(), is.end());
  CHECK(was == is);
  CHECK(read_whole(in).faces.size() == read_whole(out).faces.size());
}

TEST_CASE("resample: options and inputs that make no sense are refused with one sentence", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_box(folder.path() / "in.ply"), out = folder.path() / "out.ply";
  const auto refused = [&](int code, const fs::path& from, const std::vector<std::string>& more,
                           const std::string& says) {
    const CommandResult r = tessera_command(words(from, out, more));
    CAPTURE(more, r.errors);
    CHECK(r.code == code);
    CHECK(r.errors.find(says) != std::string::npos);
    CHECK_FALSE(fs::exists(out));
    fs::remove_all(out.string() + ".tessera");
  };
  const auto file = [&](const std::string& text) {
    const fs::path path = folder.path() / "file.json";
    spill(path, text);
    return path.string();
  };
  refused(2, in, {"--round", "1", "--sharpen"}, "--sharpen");
  refused(2, in, {"--tolerance", "1e6"}, "--tolerance");
  refused(2, in, {"--round", "-1"}, "round");
  refused(3, in, {"--blends", file("{")}, "file.json");
  refused(3, in, {"--blends", file(R"({"blends": []})")}, "list");
  refused(3, in, {"--blends", file(R"({"blends": [{"points": [[0,0,0],[1,0,0]], "widht": 1}]})")}, "width");
  refused(3, in, {"--blends", file(R"({"blends": [{"points": [[0,0,0],[1,0,0]]}]})")}, "width");
  refused(3, in, {"--blends", file(R"({"blends": [{"points": [[0,0,0],[0,0,0]], "width": 1}]})")}, "same");
  refused(3, in,
          {"--profile", file(R"({"knots": [{"at": [0,1], "way": [1,0]}, {"at": [1,0], "way": [1,0]}]})")},
          "first knot");
  refused(3, in, {"--blends", (folder.path() / "none.json").string()}, "none.json");
  spill(folder.path() / "points.off", "OFF 3 1 0\n0 0 0\n0 0 0\n1 0 0\n3 0 1 2\n");
  refused(5, folder.path() / "points.off", {}, "nothing");
}

TEST_CASE("resample: defects of the input are repaired, islands and blends that fail stay", "[pipeline]") {
  const TempFolder folder;
  MeshBlock box = filleted_box(20.0, 3.0, 40, 0.3, 0.0, 1);
  // A face twice, and one on an edge that has two already.
  box.faces.push_back(box.faces[10]);
  box.faces.push_back({box.faces[20][0], box.faces[20][1], box.faces[900][2]});
  const fs::path in = write_block(folder.path() / "in.ply", box), out = folder.path() / "out.ply";
  // Chords of the input itself are farther from an arc than that.
  REQUIRE(tessera_command(words(in, out, {"--tolerance", "0.001"})).code == 0);
  const Json done = report_of(out).at("resampled");
  CHECK(done.at("changed") == 0);
  CHECK(done.at("left").get<int>() > 8);
  for (const Json& blend : done.at("blends")) CHECK(!blend.at("left_because").get<std::string>().empty());
  CHECK(checked(out).nonmanifold_edges == 0);
  fs::remove(out);
  REQUIRE(tessera_command(words(in, out, {"--tolerance", "0.2"})).code == 0);
  CHECK(report_of(out).at("resampled").at("changed").get<int>() > 8);
  CHECK(checked(out).nonmanifold_edges == 0);
}

}  // namespace resample_test
