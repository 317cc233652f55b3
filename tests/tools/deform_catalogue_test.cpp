// tessera deform on meshes that nobody chose for it, with edits by chance: it ends, with numbers, and nothing turns over.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/command.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random_edit.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace deform_catalogue_test {

using namespace tessera;
using namespace tessera::test;

namespace {

namespace fs = std::filesystem;
/// Of the diagonal: faces no higher turn over by how their corners are rounded.
constexpr double kRounding = 1e-5;
constexpr unsigned kPatience_ms = 120000;  ///< for soups whose faces contradict each other

CommandResult quietly(std::vector<std::string> words, unsigned kill_after_ms = 0) {
  for (const char* quiet : {"--progress", "none", "-q", "--no-html", "--force"}) words.emplace_back(quiet);
  return tessera_command(words, kill_after_ms);
}

double diagonal(const WholeMesh& mesh) {
  Double3 low = mesh.points.at(0), high = low;
  for (const Double3& p : mesh.points)
    for (std::size_t c = 0; c < 3; ++c) low[c] = std::min(low[c], p[c]), high[c] = std::max(high[c], p[c]);
  return norm(high - low);
}

/// A copy with shared vertices, of those that are used.
void write_welded(const WholeMesh& mesh, const fs::path& path) {
  WholeMesh out;
  std::map<Double3, std::uint64_t> number;
  for (MeshFace f : mesh.faces) {
    for (std::uint64_t& v : f) {
      const auto [at, fresh] = number.emplace(mesh.points[v], out.points.size());
      if (fresh) out.points.push_back(mesh.points[v]);
      v = at->second;
    }
    if (f[0] != f[1] && f[1] != f[2] && f[2] != f[0]) out.faces.push_back(f);
  }
  out.header.vertices = out.points.size();
  out.header.faces = out.faces.size();
  write_whole(path, out);
}

/// A dirty mesh as a closed one, over a lattice of a `cells`th of its diagonal; open sheets, which have no inside, as they are.
/// \return false: it took too long
bool write_closed(const fs::path& mesh, const fs::path& to, double cells) {
  const WholeMesh dirty = read_whole(mesh);
  const CommandResult r = quietly({"resurface", mesh.string(), "-o", to.string(), "--resolution",
                                   std::to_string(diagonal(dirty) / cells)},
                                  kPatience_ms);
  if (r.code == 5) write_welded(dirty, to);
  return r.code == 0 || r.code == 5;
}

/// The same edits of a mesh whatever stands beside it.
std::uint64_t seed_of(const fs::path& mesh) {
  std::uint64_t sum = 0;
  for (const char c : mesh.filename().string()) sum = 31 * sum + static_cast<unsigned char>(c);
  return sum;
}

/// Refused with a sentence that names what lacks vertices or constraints.
bool names_a_region(const std::string& sentence) {
  for (const char* said : {"the support lacks constraints", "the support has no vertex",
                           "takes no vertex of the surface", "has no vertex: no vertex lies in its region"})
    if (sentence.find(said) != std::string::npos) return true;
  return false;
}

struct Chance {
  std::size_t done = 0, refused = 0, faces = 0, base_flipped = 0;
  FlippedFaces flipped;  ///< of all together
};

/// Edits the mesh once for each seed; a line for each.
void try_edits(const fs::path& mesh, std::uint64_t seeds, const std::vector<std::string>& options,
               Chance& sum) {
  const fs::path script = mesh.parent_path() / "edit.json", out = mesh.parent_path() / "edited.ply";
  const WholeMesh before = read_whole(mesh);
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const Json edit = random_edit(before.points, seed_of(mesh) + seed);
    std::ofstream(script) << dump_json(edit);
    std::vector<std::string> words = {"deform", mesh.string(), script.string(), "-o", out.string()};
    words.insert(words.end(), options.begin(), options.end());
    const CommandResult r = quietly(words);
    std::cout << mesh.stem().string() << ", " << before.faces.size() << " faces, order "
              << dump_json(edit["order"]) << ", " << edit.value("details", "turned") << ", "
              << edit["handles"].size() << " handles: ";
    INFO(mesh.filename() << " " << dump_json(edit) << " " << r.errors);
    if (r.code != 0) {
      std::cout << r.errors << std::flush;
      CHECK(r.code == 3);
      CHECK(names_a_region(r.errors));
      ++sum.refused;
      continue;
    }
    const WholeMesh after = read_whole(out);
    REQUIRE(after.faces == before.faces);
    const FlippedFaces t =
        flipped_faces(before.points, after.points, before.faces, kRounding * diagonal(before));
    const Json report = parse_json(file_bytes(out.string() + ".report.json"));
    const Json& figures = report.at("mesh");
    std::cout << t.count << " and " << t.thin << " thin turn over; base of "
              << dump_json(report.at("base").at("faces"))
              << (report.at("base").at("own").get<bool>() ? ", its own: " : ": ")
              << dump_json(figures.at("base_flipped_by_turns")) << ", then "
              << dump_json(figures.at("base_flipped_faces")) << "; cross "
              << dump_json(figures.at("base_crossing_faces_before")) << ", then "
              << dump_json(figures.at("base_crossing_faces")) << std::endl;
    CHECK(t.not_finite == 0);
    sum.base_flipped += figures.at("base_flipped_faces").get<std::size_t>();
    CHECK(figures.at("largest_move").get<double>() > 0.0);
    ++sum.done;
    sum.faces += before.faces.size();
    sum.flipped.count += t.count;
    sum.flipped.thin += t.thin;
  }
}

