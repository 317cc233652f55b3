// What glTF allows beside plain triangles: every way to store a mesh gives the same mesh, damage an InputError.
#include "stream/formats/meshes/glb_accessor.h"

#include <catch2/catch.hpp>

#include <cmath>

#include <meshoptimizer.h>

#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "stream/commands/convert_mesh.h"
#include "stream/stages/tiles/tile_mesh.h"
#include "tests/helpers/glb_file.h"
#include "tests/helpers/memory_mesh.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/solid_command.h"
#include "tests/helpers/temp_folder.h"

namespace glb_accessor_test {

using namespace tessera;
using namespace tessera::test;
using Catch::Contains;
namespace {

const std::vector<Double3> kCorners = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                       {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
const std::vector<std::uint32_t> kCube = {0, 2, 1, 1, 2, 3, 4, 5, 6, 5, 7, 6, 0, 1, 4, 1, 5, 4,
                                          2, 6, 3, 3, 6, 7, 0, 4, 2, 2, 4, 6, 1, 3, 5, 3, 7, 5};

Json primitive(std::size_t positions, std::size_t indices, int mode = 4) {
  return {{"attributes", {{"POSITION", positions}}}, {"indices", indices}, {"mode", mode}};
}

Json cube_of(GlbFile& file) {
  const std::size_t at = file.floats(kCorners);
  return Json::array({primitive(at, file.indices(kCube))});
}

WholeMesh read(const std::string& bytes) {
  const TempFolder folder;
  return read_whole(folder.write("a.glb", bytes));
}

std::vector<std::string> notes(const std::string& bytes) {
  const TempFolder folder;
  return open_mesh_file(folder.write("a.glb", bytes))->warnings();
}

void check_refused(const std::string& bytes, const std::string& words) {
  CHECK_THROWS_AS(read(bytes), InputError);
  CHECK_THROWS_WITH(read(bytes), Contains(words));
}

/// \param expected  its volume
void check_cube(const WholeMesh& mesh, double expected = 1.0) {
  CHECK(mesh.faces.size() == 12);
  CHECK(volume(mesh) == Approx(expected));
}

std::string packed_vertices(const std::string& elements, std::size_t count, std::size_t stride) {
  std::string out(meshopt_encodeVertexBufferBound(count, stride), '\0');
  out.resize(meshopt_encodeVertexBuffer(reinterpret_cast<unsigned char*>(out.data()), out.size(),
                                        elements.data(), count, stride));
  return out;
}

std::string packed_triangles(const std::vector<std::uint32_t>& corners, std::size_t vertices) {
  meshopt_encodeIndexVersion(1);
  std::string out(meshopt_encodeIndexBufferBound(corners.size(), vertices), '\0');
  out.resize(meshopt_encodeIndexBuffer(reinterpret_cast<unsigned char*>(out.data()), out.size(),
                                       corners.data(), corners.size()));
  return out;
}

std::string packed_sequence(const std::vector<std::uint32_t>& corners, std::size_t vertices) {
  meshopt_encodeIndexVersion(1);
  std::string out(meshopt_encodeIndexSequenceBound(corners.size(), vertices), '\0');
  out.resize(meshopt_encodeIndexSequence(reinterpret_cast<unsigned char*>(out.data()), out.size(),
                                         corners.data(), corners.size()));
  return out;
}

}  // namespace

TEST_CASE("GLB: faces of mirrored nodes are turned, at any depth", "[unit]") {
  GlbFile file;
  const Json cube = cube_of(file);
  check_cube(read(file.bytes(cube, Json::array({{{"mesh", 0}, {"scale", {-2, 1, 1}}}}))), 2.0);
  // A part and its mirror image, which is how symmetric things are modelled.
  const Json pair = {{{"mesh", 0}, {"translation", {0.5, 0, 0}}}, {{"mesh", 0}, {"scale", {-1, 1, 1}}}};
  const WholeMesh both = read(file.bytes(cube, pair));
  CHECK(both.faces.size() == 24);
  CHECK(volume(both) == Approx(2.0));
  CHECK(is_closed(both));
  // Mirrored twice is not mirrored; a matrix mirrors as a scale does.
  const auto nested = [&](const Json& child) {
    Json more = {{"scenes", {{{"nodes", {0}}}}}};
    const Json nodes = {{{"children", {1}}, {"scale", {1, -1, 1}}}, child};
    return read(file.bytes(cube, nodes, more));
  };
  check_cube(nested({{"mesh", 0}, {"scale", {1, 1, -3}}}), 3.0);
  check_cube(nested({{"mesh", 0}, {"rotation", {0, 0, std::sqrt(0.5), std::sqrt(0.5)}}}));
  check_cube(nested({{"mesh", 0}, {"matrix", {0, 2, 0, 0, 1, 0, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1}}}), 2.0);
}

TEST_CASE("GLB: strips turn every second triangle, joints and restarts are none, fans keep their hub",
          "[unit]") {
  GlbFile file;
  const std::size_t at = file.floats(kCorners);
  Json strips = Json::array();
  for (const std::vector<std::uint32_t>& s :
       {std::vector<std::uint32_t>{0, 2, 1, 3, 5, 7, 4, 6, 0, 2}, {4, 0, 5, 1}, {2, 6, 3, 7}})
    strips.push_back(primitive(at, file.indices(s), 5));
  check_cube(read(file.bytes(strips)));
  CHECK(is_closed(read(file.bytes(strips))));
  // In one strip: joined by triangles that are none, or begun anew by the largest index.
  const std::vector<std::uint32_t> joined = {0, 2, 1, 3, 5, 7, 4, 6, 0, 2, 2,
                                             4, 4, 0, 5, 1, 1, 2, 2, 6, 3, 7};
  check_cube(read(file.bytes(Json::array({primitive(at, file.indices(joined), 5)}))));
  const std::vector<std::uint32_t> anew = {0,     2, 1, 3, 5, 7,     4, 6, 0, 2,
                                           65535, 4, 0, 5, 1, 65535, 2, 6, 3, 7};
  check_cube(read(file.bytes(Json::array({primitive(at, file.indices(anew), 5)}))));
  Json fans = Json::array();
  for (const std::vector<std::uint32_t>& f : {std::vector<std::uint32_t>{0, 2, 3, 1},
                                              {4, 5, 7, 6},
                                              {0, 1, 5, 4},
                                              {2, 6, 7, 3},
                                              {0, 4, 6, 2},
                                              {1, 3, 7, 5}})
    fans.push_back(primitive(at, file.indices(f), 6));
  check_cube(read(file.bytes(fans)));
  CHECK(read(file.bytes(fans)).points.size() == 8);  // all fans have the same vertices
  // Without indices, and mirrored.
  const std::size_t in_order = file.floats({{0, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}});
  const Json bare = Json::array({{{"attributes", {{"POSITION", in_order}}}, {"mode", 5}}});
  CHECK(read(file.bytes(bare)).faces == std::vector<MeshFace>{{0, 1, 2}, {1, 3, 2}});
  CHECK(read(file.bytes(bare, Json::array({{{"mesh", 0}, {"scale", {1, 1, -1}}}}))).faces ==
        std::vector<MeshFace>{{0, 2, 1}, {1, 2, 3}});
  check_refused(file.bytes(Json::array({primitive(at, 0, 9)})), "mode 9");
}

TEST_CASE("GLB: quantised, interleaved, sparse and narrow numbers give the same cube", "[unit]") {
  GlbFile file;
  const std::size_t cube = file.indices(kCube);
  const auto triangles = [&](std::size_t positions) { return Json::array({primitive(positions, cube)}); };
  const Json halved = Json::array({{{"mesh", 0}, {"scale", {0.5, 0.5, 0.5}}}});
  std::vector<double> shorts, bytes;
  std::string interleaved;
  for (const Double3& p : kCorners) {
    for (const double c : p) shorts.push_back(65535 * c), bytes.push_back(-127 + 254 * c);
    shorts.push_back(0), bytes.push_back(0);
    interleaved += std::string(8, 'x') + packed_numbers<float>(std::vector<double>(p.begin(), p.end())) +
                   std::string(4, 'x');
  }
  const Json normalized = {{"normalized", true}};
  check_cube(read(file.bytes(triangles(
      file.accessor(file.view(packed_numbers<std::uint16_t>(shorts), 8), 5123, 8, "VEC3", normalized)))));
  check_cube(read(file.bytes(
      triangles(file.accessor(file.view(packed_numbers<std::int8_t>(bytes), 4), 5120, 8, "VEC3", normalized)),
      halved)));
  check_cube(read(file.bytes(triangles(
                 file.accessor(file.view(packed_numbers<std::int8_t>(bytes), 4), 5120, 8, "VEC3")))),
             254.0 * 254 * 254);
  check_cube(read(file.bytes(
      triangles(file.accessor(file.view(interleaved, 24), 5126, 8, "VEC3", {{"byteOffset", 8}})))));
  const std::size_t at = file.floats(kCorners);
  check_cube(read(file.bytes(Json::array(
      {primitive(at, file.accessor(file.view(packed_numbers<std::uint8_t>(kCube)), 5121, 36, "SCALAR"))}))));

  // All of it, or one corner, in a sparse accessor.
  const auto sparse = [&](const std::vector<std::uint32_t>& which, const std::vector<double>& values) {
    return Json{{"count", which.size()},
                {"indices",
                 {{"bufferView", file.view(packed_numbers<std::uint16_t>(which))}, {"componentType", 5123}}},
                {"values", {{"bufferView", file.view(packed_numbers<float>(values))}}}};
  };
  std::vector<double> flat;
  for (const Double3& p : kCorners) flat.insert(flat.end(), p.begin(), p.end());
  const std::size_t zeros =
      file.accessor(0, 5126, 8, "VEC3", {{"sparse", sparse({0, 1, 2, 3, 4, 5, 6, 7}, flat)}});
  file.last_accessor().erase("bufferView");
  check_cube(read(file.bytes(triangles(zeros))));
  std::vector<Double3> dented = kCorners;
  dented[5] = {7, 7, 7};
  const std::size_t mended = file.floats(dented);
  const Json one = sparse({5}, {1, 0, 1});
  file.last_accessor()["sparse"] = one;
  check_cube(read(file.bytes(triangles(mended))));

  const auto damaged = [&](const std::vector<std::uint32_t>& which) {
    const std::size_t a =
        file.accessor(0, 5126, 8, "VEC3", {{"sparse", sparse(which, std::vector<double>(9, 1.0))}});
    file.last_accessor().erase("bufferView");
    return file.bytes(triangles(a));
  };
  check_refused(damaged({1, 1, 2}), "out of order");
  check_refused(damaged({1, 2, 8}), "out of order");
  const std::size_t vast =
      file.accessor(0, 5126, std::size_t{1} << 40, "VEC3", {{"sparse", sparse({0}, {1, 1, 1})}});
  file.last_accessor().erase("bufferView");
  check_refused(file.bytes(triangles(vast)), "more than the file has bytes");
  const std::size_t none = file.accessor(0, 5126, 8, "VEC3");
  file.last_accessor().erase("bufferView");
  check_refused(file.bytes(triangles(none)), "has no data");
  check_refused(file.bytes(triangles(file.accessor(0, 5126, 9, "VEC3"))), "passes the end");
  check_refused(file.bytes(triangles(file.accessor(0, 5126, 8, "VEC3", {{"byteOffset", 80}}))),
                "passes the end");
}

TEST_CASE("GLB: colours are linear in the file, whatever their type", "[unit]") {
  GlbFile file;
  std::vector<Double3> points;
  std::vector<double> linear;
  for (int c = 0; c < 256; ++c) {
    points.push_back({1.0 * c, 1.0 * (c % 2), 0});
    const double s = c / 255.0, l = s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
    linear.insert(linear.end(), {l, l, l});
  }
  const std::size_t at = file.floats(points);
  const auto colours = [&](std::size_t accessor) {
    std::vector<int> grey;
    for (const std::uint32_t c :
         read(file.bytes(
                  Json::array({{{"attributes", {{"POSITION", at}, {"COLOR_0", accessor}}}, {"mode", 5}}})))
             .rgba) {
      CHECK((c >> 8 & 255) == (c & 255));
      CHECK(c >> 24 == 255);
      grey.push_back(static_cast<int>(c & 255));
    }
    return grey;
  };
  std::vector<int> all(256);
  for (int c = 0; c < 256; ++c) all[static_cast<std::size_t>(c)] = c;
  CHECK(colours(file.accessor(file.view(packed_numbers<float>(linear)), 5126, 256, "VEC3")) == all);
  std::vector<double> scaled;
  for (const double l : linear) scaled.push_back(std::round(65535 * l));
  // Whole numbers are shares, even where a file forgets to say so.
  CHECK(colours(file.accessor(file.view(packed_numbers<std::uint16_t>(scaled)), 5123, 256, "VEC3")) == all);
  const std::size_t thirty =
      file.accessor(file.view(std::string(4 * 256, 30), 4), 5121, 256, "VEC3", {{"normalized", true}});
  CHECK(colours(thirty)[9] == 96);
}

TEST_CASE("GLB: all 256 channels of a colour come back as they were written", "[unit]") {
  const TempFolder folder;
  WholeMesh mesh;
  for (std::uint32_t c = 0; c < 256; ++c) {
    mesh.points.push_back({1.0 * c, 1.0 * (c % 2), 0});
    mesh.rgba.push_back(c | (255 - c) << 8 | (c * 7 % 256) << 16 | c << 24);
  }
  for (std::uint64_t c = 2; c < 256; ++c) mesh.faces.push_back({c - 2, c - 1, c});
  mesh.header.vertices = 256;
  mesh.header.faces = mesh.faces.size();
  mesh.header.colour = true;
  write_whole(folder / "a.glb", mesh);
  CHECK(read_whole(folder / "a.glb").rgba == mesh.rgba);
}

TEST_CASE("GLB: meshopt-compressed vertices, triangles and strips", "[unit]") {
  const auto torus = test::torus(60, 40);
  const std::vector<Double3> points = torus.points();
  std::vector<std::uint32_t> corners;
  for (const MeshFace& f : torus.faces())
    for (const std::uint64_t v : f) corners.push_back(static_cast<std::uint32_t>(v));
  std::vector<std::uint32_t> strip(meshopt_stripifyBound(corners.size()));
  strip.resize(meshopt_stripify(strip.data(), corners.data(), corners.size(), points.size(), 0));
  std::vector<double> flat;
  for (const Double3& p : points) flat.insert(flat.end(), p.begin(), p.end());
  const std::string floats = packed_numbers<float>(flat);
  const std::size_t n = points.size();
  WholeMesh plain;
  plain.points = points, plain.faces = torus.faces();

  GlbFile file;
  const std::size_t at =
      file.accessor(file.packed_view(packed_vertices(floats, n, 12), n, 12, "ATTRIBUTES"), 5126, n, "VEC3");
  const std::size_t in_threes =
      file.accessor(file.packed_view(packed_triangles(corners, n), corners.size(), 2, "TRIANGLES"), 5123,
                    corners.size(), "SCALAR");
  const Json required = {{"extensionsRequired", {"EXT_meshopt_compression"}}};
  const WholeMesh back =
      read(file.bytes(Json::array({primitive(at, in_threes)}), Json::array({{{"mesh", 0}}}), required));
  REQUIRE(back.points.size() == n);
  CHECK(packed_numbers<float>([&] {
          std::vector<double> all;
          for (const Double3& p : back.points)
            all.insert(all.end(), {p[0], p[2], 0 - p[1]});  // as in the file: y up
          return all;
        }()) == floats);
  CHECK(back.faces.size() == plain.faces.size());
  CHECK(volume(back) == Approx(volume(plain)).epsilon(1e-6));
  CHECK(is_closed(back));

  const std::size_t in_strip = file.accessor(
      file.packed_view(packed_sequence(strip, n), strip.size(), 4, "INDICES"), 5125, strip.size(), "SCALAR");
  const WholeMesh strips = read(file.bytes(Json::array({primitive(at, in_strip, 5)})));
  CHECK(strips.faces.size() == plain.faces.size());
  CHECK(volume(strips) == Approx(volume(plain)).epsilon(1e-6));

  std::vector<float> wide(3 * n);
  for (std::size_t i = 0; i < wide.size(); ++i) wide[i] = static_cast<float>(flat[i]);
  std::string exponents(12 * n, '\0');
  meshopt_encodeFilterExp(exponents.data(), n, 12, 20, wide.data());
  const std::size_t filtered =
      file.accessor(file.packed_view(packed_vertices(exponents, n, 12), n, 12, "ATTRIBUTES", "EXPONENTIAL"),
                    5126, n, "VEC3");
  CHECK(volume(read(file.bytes(Json::array({primitive(filtered, in_threes)})))) ==
        Approx(volume(plain)).epsilon(1e-4));

  SECTION("damage is told, and claims cost no memory") {
    const auto refused = [&](const std::string& packed, std::size_t count, std::size_t stride,
                             const std::string& mode, const std::string& filter, const std::string& words) {
      const std::size_t bad =
          file.accessor(file.packed_view(packed, count, stride, mode, filter), 5126, 3, "VEC3");
      check_refused(file.bytes(Json::array({{{"attributes", {{"POSITION", bad}}}}})), words);
    };
    refused(std::string(1000, 'x'), n, 12, "ATTRIBUTES", "NONE", "does not unpack");
    refused(std::string(100, 'x'), std::size_t{1} << 40, 12, "ATTRIBUTES", "NONE", "do not fit each other");
    refused(std::string(100, 'x'), 1000, 12, "TRIANGLES", "NONE", "do not fit each other");
    refused(std::string(100, 'x'), 6, 0, "ATTRIBUTES", "NONE", "do not fit each other");
    refused(std::string(100, 'x'), 6, 6, "ATTRIBUTES", "QUATERNION", "do not fit each other");
    refused(std::string(100, 'x'), 6, 12, "ATTRIBUTES", "COLOR", "filter COLOR");
    refused(std::string(100, 'x'), 6, 12, "SPLATS", "NONE", "mode SPLATS");
  }
}

TEST_CASE("GLB: a tile of a site is a mesh", "[unit]") {
  const auto torus = test::torus(40, 30);
  MeshBlock block;
  block.position = torus.points();
  for (const MeshFace& f : torus.faces())
    block.faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                           static_cast<std::uint32_t>(f[2])});
  block.face_flags.assign(block.faces.size(), 0);
  block.rgba.assign(block.position.size(), 0xff102060u);
  WholeMesh plain;
  plain.points = torus.points(), plain.faces = torus.faces();
  const WholeMesh back = read(tile_glb(quantise_tile(block, {{0, 0, 0}, 0x1p-12}, {})));
  CHECK(back.faces.size() == plain.faces.size());
  CHECK(is_closed(back));
  CHECK(volume(back) == Approx(volume(plain)).epsilon(1e-3));
  CHECK(back.rgba == block.rgba);
}

