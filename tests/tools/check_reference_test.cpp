// `tessera check --reference` as a user runs it.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <set>
#include <span>

#include "stream/check/mesh_compare.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/surfaces.h"

namespace check_reference_test {

namespace {

using namespace tessera;
using test::Surface;

const std::string kTessera = TESSERA_BINARY;

std::string file(const test::TempFolder& folder, const std::string& name, const Surface& s) {
  MeshHeader header;
  header.vertices = s.position.size();
  header.faces = s.faces.size();
  header.double_positions = true;
  const auto writer = create_mesh_file(folder / name, header);
  writer->vertices(s.position, {});
  std::vector<MeshFace> faces;
  for (const auto& [a, b, c] : s.faces) faces.push_back({a, b, c});
  writer->faces(faces);
  writer->finish();
  return (folder / name).string();
}

Surface moved(Surface s, const Double3& by) {
  for (Double3& p : s.position)
    for (std::size_t k = 0; k < 3; ++k) p[k] += by[k];
  return s;
}

test::Outcome check(const std::string& mesh, const std::string& reference, const std::string& more) {
  return test::shell(kTessera + " check " + mesh + " --reference " + reference + " " + more);
}

double waves(double x, double y) {
  return 0.05 * (x * x - 0.7 * x * y + 0.3 * y);
}

}  // namespace

TEST_CASE("check --reference: a mesh near its reference is proven, one that is not exits with 6",
          "[pipeline]") {
  const test::TempFolder folder;
  const std::string coarse = file(folder, "coarse.ply", test::sphere(4, 1.0));
  const std::string fine = file(folder, "fine.ply", test::sphere(5, 1.0));
  const test::Outcome good = check(coarse, fine, "--tolerance 0.01");
  CHECK(good.code == 0);
  CHECK(good.said.find("proven: two-sided distance at most 0.00") != std::string::npos);
  const test::Outcome bad = check(coarse, fine, "--tolerance 0.001");
  CHECK(bad.code == 6);
  CHECK(bad.said.find("not proven within 0.001: ") != std::string::npos);
  CHECK(bad.said.find(" at (") != std::string::npos);
  const test::Outcome far =
      check(coarse, file(folder, "moved.ply", moved(test::sphere(5, 1.0), {500, 0, 0})), "--tolerance 0.01");
  CHECK(far.code == 6);
  CHECK(far.said.find("of another place") != std::string::npos);
  // The other direction counts as well: half of the reference is missing.
  Surface half = test::sphere(4, 1.0);
  half.faces.resize(half.faces.size() / 2);
  CHECK(check(file(folder, "half.ply", half), fine, "--tolerance 0.01").code == 6);
}

TEST_CASE("check --reference: borders are told apart and count on request", "[pipeline]") {
  const test::TempFolder folder;
  const std::string whole = file(folder, "whole.ply", test::height_grid(16, 1.0, waves));
  Surface slit = test::height_grid(16, 1.0, waves);
  slit.faces.erase(slit.faces.begin() + 200, slit.faces.begin() + 202);
  const std::string open = file(folder, "slit.ply", slit);
  CHECK(check(open, whole, "--tolerance 0.05").code == 0);  // nothing is farther than half a hole
  const test::Outcome strict = check(open, whole, "--tolerance 0.05 --borders");
  CHECK(strict.code == 6);
  CHECK(strict.said.find("the border of the mesh at (") != std::string::npos);
  CHECK(check(whole, whole, "--tolerance 0.05 --borders").code == 0);
}

TEST_CASE("check --reference: senseless options and unreadable references say so", "[pipeline]") {
  const test::TempFolder folder;
  const std::string mesh = file(folder, "mesh.ply", test::height_grid(3, 1.0, waves));
  const test::Outcome bare = check(mesh, mesh, "");
  CHECK(bare.code == 2);
  CHECK(bare.said.find("--reference needs --tolerance") != std::string::npos);
  CHECK(check(mesh, mesh, "--tolerance 0").code == 2);
  CHECK(check(mesh, mesh, "--tolerance -1").code == 2);
  CHECK(check(mesh, mesh, "--tolerance nan").code == 2);
  CHECK(check(mesh, mesh, "--tolerance 1e6").code == 0);
  CHECK(check(mesh, (folder / "none.ply").string(), "--tolerance 1").code == 3);
  CHECK(test::shell(kTessera + " check " + mesh + " --tolerance 1").code == 2);
}

TEST_CASE("check --reference: the same report for any threads and memory, nothing left behind",
          "[property]") {
  const test::TempFolder folder;
  test::Random random(4);
  const std::string mesh = file(folder, "mesh.ply", test::height_grid(150, 1.0, waves));
  const std::string reference =
      file(folder, "reference.ply", test::height_grid(220, 1.0, [&](double x, double y) {
             return waves(x, y) + random.in(-0.001, 0.001);
           }));
  std::string first;
  for (const char* variant : {"-t 1 --memory 1G", "-t 2 --memory 200M", "-t 5 --memory 100M"}) {
    const std::string report = (folder / "report.json").string();
    REQUIRE(
        check(mesh, reference, std::string("--tolerance 0.003 --force --report ") + report + " " + variant)
            .code == 0);
    Json json = parse_json(test::file_bytes(report)).at("deviation");
    CHECK(json.at("proven") == true);
    CHECK(json.at("cells") > 1);
    CHECK(json.at("mesh_to_reference").at("measure").get<double>() == Approx(1.0).epsilon(0.01));
    for (const char* direction : {"mesh_to_reference", "reference_to_mesh"}) {
      const Json& d = json.at(direction);
      CHECK(d.at("certified_max").get<double>() <= 1.0501 * d.at("found_max").get<double>());
    }
    json.erase("seconds");
    json.erase("import_seconds");
    if (first.empty()) first = dump_json(json);
    CHECK(dump_json(json) == first);
  }
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) CHECK(entry.is_regular_file());
}

