// Meshes in parts: ranges are what reading in order gives, parts that were encoded what writing in order does.
#include "stream/formats/mesh_parts.h"

#include <algorithm>
#include <fstream>
#include <functional>
#include <memory>

#include <catch2/catch.hpp>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/written_hash.h"
#include "stream/formats/meshes/mesh_io.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace mesh_parts_test {

using namespace tessera;
using namespace tessera::test;

namespace {

constexpr std::uint64_t kVertices = 1000, kFaces = 1990;

std::vector<Double3> positions() {
  std::vector<Double3> out;
  for (std::uint64_t i = 0; i < kVertices; ++i)
    out.push_back({0.25 * static_cast<double>(i), 0.5 * static_cast<double>(i % 7), -0.125});
  return out;
}
std::vector<std::uint32_t> colours() {
  std::vector<std::uint32_t> out;
  for (std::uint32_t i = 0; i < kVertices; ++i) out.push_back(i * 2654435761u);
  return out;
}
std::vector<MeshFace> triangles() {
  std::vector<MeshFace> out;
  for (std::uint64_t i = 0; i < kFaces; ++i)
    out.push_back({i % kVertices, (i * 3 + 1) % kVertices, (i * 7 + 2) % kVertices});
  return out;
}
std::vector<std::uint8_t> flags() {
  std::vector<std::uint8_t> out;
  for (std::uint64_t i = 0; i < kFaces; ++i) out.push_back(i % 5 == 0);
  return out;
}

MeshHeader parts_header(bool colour, bool synthetic, bool doubles) {
  MeshHeader header;
  header.vertices = kVertices;
  header.faces = kFaces;
  header.colour = colour;
  header.synthetic = synthetic;
  header.double_positions = doubles;
  return header;
}

std::string whole(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// Ranges of odd sizes against reading in order.
void check_ranges(const std::filesystem::path& path) {
  const auto mesh = open_mesh_file(path);
  auto* ranges = dynamic_cast<MeshRanges*>(mesh.get());
  REQUIRE(ranges != nullptr);
  REQUIRE(ranges->has_ranges());
  std::vector<Double3> position, position_of_ranges;
  std::vector<std::uint32_t> rgba, rgba_of_ranges;
  mesh->read_vertices([&](auto batch, auto colour) {
    position.insert(position.end(), batch.begin(), batch.end());
    rgba.insert(rgba.end(), colour.begin(), colour.end());
  });
  MeshVertexPart part;
  for (std::uint64_t begin = 0; begin < mesh->header().vertices; begin += 137) {
    ranges->read_vertex_range(begin, std::min(begin + 137, mesh->header().vertices), part);
    position_of_ranges.insert(position_of_ranges.end(), part.position.begin(), part.position.end());
    rgba_of_ranges.insert(rgba_of_ranges.end(), part.rgba.begin(), part.rgba.end());
  }
  CHECK(position == position_of_ranges);
  CHECK(rgba == rgba_of_ranges);

  std::vector<MeshFace> faces, faces_of_ranges, faces_from;
  std::vector<std::uint8_t> synthetic, synthetic_of_ranges, synthetic_from;
  mesh->read_flagged_faces([&](auto batch, auto flag) {
    faces.insert(faces.end(), batch.begin(), batch.end());
    synthetic.insert(synthetic.end(), flag.begin(), flag.end());
  });
  MeshFacePart face_part;
  for (std::uint64_t begin = 0; begin < mesh->header().faces; begin += 211) {
    const std::uint64_t end = std::min(begin + 211, mesh->header().faces);
    CHECK(ranges->read_face_range(begin, end, face_part) == end);
    faces_of_ranges.insert(faces_of_ranges.end(), face_part.faces.begin(), face_part.faces.end());
    synthetic_of_ranges.insert(synthetic_of_ranges.end(), face_part.synthetic.begin(),
                               face_part.synthetic.end());
  }
  CHECK(faces == faces_of_ranges);
  CHECK(synthetic == synthetic_of_ranges);
  constexpr std::size_t kFrom = 301;
  ranges->read_faces_from(kFrom, [&](auto batch, auto flag) {
    faces_from.insert(faces_from.end(), batch.begin(), batch.end());
    synthetic_from.insert(synthetic_from.end(), flag.begin(), flag.end());
  });
  CHECK(faces_from == std::vector<MeshFace>(faces.begin() + kFrom, faces.end()));
  if (!synthetic.empty())
    CHECK(synthetic_from == std::vector<std::uint8_t>(synthetic.begin() + kFrom, synthetic.end()));
}

/// Numbers with the byte that comes first in memory last.
template <class T>
void put_big(std::string& to, T value) {
  std::string bytes(reinterpret_cast<const char*>(&value), sizeof value);
  to.append(bytes.rbegin(), bytes.rend());
}

}  // namespace

TEST_CASE("mesh parts: ranges of a PLY file are what reading in order gives", "[unit]") {
  const TempFolder folder;
  const auto path = folder.path() / "mesh.ply";
  for (const bool colour : {false, true})
    for (const bool synthetic : {false, true})
      for (const bool doubles : {false, true}) {
        const auto file = create_mesh_file(path, parts_header(colour, synthetic, doubles));
        file->vertices(positions(), colour ? colours() : std::vector<std::uint32_t>());
        file->faces(triangles(), synthetic ? flags() : std::vector<std::uint8_t>());
        file->finish();
        check_ranges(path);
      }
}

TEST_CASE("mesh parts: ranges of big endian numbers, odd types and properties between", "[unit]") {
  const TempFolder folder;
  const auto path = folder.path() / "mesh.ply";
  std::string bytes =
      "ply\nformat binary_big_endian 1.0\nelement vertex 300\nproperty double z\nproperty float quality\n"
      "property short x\nproperty float y\nproperty float red\nproperty float green\nproperty float blue\n"
      "element face 400\nproperty uchar group\nproperty list ushort short vertex_indices\n"
      "property float synthetic\nend_header\n";
  for (int i = 0; i < 300; ++i) {
    put_big(bytes, 0.1 * i);
    put_big(bytes, 1.0f);
    put_big(bytes, static_cast<std::int16_t>(i));
    for (int c = 0; c < 4; ++c) put_big(bytes, 0.002f * static_cast<float>(i));
  }
  for (int i = 0; i < 400; ++i) {
    bytes.push_back('\1');
    put_big(bytes, std::uint16_t{3});
    for (int c = 0; c < 3; ++c) put_big(bytes, static_cast<std::int16_t>((i + 7 * c) % 300));
    put_big(bytes, i % 3 == 0 ? 1.0f : 0.0f);
  }
  std::ofstream(path, std::ios::binary) << bytes;
  check_ranges(path);
}

TEST_CASE("mesh parts: ranges of an STL file", "[unit]") {
  const TempFolder folder;
  const auto path = folder.path() / "mesh.stl";
  const auto file = create_mesh_file(path, parts_header(false, false, false));
  file->vertices(positions(), {});
  file->faces(triangles());
  file->finish();
  check_ranges(path);
}

TEST_CASE("mesh parts: a range of faces ends at the first that is no triangle or beyond the file", "[unit]") {
  const TempFolder folder;
  const auto path = folder.path() / "mesh.ply";
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nelement face 5\nproperty list uchar int vertex_indices\nend_header\n";
  bytes.append(4 * 12, '\0');
  const auto face = [&](std::vector<std::int32_t> corners) {
    bytes.push_back(static_cast<char>(corners.size()));
    bytes.append(reinterpret_cast<const char*>(corners.data()), 4 * corners.size());
  };
  face({0, 1, 2});
  face({1, -2, 3});
  const bool polygon = GENERATE(true, false);
  if (polygon) {
    face({0, 1, 2, 3});
    face({0, 1, 3});
    face({0, 2, 3});
  }
  std::ofstream(path, std::ios::binary) << bytes;
  const auto mesh = open_mesh_file(path, {.keep_bad_faces = true});
  const auto* ranges = dynamic_cast<const MeshRanges*>(mesh.get());
  REQUIRE((ranges != nullptr && ranges->has_ranges()));
  MeshFacePart part;
  CHECK(ranges->read_face_range(0, 5, part) == 2);
  CHECK(part.faces == std::vector<MeshFace>{{0, 1, 2}, {1, ~std::uint64_t{1}, 3}});
  if (polygon) return;  // what lies behind it is found in order alone
  CHECK(ranges->read_face_range(3, 5, part) == 3);
  CHECK(part.faces.empty());
}

TEST_CASE("mesh parts: files that must be read in order have no ranges", "[unit]") {
  const TempFolder folder;
  const auto has_ranges = [&](const std::string& name, const std::string& bytes) {
    std::ofstream(folder.path() / name, std::ios::binary) << bytes;
    const auto mesh = open_mesh_file(folder.path() / name);
    const auto* ranges = dynamic_cast<const MeshRanges*>(mesh.get());
    return ranges != nullptr && ranges->has_ranges();
  };
  const std::string vertex = "property float x\nproperty float y\nproperty float z\n";
  const std::string face = "element face 1\nproperty list uchar int vertex_indices\n";
  const std::string binary = "ply\nformat binary_little_endian 1.0\nelement vertex 3\n";
  CHECK(has_ranges("plain.ply", binary + vertex + face + "end_header\n" + std::string(3 * 12 + 13, '\0')));
  CHECK_FALSE(has_ranges("text.ply", "ply\nformat ascii 1.0\nelement vertex 3\n" + vertex + face +
                                         "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"));
  CHECK_FALSE(has_ranges("confidence.ply", binary + vertex + "property float confidence\n" + face +
                                               "end_header\n" + std::string(3 * 16 + 13, '\0')));
  CHECK_FALSE(has_ranges("truncated.ply", binary + vertex + face + "end_header\n" + std::string(20, '\0')));
  CHECK_FALSE(has_ranges("lists.ply", binary + vertex + face + "property list uchar float texcoord\n" +
                                          "end_header\n" + std::string(3 * 12 + 14, '\0')));
  CHECK_FALSE(has_ranges("text.stl", "solid a\nendsolid a\n"));
}

TEST_CASE("mesh parts: a file of encoded parts has the bytes of one written in order", "[unit]") {
  const TempFolder folder;
  for (const bool extras : {false, true}) {
    const MeshHeader header = parts_header(extras, extras, extras);
    const std::vector<std::uint32_t> rgba = extras ? colours() : std::vector<std::uint32_t>();
    const std::vector<std::uint8_t> synthetic = extras ? flags() : std::vector<std::uint8_t>();
    const auto one = create_mesh_file(folder.path() / "one.ply", header);
    one->vertices(positions(), rgba);
    one->faces(triangles(), synthetic);
    one->finish();

    const auto two = create_mesh_file(folder.path() / "two.ply", header);
    auto* parts = dynamic_cast<MeshPartWriter*>(two.get());
    REQUIRE(parts != nullptr);
    const auto cut = [](const auto& all, std::size_t begin, std::size_t end) {
      return all.empty() ? all : std::decay_t<decltype(all)>(all.begin() + begin, all.begin() + end);
    };
    for (std::size_t begin = 0; begin < kVertices; begin += 250) {
      MeshVertexPart part{cut(positions(), begin, begin + 250), cut(rgba, begin, begin + 250), {}};
      parts->encode(part);
      parts->append(part);
      parts->digest(part.bytes);
    }
    for (std::size_t begin = 0; begin < kFaces; begin += 199) {
      MeshFacePart part{cut(triangles(), begin, begin + 199), cut(synthetic, begin, begin + 199), {}};
      parts->encode(part);
      parts->append(part);
      parts->digest(part.bytes);
    }
    two->finish();
    CHECK(whole(folder.path() / "one.ply") == whole(folder.path() / "two.ply"));
    CHECK(hash_written_file(folder.path() / "two.ply") == hash_file(folder.path() / "two.ply"));
    CHECK(one->rounding().largest == two->rounding().largest);
  }
}

TEST_CASE("mesh parts: what is appended is checked as what is written", "[unit]") {
  const TempFolder folder;
  const auto file = create_mesh_file(folder.path() / "a.ply", parts_header(false, false, false));
  auto* parts = dynamic_cast<MeshPartWriter*>(file.get());
  REQUIRE(parts != nullptr);
  MeshVertexPart vertices{positions(), {}, {}};
  parts->encode(vertices);
  parts->append(vertices);
  parts->digest(vertices.bytes);
  CHECK_THROWS_AS(parts->append(vertices), ValidationError);
  MeshFacePart faces{{{0, 1, kVertices}}, {}, {}};
  parts->encode(faces);
  CHECK_THROWS_AS(parts->append(faces), ValidationError);
}

}  // namespace mesh_parts_test
