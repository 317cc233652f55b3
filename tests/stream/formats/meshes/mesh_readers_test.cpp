#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "stream/commands/convert_mesh.h"
#include "tests/helpers/memory_mesh.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::mesh_readers_test {
namespace {

using Catch::Contains;
using test::read_whole;
using test::TempFolder;
using test::WholeMesh;

/// A torus with more elements than any batch, floats that need all their bits, and colours.
WholeMesh sample(bool colour, bool doubles) {
  const auto torus = test::torus(300, 130);
  WholeMesh mesh;
  mesh.points = torus.points();
  mesh.faces = torus.faces();
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  mesh.header.colour = colour;
  mesh.header.double_positions = doubles;
  mesh.header.shift = {431000.125, 5.5e6, -1.0 / 3};
  mesh.header.comments = {"made for a test"};
  // Through a float variable: written as one conditional expression, GCC 12 leaves out the rounding at -O3.
  for (std::size_t i = 0; i < mesh.points.size(); ++i) {
    for (double& value : mesh.points[i]) {
      if (doubles) continue;
      volatile const float rounded = static_cast<float>(value);
      value = static_cast<double>(rounded);
    }
    if (colour) mesh.rgba.push_back(static_cast<std::uint32_t>(i * 2654435761u) | 0xff000000u);
  }
  return mesh;
}

std::vector<Float3> to_floats(const std::vector<Double3>& points) {
  std::vector<Float3> floats;
  for (const Double3& p : points) {
    floats.push_back({static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])});
  }
  return floats;
}

TEST_CASE("mesh formats: what is written is read back", "[property]") {
  const TempFolder folder;
  const bool colour = GENERATE(false, true);
  const bool doubles = GENERATE(false, true);
  const std::string extension = GENERATE("ply", "obj", "glb");
  CAPTURE(extension, colour, doubles);
  const WholeMesh mesh = sample(colour, doubles);
  const auto path = folder.path() / ("a." + extension);
  test::write_whole(path, mesh);
  const WholeMesh back = read_whole(path);
  // GLB holds floats; OBJ text is the shortest that gives the float back.
  if (doubles && extension != "glb") {
    CHECK((back.points == mesh.points));
  } else {
    CHECK((to_floats(back.points) == to_floats(mesh.points)));
  }
  CHECK((back.faces == mesh.faces));
  CHECK((back.rgba == mesh.rgba));
  CHECK(back.header.colour == colour);
  CHECK(back.header.shift == mesh.header.shift);
  if (extension != "obj") CHECK(back.header.vertices == mesh.points.size());
  if (extension == "ply") CHECK(back.header.comments == mesh.header.comments);
}

TEST_CASE("mesh formats: STL keeps positions and order, and merging brings the mesh back", "[property]") {
  const TempFolder folder;
  const WholeMesh mesh = sample(false, false);
  test::write_whole(folder.path() / "a.stl", mesh);
  const WholeMesh back = read_whole(folder.path() / "a.stl");
  REQUIRE(back.faces.size() == mesh.faces.size());
  REQUIRE(back.points.size() == 3 * mesh.faces.size());
  bool same = true;
  for (std::size_t i = 0; i < mesh.faces.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      same = same && back.points[back.faces[i][k]] == mesh.points[mesh.faces[i][k]];
  }
  CHECK(same);

  const ConvertMeshReport report = convert_mesh(folder.path() / "a.stl", folder.path() / "b.ply", {});
  CHECK(report.welded);
  CHECK(report.vertices == mesh.points.size());
  const auto reader = open_mesh_file(folder.path() / "b.ply");
  CHECK(check_mesh(*reader, {}).total_genus == 1);
}

TEST_CASE("mesh formats: STL facets carry unit normals and no text marker", "[unit]") {
  const TempFolder folder;
  WholeMesh mesh;
  mesh.points = {{0, 0, 5}, {2, 0, 5}, {0, 2, 5}, {1, 1, 5}};
  mesh.faces = {{0, 1, 2}, {1, 2, 3}, {1, 3, 1}};
  mesh.faces.resize(2);
  mesh.header.vertices = 4;
  mesh.header.faces = 2;
  mesh.header.comments = {"solid as a rock"};
  test::write_whole(folder.path() / "a.stl", mesh);
  std::ifstream in(folder.path() / "a.stl", std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), {}};
  REQUIRE(bytes.size() == 84 + 2 * 50);
  CHECK(bytes.substr(0, 7) == "Tessera");
  float normal[3];
  std::memcpy(normal, bytes.data() + 84, sizeof normal);
  CHECK((normal[0] == 0 && normal[1] == 0 && normal[2] == 1));
}

