// Colours of meshes as writers name and scale them, and what is told of what is left out.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cstring>

#include "octree/error.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::mesh_colours_test {
namespace {

using Catch::Contains;
using test::read_whole;
using test::TempFolder;
using Strings = std::vector<std::string>;

constexpr std::uint32_t kOrange = 0xff0040ffu, kBlue = 0xffff8000u;  // 255 64 0; 0 128 255

struct Reading {
  std::vector<std::uint32_t> rgba;
  Strings warnings;
  std::size_t faces = 0;
};
Reading read(const std::filesystem::path& path) {
  Reading r;
  const auto mesh = read_whole(path);
  r.rgba = mesh.rgba;
  r.faces = mesh.faces.size();
  const auto reader = open_mesh_file(path);
  reader->read_faces([](auto) {});
  r.warnings = reader->warnings();
  return r;
}

/// Two faces, orange, blue, orange, blue. \param scale  of the colours, which are 0..255 at 1
std::string ply(const Strings& names, const std::string& type, double scale, const std::string& more = "",
                const std::string& position = "x y z") {
  std::string text = "ply\nformat ascii 1.0\nelement vertex 4\n";
  for (std::size_t i = 0; i < 5; i += 2) text += "property float " + position.substr(i, 1) + "\n";
  for (const std::string& name : names) text += "property " + type + " " + name + "\n";
  text += more + "element face 2\nproperty list uchar int vertex_indices\nend_header\n";
  const double orange[] = {255, 64, 0}, blue[] = {0, 128, 255};
  for (int v = 0; v < 4; ++v) {
    text += std::to_string(v % 2) + " " + std::to_string(v / 2) + " 0";
    for (std::size_t c = 0; c < names.size(); ++c) {
      const double value = (v % 2 == 0 ? orange : blue)[c] * scale;
      text +=
          " " + (type.starts_with("f") || type == "double" ? std::to_string(value)
                                                           : std::to_string(static_cast<int>(value + 0.5)));
    }
    text += more.empty() ? "\n" : " 7 8\n";
  }
  return text + "3 0 1 2\n3 1 3 2\n";
}

TEST_CASE("mesh colours: PLY in the types and under the names that writers use", "[unit]") {
  const TempFolder folder;
  const Strings plain = {"red", "green", "blue"};
  struct Case {
    Strings names;
    std::string type;
    double scale;
  };
  const std::vector<Case> cases = {{plain, "uchar", 1},
                                   {plain, "float", 1 / 255.0},
                                   {plain, "double", 1 / 255.0},
                                   {plain, "float", 1},
                                   {plain, "double", 1},
                                   {plain, "ushort", 257},
                                   {plain, "ushort", 1},
                                   {plain, "int", 1},
                                   {plain, "short", 1},
                                   {plain, "uint", 1},
                                   {{"diffuse_red", "diffuse_green", "diffuse_blue"}, "uchar", 1},
                                   {{"r", "g", "b"}, "uchar", 1},
                                   {{"r", "g", "b"}, "float", 1 / 255.0},
                                   {{"Red", "Green", "Blue"}, "uchar", 1},
                                   {{"RED", "GREEN", "BLUE"}, "float", 1}};
  for (const Case& c : cases) {
    CAPTURE(c.names[0], c.type, c.scale);
    const Reading r = read(folder.write("a.ply", ply(c.names, c.type, c.scale)));
    CHECK(r.rgba == std::vector<std::uint32_t>{kOrange, kBlue, kOrange, kBlue});
    const bool decided = (c.scale == 1 && (c.type == "float" || c.type == "double" || c.type == "ushort"));
    CHECK(r.warnings.size() == (decided ? 1 : 0));
  }
  // A filter that overshoots 1 makes no bytes of them.
  CHECK(read(folder.write("a.ply", ply(plain, "float", 1.02 / 255))).rgba[0] == 0xff0041ffu);
  const Reading named =
      read(folder.write("a.ply", ply({}, "uchar", 1, "property float s\nproperty float T\n", "X Y Z")));
  CHECK(named.rgba.empty());
  CHECK(named.warnings == Strings{"left out: 's' of vertices, 'T' of vertices"});
}

TEST_CASE("mesh colours: binary PLY has them by the same rule", "[unit]") {
  const TempFolder folder;
  std::string bytes =
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty double x\nproperty double "
      "y\nproperty double "
      "z\nproperty float R\nproperty float G\nproperty float B\nproperty uchar alpha\nelement face "
      "1\nproperty list "
      "uchar int vertex_indices\nproperty uchar red\nend_header\n";
  const auto put = [&](auto value) { bytes.append(reinterpret_cast<const char*>(&value), sizeof value); };
  for (int v = 0; v < 3; ++v) {
    for (int a = 0; a < 3; ++a) put(a == v ? 1.0 : 0.0);
    put(255.f), put(64.f), put(0.f), put(std::uint8_t{200});
  }
  put(std::uint8_t{3}), put(0), put(1), put(2), put(std::uint8_t{9});
  const Reading r = read(folder.write("a.ply", bytes));
  CHECK(r.rgba == std::vector<std::uint32_t>(3, 0xc80040ffu));
  REQUIRE(r.warnings.size() == 2);
  CHECK(r.warnings[0] == "left out: 'red' of faces");
  CHECK_THAT(r.warnings[1], Contains("0 to 255"));
}

TEST_CASE("mesh colours: OBJ with 0 to 1 and 0 to 255, and what of a model is left out", "[unit]") {
  const TempFolder folder;
  const std::string faces = "f 1 2 3\nf 2 4 3\n";
  const std::string unit = "v 0 0 0 1 .25 0\nv 1 0 0 0 .5 1\nv 0 1 0 1 .25 0\nv 1 1 0 0 .5 1\n";
  const std::string bytes = "v 0 0 0 255 64 0\nv 1 0 0 0 128 255\nv 0 1 0 255 64 0\nv 1 1 0 0 128 255\n";
  const std::vector<std::uint32_t> expected = {kOrange, kBlue, kOrange, kBlue};
  CHECK(read(folder.write("a.obj", unit + faces)).rgba == expected);
  CHECK(read(folder.write("a.obj", unit + faces)).warnings.empty());
  CHECK(read(folder.write("a.obj", bytes + faces)).rgba == expected);
  CHECK_THAT(read(folder.write("a.obj", bytes + faces)).warnings.at(0), Contains("0 to 255"));
  CHECK(
      read(folder.write("a.obj", "v 0 0 0 1\nv 1 0 0 1.0\nv 0 1 0 1\nf 1 2 3\n")).rgba.empty());  // a weight
  const Reading r = read(folder.write(
      "a.obj",
      "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\n#MRGB ffff4000\nvt 0 0\nvn 0 0 1\nusemtl x\n" +
          faces + "l 1 2\n"));
  CHECK(r.warnings == Strings{"left out: texture coordinates, materials, lines, polypaint colours (#MRGB)"});
}

TEST_CASE("OBJ reader: lines continued anywhere, byte order marks, UTF-16", "[unit]") {
  const TempFolder folder;
  const std::string text =
      "# c\nv 0 \\\n0 \\\n 0\nv 1 0 0 # x \\\nv 1 1\\\n0\nv 0 1 0\nf 1 2 \\\n3 4\\\n\nf 1\\\n2 3";
  const std::vector<MeshFace> faces = {{0, 1, 2}, {0, 2, 3}, {0, 1, 2}};
  std::string crlf, little = "\xff\xfe", big = "\xfe\xff";
  for (const char c : text) {
    crlf += c == '\n' ? "\r\n" : std::string(1, c);
    little += std::string{c, '\0'};
    big += std::string{'\0', c};
  }
  for (const std::string& bytes : {text, crlf, "\xef\xbb\xbf" + text.substr(4), little, big}) {
    CAPTURE(bytes);
    const auto mesh = read_whole(folder.write("a.obj", bytes));
    CHECK(mesh.points == std::vector<Double3>{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}});
    CHECK(mesh.faces == faces);
  }
  CHECK_THROWS_WITH(read_whole(folder.write("a.obj", "v 0 \\\n0\n")),
                    Contains("line 2: the line ends where a coordinate"));
}

