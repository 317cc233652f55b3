// Vertices by their names, and faces of them.
#include "kernels/extract/patch_builder.h"

#include <catch2/catch.hpp>

namespace patch_builder_test {

using namespace tessera;

constexpr Int3 kCorner = {64, 128, 192};

TEST_CASE("patch builder: vertices of other bricks come behind the own ones, in the order of their keys",
          "[unit]") {
  PatchBuilder patch(kCorner, 0, true, false);
  patch.start(1, 2);
  patch.set_own(0, {patch.key({1, 2, 3}, 0), {1.5f, 2, 3}, 0, VertexClass::kSmooth});
  patch.set_foreign(0, {.key = patch.key({64, 0, 5}, 1), .position = {0, 0.5f, 5}});
  patch.set_foreign(1, {.key = patch.key({64, 0, 4}, 1), .position = {0, 0.5f, 4}});
  const std::uint32_t unused = patch.add_foreign({.key = patch.key({64, 0, 1}, 1)});
  CHECK(unused == (2u | kForeignVertex));
  patch.add_face(0, 0u | kForeignVertex, 1u | kForeignVertex, 0b010);
  const Patch out = patch.finish();
  CHECK(out.brick == Int3{1, 2, 3});
  REQUIRE(out.foreign.size() == 2);
  CHECK(out.foreign[0] < out.foreign[1]);
  CHECK(out.foreign_position[0] == Float3{0, 0.5f, 4});
  CHECK(out.faces == std::vector<PatchFace>{{0, 2, 1}});
  CHECK(out.border == std::vector<std::uint8_t>{0b010});
  CHECK(out.foreign_finer.empty());
  CHECK(vertex_name(out.foreign[1]).at == Int3{128, 128, 197});
}

TEST_CASE("patch builder: a vertex of a finer brick has one slot, whichever cell names it", "[unit]") {
  PatchBuilder patch({32, 64, 96}, 1, false, true);
  patch.start(0, 0);
  const BrickVertex one{.key = patch.finer_key({130, 128, 192}, 2), .finer = true};
  const std::uint32_t slot = patch.add_finer(one);
  const std::uint32_t other = patch.add_foreign({.key = patch.key({0, 0, 1}, 0)});
  CHECK(patch.add_finer(one) == slot);
  patch.add_face(slot, other, patch.add_own({.key = patch.key({1, 1, 1}, 6)}));
  const Patch out = patch.finish();
  REQUIRE(out.foreign.size() == 2);
  CHECK(vertex_name(out.foreign[0]).at == Int3{130, 128, 192});
  CHECK(vertex_name(out.foreign[1]).at == Int3{64, 128, 194});
  CHECK(out.foreign_finer == std::vector<std::uint8_t>{1, 0});
}

TEST_CASE("patch builder: without names there are none, no borders, and no colours where edges have none",
          "[unit]") {
  PatchBuilder patch(kCorner, 0, false, false);
  patch.start(2, 0);
  const std::uint32_t centre =
      patch.add_centre({3, 4, 5}, 0, {0.5f, 0.25f, 0.5f}, 0xff102030u, VertexClass::kCrease);
  patch.add_face(0, 1, centre, 0b001);
  const std::size_t before = patch.faces();
  patch.add_face(1, 0, centre);
  patch.mark_synthetic(before);
  patch.add_face(0, 1, centre);
  const Patch out = patch.finish();
  CHECK(out.name.empty());
  CHECK(out.border.empty());
  CHECK(out.rgba.empty());
  CHECK(out.position[centre] == Float3{3.5f, 4.25f, 5.5f});
  CHECK(out.vertex_class[centre] == VertexClass::kCrease);
  CHECK(out.synthetic == std::vector<std::uint8_t>{0, 1, 0});
}

TEST_CASE("patch builder: the centre of a cell of the halo belongs to the brick beside it", "[unit]") {
  PatchBuilder patch(kCorner, 0, true, false);
  patch.start(0, 0);
  const std::uint32_t centre = patch.add_centre({-1, 4, 5}, 1, {0.5f, 0.5f, 0.5f}, 0, VertexClass::kCorner);
  REQUIRE((centre & kForeignVertex) != 0);
  patch.add_face(centre, patch.add_own({}), patch.add_own({}));
  const Patch out = patch.finish();
  REQUIRE(out.foreign.size() == 1);
  CHECK(vertex_brick(out.foreign[0]) == Int3{0, 2, 3});
  CHECK(vertex_name(out.foreign[0]).type == 7);
  CHECK(out.foreign_position[0] == Float3{63.5f, 4.5f, 5.5f});
}

TEST_CASE("patch builder: a mean of colours leaves out those that there are not", "[unit]") {
  ColourMean mean;
  CHECK(mean.value() == 0);
  for (const std::uint32_t rgba : {0xff000010u, 0x00ffffffu, 0xff000021u}) mean.add(rgba);
  CHECK(mean.value() == 0xff000019u);
}

}  // namespace patch_builder_test
