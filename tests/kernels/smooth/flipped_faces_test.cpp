#include "kernels/smooth/flipped_faces.h"

#include <catch2/catch.hpp>

#include "kernels/smooth/smooth.h"
#include "tests/helpers/block_meshes.h"
#include "tests/helpers/random.h"

namespace flipped_faces_test {

using namespace tessera;

TEST_CASE(
    "turned faces: none on clean meshes, creases and corners included, one where a vertex passed a side",
    "[unit]") {
  CHECK(count_flipped_faces(test::cube_block(6)) == 0);
  CHECK(count_flipped_faces(test::sphere_block(3)) == 0);
  MeshBlock flat = test::grid_block(6, 6, [](double, double) { return 0.0; });
  CHECK(count_flipped_faces(flat) == 0);
  for (Double3& p : flat.position)
    if (p[0] == 3.0 && p[1] == 3.0) p = {3.8, 4.3, 0.0};
  CHECK(count_flipped_faces(flat) > 0);
  std::vector<Double3> position = flat.position;
  unflip_faces(flat, FaceCorners(flat), position);
  std::size_t moved = 0;
  for (std::size_t v = 0; v < position.size(); ++v) moved += position[v] != flat.position[v];
  flat.position = position;
  CHECK(count_flipped_faces(flat) == 0);
  CHECK(moved < 12);
}

TEST_CASE("turned faces: denoising leaves none but on creases", "[property]") {
  const bool cube = GENERATE(false, true);
  MeshBlock mesh =
      cube ? test::cube_block(20) : test::grid_block(50, 50, [](double x, double) { return 0.02 * x * x; });
  test::Random random(5);
  const double deviation = cube ? 0.25 / 20 : 0.25;
  for (Double3& p : mesh.position)
    for (double& x : p) x += deviation * random.gaussian();
  CHECK(count_flipped_faces(mesh) > 30);
  SmoothOptions options;
  options.method = "denoise";
  for (const SmoothRound& round : smooth_rounds(options)) mesh.position = smooth_block(mesh, round).position;
  CHECK(count_flipped_faces(mesh) <= (cube ? 2u : 0u));
}

TEST_CASE("turned faces: a plate after fits has the same bits in every block with enough rings",
          "[property]") {
  MeshBlock whole = test::grid_block(90, 20, [](double x, double y) { return 0.01 * x * y; });
  test::Random random(6);
  for (Double3& p : whole.position)
    for (double& x : p) x += 0.25 * random.gaussian();
  SmoothOptions options;
  options.method = "denoise";
  const SmoothRound plate = smooth_rounds(options).back();
  REQUIRE(plate.unflips);
  const SmoothedBlock all = smooth_block(whole, plate);
  const MeshBlock piece = test::piece_of(whole, [&](std::uint32_t v) { return whole.position[v][0] < 55.0; });
  const SmoothedBlock part = smooth_block(piece, plate);
  std::vector<std::uint8_t> wanted(whole.position.size());
  for (std::size_t v = 0; v < wanted.size(); ++v) wanted[v] = v % 5 == 0;
  const SmoothedBlock some = smooth_block(whole, plate, wanted);
  for (std::size_t v = 0; v < wanted.size(); ++v)
    if (some.complete[v] != 0) REQUIRE(some.position[v] == all.position[v]);
  std::size_t complete = 0, at = 0;
  for (std::size_t v = 0; v < piece.position.size(); ++v) {
    while (whole.key[at] != piece.key[v]) ++at;
    if (part.complete[v] == 0) continue;
    ++complete;
    REQUIRE(part.position[v] == all.position[at]);
  }
  CHECK(complete > 200);
  CHECK(complete < piece.position.size());
}

}  // namespace flipped_faces_test
