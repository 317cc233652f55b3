// Mesh files of any order become stores and files again: nothing is lost, the order of the input does not
// matter, defects are repaired and counted.
#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/import/import_mesh.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/mesh_store_output.h"
#include "tests/helpers/serial_job.h"

namespace tessera::mesh_import_test {
namespace {

namespace fs = std::filesystem;

struct Mesh {
  std::vector<Double3> position;
  std::vector<std::uint32_t> rgba;
  std::vector<MeshFace> faces;
};

void write(const Mesh& mesh, const fs::path& path, bool doubles = false) {
  MeshHeader header;
  header.vertices = mesh.position.size();
  header.faces = mesh.faces.size();
  header.colour = !mesh.rgba.empty();
  header.double_positions = doubles;
  const auto file = create_mesh_file(path, header);
  file->vertices(mesh.position, mesh.rgba);
  file->faces(mesh.faces);
  file->finish();
}

Mesh read(const fs::path& path) {
  Mesh mesh;
  const auto file = open_mesh_file(path);
  file->read_vertices([&](auto positions, auto rgba) {
    mesh.position.insert(mesh.position.end(), positions.begin(), positions.end());
    mesh.rgba.insert(mesh.rgba.end(), rgba.begin(), rgba.end());
  });
  file->read_faces([&](auto faces) { mesh.faces.insert(mesh.faces.end(), faces.begin(), faces.end()); });
  return mesh;
}

/// Faces by what they are: positions and colours of their corners, smallest first.
using Corner = std::pair<Double3, std::uint32_t>;
std::multiset<std::array<Corner, 3>> faces_of(const Mesh& mesh) {
  std::multiset<std::array<Corner, 3>> out;
  for (const MeshFace& f : mesh.faces) {
    std::array<Corner, 3> c;
    for (std::size_t i = 0; i < 3; ++i) c[i] = {mesh.position[f[i]], mesh.rgba.empty() ? 0 : mesh.rgba[f[i]]};
    std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
    out.insert(c);
  }
  return out;
}

/// A wavy square of side x side cells, coloured; floats exactly.
Mesh make_sheet(int side) {
  Mesh mesh;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) {
      mesh.position.push_back({0.25 * i, 0.25 * j, 0.125 * ((i * i + 3 * j) % 11)});
      mesh.rgba.push_back(0xff000000u | static_cast<std::uint32_t>(i * 256 + j));
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint64_t>(j * (side + 1) + i); };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

void shuffle(Mesh& mesh, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint64_t> order(mesh.position.size());
  std::iota(order.begin(), order.end(), std::uint64_t{0});
  std::shuffle(order.begin(), order.end(), random);
  Mesh out;
  out.position.resize(order.size());
  out.rgba.resize(mesh.rgba.size());
  for (std::size_t v = 0; v < order.size(); ++v) {
    out.position[order[v]] = mesh.position[v];
    if (!mesh.rgba.empty()) out.rgba[order[v]] = mesh.rgba[v];
  }
  for (const MeshFace& f : mesh.faces) {
    MeshFace g = {order[f[0]], order[f[1]], order[f[2]]};
    std::rotate(g.begin(), g.begin() + static_cast<std::ptrdiff_t>(random() % 3), g.end());
    out.faces.push_back(g);
  }
  std::shuffle(out.faces.begin(), out.faces.end(), random);
  mesh = std::move(out);
}

struct Imported {
  Mesh mesh;
  tessera::Json report;
  std::string bytes;
  std::size_t patches = 0;
};

// What a process under a sanitizer takes by itself: freed memory is kept for a while.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr std::uint64_t kProcessBytes = std::uint64_t{2} << 30;
#else
constexpr std::uint64_t kProcessBytes = 0;
#endif

Imported round_trip(const fs::path& in, const fs::path& folder, std::uint64_t memory = 256u << 20) {
  Imported out;
  RunOptions run;
  run.memory_bytes = memory + kProcessBytes;
  run.threads = 2;
  const MeshStore store = import_mesh(in, folder, "mesh", run, {}, &out.report);
  out.patches = store.patches().size();
  const fs::path path = folder / "out.ply";
  MeshStoreOutput output;
  output.path = path;
  output.temp = folder;
  output.memory_bytes = 1u << 20;
  write_mesh_store(store, output);
  out.mesh = read(path);
  out.bytes = test::file_bytes(path);
  fs::remove_all(folder / "mesh");
  return out;
}

}  // namespace

TEST_CASE("mesh import: a mesh comes back as it went in, whatever its order", "[property]") {
  const test::TempFolder folder;
  // With holes everywhere, so that borders pass from bucket to bucket.
  Mesh mesh = make_sheet(420);
  std::erase_if(mesh.faces, [](const MeshFace& f) { return (f[0] * 2654435761u + f[1] * 40503u) % 97 < 9; });
  const auto borders = [&] {
    std::map<std::pair<std::uint64_t, std::uint64_t>, int> edges;
    for (const MeshFace& f : mesh.faces)
      for (std::size_t e = 0; e < 3; ++e) ++edges[std::minmax(f[e], f[(e + 1) % 3])];
    return std::count_if(edges.begin(), edges.end(), [](const auto& e) { return e.second == 1; });
  }();
  {  // What the test holds counts against the caps of its jobs.
    write(mesh, folder.path() / "a.ply");
    const auto before = faces_of(mesh);
    const Imported first = round_trip(folder.path() / "a.ply", folder.path());
    CHECK(first.patches > 16);
    CHECK(first.report.at("mesh-read").at("buckets").get<int>() > 1);
    CHECK(first.report.at("mesh-tiles").at("border_edges") == borders);
    CHECK(first.report.at("mesh-tiles").at("fixes").get<int>() > 0);
    CHECK(faces_of(first.mesh) == before);
    shuffle(mesh, 7);
    write(mesh, folder.path() / "b.ply");
    CHECK(round_trip(folder.path() / "b.ply", folder.path()).bytes == first.bytes);
  }
  // Without colours and with room for them, vertices are read once and kept.
  mesh.rgba.clear();
  write(mesh, folder.path() / "c.ply");
  const Imported kept = round_trip(folder.path() / "c.ply", folder.path(), 512u << 20);
  CHECK(kept.bytes == round_trip(folder.path() / "c.ply", folder.path(), 250u << 20).bytes);
  CHECK(faces_of(kept.mesh) == faces_of(mesh));
}

TEST_CASE("mesh import: patches are canonical, whatever meets at a vertex", "[unit]") {
  Mesh sheet = make_sheet(40);
  Mesh hub;  // more faces than are sorted one by one, and all of one first corner
  hub.position.push_back({-9.0, 0.0, 0.0});
  for (int k = 0; k < 300; ++k)
    hub.position.push_back({std::cos(0.01 * (k - 150)), std::sin(0.01 * (k - 150)), 0.125 * (k % 7)});
  for (std::uint64_t k = 1; k < 300; ++k) hub.faces.push_back({0, k, k + 1});
  Mesh fans = hub;  // a second fan at the same corner: a copy of it
  fans.position.insert(fans.position.end(), {{-8.0, 5.0, 1.0}, {-8.0, 5.0, 2.0}});
  fans.faces.push_back({0, 301, 302});
  for (Mesh* mesh : {&sheet, &hub, &fans}) {
    shuffle(*mesh, 3);
    const test::TempFolder folder;
    write(*mesh, folder.path() / "in.ply");
    RunOptions run;
    run.memory_bytes = (256u << 20) + kProcessBytes;
    run.threads = 1;
    const MeshStore store = import_mesh(folder.path() / "in.ply", folder.path(), "mesh", run, {}, nullptr);
    std::size_t faces = 0;
    for (std::size_t p = 0; p < store.patches().size(); ++p) {
      const MeshBlock block = store.load(std::array{p});
      MeshBlock canonical = block;
      canonicalise(canonical);
      CHECK(canonical.key == block.key);
      CHECK(canonical.faces == block.faces);
      CHECK(canonical.face_flags == block.face_flags);
      faces += block.faces.size();
    }
    CHECK(faces == mesh->faces.size());
  }
}

TEST_CASE("mesh import: numbers of vertices that do not fit in memory are taken range by range",
          "[property]") {
  const test::TempFolder folder;
  const Mesh mesh = make_sheet(80);
  const std::size_t n = mesh.position.size();
  Mesh many;  // every vertex sixty times
  for (int i = 0; i < 60; ++i)
    many.position.insert(many.position.end(), mesh.position.begin(), mesh.position.end());
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    MeshFace g = mesh.faces[f];
    for (std::size_t c = 0; c < 3; ++c) g[c] += n * ((7 * f + 13 * c) % 60);
    many.faces.push_back(g);
  }
  write(many, folder.path() / "a.ply");
  JobState state;
  state.work = folder.path();
  state.inputs = {folder.path() / "a.ply"};
  state.run.memory_bytes = 1;
  tessera::Json welded;
  for (const StageEntry& entry : import_stages({0, "mesh"})) {
    const tessera::Json report = test::run_stage(*entry.make(state), state.work);
    if (entry.name == "mesh-vertices") welded = report.at("welded");
  }
  CHECK(welded == 59 * n);
  MeshStoreOutput output;
  output.path = folder.path() / "out.ply";
  output.temp = folder.path();
  const auto written = write_mesh_store(open_imported_mesh(state.work, "mesh"), output);
  CHECK(written.vertices == n);
  const Mesh result = read(output.path);
  CHECK(faces_of(result) == faces_of({mesh.position, {}, mesh.faces}));
}

