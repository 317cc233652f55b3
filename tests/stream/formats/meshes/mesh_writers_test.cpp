#include <catch2/catch.hpp>

#include <sys/resource.h>

#include <csignal>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>

#include "octree/error.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::mesh_writers_test {
namespace {

std::string contents(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

const std::vector<Double3> kCorners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.1, 0.25, 1}};
const std::vector<MeshFace> kTetrahedron = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};

TEST_CASE("PLY writer: the bytes of one coloured triangle", "[unit]") {
  const test::TempFolder folder;
  MeshHeader header;
  header.vertices = 3;
  header.faces = 1;
  header.colour = true;
  header.shift = {500000.5, -2, 0};
  header.comments = {"made by\na test"};
  const auto writer = create_mesh_file(folder.path() / "a.ply", header);
  writer->vertices(std::vector<Double3>{{1, 2, 3}, {4, 5, 6}, {7, 8, 9}},
                   std::vector<std::uint32_t>{0x04030201u, 0xff0000ffu, 0u});
  writer->faces(std::vector<MeshFace>{{2, 1, 0}});
  CHECK_FALSE(std::filesystem::exists(folder.path() / "a.ply"));
  writer->finish();
  std::string want =
      "ply\nformat binary_little_endian 1.0\ncomment made by a test\ncomment tessera_shift 500000.5 -2 0\n"
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n"
      "element face 1\nproperty list uchar uint vertex_indices\nend_header\n";
  const auto put = [&](const auto& value) {
    want.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  const std::uint32_t colours[3] = {0x04030201u, 0xff0000ffu, 0u};
  for (int v = 0; v < 3; ++v) {
    for (int c = 0; c < 3; ++c) put(static_cast<float>(3 * v + c + 1));
    put(colours[v]);
  }
  put(std::uint8_t{3});
  for (const std::uint32_t index : {2u, 1u, 0u}) put(index);
  CHECK(contents(folder.path() / "a.ply") == want);
  CHECK(writer->bytes_written() == want.size());
  CHECK_FALSE(std::filesystem::exists(folder.path() / "a.ply.tessera-part"));
}

TEST_CASE("PLY writer: faces that close a hole say so, other formats drop it", "[unit]") {
  const test::TempFolder folder;
  MeshHeader header;
  header.vertices = 4;
  header.faces = 4;
  header.synthetic = true;
  for (const char* name : {"a.ply", "a.obj", "a.stl", "a.glb"}) {
    const auto writer = create_mesh_file(folder.path() / name, header);
    writer->vertices(kCorners, {});
    CHECK_THROWS_AS(writer->faces(kTetrahedron), ValidationError);
    writer->faces(kTetrahedron, std::vector<std::uint8_t>{0, 1, 0, 1});
    writer->finish();
  }
  const std::string bytes = contents(folder.path() / "a.ply");
  CHECK(bytes.find("property list uchar uint vertex_indices\nproperty uchar synthetic\nend_header\n") !=
        std::string::npos);
  for (std::size_t f = 0; f < 4; ++f)
    CHECK(bytes[bytes.size() - 1 - 14 * (3 - f)] == static_cast<char>(f % 2));
  std::size_t read = 0;
  open_mesh_file(folder.path() / "a.ply")->read_faces([&](std::span<const MeshFace> faces) {
    for (const MeshFace& face : faces) CHECK(face == kTetrahedron[read++]);
  });
  CHECK(read == 4);
  const auto reader = open_mesh_file(folder.path() / "a.ply");
  CHECK(reader->has_synthetic());
  std::vector<std::uint8_t> flags;
  reader->read_flagged_faces([&](std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
    REQUIRE(faces.size() == synthetic.size());
    flags.insert(flags.end(), synthetic.begin(), synthetic.end());
  });
  CHECK(flags == std::vector<std::uint8_t>{0, 1, 0, 1});
  CHECK_FALSE(open_mesh_file(folder.path() / "a.obj")->has_synthetic());
}

// Whoever reads decimals as doubles must see the positions that were searched for crossings and proven: floats.
TEST_CASE("mesh writers: decimals of floats are read as the same doubles", "[unit]") {
  const test::TempFolder folder;
  for (const char* name : {"a.obj", "a.3mf"}) {
    INFO(name);
    MeshHeader header;
    header.vertices = kCorners.size();
    header.faces = kTetrahedron.size();
    const auto writer = create_mesh_file(folder.path() / name, header);
    std::vector<Double3> floats = kCorners;
    for (Double3& p : floats)
      for (double& x : p) x = static_cast<float>(x / 3.0 + 1e3);
    writer->vertices(floats, {});
    writer->faces(kTetrahedron);
    writer->finish();
    CHECK(test::read_whole(folder.path() / name).points == floats);
  }
}

TEST_CASE("mesh writers: nothing remains of an unfinished file", "[fault]") {
  const test::TempFolder folder;
  const std::filesystem::path path = folder.path() / GENERATE("a.ply", "a.obj", "a.stl", "a.glb");
  MeshHeader header;
  header.vertices = 4;
  header.faces = 4;
  {
    const auto writer = create_mesh_file(path, header);
    writer->vertices(kCorners, {});
    CHECK_THROWS_AS(writer->finish(), ValidationError);
  }
  CHECK(std::filesystem::is_empty(folder.path()));
}

TEST_CASE("mesh writers: calls that break the contract are refused", "[unit]") {
  const test::TempFolder folder;
  MeshHeader header;
  header.vertices = 4;
  header.faces = 1;
  const auto writer = create_mesh_file(folder.path() / "a.ply", header);
  CHECK_THROWS_AS(writer->vertices(kCorners, std::vector<std::uint32_t>(4)), ValidationError);
  CHECK_THROWS_AS(writer->faces(kTetrahedron), ValidationError);
  writer->vertices(kCorners, {});
  CHECK_THROWS_AS(writer->vertices(kCorners, {}), ValidationError);
  CHECK_THROWS_AS(writer->faces(kTetrahedron), ValidationError);
  CHECK_THROWS_AS(writer->faces(std::vector<MeshFace>{{0, 1, 4}}), ValidationError);
  writer->faces(std::vector<MeshFace>{{0, 1, 3}});
  CHECK_THROWS_AS(writer->vertices(kCorners, {}), ValidationError);
}

TEST_CASE("mesh writers: a mesh over a format's limit is refused before a file is made", "[unit]") {
  const test::TempFolder folder;
  MeshHeader header;
  header.vertices = (1ULL << 32) + 1;
  header.faces = 1ULL << 33;
  CHECK_THROWS_WITH(create_mesh_file(folder.path() / "a.ply", header), Catch::Contains("write .obj"));
  CHECK_THROWS_WITH(create_mesh_file(folder.path() / "a.stl", header), Catch::Contains("write .ply"));
  CHECK_THROWS_WITH(create_mesh_file(folder.path() / "a.glb", header), Catch::Contains("write .ply"));
  header.vertices = 200000000;
  header.faces = 200000000;  // 4.8 GB of buffers
  CHECK_THROWS_WITH(create_mesh_file(folder.path() / "a.glb", header), Catch::Contains("4 GiB"));
  CHECK_THROWS_WITH(create_mesh_file(folder.path() / "a.glb", MeshHeader{}),
                    Catch::Contains("without faces"));
  CHECK_THROWS_AS(create_mesh_file(folder.path() / "a.xyz", header), UsageError);
  CHECK(std::filesystem::is_empty(folder.path()));
}

TEST_CASE("mesh writers: a full disk is one sentence and leaves nothing behind", "[fault]") {
  // A limit on the size of files stands in for the disk.
  const test::TempFolder folder;
  rlimit before{};
  REQUIRE(::getrlimit(RLIMIT_FSIZE, &before) == 0);
  rlimit small = before;
  small.rlim_cur = 1000000;
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &small) == 0);
  MeshHeader header;
  header.vertices = 1000000;
  header.faces = 0;
  {
    const auto writer = create_mesh_file(folder.path() / "a.ply", header);
    CHECK_THROWS_AS(writer->vertices(std::vector<Double3>(1000000), {}), ResourceError);
  }
  REQUIRE(::setrlimit(RLIMIT_FSIZE, &before) == 0);
  std::signal(SIGXFSZ, handler);
  CHECK(std::filesystem::is_empty(folder.path()));
}

TEST_CASE("mesh writers: a folder that does not exist is a usage error", "[fault]") {
  CHECK_THROWS_AS(create_mesh_file("/nonexistent-tessera/a.ply", MeshHeader{}), UsageError);
}

}  // namespace
}  // namespace tessera::mesh_writers_test
