#include <catch2/catch.hpp>

#include <algorithm>
#include <array>
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

TEST_CASE("block contacts: no pairs without two faces", "[unit]") {
  CHECK(found({}, kAll).empty());
  CHECK(found(strewn_faces(1, 1), kAll).empty());
}

}  // namespace
}  // namespace tessera::block_contacts_test