namespace {

/// Whether everything in `part` stands in `all` as well.
bool is_part(const Json& part, const Json& all) {
  if (!part.is_object()) return part == all;
  for (const auto& [key, value] : part.items())
    if (!all.contains(key) || !is_part(value, all.at(key))) return false;
  return true;
}

std::string line_of(const std::string& said, const std::string& start) {
  const std::size_t at = said.find(start);
  return at == std::string::npos ? "" : said.substr(at, said.find('\n', at) - at);
}

/// A block with a step in it, n x n squares a unit side; corners welded.
Surface step_block(int n) {
  return test::height_grid(4 * n, 1.0, [](double x, double y) {
    return std::min(0.2, std::max(0.0, 4.0 * (x - 0.5))) + (y > 0.74 ? 0.25 * (y - 0.75) : 0.0);
  });
}

}  // namespace

TEST_CASE("check --method: exact, raster and auto give one answer", "[property]") {
  const test::TempFolder folder;
  test::Random random(6);
  const auto scanned = [&](int cells) {
    Surface s = test::height_grid(cells, 1.0, [&](double x, double y) {
      return 0.1 * std::sin(9.0 * x + 4.0 * y) + random.in(-0.002, 0.002);
    });
    for (std::size_t f = 50; f + 4 < s.faces.size(); f += 997)  // dropouts
      s.faces.erase(s.faces.begin() + static_cast<long>(f), s.faces.begin() + static_cast<long>(f) + 4);
    return s;
  };
  struct Pair {
    std::string what;
    Surface mesh, reference;
    std::string tolerance;
    int code;
  };
  const std::vector<Pair> pairs = {
      {"clean", test::sphere(4, 1.0), test::sphere(5, 1.0), "0.01", 0},
      {"CAD", step_block(4), step_block(12), "0.02", 0},
      {"raw scans", scanned(150), scanned(170), "0.02", 0},
      {"exceeds", test::sphere(4, 1.0), test::sphere(5, 1.0), "0.001", 6},
      {"raw scans exceed", scanned(150), scanned(170), "0.003", 6},
      {"elsewhere", moved(test::sphere(3, 1.0), {50, 0, 0}), test::sphere(3, 1.0), "0.01", 6}};
  for (const Pair& pair : pairs) {
    INFO(pair.what);
    const std::string mesh = file(folder, "mesh.ply", pair.mesh);
    const std::string reference = file(folder, "reference.ply", pair.reference);
    Json exact, first;
    std::string complaint;
    for (const std::string variant : {"exact", "raster", "raster -t 3 --memory 100M", "auto"}) {
      INFO(variant);
      const std::string report = (folder / "report.json").string();
      const test::Outcome outcome =
          check(mesh, reference,
                "--tolerance " + pair.tolerance + " --force --report " + report + " --method " + variant);
      CHECK(outcome.code == pair.code);
      Json json = parse_json(test::file_bytes(report)).at("deviation");
      json.erase("seconds");
      json.erase("import_seconds");
      CHECK((outcome.said.find("certificate   proven") != std::string::npos) == (pair.code == 0));
      const std::string why = line_of(outcome.said, "not proven within");  // of borders where surfaces are
      if (variant == "exact") {
        exact = json;
        complaint = why;
        continue;
      }
      CHECK(why == complaint);
      CHECK(is_part(json, exact));
      if (first.is_null()) first = json;
      CHECK(json == first);
      CHECK(outcome.said.find("method        ") != std::string::npos);
      const bool both = outcome.said.find("the raster took ") != std::string::npos &&
                        outcome.said.find("the certificate ") != std::string::npos;
      CHECK(both == (variant == "auto"));
    }
    std::filesystem::remove(mesh);
    std::filesystem::remove(reference);
  }
}

