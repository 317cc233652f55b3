// Damaged meshes, a few thousand per reader, always the same ones: what a fuzz target finds, in every test
// run.
#include <catch2/catch.hpp>

#include <cstring>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include <meshoptimizer.h>

#include "tests/fuzz/mesh_reader_check.h"
#include "tests/fuzz/mesh_samples.h"
#include "tests/helpers/glb_file.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::mesh_mutation_test {
namespace {

constexpr int kMutations = 3000;

test::WholeMesh small_mesh(bool colour) {
  test::WholeMesh mesh;
  mesh.points = {{0, 0, 0}, {1.5, 0, 0}, {0, 1, 0}, {0.1, 0.25, 1}};
  mesh.faces = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}};
  mesh.header.vertices = 4;
  mesh.header.faces = 4;
  mesh.header.colour = colour;
  mesh.header.shift = {5e5, 0, 1};
  if (colour) mesh.rgba = {1, 2, 0xff112233u, 4};
  return mesh;
}

std::string written(const std::string& name, bool colour) {
  const test::TempFolder folder;
  test::write_whole(folder.path() / name, small_mesh(colour));
  std::ifstream in(folder.path() / name, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// Strips, a sparse accessor and interleaved colours in a mirrored node; or views packed by meshopt.
std::string foreign_glb(bool packed) {
  const test::WholeMesh mesh = small_mesh(false);
  test::GlbFile file;
  std::vector<double> flat;
  for (const Double3& p : mesh.points) flat.insert(flat.end(), p.begin(), p.end());
  const std::string floats = test::packed_numbers<float>(flat);
  if (packed) {
    std::string vertices(meshopt_encodeVertexBufferBound(4, 12), '\0'),
        faces(meshopt_encodeIndexBufferBound(12, 4), '\0');
    vertices.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(vertices.data()),
                                               vertices.size(), floats.data(), 4, 12));
    const unsigned int corners[] = {0, 2, 1, 0, 1, 3, 1, 2, 3, 2, 0, 3};
    meshopt_encodeIndexVersion(1);
    faces.resize(
        meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(faces.data()), faces.size(), corners, 12));
    const std::size_t at = file.accessor(file.packed_view(vertices, 4, 12, "ATTRIBUTES"), 5126, 4, "VEC3");
    const std::size_t index = file.accessor(file.packed_view(faces, 12, 2, "TRIANGLES"), 5123, 12, "SCALAR");
    return file.bytes(tessera::Json::array({{{"attributes", {{"POSITION", at}}}, {"indices", index}}}));
  }
  const std::size_t at = file.floats(mesh.points);
  const tessera::Json sparse = {
      {"count", 1},
      {"indices", {{"bufferView", file.view(std::string(1, '\3'))}, {"componentType", 5121}}},
      {"values", {{"bufferView", file.view(floats.substr(0, 12))}}}};
  file.last_accessor()["sparse"] = sparse;
  const std::size_t colours = file.accessor(file.view(std::string(48, 'c'), 12), 5123, 4, "VEC4");
  const std::size_t index = file.indices({0, 1, 2, 3, 0, 65535, 1, 2, 3});
  return file.bytes(
      tessera::Json::array(
          {{{"attributes", {{"POSITION", at}, {"COLOR_0", colours}}}, {"indices", index}, {"mode", 5}},
           {{"attributes", {{"POSITION", at}}}, {"mode", 6}}}),
      tessera::Json::array({{{"mesh", 0}, {"scale", {1, -1, 1}}}}));
}

struct Case {
  std::string name;
  fuzz::OpenMesh open;
  std::vector<std::string> files;
};

std::vector<std::string> with(std::vector<std::string> samples, std::initializer_list<std::string> more) {
  samples.insert(samples.end(), more);
  return samples;
}

std::vector<Case> cases() {
  return {{"ply", open_ply_mesh, with(fuzz::ply_meshes(), {written("a.ply", false), written("a.ply", true)})},
          {"obj", open_obj_mesh, with(fuzz::obj_meshes(), {written("a.obj", true)})},
          {"off", open_off_mesh, fuzz::off_meshes()},
          {"stl", open_stl_mesh, with(fuzz::stl_meshes(), {written("a.stl", false)})},
          {"glb", open_glb_mesh,
           with(fuzz::glb_meshes(),
                {written("a.glb", false), written("a.glb", true), foreign_glb(false), foreign_glb(true)})},
          {"3mf", open_threemf_mesh, {written("a.3mf", false)}},
          {"vtu", open_vtu_mesh, with(fuzz::vtu_meshes(), {written("a.vtu", false), written("a.vtu", true)})},
          {"msh", open_msh_mesh, with(fuzz::msh_meshes(), {written("a.msh", false)})}};
}

/// Bytes changed, numbers swapped for absurd ones, parts cut, repeated or moved.
void mutate(std::string& bytes, std::mt19937_64& random) {
  const auto below = [&](std::size_t n) { return static_cast<std::size_t>(random() % n); };
  for (std::size_t edits = 1 + below(4); edits > 0 && !bytes.empty(); --edits) {
    const std::size_t at = below(bytes.size());
    switch (below(7)) {
      case 0:
        bytes[at] = static_cast<char>(random());
        break;
      case 1:
        bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8)));
        break;
      case 2:
        bytes.resize(at);
        break;
      case 3:
        bytes.insert(at, bytes.substr(below(bytes.size()), below(20)));
        break;
      case 4:
        bytes.erase(at, below(20));
        break;
      case 5: {
        const std::uint32_t words[] = {0, 1, 0x7fffffffu, 0x80000000u, 0xffffffffu, 0x10000u};
        if (at + 4 <= bytes.size()) std::memcpy(bytes.data() + at, &words[below(6)], 4);
        break;
      }
      default: {
        const char* const texts[] = {"99999999999", "-1", "1e999",      "nan",
                                     "\n",          " ",  "4294967296", "18446744073709551615"};
        bytes.insert(at, texts[below(8)]);
      }
    }
  }
}

TEST_CASE("mesh readers: damaged bytes give a sound mesh or an InputError", "[fault]") {
  for (const Case& reader : cases()) {
    std::mt19937_64 random(20260101);
    int sound = 0;
    for (const std::string& file : reader.files) {
      INFO(reader.name);
      REQUIRE(fuzz::check_mesh_reader(reader.open, file));
      for (std::size_t length = 1; length < file.size(); length += 1 + file.size() / 300) {
        CHECK_NOTHROW(fuzz::check_mesh_reader(reader.open, file.substr(0, length)));
      }
      for (int i = 0; i < kMutations; ++i) {
        std::string bytes = file;
        mutate(bytes, random);
        if (bytes.empty()) continue;
        CAPTURE(i);
        REQUIRE_NOTHROW(sound += fuzz::check_mesh_reader(reader.open, bytes) ? 1 : 0);
      }
    }
    CHECK(sound > 50);  // else the mutations only test the first check of the reader
  }
}

}  // namespace
}  // namespace tessera::mesh_mutation_test