TEST_CASE("mesh formats: conversions keep the mesh", "[property]") {
  const TempFolder folder;
  const WholeMesh mesh = sample(true, false);
  test::write_whole(folder.path() / "a.ply", mesh);
  convert_mesh(folder.path() / "a.ply", folder.path() / "b.glb", {});
  convert_mesh(folder.path() / "b.glb", folder.path() / "c.obj", {});
  ConvertMeshOptions floats;
  floats.floats = true;
  convert_mesh(folder.path() / "c.obj", folder.path() / "d.ply", floats);
  const WholeMesh back = read_whole(folder.path() / "d.ply");
  CHECK((back.points == mesh.points));
  CHECK((back.rgba == mesh.rgba));
  CHECK((back.faces == mesh.faces));
  CHECK(back.header.shift == mesh.header.shift);
  CHECK_FALSE(back.header.double_positions);
  CHECK_THROWS_AS(convert_mesh(folder.path() / "a.ply", folder.path() / "a.ply", {}), UsageError);
  CHECK(converts_as_mesh(folder.path() / "a.ply", "out.ply"));
  CHECK_FALSE(converts_as_mesh(folder.path() / "a.ply", "out.las"));
}

TEST_CASE("PLY reader: big endian, odd properties, polygons, other elements between", "[unit]") {
  const TempFolder folder;
  std::string bytes =
      "ply\r\nformat binary_big_endian 1.0\r\nelement thing 2\r\nproperty list uchar short odd\r\n"
      "element vertex 4\r\nproperty uchar red\r\nproperty uchar green\r\nproperty uchar blue\r\nproperty "
      "double z\r\n"
      "property float x\r\nproperty short y\r\nelement face 2\r\nproperty uchar flag\r\n"
      "property list ushort int vertex_index\r\nproperty list uchar float texcoord\r\nend_header\r\n";
  const auto put = [&](auto value) {
    char raw[sizeof value];
    std::memcpy(raw, &value, sizeof value);
    bytes.append(std::reverse_iterator(raw + sizeof value), std::reverse_iterator(raw));
  };
  put(std::uint8_t{2}), put(std::int16_t{1}), put(std::int16_t{2}), put(std::uint8_t{0});
  for (int i = 0; i < 4; ++i) {
    put(static_cast<std::uint8_t>(i)), put(std::uint8_t{20}), put(std::uint8_t{30});
    put(0.5 * i), put(static_cast<float>(i) + 0.25f), put(static_cast<std::int16_t>(-i));
  }
  put(std::uint8_t{7}), put(std::uint16_t{4});
  for (const int v : {0, 1, 2, 3}) put(static_cast<std::int32_t>(v));
  put(std::uint8_t{1}), put(0.5f);
  put(std::uint8_t{7}), put(std::uint16_t{3});
  for (const int v : {3, 1, 0}) put(static_cast<std::int32_t>(v));
  put(std::uint8_t{0});
  const WholeMesh mesh = read_whole(folder.write("a.ply", bytes));
  CHECK(mesh.format == "PLY binary big endian");
  CHECK(mesh.points == std::vector<Double3>{{0.25, 0, 0}, {1.25, -1, 0.5}, {2.25, -2, 1}, {3.25, -3, 1.5}});
  CHECK(mesh.rgba[3] == 0xff1e1403u);
  CHECK(mesh.faces == std::vector<MeshFace>{{0, 1, 2}, {0, 2, 3}, {3, 1, 0}});
}

