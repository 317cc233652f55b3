// The tree of boxes of faces against all boxes one by one, while they change.
#include <catch2/catch.hpp>

#include <set>

#include "kernels/mesh/face_boxes.h"
#include "tests/helpers/random.h"

namespace face_boxes_test {

using namespace tessera;

namespace {

std::array<Double3, 3> some_face(test::Random& random, double size) {
  std::array<Double3, 3> face;
  const Double3 at = {random.in(-3, 5), random.in(0, 1), random.in(10, 20)};
  for (Double3& c : face)
    for (std::size_t a = 0; a < 3; ++a) c[a] = at[a] + random.in(-size, size);
  return face;
}

bool meet(const std::array<Double3, 3>& a, const std::array<Double3, 3>& b) {
  for (std::size_t k = 0; k < 3; ++k)
    if (std::min({a[0][k], a[1][k], a[2][k]}) > std::max({b[0][k], b[1][k], b[2][k]}) ||
        std::min({b[0][k], b[1][k], b[2][k]}) > std::max({a[0][k], a[1][k], a[2][k]}))
      return false;
  return true;
}

}  // namespace

TEST_CASE("face boxes: all that meet are found, as they change and go", "[property]") {
  test::Random random(7);
  const std::size_t count = GENERATE(1u, 8u, 9u, 700u);
  FaceBoxes tree({-4, -1, 9}, {6, 2, 21});
  std::vector<std::array<Double3, 3>> faces;
  std::vector<FaceBoxes::Box> boxes;
  for (std::size_t f = 0; f < count; ++f) {
    faces.push_back(some_face(random, 0.3));
    boxes.push_back(tree.box(faces.back()));
  }
  tree.build(boxes, GENERATE(FaceBoxes::Order::kGiven, FaceBoxes::Order::kMorton));
  std::vector<bool> gone(count);
  std::size_t met = 0, missed = 0, extra = 0;
  for (int step = 0; step < 300; ++step) {
    const auto changed = static_cast<std::uint32_t>(random.below(count));
    if (step % 3 == 0) {
      gone[changed] = true;
      tree.set(changed, FaceBoxes::kNothing);
    } else {
      gone[changed] = false;
      faces[changed] = some_face(random, step % 5 == 0 ? 2.0 : 0.2);
      tree.set(changed, tree.box(faces[changed]));
    }
    const std::array<Double3, 3>& face = faces[changed];
    CHECK(FaceBoxes::around(tree.steps(face[0]), tree.steps(face[1]), tree.steps(face[2])) == tree.box(face));
    // Now and then all of space, which those that are gone must not meet either.
    const std::array<Double3, 3> probe = step % 10 == 0
                                             ? std::array<Double3, 3>{{{-9, -9, 0}, {9, 9, 30}, {0, 0, 0}}}
                                             : some_face(random, 0.5);
    std::set<std::uint32_t> found;
    tree.for_meeting(tree.box(probe), [&](std::uint32_t f) {
      CHECK(found.insert(f).second);
      return true;
    });
    for (std::uint32_t f = 0; f < count; ++f) {
      const bool meets = !gone[f] && meet(faces[f], probe);
      met += meets;
      missed += meets && found.count(f) == 0;
      extra += found.count(f) != 0 && gone[f];
      if (!gone[f]) CHECK((found.count(f) != 0) == tree.box(faces[f]).meets(tree.box(probe)));
    }
  }
  CHECK(met > 20);
  CHECK(missed == 0);
  CHECK(extra == 0);
}

TEST_CASE("face boxes: no face, and a range without a width", "[unit]") {
  FaceBoxes none({0, 0, 0}, {1, 1, 1});
  none.build({});
  none.for_meeting(none.box(std::array<Double3, 1>{{{0.5, 0.5, 0.5}}}), [](std::uint32_t) {
    FAIL();
    return true;
  });
  FaceBoxes flat({0, 0, 2}, {1, 1, 2});
  const std::array<Double3, 3> face = {{{0, 0, 2}, {1, 0, 2}, {0, 1, 2}}};
  flat.build(std::array<FaceBoxes::Box, 1>{flat.box(face)});
  int found = 0;
  flat.for_meeting(flat.box(face), [&](std::uint32_t) { return ++found > 0; });
  CHECK(found == 1);
}

}  // namespace face_boxes_test
