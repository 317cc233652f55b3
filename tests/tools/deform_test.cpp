// tessera deform as a user runs it: what is fixed stays, handles go as told, the same bytes whatever must not matter.
#include <catch2/catch.hpp>

#include <cmath>
#include <fstream>
#include <string>
#include <vector>

#include "octree/placement.h"
#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/serial_job.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/solid_command.h"

namespace deform_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;
constexpr double kLength = 10.0;

/// A closed bar along x with fine waves on it; `side` squares around, 4 `side` along.
fs::path write_bar(const fs::path& path, int side) {
  WholeMesh mesh;
  const int around = side, along = 4 * side;
  for (int i = 0; i <= along; ++i)
    for (int j = 0; j < around; ++j) {
      const double x = kLength * i / along, angle = 2.0 * 3.14159265358979 * j / around;
      const double r = 1.0 + 0.01 * std::sin(20.0 * x) * std::cos(9.0 * angle);
      mesh.points.push_back(wide(narrow(Double3{x, r * std::cos(angle), r * std::sin(angle)})));
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint64_t>(i * around + j % around); };
  for (int i = 0; i < along; ++i)
    for (int j = 0; j < around; ++j) {
      mesh.faces.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
      mesh.faces.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
    }
  for (const int end : {0, along}) {
    const std::uint64_t centre = mesh.points.size();
    mesh.points.push_back({kLength * end / along, 0, 0});
    for (int j = 0; j < around; ++j) {
      if (end == 0)
        mesh.faces.push_back({centre, at(0, j + 1), at(0, j)});
      else
        mesh.faces.push_back({centre, at(end, j), at(end, j + 1)});
    }
  }
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  write_whole(path, mesh);
  return path;
}

fs::path write_json(const fs::path& path, const Json& value) {
  std::ofstream(path) << dump_json(value);
  return path;
}

const Json kBend = {
    {"handles", {{"end", {{"rotate", {{"axis", {0, 0, 1}}, {"angle", 60}, {"centre", {5, 0, 0}}}}}}}}};

/// The bar between x = 2 and x = 8 follows, what is beyond 8 is the handle.
Json edit() {
  Json e = kBend;
  e["order"] = 2;
  e["regions"] = Json::array();
  e["regions"].push_back({{"role", "support"}, {"box", {{2, -2, -2}, {8, 2, 2}}}});
  e["regions"].push_back(
      {{"role", "handle"}, {"name", "end"}, {"half_space", {{"point", {8, 0, 0}}, {"normal", {-1, 0, 0}}}}});
  return e;
}

CommandResult deform(const std::vector<std::string>& more) {
  std::vector<std::string> w = {"deform"};
  w.insert(w.end(), more.begin(), more.end());
  for (const char* quiet : {"--progress", "none", "-q", "--no-html"}) w.emplace_back(quiet);
  return tessera_command(w);
}

Json report_of(const fs::path& out) {
  return parse_json(file_bytes(out.string() + ".report.json"));
}

const Placement kRotation = rotation({0, 0, 1}, 60.0).about({5, 0, 0});

/// Fixed vertices keep their bits but for those within a face of the support, those of the handle turn.
void require_bent(const fs::path& in, const fs::path& out, double tolerance) {
  const WholeMesh before = read_whole(in), after = read_whole(out);
  REQUIRE(after.points.size() == before.points.size());
  CHECK(after.faces == before.faces);
  for (std::size_t v = 0; v < before.points.size(); ++v) {
    const Double3 p = before.points[v], q = after.points[v];
    if (p[0] < 1.5) CHECK(p == q);
    if (p[0] > 8.2) CHECK(norm(q - kRotation.apply(p)) < tolerance);
  }
}

}  // namespace

