#include "kernels/smooth/flipped_faces.h"

#include <algorithm>
#include <span>

#include "octree/vector.h"

namespace tessera {
namespace {

/// Share of the way to the mean of the neighbours.
constexpr double kStep = 0.7;
/// Vertices around which the mean of unit normals, turned ones left out, is shorter lie on creases, and stay.
constexpr double kFlat = 0.9;

Double3 unit_normal(const std::array<std::uint32_t, 3>& face, std::span<const Double3> position) {
  return unit_or_zero(triangle_normal(position[face[0]], position[face[1]], position[face[2]]));
}

/// What is looked at again after some vertices moved; each thing once.
class Marked {
 public:
  explicit Marked(std::size_t size) : flag_(size, 0) {}
  void add(std::uint32_t i) {
    if (flag_[i] != 0) return;
    flag_[i] = 1;
    list_.push_back(i);
  }
  void clear() {
    for (const std::uint32_t i : list_) flag_[i] = 0;
    list_.clear();
  }
  const std::vector<std::uint32_t>& list() const { return list_; }

 private:
  std::vector<std::uint8_t> flag_;
  std::vector<std::uint32_t> list_;
};

}  // namespace

std::uint64_t count_flipped_faces(const MeshBlock& block) {
  std::vector<Double3> normal, sum(block.position.size(), Double3{});
  normal.reserve(block.faces.size());
  for (const auto& face : block.faces) {
    normal.push_back(unit_normal(face, block.position));
    for (const std::uint32_t v : face) sum[v] = sum[v] + normal.back();
  }
  std::uint64_t count = 0;
  for (std::size_t f = 0; f < block.faces.size(); ++f) {
    const auto& [a, b, c] = block.faces[f];
    count += dot(normal[f], sum[a] + sum[b] + sum[c] - normal[f] * 3.0) < 0.0;
  }
  return count;
}

void unflip_faces(const MeshBlock& block, const FaceCorners& corners, std::vector<Double3>& position) {
  std::vector<Double3> normal, sum(position.size(), Double3{});
  normal.reserve(block.faces.size());
  for (const auto& face : block.faces) {
    normal.push_back(unit_normal(face, position));
    for (const std::uint32_t v : face) sum[v] = sum[v] + normal.back();
  }
  const auto flipped = [&](std::uint32_t f) {
    const auto& [a, b, c] = block.faces[f];
    return dot(normal[f], sum[a] + sum[b] + sum[c] - normal[f] * 3.0) < 0.0;
  };
  const auto around = [&](const Marked& vertices, Marked& faces) {
    for (const std::uint32_t v : vertices.list())
      for (const std::uint32_t corner : corners.at(v)) faces.add(corner >> 2);
  };
  const auto corners_of = [&](const Marked& faces, Marked& vertices) {
    for (const std::uint32_t f : faces.list())
      for (const std::uint32_t v : block.faces[f]) vertices.add(v);
  };
  const auto on_crease = [&](std::uint32_t v) {
    Double3 unflip{};
    double count = 0.0;
    for (const std::uint32_t corner : corners.at(v))
      if (dot(normal[corner >> 2], sum[v]) > 0.0) unflip = unflip + normal[corner >> 2], count += 1.0;
    return dot(unflip, unflip) < kFlat * kFlat * count * count;
  };
  Marked bad(block.faces.size()), near(block.faces.size()), moving(position.size()), touched(position.size());
  for (std::uint32_t f = 0; f < block.faces.size(); ++f)
    if (flipped(f)) bad.add(f);
  std::vector<Double3> next;
  for (int round = 0; round < kUnflipRounds && !bad.list().empty(); ++round) {
    moving.clear();
    corners_of(bad, moving);
    near.clear();
    around(moving, near);
    if (round >= kUnflipPlainRounds) {
      corners_of(near, moving);
      around(moving, near);
    }
    next.clear();
    for (const std::uint32_t v : moving.list()) {
      Double3 delta{};
      if (!on_crease(v))
        for (const std::uint32_t corner : corners.at(v))
          for (const std::uint32_t u : block.faces[corner >> 2]) delta = delta + (position[u] - position[v]);
      next.push_back(position[v] + delta * (kStep / static_cast<double>(2 * corners.at(v).size())));
    }
    for (std::size_t i = 0; i < next.size(); ++i) position[moving.list()[i]] = next[i];
    // The same sums as from the start, in the order of the faces.
    for (const std::uint32_t f : near.list()) normal[f] = unit_normal(block.faces[f], position);
    touched.clear();
    corners_of(near, touched);
    for (const std::uint32_t v : touched.list()) {
      sum[v] = {};
      for (const std::uint32_t corner : corners.at(v)) sum[v] = sum[v] + normal[corner >> 2];
    }
    near.clear();
    around(touched, near);
    bad.clear();
    for (const std::uint32_t f : near.list())
      if (flipped(f)) bad.add(f);
  }
}

}  // namespace tessera
