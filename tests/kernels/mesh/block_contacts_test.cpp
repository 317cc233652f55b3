#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <tuple>
#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"
#include "tests/helpers/random.h"

namespace tessera::block_contacts_test {
namespace {

using Pair = std::tuple<std::uint32_t, std::uint32_t, FaceContact>;
constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr ContactCell kAll{{-kInfinity, -kInfinity, -kInfinity}, {kInfinity, kInfinity, kInfinity}};

/// Small faces strewn in a cube of 30, some of which share corners, on whole and other numbers.
std::vector<ContactFace> strewn_faces(std::size_t count, std::uint64_t seed) {
  test::Random random(seed);
  std::vector<ContactFace> faces;
  while (faces.size() < count) {
    ContactFace f;
    Double3 middle;
    for (double& x : middle) x = static_cast<double>(random.below(30));
    for (std::size_t c = 0; c < 3; ++c) {
      f.vertex[c] = 3 * faces.size() + c;
      for (std::size_t k = 0; k < 3; ++k)
        f.corner[c][k] = middle[k] + static_cast<double>(random.below(6)) * 0.7;
    }
    if (!faces.empty() && random.below(2)) {
      const ContactFace& other = faces[random.below(faces.size())];
      f.vertex[1] = other.vertex[2], f.corner[1] = other.corner[2];
    }
    if (!collinear(f.corner[0], f.corner[1], f.corner[2])) faces.push_back(f);
  }
  return faces;
}

std::vector<Pair> found(const std::vector<ContactFace>& faces, const ContactCell& cell) {
  std::vector<Pair> pairs;
  block_contacts(faces, cell,
                 [&](std::uint32_t i, std::uint32_t j, FaceContact c) { pairs.emplace_back(i, j, c); });
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

std::vector<Pair> all_pairs(const std::vector<ContactFace>& faces) {
  std::vector<Pair> pairs;
  for (std::uint32_t i = 0; i < faces.size(); ++i)
    for (std::uint32_t j = i + 1; j < faces.size(); ++j)
      if (const FaceContact c = face_contact(faces[i], faces[j]); c != FaceContact::kNone)
        pairs.emplace_back(i, j, c);
  return pairs;
}

TEST_CASE("block contacts: the same pairs as when every face is asked about every other", "[unit]") {
  for (const std::size_t count : {2u, 7u, 8u, 9u, 65u, 1500u}) {
    const std::vector<ContactFace> faces = strewn_faces(count, count);
    const std::vector<Pair> all = all_pairs(faces);
    if (count == 1500) REQUIRE(all.size() > 300);
    CHECK(found(faces, kAll) == all);
  }
}

TEST_CASE("block contacts: far from the origin the same pairs", "[unit]") {
  std::vector<ContactFace> faces = strewn_faces(1500, 3);
  for (ContactFace& f : faces)
    for (Double3& p : f.corner)
      for (double& x : p) x = 0x1p-20 * static_cast<double>(static_cast<std::int64_t>(x * 0x1p20));
  const std::vector<Pair> near = found(faces, kAll);
  REQUIRE(near.size() > 300);
  for (ContactFace& f : faces)
    for (Double3& p : f.corner) p = p + Double3{4.5e6, -6378137.0, 100.0};
  CHECK(found(faces, kAll) == near);
}

TEST_CASE("block contacts: cells that tile space tell every pair once, whatever each is given beside",
          "[unit]") {
  const std::vector<ContactFace> faces = strewn_faces(1500, 11);
  std::vector<Pair> sum;
  const std::array<double, 5> cuts = {-kInfinity, 7.0, 7.7, 19.0, kInfinity};  // on corners
  for (std::size_t x = 0; x < 4; ++x)
    for (std::size_t y = 0; y < 4; ++y)
      for (std::size_t z = 0; z < 4; ++z) {
        const ContactCell cell{{cuts[x], cuts[y], cuts[z]}, {cuts[x + 1], cuts[y + 1], cuts[z + 1]}};
        const std::vector<Pair> part = found(faces, cell);
        sum.insert(sum.end(), part.begin(), part.end());
      }
  std::sort(sum.begin(), sum.end());
  CHECK(sum == found(faces, kAll));
}

/// A sheet of n x n squares over a plane, in two triangles each, corners bent by up to `rough` and turned so that any axis may see it.
MeshBlock sheet(std::size_t n, double rough, std::size_t axis, bool flipped, std::uint64_t seed) {
  test::Random random(seed);
  MeshBlock block;
  for (std::size_t y = 0; y <= n; ++y)
    for (std::size_t x = 0; x <= n; ++x) {
      Double3 p;
      p[axis] = random.in(-rough, rough);
      p[(axis + 1) % 3] = static_cast<double>(x) + 0.3 * random.in(-rough, rough);
      p[(axis + 2) % 3] = static_cast<double>(y) + 0.3 * random.in(-rough, rough);
      block.position.push_back(p);
    }
  const auto at = [&](std::size_t x, std::size_t y) { return static_cast<std::uint32_t>(y * (n + 1) + x); };
  for (std::size_t y = 0; y < n; ++y)
    for (std::size_t x = 0; x < n; ++x) {
      block.faces.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
      block.faces.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
    }
  if (flipped)
    for (auto& f : block.faces) std::swap(f[1], f[2]);
  return block;
}

std::vector<Pair> found_any(const std::vector<ContactFace>& faces) {
  std::vector<Pair> pairs;
  const auto use = [&](std::uint32_t i, std::uint32_t j, FaceContact c) { pairs.emplace_back(i, j, c); };
  block_contacts(faces, kAll, use, ContactOrder::kAny);
  std::sort(pairs.begin(), pairs.end());
  return pairs;
}

/// Of a block whose borders are marked, all of it and a part: the pairs of core_contacts() against all pairs.
void check_core(MeshBlock block) {
  block.face_flags.assign(block.faces.size(), 0);
  for (std::size_t f = 0; f < block.faces.size(); ++f)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = block.faces[f][k], b = block.faces[f][(k + 1) % 3];
      const bool shared = std::any_of(block.faces.begin(), block.faces.end(), [&](const auto& g) {
        return (g[0] == b && g[1] == a) || (g[1] == b && g[2] == a) || (g[2] == b && g[0] == a);
      });
      if (!shared) block.face_flags[f] = static_cast<std::uint8_t>(block.face_flags[f] | 1u << k);
    }
  for (const std::size_t first : {std::size_t{0}, block.faces.size() / 3}) {
    std::vector<std::uint8_t> core(block.faces.size(), 1);
    std::fill_n(core.begin(), first, std::uint8_t{0});
    std::vector<std::uint32_t> number;
    const std::vector<ContactFace> faces = contact_faces(block, &number);
    std::size_t expected = 0, pairs = 0;
    for (const auto& [i, j, contact] : all_pairs(faces))
      expected += core[number[i]] != 0 && core[number[j]] != 0 && !meet_in_copies(faces[i], faces[j]);
    core_contacts(block, core, [&](const ContactFace& one, const ContactFace& other) {
      CHECK(face_contact(one, other) != FaceContact::kNone);
      ++pairs;
    });
    CHECK(pairs == expected);
  }
}

/// Against all pairs, however it is asked. \returns how many
std::size_t check_block(const MeshBlock& block) {
  std::vector<std::uint32_t> number, every;
  const std::vector<ContactFace> faces = contact_faces(block, &every);
  const std::vector<Pair> all = all_pairs(faces);
  CHECK(found(faces, kAll) == all);
  CHECK(found_any(faces) == all);
  CHECK(count_contacts(block) ==
        static_cast<std::size_t>(std::count_if(all.begin(), all.end(), [&](const Pair& p) {
          return !meet_in_copies(faces[std::get<0>(p)], faces[std::get<1>(p)]);
        })));
  const std::vector<ContactFace> some = doubtful_faces(block, &number);
  REQUIRE(some.size() == number.size());
  for (const Pair& p : all)
    for (const std::uint32_t f : {every[std::get<0>(p)], every[std::get<1>(p)]})
      CHECK(std::binary_search(number.begin(), number.end(), f));
  check_core(block);
  return all.size();
}

TEST_CASE("block contacts: of one sheet over a plane only faces at its border are in doubt", "[unit]") {
  const std::size_t axis = GENERATE(0u, 1u, 2u);
  const bool flipped = GENERATE(false, true);
  const MeshBlock block = sheet(30, 0.4, axis, flipped, 5);
  CHECK(check_block(block) == 0);
  CHECK(doubtful_faces(block).size() < block.faces.size() / 2);
  CHECK(doubtful_faces(block).size() >= 4 * 30 - 4);
}

TEST_CASE("block contacts: sheets that fold, lie over themselves, branch or come apart are seen", "[unit]") {
  const std::size_t n = 30;
  SECTION("folds") {
    MeshBlock block = sheet(n, 0.3, 2, false, 6);
    for (const std::size_t v : {200u, 411u, 700u})
      block.position[v] = block.position[v] + Double3{1.7, 0.4, 0.1};
    CHECK(check_block(block) > 0);
  }
  SECTION("a spike through a face beside it") {
    MeshBlock block = sheet(n, 0.1, 2, false, 7);
    block.position[15 * (n + 1) + 15] = {18.4, 15.3, 0.0};
    CHECK(check_block(block) > 0);
  }
  SECTION("a second sheet through the first, every face looking the same way") {
    MeshBlock block = sheet(n, 0.1, 2, false, 8);
    const MeshBlock other = sheet(6, 0.1, 2, false, 9);
    const auto first = static_cast<std::uint32_t>(block.position.size());
    for (const Double3& p : other.position)
      block.position.push_back(p + Double3{12.3, 11.4, 0.05 * p[0] - 0.1});
    for (const auto& f : other.faces) block.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
    CHECK(check_block(block) > 0);
  }
  SECTION("a ramp twice around an axis, closed on itself at the wrong end") {
    // Two turns with one border inside and one outside: every face looks up, all of it is covered twice.
    MeshBlock block;
    const std::size_t around = 80, rings = 12;
    for (std::size_t a = 0; a <= around; ++a)
      for (std::size_t r = 0; r <= rings; ++r) {
        const double angle = 4.0 * 3.14159265358979 * static_cast<double>(a) / static_cast<double>(around);
        const double radius = 1.0 + static_cast<double>(r);
        // The second turn comes down through the first.
        const double height = a <= around / 2 ? 0.05 * static_cast<double>(a)
                                              : 2.0 - 0.07 * static_cast<double>(a - around / 2);
        block.position.push_back({radius * std::cos(angle), radius * std::sin(angle), height});
      }
    const auto at = [&](std::size_t a, std::size_t r) {
      return static_cast<std::uint32_t>(a * (rings + 1) + r);
    };
    for (std::size_t a = 0; a < around; ++a)
      for (std::size_t r = 0; r < rings; ++r) {
        block.faces.push_back({at(a, r), at(a, r + 1), at(a + 1, r + 1)});
        block.faces.push_back({at(a, r), at(a + 1, r + 1), at(a + 1, r)});
      }
    CHECK(check_block(block) > 0);
  }
  SECTION("a cone twice around its tip") {
    MeshBlock block;
    const std::size_t around = 64, rings = 10;
    block.position.push_back({0, 0, 0});
    for (std::size_t a = 0; a < around; ++a)
      for (std::size_t r = 1; r <= rings; ++r) {
        const double angle = 4.0 * 3.14159265358979 * static_cast<double>(a) / static_cast<double>(around);
        block.position.push_back({static_cast<double>(r) * std::cos(angle),
                                  static_cast<double>(r) * std::sin(angle),
                                  0.3 * static_cast<double>(r) * std::cos(angle / 2.0)});
      }
    const auto at = [&](std::size_t a, std::size_t r) {
      return r == 0 ? 0u : static_cast<std::uint32_t>((a % around) * rings + r);
    };
    for (std::size_t a = 0; a < around; ++a)
      for (std::size_t r = 0; r < rings; ++r) {
        block.faces.push_back({at(a, r), at(a, r + 1), at(a + 1, r + 1)});
        if (r > 0) block.faces.push_back({at(a, r), at(a + 1, r + 1), at(a + 1, r)});
      }
    CHECK(check_block(block) > 0);
  }
  SECTION("a slit whose sides lie over each other") {
    MeshBlock block = sheet(n, 0.1, 2, false, 10);
    // The faces on one side of a line get corners of their own, a little beyond it.
    std::vector<std::uint32_t> copy(block.position.size(), 0);
    const std::size_t given = block.faces.size();
    for (std::size_t i = 0; i < given; ++i)
      for (std::uint32_t& v : block.faces[i]) {
        if (i / (2 * n) < 15 || v / (n + 1) != 15) continue;
        if (copy[v] == 0) {
          copy[v] = static_cast<std::uint32_t>(block.position.size());
          block.position.push_back(block.position[v] + Double3{0.05, -0.2, 0.0});
        }
        v = copy[v];
      }
    CHECK(check_block(block) > 0);
  }
  SECTION("a face more on an edge, and one the wrong way round") {
    MeshBlock block = sheet(n, 0.1, 2, false, 11);
    block.position.push_back({15.4, 15.5, 1.0});
    block.position.push_back({17.2, 18.1, -0.5});
    block.faces.push_back(
        {15 * (n + 1) + 15, 15 * (n + 1) + 16, static_cast<std::uint32_t>(block.position.size() - 2)});
    block.faces.push_back({15 * (n + 1) + 15, static_cast<std::uint32_t>(block.position.size() - 2),
                           static_cast<std::uint32_t>(block.position.size() - 1)});
    std::swap(block.faces[333][0], block.faces[333][1]);
    CHECK(check_block(block) > 0);
  }
}

TEST_CASE("block contacts: no pairs without two faces", "[unit]") {
  CHECK(found({}, kAll).empty());
  CHECK(found(strewn_faces(1, 1), kAll).empty());
}

}  // namespace
}  // namespace tessera::block_contacts_test