TEST_CASE("deform: a mesh that is its own base", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_bar(folder.path() / "in.ply", 40), out = folder.path() / "out.ply";
  const fs::path script = write_json(folder.path() / "edit.json", edit());
  const CommandResult r = deform({in.string(), script.string(), "-o", out.string()});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  require_bent(in, out, 1e-5);
  const Json report = report_of(out);
  CHECK(report.at("base").at("own") == true);
  CHECK(report.at("edit").at("residual").get<double>() < 1e-8);
  CHECK(report.at("mesh").at("base_flipped_faces") == 0);
  CHECK(report.at("mesh").at("largest_move").get<double>() > 2.0);

  SECTION("details keep their volumes") {
    Json e = edit();
    e["details"] = "volumes";
    const fs::path kept = folder.path() / "kept.ply";
    const fs::path with = write_json(folder.path() / "volumes.json", e);
    REQUIRE(deform({in.string(), with.string(), "-o", kept.string()}).code == 0);
    require_bent(in, kept, 1e-5);
    const Json mesh = report_of(kept).at("mesh");
    CHECK(mesh.at("details").at("volumes_off").get<double>() < 0.05);
    CHECK(mesh.at("details").at("volumes_off_before").get<double>() > 0.05);
    const auto change = [](const Json& m) {
      return std::fabs(m.at("base_volume").get<double>() / m.at("base_volume_before").get<double>() - 1.0);
    };
    CHECK(change(mesh) < 0.6 * change(report.at("mesh")));
    CHECK(mesh.at("base_crossing_faces") == 0);

    e["keep_volume"] = true;
    const fs::path whole = folder.path() / "whole.ply";
    REQUIRE(deform({in.string(), write_json(with, e).string(), "-o", whole.string()}).code == 0);
    CHECK(change(report_of(whole).at("mesh")) < 0.01);
    CHECK(report_of(whole).at("mesh").at("base_crossing_faces") == 0);
    e["handles"]["end"] = {{"scale", {{"factor", 1.5}}}};
    const CommandResult no =
        deform({in.string(), write_json(with, e).string(), "-o", whole.string(), "--force"});
    CHECK(no.code == 3);
    CHECK_THAT(no.errors, Catch::Contains("one of them changes volumes by a factor of 3.375"));
  }

  SECTION("a dry run colours the regions and moves nothing") {
    const fs::path drawn = folder.path() / "drawn.ply";
    REQUIRE(deform({in.string(), script.string(), "-o", drawn.string(), "--dry-run"}).code == 0);
    const WholeMesh before = read_whole(in), coloured = read_whole(drawn);
    CHECK(coloured.points == before.points);
    REQUIRE(coloured.rgba.size() == coloured.points.size());
    const auto colour = [&](double x) {
      for (std::size_t v = 0; v < coloured.points.size(); ++v)
        if (std::fabs(coloured.points[v][0] - x) < 0.2) return coloured.rgba[v] & 0xffffffu;
      return 0u;
    };
    CHECK((colour(5) >> 16) > (colour(5) & 0xff));              // blue
    CHECK((colour(9) >> 8 & 0xff) > (colour(9) >> 16 & 0xff));  // green
    CHECK((colour(1) >> 16) == (colour(1) & 0xff));             // grey
  }
}