TEST_CASE("PLY reader: lines with more values than declared are counted, values without lines are not lost",
          "[unit]") {
  const TempFolder folder;
  const std::string header =
      "ply\nformat ascii 1.0\nMeshLab wrote this\nelement vertex 3\nproperty float x\nproperty float "
      "y\nproperty float z\n"
      "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
  const auto read = [&](const std::string& body) {
    const auto path = folder.write("a.ply", header + body);
    const WholeMesh mesh = read_whole(path);
    CHECK(mesh.points == std::vector<Double3>{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}});
    CHECK(mesh.faces == std::vector<MeshFace>{{0, 1, 2}, {2, 1, 0}});
    const auto reader = open_mesh_file(path);
    reader->read_faces([](auto) {});
    reader->read_vertices([](auto, auto) {});
    std::vector<std::string> warnings = reader->warnings();
    REQUIRE_FALSE(warnings.empty());
    CHECK_THAT(warnings.front(), Contains("line 3") && Contains("comment"));
    warnings.erase(warnings.begin());
    return warnings;
  };
  // Wedge colours behind the indices, one line without; a surplus value at a vertex.
  const std::string wedges = " 9 255 0 0 0 255 0 0 0 255";
  std::vector<std::string> warnings =
      read("0 0 0\n1 0 0\n\n0 1 0 7\n3 0 1 2" + wedges + "\n3 2 1 0" + wedges + "\n");
  REQUIRE(warnings.size() == 2);
  CHECK_THAT(warnings[0], Contains("1 line holds more values"));
  CHECK_THAT(warnings[1], Contains("2 lines hold more values"));
  CHECK(read("0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n3 2 1 0\n").empty());
  CHECK(read("0 0 0 1 0 0 0 1 0 3 0 1 2 3 2 1 0\n").empty());
  CHECK(read("0\n0 0 1\n0 0 0 1\n0\n3 0 1\n2 3 2\n1 0").empty());
}

TEST_CASE("PLY reader: strips turn every second triangle and restart at -1", "[unit]") {
  const TempFolder folder;
  const WholeMesh mesh = read_whole(folder.write(
      "a.ply",
      "ply\nformat ascii 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
      "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 2 2\n11 0 1 2 3 3 4 -1 4 3 0 1\n"));
  CHECK(mesh.faces == std::vector<MeshFace>{{0, 1, 2}, {2, 1, 3}, {4, 3, 0}, {0, 3, 1}});
  CHECK(mesh.header.faces == 0);
}

TEST_CASE("OBJ reader: relative indices, all corner forms, continued lines, colours, no last newline",
          "[unit]") {
  const TempFolder folder;
  const WholeMesh mesh =
      read_whole(folder.write("a.obj",
                              "# tessera_shift 1 2 3\n# other\nv 0 0 0 1 0 0.5\nv\t1 0 0 nan 0 0\r\n"
                              "v 1 1 0 0 0 0\nvt 0 0\nvn 0 0 1\nf 1/1 2/1 3/1\nv 0 1 0 1 1 1\n"
                              "f 1//1 \\\n 2//1 3//1 4//1\ng f 9 9 9\nf -4 -3 -1\nf 4/1/1 6 5 # end\n"
                              "v 2 2 2 0 0 0\nv 3 3 3 0 0 0\nf 1// 2// -1"));
  CHECK(mesh.points.size() == 6);
  CHECK(mesh.rgba[0] == 0xff8000ffu);
  CHECK(mesh.rgba[1] == 0xff000000u);
  CHECK(mesh.faces ==
        std::vector<MeshFace>{{0, 1, 2}, {0, 1, 2}, {0, 2, 3}, {0, 1, 3}, {3, 5, 4}, {0, 1, 5}});
  CHECK(mesh.header.shift == Double3{1, 2, 3});
  CHECK(mesh.header.comments == std::vector<std::string>{"other"});
}

TEST_CASE("OFF reader: counts glued to the word, comments, colours", "[unit]") {
  const TempFolder folder;
  const WholeMesh mesh = read_whole(folder.write("a.off",
                                                 " COFF3 1 # three\n0 0 0 255 0 10 255\n\n1 0 0 0 0 0 255 # "
                                                 "here\n0 1 0 1 2 3 4\n3 0 1 2 0.5 0.5 0.5\n"));
  CHECK(mesh.points.size() == 3);
  CHECK(mesh.rgba == std::vector<std::uint32_t>{0xff0a00ffu, 0xff000000u, 0x04030201u});
  CHECK(mesh.faces == std::vector<MeshFace>{{0, 1, 2}});
}