TEST_CASE("mesh import: faces from the first that is no triangle on are read in order", "[property]") {
  const test::TempFolder folder;
  Mesh mesh = make_sheet(200);
  mesh.rgba.clear();
  write(mesh, folder.path() / "triangles.ply");
  // One pair of triangles in the middle of a range, and one at the start of another, become quads.
  std::string bytes = test::file_bytes(folder.path() / "triangles.ply");
  constexpr std::size_t kTriangle = 13;
  const std::size_t faces = bytes.size() - kTriangle * mesh.faces.size();
  std::string cut = bytes.substr(0, faces);
  std::size_t count = mesh.faces.size();
  for (std::size_t f = 0; f < mesh.faces.size(); ++f) {
    cut += bytes.substr(faces + kTriangle * f, kTriangle);
    if (f != 40000 && f != 65536) continue;
    cut[cut.size() - kTriangle] = 4;
    const auto last = static_cast<std::uint32_t>(mesh.faces[++f][2]);
    cut.append(reinterpret_cast<const char*>(&last), sizeof last);
    --count;
  }
  const std::string claim = "element face " + std::to_string(mesh.faces.size());
  cut.replace(cut.find(claim), claim.size(), "element face " + std::to_string(count));
  std::ofstream(folder.path() / "quads.ply", std::ios::binary) << cut;
  const Imported want = round_trip(folder.path() / "triangles.ply", folder.path());
  const Imported got = round_trip(folder.path() / "quads.ply", folder.path());
  CHECK(got.report.at("mesh-corners").at("faces") == mesh.faces.size());
  CHECK(got.mesh.faces.size() == want.mesh.faces.size());
  CHECK(got.mesh.position == want.mesh.position);
}

