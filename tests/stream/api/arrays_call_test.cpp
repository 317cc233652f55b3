#include "stream/api/arrays_call.h"

#include <catch2/catch.hpp>

#include <cmath>

#include "octree/error.h"
#include "tests/helpers/shell.h"

namespace arrays_call_test {

namespace {

using namespace tessera;
using test::TempFolder;

/// A sheet with a wave.
MadeMesh sheet(std::uint64_t side, double step = 1.0) {
  MadeMesh made;
  for (std::uint64_t y = 0; y < side; ++y)
    for (std::uint64_t x = 0; x < side; ++x)
      made.vertices.push_back({step * static_cast<double>(x), step * static_cast<double>(y),
                               std::sin(0.2 * static_cast<double>(x))});
  for (std::uint64_t y = 0; y + 1 < side; ++y)
    for (std::uint64_t x = 0; x + 1 < side; ++x) {
      const std::uint64_t v = y * side + x;
      made.faces.push_back({v, v + 1, v + side + 1});
      made.faces.push_back({v, v + side + 1, v + side});
    }
  return made;
}

void write(const std::filesystem::path& path, const MeshArrays& mesh) {
  const auto writer = create_mesh_file(path, mesh.header());
  mesh.open()->read_vertices([&](auto positions, auto) { writer->vertices(positions, {}); });
  mesh.open()->read_faces([&](auto faces) { writer->faces(faces); });
  writer->finish();
}

MadeMesh read(const std::filesystem::path& path) {
  MadeMesh made;
  const auto reader = open_mesh_file(path);
  reader->read_vertices([&](auto positions, auto) {
    made.vertices.insert(made.vertices.end(), positions.begin(), positions.end());
  });
  reader->read_faces([&](auto faces) { made.faces.insert(made.faces.end(), faces.begin(), faces.end()); });
  return made;
}

RunOptions small_run(const std::filesystem::path& temp) {
  RunOptions how;
  how.memory_bytes = std::uint64_t{256} << 20;
  how.threads = 2;
  how.page = false;
  how.temp = temp;
  return how;
}

template <class Options>
void check_same(const MadeMesh& given, const Options& options) {
  const TempFolder folder, temp;
  const MeshArrays mesh(given.vertices, FaceSpan<std::uint64_t>(given.faces));
  write(folder / "in.ply", mesh);
  const Json of_file =
      JobCall<Options>{{(folder / "in.ply").string()}, folder / "out.ply", options, small_run({})}.run();
  const MadeMesh want = read(folder / "out.ply");
  const ArraysResult made = run_on_arrays(mesh, options, small_run(temp.path()));
  CHECK(made.mesh.vertices == want.vertices);
  CHECK(made.mesh.faces == want.faces);
  CHECK(made.report.at("mesh").at("faces") == of_file.at("mesh").at("faces"));
  CHECK(made.report.at("output").is_null());
  CHECK(std::filesystem::is_empty(temp.path()));
}

}  // namespace

TEST_CASE("arrays: a job on them makes what it makes of a file", "[pipeline]") {
  SimplifyOptions decimate;
  decimate.tolerance = 0.02;
  check_same(sheet(60), decimate);
  RemeshJobOptions remesh;
  remesh.edge = 1.5;
  check_same(sheet(40), remesh);
  SmoothOptions smooth;
  smooth.steps = 2;
  check_same(sheet(40, 0.1), smooth);  // more than floats hold
}

TEST_CASE("arrays: faces of any type are the same mesh, and the reference may be a file", "[pipeline]") {
  const TempFolder folder;
  const MadeMesh given = sheet(40);
  std::vector<std::array<std::int32_t, 3>> narrow_faces;
  for (const MeshFace& f : given.faces)
    narrow_faces.push_back(
        {static_cast<std::int32_t>(f[0]), static_cast<std::int32_t>(f[1]), static_cast<std::int32_t>(f[2])});
  const MeshArrays wide_mesh(given.vertices, FaceSpan<std::uint64_t>(given.faces));
  const MeshArrays narrow_mesh(given.vertices, FaceSpan<std::int32_t>(narrow_faces));
  write(folder / "reference.ply", wide_mesh);
  SimplifyOptions options;
  options.tolerance = 0.02;
  const ArraysResult a = run_on_arrays(wide_mesh, options, small_run(folder.path()));
  const ArraysResult b = run_on_arrays(narrow_mesh, options, small_run(folder.path()));
  CHECK(a.mesh.vertices == b.mesh.vertices);
  CHECK(a.mesh.faces == b.mesh.faces);
  options.reference = (folder / "reference.ply").string();
  CHECK(run_on_arrays(narrow_mesh, options, small_run(folder.path())).mesh.faces == a.mesh.faces);
}

TEST_CASE("arrays: what cannot work is refused", "[unit]") {
  const TempFolder folder;
  MadeMesh given = sheet(4);
  const MeshArrays mesh(given.vertices, FaceSpan<std::uint64_t>(given.faces));
  const auto run = [&](const auto& options) {
    static_cast<void>(run_on_arrays(mesh, options, small_run(folder.path())));
  };
  SimplifyOptions textured;
  textured.tolerance = 0.1;
  textured.texture = 0.01;
  CHECK_THROWS_AS(run(textured), UsageError);
  CHECK_THROWS_AS(run(SimplifyOptions{}), UsageError);
  CHECK_THROWS_AS(static_cast<void>(request_on_arrays("merge", Json::object())), UsageError);
  SmoothOptions smooth;
  CHECK_THROWS_AS(static_cast<void>(run_on_arrays(mesh, smooth, small_run(folder.path()),
                                                  [](const JobProgress&) { return false; })),
                  StoppedError);
  CHECK(std::filesystem::is_empty(folder.path()));
  const std::array<std::int64_t, 3> beyond = {0, 1, -1};
  CHECK_THROWS_AS(MeshArrays(given.vertices, FaceSpan<std::int64_t>(&beyond, 1)), InputError);
  given.faces[3][2] = 16;
  CHECK_THROWS_AS(MeshArrays(given.vertices, FaceSpan<std::uint64_t>(given.faces)), InputError);
}

}  // namespace arrays_call_test