TEST_CASE("STL reader: text of several solids in any letter case", "[unit]") {
  const TempFolder folder;
  const std::string facet =
      "FACET Normal 0 0 1\nouter loop\nvertex 0 0 0\nVERTEX 1e0 0 0\nvertex 0 +1 0.1\nendloop\nendfacet\n";
  const WholeMesh mesh =
      read_whole(folder.write("a.stl", "solid one\n" + facet + "endsolid one\nsolid\n" + facet + "endsolid"));
  CHECK(mesh.faces == std::vector<MeshFace>{{0, 1, 2}, {3, 4, 5}});
  CHECK(mesh.points[5] == Double3{0, 1, 0.1});
}

TEST_CASE("GLB reader: node transforms, several primitives, 16-bit indices, no indices", "[unit]") {
  const TempFolder folder;
  std::string bin;
  for (const float f : {0.f, 0.f, 0.f, 1.f, 0.f, 0.f, 0.f, 1.f, 0.f})
    bin.append(reinterpret_cast<const char*>(&f), 4);
  bin += std::string("\2\0\1\0\0\0\0\0", 8);  // the indices 2, 1, 0 and padding
  const auto glb = [&](std::string json) {
    json.resize((json.size() + 3) / 4 * 4, ' ');
    std::string bytes = "glTF";
    for (const std::size_t n : {std::size_t{2}, 28 + json.size() + bin.size(), json.size()}) {
      const auto word = static_cast<std::uint32_t>(n);
      bytes.append(reinterpret_cast<const char*>(&word), 4);
    }
    bytes += "JSON" + json;
    const auto word = static_cast<std::uint32_t>(bin.size());
    bytes.append(reinterpret_cast<const char*>(&word), 4);
    return bytes + std::string("BIN\0", 4) + bin;
  };
  const std::string rest =
      R"("buffers":[{"byteLength":44}],"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],
      "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"},
                   {"bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}]})";
  const WholeMesh mesh = read_whole(folder.write(
      "a.glb", glb(R"({"scenes":[{"nodes":[0]}],"nodes":[{"translation":[10,0,0],"children":[1,2]},{"mesh":0},
      {"mesh":0,"scale":[2,2,2],"rotation":[0,0,1,0]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0},"indices":1},
      {"attributes":{"POSITION":0},"mode":4},{"attributes":{"POSITION":0},"mode":1}]}],)" +
                   rest)));
  // Primitives of one mesh that use the same vertices share them, two uses of the mesh do not.
  CHECK(mesh.faces == std::vector<MeshFace>{{2, 1, 0}, {0, 1, 2}, {5, 4, 3}, {3, 4, 5}});
  // +Y is up in glTF: what lies along it goes to z, and its z to -y.
  CHECK(mesh.points[1] == Double3{11, 0, 0});
  CHECK(mesh.points[2] == Double3{10, 0, 1});
  CHECK(mesh.points[4] == Double3{8, 0, 0});
  CHECK(mesh.points[5] == Double3{10, 0, -2});

  const auto refused = [&](const std::string& front, const std::string& words) {
    CHECK_THROWS_WITH(read_whole(folder.write("b.glb", glb(front + rest))), Contains(words));
  };
  refused(R"({"extensionsRequired":["KHR_draco_mesh_compression"],)", "KHR_draco");
  refused(R"({"scenes":[{"nodes":[0]}],"nodes":[{"children":[0]}],)", "cycle");
  refused(R"({"scenes":[{"nodes":[7]}],"nodes":[],)", "nodes 7");
  refused(
      R"({"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"mode":7,"attributes":{"POSITION":0}}]}],)",
      "mode 7");
  refused(R"({"scenes":[{"nodes":["x"]}],)", "not valid");
}

