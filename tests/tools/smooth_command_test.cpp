// tessera smooth and tessera parameterize as a user runs them.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>
#include <set>

#include "kernels/mesh/closest_face.h"
#include "kernels/smooth/smooth.h"
#include "octree/vector.h"
#include "stream/files/json.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/import/import_mesh.h"
#include "tests/helpers/command.h"
#include "tests/helpers/killed_command.h"
#include "tests/helpers/temp_folder.h"

namespace smooth_command_test {

namespace {

using namespace tessera;
namespace fs = std::filesystem;

struct Mesh {
  std::vector<Double3> position;
  std::vector<MeshFace> faces;
};

Mesh read(const fs::path& path) {
  Mesh mesh;
  const auto file = open_mesh_file(path);
  file->read_vertices(
      [&](auto batch, auto) { mesh.position.insert(mesh.position.end(), batch.begin(), batch.end()); });
  file->read_faces([&](auto batch) { mesh.faces.insert(mesh.faces.end(), batch.begin(), batch.end()); });
  return mesh;
}

fs::path write(const Mesh& mesh, const fs::path& path, bool doubles = false) {
  MeshHeader header;
  header.vertices = mesh.position.size();
  header.faces = mesh.faces.size();
  header.double_positions = doubles;
  const auto file = create_mesh_file(path, header);
  file->vertices(mesh.position, {});
  file->faces(mesh.faces);
  file->finish();
  return path;
}

/// Vertices at edges whose normals differ by more.
std::vector<Double3> crease_vertices(const Mesh& mesh, double degrees) {
  std::map<std::pair<std::uint64_t, std::uint64_t>, Double3> first;
  std::set<std::uint64_t> found;
  const double limit = std::cos(degrees * 3.14159265358979 / 180.0);
  for (const MeshFace& f : mesh.faces) {
    const Double3 n = unit_or_zero(
        cross(mesh.position[f[1]] - mesh.position[f[0]], mesh.position[f[2]] - mesh.position[f[0]]));
    for (std::size_t k = 0; k < 3; ++k) {
      const auto edge = std::minmax(f[k], f[(k + 1) % 3]);
      const auto [other, is_first] = first.emplace(edge, n);
      if (is_first || dot(other->second, n) > limit) continue;
      found.insert(edge.first);
      found.insert(edge.second);
    }
  }
  std::vector<Double3> out;
  for (const std::uint64_t v : found) out.push_back(mesh.position[v]);
  return out;
}

/// A noisy sheet with a ridge, a hole and floats for coordinates: many patches, creases, borders.
Mesh sheet(int side, unsigned seed = 1) {
  std::mt19937 random(seed);
  const auto noise = [&] { return 0.3 * (static_cast<double>(random() % 1024) / 1024.0 - 0.5); };
  Mesh mesh;
  for (int j = 0; j <= side; ++j)
    for (int i = 0; i <= side; ++i) {
      const double x = i + noise(), y = j + noise();
      const double z = -1.5 * std::fabs(i - side / 2) + noise();
      mesh.position.push_back({double(float(x)), double(float(y)), double(float(z))});
    }
  const auto at = [&](int i, int j) { return static_cast<std::uint64_t>(j * (side + 1) + i); };
  for (int j = 0; j < side; ++j)
    for (int i = 0; i < side; ++i) {
      if (std::abs(i - side / 4) < 5 && std::abs(j - side / 3) < 5) continue;
      mesh.faces.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
      mesh.faces.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
    }
  return mesh;
}

Mesh shuffled(const Mesh& mesh, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<std::uint64_t> order(mesh.position.size());
  std::iota(order.begin(), order.end(), std::uint64_t{0});
  std::shuffle(order.begin(), order.end(), random);
  Mesh out;
  out.position.resize(order.size());
  for (std::size_t v = 0; v < order.size(); ++v) out.position[order[v]] = mesh.position[v];
  for (const MeshFace& f : mesh.faces) out.faces.push_back({order[f[1]], order[f[2]], order[f[0]]});
  std::shuffle(out.faces.begin(), out.faces.end(), random);
  return out;
}

/// The bytes that smoothing writes.
std::string smoothed(const fs::path& in, const fs::path& out, std::vector<std::string> more) {
  std::vector<std::string> words = {"smooth", in.string(), "-o", out.string(), "-q", "--force"};
  words.insert(words.end(), more.begin(), more.end());
  const test::CommandResult result = test::tessera_command(words);
  INFO(result.errors);
  REQUIRE(result.code == 0);
  return test::file_bytes(out);
}

}  // namespace

TEST_CASE("smooth command: same bytes for tiles, threads, cap and input order", "[property]") {
  const test::TempFolder folder;
  const Mesh mesh = sheet(130);
  const fs::path in = write(mesh, folder / "in.ply");
  const std::vector<std::string> how =
      GENERATE(std::vector<std::string>{"--lambda", "4"},
               std::vector<std::string>{"--lambda", "5000", "--steps", "2", "--tolerance", "3"},
               std::vector<std::string>{"--lambda", "1e6", "--order", "2", "--steps", "2"},
               std::vector<std::string>{"--method", "denoise", "--tolerance", "0.1"},
               std::vector<std::string>{"--method", "taubin", "--steps", "20"},
               std::vector<std::string>{"--method", "curvature-flow", "--lambda", "40", "--steps", "2"});
  const auto with = [&](std::vector<std::string> more) {
    more.insert(more.end(), how.begin(), how.end());
    return more;
  };
  const std::string expected = smoothed(in, folder / "out.ply", with({"-t", "1"}));
  CHECK(expected.size() > 130'000);
  CHECK(smoothed(in, folder / "out.ply", with({"--tile-size", "64", "-t", "2"})) == expected);
  CHECK(smoothed(in, folder / "out.ply", with({"--tile-size", "128", "-t", "1"})) == expected);
  const std::string cap = how[1] == "curvature-flow" ? "240M" : "160M";
  CHECK(smoothed(in, folder / "out.ply", with({"--memory", cap, "-t", "2"})) == expected);
  if (how[0] == "--lambda" && how[1] != "4")
    CHECK(smoothed(in, folder / "out.ply", with({"--processes", "-t", "2"})) == expected);
  const fs::path other = write(shuffled(mesh, 5), folder / "other.ply");
  CHECK(smoothed(other, folder / "out.ply", with({"-t", "2"})) == expected);
}

TEST_CASE("smooth command: the result is that of the kernel on the whole mesh", "[pipeline]") {
  const test::TempFolder folder;
  const fs::path in = write(sheet(200), folder / "in.ply");
  smoothed(in, folder / "out.ply", {"--tile-size", "64", "--lambda", "4", "--tolerance", "0.05"});
  RunOptions run;
  run.memory_bytes = std::uint64_t{1} << 30;
  run.threads = 1;
  const MeshStore store = import_mesh(in, folder.path(), "mesh", run, {});
  std::vector<std::size_t> all(store.patches().size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  REQUIRE(all.size() > 4);
  const MeshBlock block = store.load(all);
  SmoothOptions options;
  options.lambda = 4;
  const SmoothedBlock whole = smooth_block(block, smooth_rounds(options).at(0));
  CHECK(whole.counts.line > 400);
  std::vector<Double3> expected;
  for (std::size_t v = 0; v < block.position.size(); ++v)
    expected.push_back(limit_move(block.position[v], whole.position[v], 0.05, true));
  std::vector<Double3> got = read(folder / "out.ply").position;
  std::sort(expected.begin(), expected.end());
  std::sort(got.begin(), got.end());
  CHECK(got == expected);
}

TEST_CASE("smooth command: moves are told from where vertices were given, whatever the method and its rounds",
          "[pipeline]") {
  const std::vector<std::string> how = GENERATE(
      std::vector<std::string>{"--lambda", "4"}, std::vector<std::string>{"--lambda", "4", "--steps", "3"},
      std::vector<std::string>{"--lambda", "5000", "--steps", "2"},
      std::vector<std::string>{"--lambda", "1e6", "--order", "2"},
      std::vector<std::string>{"--lambda", "5000", "--steps", "2", "--tolerance", "0.1"},
      std::vector<std::string>{"--method", "denoise"},
      std::vector<std::string>{"--method", "denoise", "--steps", "2"},
      std::vector<std::string>{"--method", "bilateral"},
      std::vector<std::string>{"--method", "laplacian", "--steps", "20"},
      std::vector<std::string>{"--method", "bilaplacian", "--steps", "20"},
      std::vector<std::string>{"--method", "taubin", "--steps", "20"},
      std::vector<std::string>{"--method", "curvature-flow", "--lambda", "10", "--steps", "2"});
  CAPTURE(how);
  const test::TempFolder folder;
  const Mesh mesh = sheet(60);
  MeshHeader header;
  header.vertices = mesh.position.size();
  header.faces = mesh.faces.size();
  header.colour = true;
  std::vector<std::uint32_t> number;  // colours tell which vertex is which
  for (std::uint32_t v = 0; v < mesh.position.size(); ++v) number.push_back(0xff000000u | v);
  const auto file = create_mesh_file(folder / "in.ply", header);
  file->vertices(mesh.position, number);
  file->faces(mesh.faces);
  file->finish();
  smoothed(folder / "in.ply", folder / "out.ply", how);
  double maximum = 0.0, squares = 0.0;
  std::size_t count = 0;
  open_mesh_file(folder / "out.ply")->read_vertices([&](auto positions, auto colours) {
    for (std::size_t v = 0; v < positions.size(); ++v, ++count) {
      const double square = squared_distance(positions[v], mesh.position.at(colours[v] & 0xffffffu));
      maximum = std::max(maximum, square);
      squares += square;
    }
  });
  REQUIRE(count > 3000);
  const Json figures = parse_json(test::file_bytes(folder / "out.ply.report.json")).at("mesh");
  CHECK(std::sqrt(maximum) > 0.05);
  CHECK(figures.at("largest_move").get<double>() == Approx(std::sqrt(maximum)));
  CHECK(figures.at("rms_move").get<double>() == Approx(std::sqrt(squares / static_cast<double>(count))));
}

TEST_CASE("smooth command: vertices keep their colours", "[pipeline]") {
  const test::TempFolder folder;
  const Mesh mesh = sheet(120);
  using Coloured = std::pair<Double3, std::uint32_t>;
  std::vector<Coloured> before, after;
  std::vector<std::uint32_t> rgba;
  for (std::uint32_t v = 0; v < mesh.position.size(); ++v)
    rgba.push_back(0xff000000u | (v * 2654435761u >> 8));
  std::vector<std::uint8_t> used(mesh.position.size(), 0);
  for (const MeshFace& f : mesh.faces)
    for (const std::uint64_t v : f) used[v] = 1;
  for (std::size_t v = 0; v < used.size(); ++v)
    if (used[v] != 0) before.emplace_back(mesh.position[v], rgba[v]);
  MeshHeader header;
  header.vertices = mesh.position.size();
  header.faces = mesh.faces.size();
  header.colour = true;
  const auto file = create_mesh_file(folder / "in.ply", header);
  file->vertices(mesh.position, rgba);
  file->faces(mesh.faces);
  file->finish();
  // So small a tolerance that positions name the vertices.
  smoothed(folder / "in.ply", folder / "out.ply", {"--tolerance", "1e-12", "--tile-size", "64"});
  open_mesh_file(folder / "out.ply")->read_vertices([&](auto positions, auto colours) {
    REQUIRE(colours.size() == positions.size());
    for (std::size_t v = 0; v < positions.size(); ++v) after.emplace_back(positions[v], colours[v]);
  });
  std::sort(before.begin(), before.end());
  std::sort(after.begin(), after.end());
  CHECK(before == after);
}

TEST_CASE("smooth command: a noisy fandisk loses its noise and keeps its creases", "[pipeline]") {
  const test::TempFolder folder;
  const double h = 0.016;
  const fs::path scan = folder / "scan.ply", mesh = folder / "mesh.ply", in = folder / "in.ply",
                 out = folder / "out.ply";
  REQUIRE(test::tessera_command(
              {"synth", "--scene", "fandisk", "--points", "120k", "--normals", "-o", scan.string()})
              .code == 0);
  REQUIRE(test::tessera_command({"reconstruct", scan.string(), "-o", mesh.string(), "--resolution", "0.016"})
              .code == 0);
  const Mesh clean = read(mesh);
  REQUIRE(clean.position.size() > 20000);
  Mesh noisy = clean;
  std::mt19937 random(3);
  std::normal_distribution<double> normal(0.0, 0.1 * h);
  for (Double3& p : noisy.position)
    for (double& x : p) x = static_cast<double>(static_cast<float>(x + normal(random)));
  write(noisy, in);
  REQUIRE(test::tessera_command({"smooth", in.string(), "-o", out.string(), "--method", "denoise"}).code ==
          0);
  const Mesh result = read(out);
  const auto triangles = [](const Mesh& m) {
    std::vector<std::array<std::uint32_t, 3>> faces;
    for (const MeshFace& f : m.faces)
      faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                       static_cast<std::uint32_t>(f[2])});
    return faces;
  };
  const auto off = [&](const std::vector<Double3>& points, const Mesh& m) {
    const ClosestFaces faces(m.position, triangles(m), Double3{0, 0, 0});
    std::vector<double> distance;
    for (const Double3& p : points)
      distance.push_back(std::sqrt(faces.closest(p, 1e30, ClosestFaces::kNone).square) / h);
    std::sort(distance.begin(), distance.end());
    return distance;
  };
  const auto rms = [](const std::vector<double>& d) {
    double sum = 0.0;
    for (const double x : d) sum += x * x;
    return std::sqrt(sum / static_cast<double>(d.size()));
  };
  const std::vector<double> before = off(noisy.position, clean), after = off(result.position, clean);
  CHECK(rms(before) == Approx(0.1).epsilon(0.05));
  CHECK(rms(after) < rms(before) / 5.0);
  const std::vector<double> creases = off(crease_vertices(clean, 60.0), result);
  CHECK(creases.size() > 500);
  CHECK(creases[creases.size() / 2] < 0.02);
  CHECK(creases[creases.size() * 95 / 100] < 0.05);
}

TEST_CASE("smooth command: killed at any moment, the same command ends with the same bytes", "[fault]") {
  const test::TempFolder folder;
  const fs::path in = write(sheet(150), folder / "in.ply");
  const std::vector<std::string> how = {"--method", "denoise", "--tile-size", "64"};
  const std::string expected = smoothed(in, folder / "one.ply", how);
  std::vector<std::string> words = {"smooth", in.string(), "-o", (folder / "two.ply").string(), "-q"};
  words.insert(words.end(), how.begin(), how.end());
  CHECK(test::resumed_after_kills(words).code == 0);
  CHECK(test::file_bytes(folder / "two.ply") == expected);
}

TEST_CASE("smooth command: what cannot work is said", "[pipeline]") {
  const test::TempFolder folder;
  const fs::path in = write(sheet(20), folder / "in.ply");
  const auto run = [&](std::vector<std::string> more) {
    std::vector<std::string> words = {"smooth", in.string(), "-o", (folder / "out.ply").string()};
    words.insert(words.end(), more.begin(), more.end());
    return test::tessera_command(words);
  };
  CHECK(run({"--lambda", "-1"}).code == 2);
  CHECK(run({"--method", "laplacian", "--lambda", "3"}).code == 2);
  CHECK(run({"--method", "nonsense"}).code == 2);
  CHECK(run({"--method", "denoise", "--noise", "-1"}).code == 2);
  CHECK(run({"--memory", "1M"}).code == 4);
  const test::CommandResult large = run({"--method", "curvature-flow", "--memory", "48M"});
  INFO(large.errors);
  CHECK(large.code == 4);
  CHECK(test::tessera_command({"smooth", in.string(), "-o", (folder / "out.xyz").string()}).code == 2);
  CHECK(test::tessera_command({"smooth", (folder / "none.ply").string(), "-o", (folder / "o.ply").string()})
            .code == 3);
  CHECK_FALSE(fs::exists(folder / "out.ply"));
}

TEST_CASE("smooth command: what the import repaired is in the report", "[pipeline]") {
  const test::TempFolder folder;
  Mesh mesh = sheet(20);
  mesh.position[210][0] = std::nan("");
  const fs::path in = write(mesh, folder / "in.ply"), out = folder / "out.ply";
  REQUIRE(test::tessera_command({"smooth", in.string(), "-o", out.string()}).code == 0);
  const auto report = parse_json(test::file_bytes(out.string() + ".report.json"));
  CHECK(report.at("input").at("faces") == mesh.faces.size());
  CHECK(report.at("input").at("repair").at("nonfinite_vertices") == 1);
  CHECK(read(out).position.size() < mesh.position.size());
}

TEST_CASE("parameterize command: coordinates for a disk, a clear word for the rest", "[pipeline]") {
  const test::TempFolder folder;
  Mesh mesh = sheet(30);
  std::erase_if(mesh.faces, [](const MeshFace& f) { return f[0] / 31 < 17; });  // above the hole: a disk
  const fs::path in = write(mesh, folder / "in.ply");
  const fs::path obj = folder / "out.obj", ply = folder / "out.ply";
  CHECK(test::tessera_command({"parameterize", in.string(), "-o", obj.string()}).code == 0);
  const std::string text = test::file_bytes(obj);
  CHECK(static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) >=
        2 * mesh.position.size() + mesh.faces.size());
  CHECK(text.find("\nvt ") != std::string::npos);
  CHECK(read(obj).faces == mesh.faces);
  CHECK(test::tessera_command(
            {"parameterize", in.string(), "-o", ply.string(), "--method", "conformal", "--border", "square"})
            .code == 0);
  CHECK(test::file_bytes(ply).find("property float s\nproperty float t\n") != std::string::npos);
  CHECK(read(ply).position == mesh.position);
  CHECK(test::tessera_command({"parameterize", in.string(), "-o", ply.string()}).code ==
        2);  // is there already
  CHECK(test::tessera_command({"parameterize", in.string(), "-o", (folder / "o.stl").string()}).code == 2);
  const fs::path holed = write(sheet(30), folder / "holed.ply");
  const test::CommandResult refused =
      test::tessera_command({"parameterize", holed.string(), "-o", (folder / "x.obj").string()});
  CHECK(refused.code == 3);
  CHECK(refused.errors.find("Euler characteristic 0, 2 borders, 1 piece") != std::string::npos);
  CHECK_FALSE(fs::exists(folder / "x.obj"));
  CHECK(test::tessera_command(
            {"parameterize", in.string(), "-o", (folder / "y.obj").string(), "--memory", "100K"})
            .code == 4);
}

}  // namespace smooth_command_test