TEST_CASE("OFF reader: comments above the keyword, columns that the keyword does not tell of", "[unit]") {
  const TempFolder folder;
  const std::vector<std::uint32_t> three = {kOrange, kBlue, kOrange};
  const auto file = [&](const std::string& keyword, const Strings& extra) {
    std::string text = keyword + "\n3 1 0\n";
    const char* const points[] = {"0 0 0", "1 0 0", "0 1 0"};
    for (std::size_t v = 0; v < 3; ++v) text += points[v] + std::string(" ") + extra[v % extra.size()] + "\n";
    return folder.write("a.off", text + "3 0 1 2\n");
  };
  const Strings bytes = {"255 64 0", "0 128 255"}, unit = {"1 .25 0", "0 .5 1"},
                opaque = {"255 64 0 255", "0 128 255 255"};
  const Strings normals = {"0 0 1", "0 0 -1"}, both = {"0 0 1 255 64 0", "0 0 -1 0 128 255"};
  for (const std::string comment : {"", "# made by hand\n\n  # 3 1 0 OFF\n"}) {
    CHECK(read(file(comment + "OFF", {""})).rgba.empty());
    CHECK(read(file(comment + "OFF", {""})).warnings.empty());
    for (const Strings& colour : {bytes, unit, opaque}) {
      CHECK(read(file(comment + "COFF", colour)).rgba == three);
      CHECK(read(file(comment + "OFF", colour)).rgba == three);
      CHECK_THAT(read(file(comment + "OFF", colour)).warnings.at(0), Contains("a colour"));
    }
    CHECK(read(file(comment + "NOFF", normals)).rgba.empty());
    CHECK(read(file(comment + "NOFF", normals)).warnings.empty());
    CHECK(read(file(comment + "OFF", normals)).rgba.empty());
    CHECK_THAT(read(file(comment + "OFF", normals)).warnings.at(0), Contains("a normal"));
    CHECK(read(file(comment + "NCOFF", both)).rgba == three);
    CHECK(read(file(comment + "NOFF", both)).rgba == three);
    CHECK(read(file(comment + "OFF", both)).rgba == three);
    CHECK(read(file(comment + "STOFF", {"0.5 0.25"})).warnings == Strings{"left out: texture coordinates"});
    CHECK(read(file(comment + "STCOFF", {"255 64 0 0.5 0.5", "0 128 255 1 0"})).rgba == three);
    CHECK(read(file(comment + "STNOFF", {"0 0 1 0.5 0.5"})).faces == 1);
    CHECK(read(file(comment + "OFF", {"0.5 0.25"})).faces == 1);
  }
  // Numbers in any lines, several vertices on one.
  CHECK(read(folder.write("a.off", "OFF 3 1 0 0 0 0 1 0 0 0 1 0 3 0 1 2")).faces == 1);
  CHECK(read(folder.write("a.off", "OFF\n4 1 0\n0 0 0 1 0 0\n0 1 0 1 1 0\n4 0 1 3 2\n")).faces == 2);
  // The extension is not needed, and colours of faces are told of.
  const Reading r = read(folder.write("a", "# c\nOFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 255 0 0\n"));
  CHECK(r.warnings == Strings{"left out: colours of faces"});
}

}  // namespace
}  // namespace tessera::mesh_colours_test