TEST_CASE("deform: a mesh larger than its base follows with its details", "[property]") {
  const TempFolder folder;
  const fs::path in = write_bar(folder.path() / "in.ply", 120);
  const fs::path script = write_json(folder.path() / "edit.json", edit());
  const std::vector<std::string> base = {"--base-vertices", "6000"};
  const auto run = [&](std::vector<std::string> more) {
    const fs::path out = folder.path() / "out.ply";
    fs::remove(out);
    more.insert(more.end(), base.begin(), base.end());
    more.insert(more.begin(), {in.string(), script.string(), "-o", out.string()});
    const CommandResult r = deform(more);
    INFO(r.errors);
    REQUIRE(r.code == 0);
    return file_bytes(out);
  };
  const std::string bytes = run({"-t", "1", "--memory", "1G"});
  require_bent(in, folder.path() / "out.ply", 1e-4);
  const Json report = report_of(folder.path() / "out.ply");
  CHECK(report.at("base").at("own") == false);
  CHECK(report.at("edit").at("base_vertices").get<std::uint64_t>() < 9000);
  CHECK(report.at("mesh").at("base_flipped_faces") == 0);
  CHECK(run({"-t", "3", "--memory", "400M"}) == bytes);
  CHECK(run({"-t", "2", "--memory", "2G", "--tile-size", "128"}) == bytes);

  SECTION("prepared once, the same pose has the same bytes; at rest the mesh comes back") {
    const fs::path basis = folder.path() / "basis.tsb", out = folder.path() / "posed.ply";
    REQUIRE(deform({"prepare", in.string(), script.string(), "-o", basis.string(), "--base-vertices", "6000"})
                .code == 0);
    const Json prepared = report_of(basis).at("mesh");
    CHECK(prepared.at("reconstruction_error").get<double>() <= 1e-6 * prepared.at("diagonal").get<double>());
    REQUIRE(deform({"apply", basis.string(), "--pose", script.string(), "-o", out.string()}).code == 0);
    CHECK(file_bytes(out) == bytes);
    const Json series = {{"poses",
                          {{{"name", "still"}, {"handles", Json::object()}},
                           {{"name", "bent"}, {"handles", kBend.at("handles")}}}}};
    const fs::path poses = write_json(folder.path() / "poses.json", series);
    REQUIRE(
        deform({"apply", basis.string(), "--poses", poses.string(), "-o", out.string(), "--force"}).code ==
        0);
    CHECK(file_bytes(folder.path() / "posed.bent.ply") == bytes);
    CHECK(read_whole(folder.path() / "posed.still.ply").points == read_whole(in).points);

    write_bar(in, 100);
    const CommandResult r = deform(
        {"apply", basis.string(), "--pose", script.string(), "-o", (folder.path() / "no.ply").string()});
    CHECK(r.code == 3);
    CHECK_THAT(r.errors, Catch::Contains("it is not the mesh that"));
  }
}

TEST_CASE("deform: a mesh is fitted to control points", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_bar(folder.path() / "in.ply", 40), out = folder.path() / "out.ply";
  const fs::path points = folder.path() / "points.csv";
  std::ofstream(points) << "# x,y,z,X,Y,Z\n0,1,0,0,1,0\n5, 1, 0, 5.1, 1.2, 0.1\n\n10,0,1,10.1,0.3,1.05\r\n";
  const CommandResult r = deform({in.string(), "--fit", points.string(), "-o", out.string()});
  INFO(r.errors);
  REQUIRE(r.code == 0);
  const Json targets = report_of(out).at("mesh").at("targets");
  CHECK(targets.at("count") == 3);
  CHECK(targets.at("largest_before").get<double>() > 0.3);
  CHECK(targets.at("largest_after").get<double>() < 0.01);
  std::ofstream(points) << "0,1,0,0,1\n";
  const CommandResult bad =
      deform({in.string(), "--fit", points.string(), "-o", (folder.path() / "no.ply").string()});
  CHECK(bad.code == 3);
  CHECK_THAT(bad.errors, Catch::Contains("points.csv:1: a control point is six numbers"));
}

