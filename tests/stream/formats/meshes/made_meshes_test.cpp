// Meshes whose state is known because a test has damaged them so, through every format that is written; and files at the edge of their formats. Their
// like from elsewhere is read by mesh_data_test.cpp.
#include <catch2/catch.hpp>

#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "tests/helpers/made_meshes.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::made_meshes_test {
namespace {

using test::WholeMesh;

constexpr std::uint64_t kSquares = 14, kSide = 4;
constexpr std::uint64_t kFaces = 2 * kSquares * kSide * kSide, kVertices = kFaces / 2 + 2;

struct Known {
  const char* name;
  WholeMesh mesh;
  std::uint64_t vertices, faces, boundary, nonmanifold, inconsistent, duplicates, zero_area, unreferenced,
      components;
};

/// A bracket of integer coordinates, each time with another defect.
std::vector<Known> known_meshes() {
  const WholeMesh sound = test::made_bracket(static_cast<int>(kSide), static_cast<double>(2 * kSide));
  // A vertex in the middle of a flat side: six faces of one fan.
  std::uint64_t middle = 0;
  const Double3 position = {4, 0, 4};
  while (sound.points[middle] != position) ++middle;
  const auto uses_middle = [&](const MeshFace& f) {
    return f[0] == middle || f[1] == middle || f[2] == middle;
  };
  const MeshFace one = sound.faces[0];
  const Double3 &a = sound.points[one[0]], &b = sound.points[one[1]];

  WholeMesh hole = sound;
  std::erase_if(hole.faces, uses_middle);
  WholeMesh twice = sound;
  twice.faces.push_back(one);
  WholeMesh reversed = sound;
  std::swap(reversed.faces[0][1], reversed.faces[0][2]);
  WholeMesh fin = sound;
  fin.points.push_back(a + Double3{0, -16, 0});
  fin.faces.push_back({one[1], one[0], sound.points.size()});
  WholeMesh flat = sound;
  flat.points.push_back((a + b) * 0.5);
  flat.faces.push_back({one[1], one[0], sound.points.size()});
  WholeMesh spare = sound;
  spare.points.push_back({100, 100, 100});
  const std::uint64_t f = kFaces, v = kVertices;
  return {{"sound", sound, v, f, 0, 0, 0, 0, 0, 0, 1},
          {"hole", hole, v, f - 6, 6, 0, 0, 0, 0, 1, 1},
          {"a face twice", twice, v, f + 1, 0, 3, 0, 1, 0, 0, 1},
          {"a face turned over", reversed, v, f, 0, 0, 3, 0, 0, 0, 1},
          {"a fin", fin, v + 1, f + 1, 2, 1, 0, 0, 0, 0, 1},
          {"a face without area", flat, v + 1, f + 1, 2, 1, 0, 0, 1, 0, 1},
          {"a vertex of nobody", spare, v + 1, f, 0, 0, 0, 0, 0, 1, 1},
          {"two bodies", test::joined(sound, sound, {64, 0, 0}), 2 * v, 2 * f, 0, 0, 0, 0, 0, 0, 2},
          {"torn", test::torn(sound), 3 * f, f, 3 * f, 0, 0, 0, 0, 0, f}};
}

TEST_CASE("made meshes: the check finds what was done to them, in every format that is written",
          "[pipeline]") {
  const test::TempFolder folder;
  for (Known& known : known_meshes()) {
    known.mesh = test::counted(known.mesh);
    for (const std::string format : {".ply", ".obj", ".glb", ".stl"}) {
      CAPTURE(known.name, format);
      const auto path = folder / ("mesh" + format);
      std::filesystem::remove(path);
      test::write_whole(path, known.mesh);
      const MeshCheck c = check_mesh(*open_mesh_file(path, {.keep_bad_faces = true}), {});
      // STL has no vertices but those of faces, and they are joined where they lie in one place.
      const bool joins = format == ".stl";
      const bool torn = joins && known.components == kFaces;
      CHECK(c.vertices == (torn ? kVertices : known.vertices - (joins ? known.unreferenced : 0)));
      CHECK(c.faces == known.faces);
      CHECK(c.boundary_edges == (torn ? 0 : known.boundary));
      CHECK(c.nonmanifold_edges == known.nonmanifold);
      CHECK(c.inconsistent_edges == known.inconsistent);
      CHECK(c.duplicate_faces == known.duplicates);
      CHECK(c.zero_area_faces == known.zero_area);
      CHECK(c.unreferenced_vertices == (joins ? 0 : known.unreferenced));
      CHECK(c.components == (torn ? 1 : known.components));
      CHECK(c.bad_index_faces == 0);
    }
  }
}

struct Edge {
  const char* name;
  std::string text;
  int faces;  ///< -1: refused in one sentence
};

const std::string kFourCorners = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
const std::string kOffTriangle = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

std::string ply_head(const std::string& elements) {
  return "ply\nformat ascii 1.0\n" + elements + "end_header\n";
}
const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";

std::string facet(const std::string& c) {
  return "facet normal 0 0 1\nouter loop\nvertex 0 0 " + c + "\nvertex 1 0 " + c + "\nvertex 0 1 " + c +
         "\nendloop\nendfacet\n";
}

TEST_CASE("made meshes: files at the edge of their formats are read or refused in one sentence", "[fault]") {
  const std::vector<Edge> edges = {
      {"nothing.obj", "", -1},
      {"comment_alone.obj", "# made by nobody\n", -1},
      {"points_alone.obj", kFourCorners, -1},
      {"points_as_elements.obj", kFourCorners + "p 1\np 2\n", -1},
      {"wires.obj", kFourCorners + "l 1 2\nl 2 3 4\n", -1},
      {"from_the_end.obj", kFourCorners + "f -4 -3 -2\nf -4 -2 -1\n", 2},
      {"group_like_a_face.obj", "g An f Three Other Things\n" + kFourCorners + "f 1 2 3\n", 1},
      {"materials.obj", "mtllib none.mtl\no one\ns 1\nusemtl m\n" + kFourCorners + "f 1// 2// 3//\ns off\n",
       1},
      {"square.obj", kFourCorners + "f 1 2 3 4\n", 2},
      {"colour_not_a_number.obj", "v 0 0 0 1 nan 1\nv 1 0 0 1 nan 1\nv 0 1 0 1 1 1\nf 1 2 3\n", 1},
      {"two_corners.obj", kFourCorners + "f 1 2 3\nf 1 2\n", 1},
      {"beyond.obj", kFourCorners + "f 1 2 9\n", -1},
      {"nothing.off", "", -1},
      {"comments.off",
       "OFF\n#\n# a triangle\n\n3 1 3 # counts\n0 0 0 # a vertex\n1 0 0\n0 1 0\n3 0 1 2 255 0 0 # a face\n",
       1},
      {"one_line.off", "OFF3 1 0\n" + kOffTriangle, 1},
      {"short.off", "OFF\n3 2 0\n" + kOffTriangle, -1},
      {"nothing.ply", "", -1},
      {"no_elements.ply", "ply\nformat ascii 1.0\nend_header\n", -1},
      {"points_alone.ply", ply_head("element vertex 1\n" + kXyz) + "1 2 3\n", -1},
      {"other_lists.ply",
       ply_head(
           "element vertex 3\n" + kXyz +
           "element more 2\nproperty list uchar uint one\nproperty list uchar uint two\nproperty float x\n"
           "element face 1\nproperty list uchar int vertex_indices\n") +
           "0 0 0\n1 0 0\n0 1 0\n2 0 1 1 7 0.5\n0 3 1 2 3 0.25\n3 0 1 2\n",
       1},
      {"textured.ply",
       ply_head("comment by hand\nelement vertex 3\n" + kXyz +
                "property float s\nproperty float t\nproperty uchar red\nproperty uchar green\nproperty "
                "uchar blue\n"
                "element face 1\nproperty list uchar uint vertex_indices\n") +
           "0 0 0 0 0 1 2 3\n1 0 0 0 1 4 5 6\n0 1 0 1 0 7 8 9\n3 0 1 2\n",
       1},
      {"nothing.stl", "", -1},
      {"no_facet.stl", "solid nothing\nendsolid nothing\n", -1},
      {"no_facet_binary.stl", std::string(84, '\0'), -1},
      {"two_solids.stl",
       "solid One\n" + facet("0") + "endsolid One\nSOLID two\n" + facet("1") + "endsolid two\n", 2},
  };
  const test::TempFolder folder;
  for (const Edge& edge : edges) {
    CAPTURE(edge.name);
    const auto path = folder.write(edge.name, edge.text);
    try {
      const MeshCheck c = check_mesh(*open_mesh_file(path, {.keep_bad_faces = true}), {});
      // What has no face, or one that names no vertex, is read: the check says so.
      CHECK(c.faces - c.bad_index_faces - c.degenerate_faces ==
            static_cast<std::uint64_t>(std::max(edge.faces, 0)));
    } catch (const InputError& e) {
      CHECK(edge.faces == -1);
      CHECK(std::string(e.what()).find('\n') == std::string::npos);
      CHECK(std::string(e.what()).find(edge.name) != std::string::npos);
    }
  }
}

}  // namespace
}  // namespace tessera::made_meshes_test