TEST_CASE("GLB: what is left out is told, what cannot be read is named", "[unit]") {
  GlbFile file;
  Json all = cube_of(file);
  CHECK(notes(file.bytes(all)).empty());
  all.push_back({{"attributes", {{"POSITION", 0}}}, {"mode", 0}});
  CHECK_THAT(notes(file.bytes(all)).at(0), Contains("1 primitive of points or lines left out"));
  all.push_back({{"attributes", {{"POSITION", 0}}}, {"mode", 3}});
  CHECK_THAT(notes(file.bytes(all)).at(0), Contains("2 primitives of points or lines left out"));
  check_cube(read(file.bytes(all)));
  check_refused(file.bytes(Json::array({all[1], all[2]})), "no triangles, only points or lines");
  Json cube = Json::array({all[0]});
  const Json outside = {{"scenes", {{{"nodes", {0}}}}}};
  const Json two = {{{"mesh", 0}}, {{"mesh", 0}, {"translation", {9, 9, 9}}}};
  check_cube(read(file.bytes(cube, two, outside)));
  CHECK_THAT(notes(file.bytes(cube, two, outside)).at(0), Contains("1 node with a mesh left out"));
  cube[0]["attributes"]["TEXCOORD_0"] = 0;
  cube[0]["targets"] = {{{"POSITION", 0}}};
  const std::vector<std::string> reported =
      notes(file.bytes(cube, Json::array({{{"mesh", 0}, {"skin", 0}}})));
  REQUIRE(reported.size() == 3);
  CHECK_THAT(reported[0], Contains("texture coordinates"));
  CHECK_THAT(reported[1], Contains("skin"));
  CHECK_THAT(reported[2], Contains("morph targets"));

  cube = Json::array({all[0]});
  const auto requiring = [&](const char* name) {
    return file.bytes(cube, Json::array({{{"mesh", 0}}}), {{"extensionsRequired", {name}}});
  };
  check_cube(read(requiring("KHR_materials_unlit")));
  check_cube(read(requiring("KHR_texture_transform")));
  check_refused(requiring("KHR_draco_mesh_compression"), "KHR_draco_mesh_compression");
  check_refused(requiring("EXT_something_new"), "EXT_something_new");
  // Packed by Draco without being said at the top.
  cube[0]["extensions"]["KHR_draco_mesh_compression"] = {{"bufferView", 0}};
  check_cube(read(file.bytes(cube)));
  file.accessor(0, 5126, 8, "VEC3");
  file.last_accessor().erase("bufferView");
  cube[0]["attributes"]["POSITION"] = 2;
  check_refused(file.bytes(cube), "KHR_draco_mesh_compression");
}

