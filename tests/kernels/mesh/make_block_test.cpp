#include "kernels/mesh/make_block.h"

#include <catch2/catch.hpp>

#include <limits>
#include <vector>

#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"

namespace make_block_test {

namespace {

using namespace tessera;
using Face = std::array<std::uint32_t, 3>;

const std::vector<Double3> kSquare = {{0, 0, 0}, {1, 0, 0}, {9, 9, 9}, {1, 1, 0}, {0, 1, 0}};

}  // namespace

TEST_CASE("make_block: arrays become a canonical block whose borders are known", "[unit]") {
  const MeshBlock block = make_block(kSquare, std::vector<Face>{{3, 4, 0}, {1, 3, 0}});
  CHECK(block.key == std::vector<std::uint64_t>{0, 1, 3, 4});  // 2 is of no face
  CHECK(block.faces == std::vector<Face>{{0, 1, 2}, {0, 2, 3}});
  CHECK(block.position[2] == kSquare[3]);
  CHECK(int{block.face_flags[0]} == (kFaceBorder01 | kFaceBorder12));
  CHECK(int{block.face_flags[1]} == (kFaceBorder12 | kFaceBorder20));
  for (const std::uint8_t complete : complete_stars(block)) CHECK(complete == 1);
  CHECK(make_block({}, {}).faces.empty());
}

TEST_CASE("make_block: what is no mesh is refused by name", "[unit]") {
  const auto said = [](const std::vector<Double3>& vertices, const std::vector<Face>& faces) {
    try {
      static_cast<void>(make_block(vertices, faces));
    } catch (const InputError& e) {
      return std::string(e.what());
    }
    return std::string("nothing");
  };
  CHECK(said(kSquare, {{0, 1, 5}}) == "face 0 names vertex 5 of 5");
  CHECK(said(kSquare, {{0, 1, 3}, {0, 3, 3}}) == "face 1 repeats vertex 3");
  CHECK(said({{0, 0, 0}, {1, 0, std::numeric_limits<double>::quiet_NaN()}}, {}) == "vertex 1 is not finite");
  CHECK(said(kSquare, {{0, 1, 3}, {0, 1, 4}}).find("same direction") != std::string::npos);
  CHECK(said(kSquare, {{0, 1, 3}, {1, 0, 4}, {0, 1, 2}}).find("has 3 faces") != std::string::npos);
}

}  // namespace make_block_test