std::vector<fs::path> meshes_in(const fs::path& folder, std::uintmax_t larger_than) {
  std::vector<fs::path> out;
  for (const auto& file : fs::directory_iterator(folder))
    if (const std::string end = lower_extension(file.path());
        (end == ".ply" || end == ".obj" || end == ".off" || end == ".stl") && file.file_size() > larger_than)
      out.push_back(file.path());
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace

TEST_CASE("deform: bodies, parts, crossing bodies and needles with edits by chance", "[pipeline]") {
  const TempFolder folder;
  Chance sum;
  const auto made = [&](const std::string& name, const WholeMesh& mesh) {
    write_whole(folder / name, mesh);
    return folder / name;
  };
  for (const auto& [name, mesh] :
       {std::pair("body.ply", made_body(5)), std::pair("open.ply", made_open_body(4)),
        std::pair("bracket.obj", made_bracket(20)), std::pair("block.glb", made_part({{0, 0, 0}}, 25))})
    try_edits(made(name, mesh), 2, {}, sum);
  const fs::path closed = folder / "closed.ply";
  REQUIRE(
      write_closed(made("crossing.ply", joined(made_body(4), made_body(4), {0.7, 0.2, 0.1})), closed, 60.0));
  try_edits(closed, 2, {}, sum);
  // Thin triangles: they get an even base.
  try_edits(made("cylinder.ply", made_cylinder(120, 1.0, 9.0)), 2, {"--base-vertices", "20000"}, sum);
  CHECK(sum.done >= 9);
  CHECK(sum.flipped.count == 0);
  CHECK(sum.base_flipped == 0);
}

TEST_CASE("deform: meshes of the catalogue with edits by chance", "[pipeline][.shared]") {
  if (!has_shared_data()) return;
  const TempFolder folder;
  Chance sum;
  for (const char* name : {"block.obj", "bunny.ply", "casting-10k.off", "face.obj", "fandisk.obj",
                           "gargo.ply", "laurana.ply", "max-planck-20k.obj", "mechanical1.obj", "tray.stl"}) {
    const fs::path mesh = folder / (std::string(name) + ".ply");
    write_welded(read_whole(kSharedData / "meshes" / name), mesh);
    try_edits(mesh, 2, {}, sum);
  }
  for (const char* name : {"bed.obj", "conrod-flipped.stl", "self-intersect-a.obj"}) {
    const fs::path mesh = folder / (std::string(name) + ".ply");
    REQUIRE(write_closed(kSharedData / "dirty" / name, mesh, 60.0));
    try_edits(mesh, 2, {}, sum);
  }
  // Thin triangles: they get an even base.
  for (const char* name : {"adis16480.stl", "thingi-472042.stl"}) {
    const fs::path mesh = folder / (std::string(name) + ".ply");
    write_welded(read_whole(kSharedData / "meshes" / name), mesh);
    try_edits(mesh, 2, {"--base-vertices", "20000"}, sum);
  }
  CHECK(sum.done >= 28);
  CHECK(sum.flipped.count == 0);
  CHECK(sum.base_flipped == 0);
}

TEST_CASE("deform: all meshes of the catalogue with edits by chance", "[pipeline][.large][.shared]") {
  if (!has_shared_data()) return;
  const TempFolder folder;
  Chance sum, walls;
  std::size_t meshes = 0;
  const auto edit = [&](const fs::path& mesh) {
    ++meshes;
    // Contradictory faces, closed into walls without thickness, which cross each other once they bend.
    const bool contradicts = mesh.filename().string().starts_with("abominevole");
    try_edits(mesh, 2, {}, contradicts ? walls : sum);
    fs::remove(mesh);
  };
  for (const fs::path& file : meshes_in(kSharedData / "meshes", 0)) {
    const fs::path mesh = folder / (file.filename().string() + ".ply");
    write_welded(read_whole(file), mesh);
    edit(mesh);
  }
  for (const auto& [in, larger_than] : {std::pair("dirty", 0), std::pair("dirty/edge-cases", 20000)})
    for (const fs::path& file : meshes_in(kSharedData / in, static_cast<std::uintmax_t>(larger_than))) {
      const fs::path mesh = folder / (file.filename().string() + ".ply");
      if (write_closed(file, mesh, 100.0))
        edit(mesh);
      else
        std::cout << file.filename().string() << ": not closed within two minutes" << std::endl;
    }
  std::cout << meshes << " meshes, " << sum.done << " edits, " << sum.refused << " refused; of " << sum.faces
            << " faces turn over " << sum.flipped.count << " and " << sum.flipped.thin << " thin"
            << std::endl;
  CHECK(meshes >= 37);
  // What is left: a car body whose support has 154 vertices, and cables of needles from end to end.
  CHECK(sum.flipped.count * 100'000 < sum.faces);
  CHECK(walls.flipped.count * 50 <= walls.faces);
}

}  // namespace deform_catalogue_test
