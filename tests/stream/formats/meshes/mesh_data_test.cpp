// Real meshes of the shared catalogue, with the states that other parsers found there.
#include <catch2/catch.hpp>

#include <filesystem>
#include <string>

#include "octree/error.h"
#include "stream/check/mesh_check.h"
#include "tests/helpers/skip.h"

namespace tessera::mesh_data_test {
namespace {

struct Known {
  const char* file;
  std::uint64_t vertices, faces, boundary, nonmanifold, inconsistent, duplicates, zero_area, unreferenced,
      components;
};

constexpr Known kMeshes[] = {
    {"meshes/adis16480.stl", 3672, 7436, 0, 0, 0, 0, 0, 0, 1},
    {"meshes/block.obj", 8771, 17550, 0, 0, 0, 0, 0, 0, 1},
    {"meshes/bunny.ply", 35947, 69451, 223, 0, 0, 0, 0, 1113, 1},
    {"meshes/casting-10k.off", 5096, 10224, 0, 0, 0, 0, 0, 0, 1},
    {"meshes/horse.ply", 48485, 96966, 0, 0, 0, 0, 0, 0, 1},
    {"meshes/laurana.ply", 25160, 50000, 318, 0, 0, 0, 0, 0, 1},
    {"meshes/thingi-99865.stl", 35987, 71974, 0, 0, 0, 0, 0, 0, 4},
    {"meshes/tray.stl", 2216, 4520, 0, 0, 0, 0, 0, 0, 1},
    {"dirty/abominevole.off", 5021, 50706, 287, 30361, 1333, 0, 0, 0, 1},
    {"dirty/beast.obj", 32311, 64618, 0, 2, 0, 2, 0, 0, 1},
    {"dirty/bed.obj", 8964, 14042, 3594, 0, 1, 0, 43, 26, 156},
    {"dirty/beetle.obj", 1148, 2053, 296, 47, 0, 0, 0, 0, 2},
    {"dirty/brain-tristrips.ply", 18844, 36752, 920, 0, 0, 0, 0, 0, 14},
    {"dirty/conrod-flipped.stl", 3223, 6442, 0, 3, 5149, 3, 0, 0, 1},
    {"dirty/cycloidal.ply", 21384, 43368, 0, 242, 0, 0, 0, 0, 100},
    {"dirty/generic-twin-left.obj", 9874, 19704, 0, 0, 0, 0, 0, 0, 12},
    {"dirty/openscad-nonmanifold.obj", 717, 1442, 0, 0, 0, 0, 1, 0, 2},
    {"dirty/pickup.ply", 6870, 13402, 318, 183, 26, 113, 0, 0, 49},
    {"dirty/table-soup.off", 13244, 12500, 13244, 0, 0, 0, 0, 0, 373},
    {"dirty/thingi-38157-face.stl", 29995, 59955, 111, 2, 0, 0, 0, 0, 1},
    {"dirty/thingi-43149-soup.off", 50790, 16930, 50790, 0, 0, 0, 4, 0, 16930},
    {"dirty/trumpet.obj", 11908, 23696, 0, 0, 0, 0, 0, 0, 33},
};

TEST_CASE("real meshes: the check agrees with the catalogue", "[pipeline][.shared]") {
  if (!test::has_shared_data()) return;
  for (const Known& known : kMeshes) {
    const std::filesystem::path path = test::kSharedData / known.file;
    CAPTURE(known.file);
    const auto mesh = open_mesh_file(path, {.keep_bad_faces = true});
    const MeshCheck c = check_mesh(*mesh, {});
    CHECK(c.vertices == known.vertices);
    CHECK(c.faces == known.faces);
    CHECK(c.boundary_edges == known.boundary);
    CHECK(c.nonmanifold_edges == known.nonmanifold);
    CHECK(c.inconsistent_edges == known.inconsistent);
    CHECK(c.duplicate_faces == known.duplicates);
    CHECK(c.zero_area_faces == known.zero_area);
    CHECK(c.unreferenced_vertices == known.unreferenced);
    CHECK(c.components == known.components);
    CHECK(c.bad_index_faces == 0);
  }
}

TEST_CASE("real meshes: every edge case is read or refused in one sentence", "[fault][.shared]") {
  if (!test::has_shared_data()) return;
  const std::filesystem::path folder = test::kSharedData / "dirty/edge-cases";
  int read = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (!entry.path().has_extension()) continue;
    CAPTURE(entry.path().string());
    try {
      const auto mesh = open_mesh_file(entry.path(), {.keep_bad_faces = true});
      const MeshCheck c = check_mesh(*mesh, {});
      CHECK(c.bad_index_faces == 0);
      ++read;
    } catch (const InputError& e) {
      CHECK(std::string(e.what()).find('\n') == std::string::npos);
    }
  }
  CHECK(read >= 27);  // the others hold points only, or no elements at all
}

}  // namespace
}  // namespace tessera::mesh_data_test