TEST_CASE("deform: regions by paint and by creases", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_bar(folder.path() / "plain.ply", 40), painted = folder.path() / "in.ply",
                 out = folder.path() / "out.ply";
  WholeMesh mesh = read_whole(in);
  mesh.header.colour = true;
  for (const Double3& p : mesh.points)
    mesh.rgba.push_back(p[0] > 8 ? 0xff0000ffu : p[0] > 2 ? 0xffff2020u : 0xffffffffu);
  write_whole(painted, mesh);
  Json e = kBend;
  e["regions"] = Json::array();
  e["regions"].push_back({{"role", "support"}, {"painted", {{"colour", {0, 0, 255}}}}});
  e["regions"].push_back(
      {{"role", "handle"}, {"name", "end"}, {"painted", {{"colour", {255, 0, 0}}, {"within", 10}}}});
  const fs::path script = write_json(folder.path() / "edit.json", e);
  // On its own base, and on one that has other vertices.
  for (const char* base : {"auto", "even"}) {
    const CommandResult r = deform({painted.string(), script.string(), "-o", out.string(), "--force",
                                    "--base", base, "--base-vertices", "5000"});
    INFO(r.errors);
    REQUIRE(r.code == 0);
    require_bent(painted, out, 1e-4);
  }
  const CommandResult plain = deform({in.string(), script.string(), "-o", out.string(), "--force"});
  CHECK(plain.code == 3);
  CHECK_THAT(plain.errors, Catch::Contains("region 1 is painted, but the mesh has no vertex colours"));

  // The ends of the bar are flat: creases bound them.
  e["regions"][0] = {{"role", "support"}, {"all", true}};
  e["regions"][1] = {{"role", "fixed"}, {"patch", {{"points", {{0, 0.2, 0.1}}}}}};
  e["regions"][2] = {
      {"role", "handle"}, {"name", "end"}, {"patch", {{"points", {{10, 0.2, 0.1}}}, {"crease", 45}}}};
  write_json(script, e);
  for (const char* base : {"auto", "even"}) {
    REQUIRE(deform({in.string(), script.string(), "-o", out.string(), "--force", "--base", base,
                    "--base-vertices", "5000"})
                .code == 0);
    const WholeMesh before = read_whole(in), after = read_whole(out);
    for (std::size_t v = 0; v < before.points.size(); ++v) {
      if (before.points[v][0] == 0.0) CHECK(norm(after.points[v] - before.points[v]) < 0.02);
      if (before.points[v][0] == kLength)
        CHECK(norm(after.points[v] - kRotation.apply(before.points[v])) < 0.02);
    }
  }
}

TEST_CASE("deform: a factor that memory does not hold is on disk, and the bytes are the same", "[memory]") {
  const TempFolder folder;
  const fs::path in = write_bar(folder.path() / "in.ply", 120);
  const fs::path script = write_json(folder.path() / "edit.json", edit());
  const auto run = [&](const std::string& out, const std::string& cap) {
    return tessera_command({"deform", in.string(), script.string(), "-o", (folder.path() / out).string(),
                            "--no-html", "--memory", cap});
  };
  const CommandResult refused = run("none.ply", "8M");
  INFO(refused.errors);
  REQUIRE(refused.code == 4);
  const std::size_t at = refused.errors.find("would do is --memory ");
  REQUIRE(at != std::string::npos);
  const std::uint64_t named = std::stoull(refused.errors.substr(at + 21));
  const CommandResult narrow = run("narrow.ply", std::to_string(named) + "M");
  INFO(narrow.errors);
  REQUIRE(narrow.code == 0);
  CHECK(narrow.peak_bytes <= named << 20);
  REQUIRE(run("wide.ply", "2G").code == 0);
  CHECK(file_bytes(folder.path() / "narrow.ply") == file_bytes(folder.path() / "wide.ply"));
  const Json less = report_of(folder.path() / "narrow.ply").at("edit"),
             all = report_of(folder.path() / "wide.ply").at("edit");
  const auto factor = all.at("factor_entries").get<std::uint64_t>() * sizeof(double);
  CHECK(less.at("factor_spilled_bytes").get<std::uint64_t>() > factor / 10);
  CHECK(all.at("factor_spilled_bytes") == 0);
  CHECK(less.at("factor_bytes") == all.at("factor_bytes"));
}