TEST_CASE("check --method: only with a reference, and of three words", "[pipeline]") {
  const test::TempFolder folder;
  const std::string mesh = file(folder, "mesh.ply", test::height_grid(3, 1.0, waves));
  CHECK(test::shell(kTessera + " check " + mesh + " --method raster").code == 2);
  CHECK(check(mesh, mesh, "--tolerance 1 --method quick").code == 2);
  CHECK(check(mesh, mesh, "--method raster").code == 2);
}

TEST_CASE("compare: cells are compared again until the bound of the whole is tight, and no others",
          "[unit]") {
  const auto cell = [](double upper, double lower, double upper_back = 0.0, double lower_back = 0.0) {
    CellBounds c;
    c.upper = {upper, upper_back};
    c.lower = {lower, lower_back};
    return c;
  };
  // After the first one 0.89 is known to be there, and 0.91 is near enough to it.
  std::vector<CellBounds> cells = {cell(0.80, 0.50), cell(0.99, 0.60), cell(0.91, 0.70),
                                   cell(0.95, 0.10), cell(1.50, 1.45), cell(0.10, 0.05, 0.30, 0.05)};
  cells[4] = cell(0.0, 0.0);
  std::vector<std::size_t> again;
  std::vector<double> enough_of;
  const auto compare = [&](std::span<const std::size_t> which, double enough) {
    std::vector<CellBounds> found;
    for (const std::size_t i : which) {
      again.push_back(i);
      enough_of.push_back(enough);
      const double tight[] = {0.70, 0.91, 0.85, 0.30, 0.0, 0.06};
      found.push_back(cell(std::max(tight[i], std::min(enough, cells[i].upper[0])), tight[i] / 1.02,
                           i == 5 ? 0.2 : 0.0, i == 5 ? 0.2 : 0.0));
    }
    return found;
  };
  tighten_cells(cells, 1.0, compare);
  CHECK(again == std::vector<std::size_t>{1, 3, 5});
  // Below what was found, no cell need be searched: first 0.70, then 0.91 / 1.02, but that on its other side 0.05 are known.
  CHECK(enough_of[0] == Approx(1.05 * 0.70));
  CHECK(enough_of[1] == Approx(1.05 * 0.05));
  CHECK(enough_of[2] == enough_of[1]);
  double upper = 0.0, lower = 0.0;
  for (const CellBounds& c : cells) upper = std::max(upper, c.upper[0]), lower = std::max(lower, c.lower[0]);
  CHECK(upper <= 1.03 * lower);
  // Of many like each other ever more at once, none twice, and none after one was found to be as far as all may be.
  again.clear();
  enough_of.clear();
  cells.assign(300, cell(0.9, 0.1));
  std::vector<std::size_t> calls;
  tighten_cells(cells, 1.0, [&](std::span<const std::size_t> which, double) {
    calls.push_back(which.size());
    std::vector<CellBounds> found;
    for (const std::size_t i : which) {
      again.push_back(i);
      found.push_back(i == 150 ? cell(0.88, 0.87) : cell(0.3, 0.2));
    }
    return found;
  });
  CHECK(calls == std::vector<std::size_t>{1, 2, 4, 8, 16, 32, 64, 64});
  CHECK(std::set<std::size_t>(again.begin(), again.end()).size() == again.size());
  // What exceeds the tolerance was searched to the end before.
  again.clear();
  cells = {cell(1.5, 1.49), cell(0.99, 0.1)};
  tighten_cells(cells, 1.0, compare);
  CHECK(again.empty());
}

TEST_CASE(
    "check --reference: no RMS is above its bound, and none is told where part of a mesh is out of reach",
    "[pipeline]") {
  const test::TempFolder folder;
  const auto level = [](double, double) { return 0.0; };
  const Surface wave_surface = test::height_grid(
      80, 4.0, [](double x, double) { return 0.01 * std::sin(x * 3.14159265358979 / 0.4); });
  const std::string two = file(folder, "two.ply", test::height_grid(1, 4.0, level));
  const std::string wave = file(folder, "wave.ply", wave_surface);
  const std::string report = (folder / "report.json").string();
  for (const std::string tolerance : {"0.02", "0.5", "1"}) {
    REQUIRE(check(wave, two, "--tolerance " + tolerance + " --force --report " + report).code == 0);
    const auto deviation = parse_json(test::file_bytes(report)).at("deviation");
    for (const char* variant : {"mesh_to_reference", "reference_to_mesh"}) {
      const double rms = deviation.at(variant).at("rms").number();
      CHECK(rms <= deviation.at(variant).at("found_max").get<double>());
      // Of the sine 0.00707, a little less of its chords; back it is less by the slopes.
      CHECK(rms == Approx(0.0069).epsilon(0.05));
    }
  }
  CHECK(check(wave, two, "--tolerance 0.002 --force --report " + report).code == 6);
  const auto deviation = parse_json(test::file_bytes(report)).at("deviation");
  CHECK(deviation.at("mesh_to_reference").at("rms").is_null());
}

}  // namespace check_reference_test