TEST_CASE("mesh import: doubles keep all bits, triangle soups are welded", "[unit]") {
  const test::TempFolder folder;
  Mesh mesh = make_sheet(20);
  mesh.rgba.clear();
  for (Double3& p : mesh.position) p = {p[0] / 3 + 4.5e6, p[1] / 7 + 5.6e6, p[2] / 11};
  write(mesh, folder.path() / "a.ply", true);
  CHECK(faces_of(round_trip(folder.path() / "a.ply", folder.path()).mesh) == faces_of(mesh));

  const Mesh floats = make_sheet(20);
  write({floats.position, {}, floats.faces}, folder.path() / "b.stl");
  const Imported soup = round_trip(folder.path() / "b.stl", folder.path());
  CHECK(soup.mesh.position.size() == floats.position.size());
  CHECK(soup.mesh.faces.size() == floats.faces.size());
}

TEST_CASE("mesh import: every defect is repaired and counted", "[unit]") {
  const test::TempFolder folder;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  // Two tetrahedra that share an edge, a third that touches one in a vertex, and rubbish.
  Mesh mesh;
  mesh.position = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, {1, 1, 0},   {-1, 0, 0}, {-1, -1, 0},
                   {5, 5, 5}, {6, 5, 5}, {5, 6, 5}, {nan, 0, 0}, {9, 9, 9}};
  const auto tetrahedron = [&](std::uint64_t a, std::uint64_t b, std::uint64_t c, std::uint64_t d) {
    mesh.faces.push_back({a, c, b});
    mesh.faces.push_back({a, b, d});
    mesh.faces.push_back({b, c, d});
    mesh.faces.push_back({c, a, d});
  };
  tetrahedron(0, 1, 2, 3);
  tetrahedron(0, 1, 4, 5);
  tetrahedron(3, 6, 7, 8);
  const std::size_t sound = mesh.faces.size();
  mesh.faces.push_back({2, 1, 0});  // the same corners as one above
  mesh.faces.push_back({6, 6, 7});
  mesh.faces.push_back({0, 1, 9});
  write(mesh, folder.path() / "a.ply");
  const Imported result = round_trip(folder.path() / "a.ply", folder.path());
  CHECK(result.mesh.faces.size() == sound);
  CHECK(result.mesh.position.size() == 12);
  const auto& tiles = result.report.at("mesh-tiles");
  CHECK(tiles.at("duplicate_faces") == 1);
  CHECK(tiles.at("nonmanifold_edges") == 1);
  CHECK(tiles.at("split_vertices") == 3);
  CHECK(tiles.at("border_edges") == 0);
  CHECK(tiles.at("unreferenced_vertices") == 1);
  CHECK(result.report.at("mesh-read").at("nonfinite_vertices") == 1);
  CHECK(result.report.at("mesh-corners").at("degenerate_faces") == 1);
  CHECK(result.report.at("mesh-corners").at("bad_faces") == 1);
  MeshCheckOptions options;
  options.temp = folder.path();
  const MeshCheck check = check_mesh(*open_mesh_file(folder.path() / "out.ply"), options);
  CHECK(check.boundary_edges == 0);
  CHECK(check.nonmanifold_edges == 0);
  CHECK(check.nonmanifold_vertices == 0);
  CHECK(check.components == 3);
}

TEST_CASE("mesh import: faces of one part are turned to agree", "[unit]") {
  const test::TempFolder folder;
  Mesh mesh = make_sheet(10);
  mesh.rgba.clear();
  const auto sound = faces_of(mesh);
  for (std::size_t f = 0; f < mesh.faces.size(); f += 5) std::swap(mesh.faces[f][0], mesh.faces[f][1]);
  write(mesh, folder.path() / "a.ply");
  const Imported result = round_trip(folder.path() / "a.ply", folder.path());
  CHECK(result.report.at("mesh-tiles").at("turned_faces") == 40);
  CHECK(result.report.at("mesh-tiles").at("inconsistent_edges") == 0);
  CHECK(faces_of(result.mesh) == sound);
}

TEST_CASE("mesh import: a mesh without a face or a finite vertex is refused", "[unit]") {
  const test::TempFolder folder;
  write({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {}, {{0, 1, 1}}}, folder.path() / "a.ply");
  CHECK_THROWS_AS(round_trip(folder.path() / "a.ply", folder.path()), EmptyError);
}

}  // namespace tessera::mesh_import_test