TEST_CASE("deform: goes on after a stop", "[fault]") {
  const TempFolder folder;
  const fs::path in = write_bar(folder.path() / "in.ply", 100);
  const fs::path script = write_json(folder.path() / "edit.json", edit());
  const auto run = [&](const std::string& out, std::vector<std::string> more) {
    more.insert(more.begin(), {in.string(), script.string(), "-o", (folder.path() / out).string(),
                               "--base-vertices", "5000"});
    return deform(more).code;
  };
  REQUIRE(run("want.ply", {}) == 0);
  for (const unsigned after_ms : {40u, 120u, 250u, 500u})
    tessera_command({"deform", in.string(), script.string(), "-o", (folder.path() / "out.ply").string(),
                     "--base-vertices", "5000", "--progress", "none", "-q", "--no-html"},
                    after_ms);
  fs::remove(folder.path() / "out.ply");
  for (const char* stage : {"pass-1", "base", "basis"}) CHECK(run("late.ply", {"--until", stage}) == 7);
  CHECK_FALSE(fs::exists(folder.path() / "late.ply"));
  CHECK(run("late.ply", {}) == 0);
  CHECK(file_bytes(folder.path() / "late.ply") == file_bytes(folder.path() / "want.ply"));
  REQUIRE(run("out.ply", {}) == 0);
  CHECK(file_bytes(folder.path() / "out.ply") == file_bytes(folder.path() / "want.ply"));
}

TEST_CASE("deform: what makes no sense is said", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_bar(folder.path() / "in.ply", 20);
  const auto run = [&](const Json& script) {
    const CommandResult r = deform({in.string(), write_json(folder.path() / "edit.json", script).string(),
                                    "-o", (folder.path() / "out.ply").string()});
    CHECK_FALSE(fs::exists(folder.path() / "out.ply"));
    fs::remove_all(folder.path() / "out.ply.tessera");
    return r;
  };
  const auto refused = [&](const Json& script, const std::string& with) {
    const CommandResult r = run(script);
    CHECK(r.code == 3);
    CHECK_THAT(r.errors, Catch::Contains(with));
  };
  Json e = edit();
  e["regions"][0]["boxx"] = 1;
  refused(e, "\"boxx\" is not known in region 1, did you mean box?");
  e = edit();
  e["regions"][1].erase("name");
  refused(e, "a handle wants a \"name\"");
  e = edit();
  e["handles"]["knob"] = {{"move", {1, 2, 3}}};
  refused(e, "no handle of this name");
  e = edit();
  e["regions"] = Json::array({{{"role", "support"}, {"all", true}}});
  e["handles"] = Json::object();
  refused(e, "lacks constraints");
  e = edit();
  e["regions"][1]["half_space"]["point"] = {80, 0, 0};
  refused(e, "region 2 ('end') takes no vertex");
  e = edit();
  e["regions"][0] = {{"role", "support"}, {"painted", {{"colour", {0, 0, 300}}}}};
  refused(e, "\"colour\" takes numbers from 0 to 255");
  e["regions"][0] = {{"role", "support"}, {"patch", {{"points", {{0, 0, 0}}}, {"crease", 0}}}};
  refused(e, "\"crease\" is an angle between 0 and 180 degrees");
  e["regions"][0] = {{"role", "support"}, {"patch", {{"points", Json::array()}}}};
  refused(e, "region 1: \"patch\"");
  e = edit();
  e["order"] = 4;
  refused(e, "\"order\" is 1, 2 or 3");
  CHECK(deform({in.string(), "-o", (folder.path() / "out.ply").string()}).code == 2);
  CHECK(deform({"apply", in.string(), "--pose", in.string(), "-o", (folder.path() / "out.ply").string()})
            .code == 3);
  for (const char* text : {"{ no", R"({"order": 444E4444})"}) {
    std::ofstream(folder.path() / "no.json") << text;
    CHECK(deform(
              {in.string(), (folder.path() / "no.json").string(), "-o", (folder.path() / "out.ply").string()})
              .code == 3);
  }
}