TEST_CASE("mesh readers: damaged files are refused with the place", "[fault]") {
  const TempFolder folder;
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string face = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string points = "0 0 0\n1 0 0\n0 1 0\n";
  const auto refused = [&](const std::string& name, const std::string& bytes, const std::string& words) {
    CAPTURE(name, bytes.substr(0, 300));
    const auto path = folder.write(name, bytes);
    CHECK_THROWS_AS(read_whole(path), InputError);
    CHECK_THROWS_WITH(read_whole(path), Contains(words) && Contains(path.string()));
  };
  refused("a.ply", ply + "end_header\n" + points, "no faces");
  refused("a.ply", ply + face + points + "3 0 1 3\n", "line 13: a face names vertex 3");
  refused("a.ply", ply + face + points + "3 0 -1 2\n", "a face names vertex -1");
  refused("a.ply", ply + face + points + "3 0 1\n", "the file ends");
  refused("a.ply", ply + face + points + "3 0 1 zwei\n", "'zwei'");
  refused("a.ply", ply + face + points + "3 0 1 1.5\n", "no whole number");
  refused("a.ply", ply + face + points + "2 0 1\n", "2 corners");
  refused("a.ply", ply + face + "0 0 0\n1 0\n", "the file ends");
  refused("a.ply", ply + "element face 1\nproperty list uchar float vertex_indices\nend_header\n" + points,
          "list of integers");
  refused("a.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\n" + face,
          "no number 'z'");
  const std::string binary =
      "ply\nformat binary_little_endian 1.0\nelement vertex 1000000000000000000\nproperty float x\n"
      "property float y\nproperty float z\nelement face 1000000000000000000\n";
  refused("a.ply", binary + "property list uint uint vertex_indices\nend_header\nabc", "truncated");
  refused("a.ply",
          "ply\nformat binary_little_endian 1.0\nelement face 1\nproperty list uint uint "
          "vertex_indices\nelement vertex 0\n"
          "property float x\nproperty float y\nproperty float z\nend_header\n\xff\xff\xff\xff",
          "4294967295 items passes the end");
  refused("a.obj", "v 0 0\n", "line 1: the line ends where a coordinate");
  refused("a.obj", "v 0 0 0\nf 1 2 3\n", "line 2: a face names vertex 1");
  refused("a.obj", "v 0 0 0\nf -2 1 1\n", "a face names vertex -1");
  refused("a.obj", "v 0 0 0\nf 0 1 1\n", "start at 1");
  refused("a.obj", "v 0 0 0\nf 1 1\n", "2 corners");
  refused("a.obj", "v 0 0 0\nf 99999999999999999999 1 1\n", "not a vertex number");
  refused("a.obj", std::string(5000, 'x'), "longer than");
  refused("a.off", "OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "the file ends");
  refused("a.off", "OFF BINARY\n", "binary OFF");
  refused("a.off", "4OFF\n3 1 0\n", "prefix '4'");
  refused("a.off", "OFF\n-3 1 0\n", "number of vertices");
  refused("a.off", "OFF 18446744073709551615 1 0\n0 0 0\n", "the file ends");
  refused("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\n",
          "2 vertices");
  refused("a.stl", "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\n", "inside a facet");
  refused("a.stl", "solid a\nfacet\nvertex 0 0 0\nvertex 0 0 0\nvertex 0 0 0\nvertex 0 0 0\n",
          "more than three");
  refused("a.stl", "solid a\nfacet\nvertex 0 0 x\n", "'x'");
  refused("a.stl", "solid a\nvertex 0 0 1\n", "outside of any facet");
  refused("a.stl", std::string(80, '\0') + "\xff\xff\xff\xff" + std::string(101, 'a'), "4294967295 facets");
  refused("a.stl", "short", "without a facet");
  refused("a.glb", "glTF", "truncated");
  refused("a.glb", std::string("glTF\2\0\0\0\xff\xff\0\0\0\0\0\0JSON", 20), "truncated");
  refused("a.glb", std::string("glTF\1\0\0\0\x14\0\0\0\0\0\0\0JSON", 20), "version 1");
  refused("a.glb", std::string("glTF\2\0\0\0\x18\0\0\0\4\0\0\0JSON[[[[", 24), "not valid");
  refused("a.xyz", "1 2 3\n", "not a mesh");
  refused("a.obj", "", "empty");
  CHECK_THROWS_AS(open_mesh_file(folder.path() / "missing.ply"), InputError);
  CHECK_THROWS_AS(open_mesh_file(folder.path()), InputError);
}

TEST_CASE("mesh readers: faces that a check must see are kept on demand", "[unit]") {
  const TempFolder folder;
  const auto path = folder.write("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 9\nf 1 2\n");
  CHECK_THROWS_AS(read_whole(path), InputError);
  const WholeMesh mesh = read_whole(path, {.keep_bad_faces = true});
  CHECK(mesh.faces == std::vector<MeshFace>{{0, 1, 2}, {0, 1, 8}, {0, 0, 1}});
}

}  // namespace
}  // namespace tessera::mesh_readers_test