TEST_CASE("GLB: triangles without indices are joined by their positions, as those of STL", "[unit]") {
  const TempFolder folder;
  GlbFile file;
  std::vector<Double3> soup;
  for (const std::uint32_t v : kCube) soup.push_back(kCorners[v]);
  const Json bare = Json::array({{{"attributes", {{"POSITION", file.floats(soup)}}}}});
  const auto path =
      folder.write("a.glb", file.bytes(bare, Json::array({{{"mesh", 0}, {"scale", {-1, 1, 1}}}})));
  CHECK_FALSE(open_mesh_file(path)->shared_vertices());
  const MeshCheck check = check_mesh(*open_mesh_file(path), {});
  CHECK(check.boundary_edges == 0);
  CHECK(check.volume == Approx(1.0));
  convert_mesh(path, folder / "b.ply", {});
  CHECK(read_whole(folder / "b.ply").points.size() == 8);
  CHECK(volume(read_whole(folder / "b.ply")) == Approx(1.0));
}

TEST_CASE("GLB: vertices that stand there once for each normal or texture coordinate are one", "[unit]") {
  const TempFolder folder;
  const auto written = [&](const char* attribute) {
    GlbFile file;
    std::vector<Double3> corners;
    std::vector<std::uint32_t> numbers;
    for (const std::uint32_t v : kCube) {
      numbers.push_back(static_cast<std::uint32_t>(corners.size()));
      corners.push_back(kCorners[v]);
    }
    Json split = primitive(file.floats(corners), file.indices(numbers));
    if (attribute != nullptr) split["attributes"][attribute] = file.floats(corners);
    return folder.write("a.glb", file.bytes(Json::array({split})));
  };
  for (const char* attribute : {"NORMAL", "TEXCOORD_0"}) {
    const auto path = written(attribute);
    const MeshCheck check = check_mesh(*open_mesh_file(path), {});
    CHECK(check.welded);
    CHECK(check.file_vertices == 36);
    CHECK(check.vertices == 8);
    CHECK(check.components == 1);
    CHECK(check.boundary_edges == 0);
    convert_mesh(path, folder / "b.ply", {});
    CHECK(read_whole(folder / "b.ply").points.size() == 8);
  }
  // Where nothing else tells them apart they are taken as they are.
  const auto path = written(nullptr);
  CHECK(check_mesh(*open_mesh_file(path), {}).boundary_edges == 36);
  convert_mesh(path, folder / "b.ply", {});
  CHECK(read_whole(folder / "b.ply").points.size() == 36);
}

TEST_CASE("GLB: a node in many places by EXT_mesh_gpu_instancing", "[unit]") {
  GlbFile file;
  const Json cube = cube_of(file);
  const std::size_t to = file.floats({{0, 0, 0}, {5, 0, 0}, {9, 0, 0}}),
                    size = file.floats({{1, 1, 1}, {2, 1, 1}, {-1, 1, 1}});
  const auto placed = [&](const Json& attributes) {
    return file.bytes(
        cube,
        Json::array(
            {{{"mesh", 0}, {"extensions", {{"EXT_mesh_gpu_instancing", {{"attributes", attributes}}}}}}}),
        {{"extensionsRequired", {"EXT_mesh_gpu_instancing"}}});
  };
  const WholeMesh mesh = read(placed({{"TRANSLATION", to}, {"SCALE", size}}));
  CHECK(mesh.faces.size() == 36);
  CHECK(volume(mesh) == Approx(4.0));
  check_refused(placed({{"TRANSLATION", to}, {"SCALE", 1}}), "do not fit each other");
}

}  // namespace glb_accessor_test