TEST_CASE("deform: a mesh that is mirrored as a whole keeps its inside, one in part is told", "[pipeline]") {
  const TempFolder folder;
  const fs::path in = write_bar(folder.path() / "in.ply", 20), out = folder.path() / "out.ply";
  const auto run = [&](const fs::path& mesh, const Json& regions, const Json& motion,
                       const std::string& details) {
    const Json e = {{"regions", regions}, {"handles", {{"end", motion}}}, {"details", details}};
    return deform(
        {mesh.string(), write_json(folder.path() / "edit.json", e).string(), "-o", out.string(), "--force"});
  };
  const Json handle = {{"role", "handle"}, {"name", "end"}, {"all", true}};
  const Json middle = {{"role", "support"}, {"box", {{4, -2, -2}, {6, 2, 2}}}};
  const WholeMesh before = read_whole(in);
  const std::vector<std::pair<Json, Placement>> mirrors = {
      {{{"scale", {{"factor", {1, -1, 1}}}}}, {{1, 0, 0, 0, -1, 0, 0, 0, 1}, {0, 0, 0}}},
      {{{"matrix", {-2, 0, 0, 7, 0, 2, 0, 0, 0, 0, 2, 0}}}, {{-2, 0, 0, 0, 2, 0, 0, 0, 2}, {7, 0, 0}}}};
  for (const std::string details : {"turned", "volumes"})
    for (const auto& [motion, map] : mirrors) {
      if (details == "volumes" && map.determinant() < -1.5) continue;  // it keeps those
      CAPTURE(dump_json(motion), details);
      const CommandResult r = run(in, Json::array({handle, middle}), motion, details);
      CAPTURE(r.errors);
      REQUIRE(r.code == 0);
      const WholeMesh after = read_whole(out);
      REQUIRE(after.points.size() == before.points.size());
      const double scale = std::cbrt(std::fabs(map.determinant()));
      CHECK(volume(after) == Approx(volume(before) * scale * scale * scale).epsilon(2e-2));
      double worst = 0.0;
      for (std::size_t v = 0; v < before.points.size(); ++v)
        worst = std::max(worst, norm(after.points[v] - map.apply(before.points[v])));
      CHECK(worst < (scale > 1.0 ? 0.1 : 1e-4));  // details keep their size
      CHECK(report_of(out).at("mesh").at("mirrored") == true);
    }
  // Only one end: the bar stays in one piece, and its faces keep their side.
  const Json far = {
      {"role", "handle"}, {"name", "end"}, {"half_space", {{"point", {8, 0, 0}}, {"normal", {-1, 0, 0}}}}};
  const Json between = {{"role", "support"}, {"box", {{2, -2, -2}, {8, 2, 2}}}};
  REQUIRE(run(in, Json::array({between, far}), mirrors[0].first, "turned").code == 0);
  CHECK(read_whole(out).faces == before.faces);
  CHECK_FALSE(report_of(out).at("mesh").contains("mirrored"));
  // One of two bars.
  WholeMesh two = before;
  for (const Double3& p : before.points) two.points.push_back(p + Double3{0, 20, 0});
  for (const MeshFace& f : before.faces)
    two.faces.push_back(
        {f[0] + before.points.size(), f[1] + before.points.size(), f[2] + before.points.size()});
  two.header.vertices = two.points.size();
  two.header.faces = two.faces.size();
  write_whole(folder.path() / "two.ply", two);
  const Json near = {
      {"role", "handle"}, {"name", "end"}, {"half_space", {{"point", {0, 10, 0}}, {"normal", {0, -1, 0}}}}};
  const CommandResult r =
      run(folder.path() / "two.ply", Json::array({near, middle}), mirrors[0].first, "turned");
  CHECK(r.code == 3);
  CHECK_THAT(r.errors, Catch::Contains("'end' mirrors a whole part of the mesh"));
}

}  // namespace deform_test
