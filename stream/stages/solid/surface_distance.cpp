#include "stream/stages/solid/surface_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/solid/offset_field.h"
#include "octree/box_levels.h"

namespace tessera {
namespace {

constexpr double kBoxMargin = 1e-5;  ///< cells: positions are rounded to 2^-20

}  // namespace

PatchTree::PatchTree(const MeshStore& mesh, const Lattice& lattice) : mesh_(mesh), lattice_(lattice) {
  std::vector<Box> boxes;
  for (std::size_t p = 0; p < mesh.patches().size(); ++p) {
    const MeshBox& box = mesh.patches()[p].box;
    Box& made = boxes.emplace_back();
    for (std::size_t a = 0; a < 3; ++a) {
      const double origin = static_cast<double>(lattice.origin_brick[a] * kBrickCells);
      made.low[a] = box.low[a] / lattice.h - origin - kBoxMargin;
      made.high[a] = box.high[a] / lattice.h - origin + kBoxMargin;
    }
    largest_ = std::max(largest_, patch_bytes(p));
    all_ += patch_bytes(p);
  }
  levels_ = box_levels(std::move(boxes), kChildren);
}

std::uint64_t PatchTree::patch_bytes(std::size_t patch) const {
  const MeshPatchEntry& e = mesh_.patches()[patch];
  return patch_bytes(e.vertices, e.faces);
}

std::uint64_t PatchTree::patch_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return MeshStore::block_bytes(vertices, faces) + faces * ClosestFaces::bytes_per_face() + 16'384;
}

std::uint64_t PatchTree::bytes() const {
  std::uint64_t sum = 0;
  for (const std::vector<Box>& level : levels_) sum += level.capacity() * sizeof(Box);
  return sum;
}

SurfaceDistance::SurfaceDistance(const PatchTree& tree, const RowSigns& signs, std::uint64_t kept_bytes)
    : tree_(tree), signs_(signs), kept_bytes_(kept_bytes) {}

SurfaceDistance::Patch& SurfaceDistance::patch(std::size_t number) {
  if (const auto found = where_.find(number); found != where_.end()) {
    kept_.splice(kept_.begin(), kept_, found->second);
    return kept_.front();
  }
  const std::uint64_t bytes = tree_.patch_bytes(number);
  while (!kept_.empty() && used_bytes_ + bytes > kept_bytes_) {
    used_bytes_ -= kept_.back().bytes;
    where_.erase(kept_.back().number);
    kept_.pop_back();
  }
  MeshBlock block = tree_.mesh().load({&number, 1});
  const Int3 brick = brick_of_key(tree_.mesh().patches()[number].key);
  const Int3 corner = {brick[0] * kBrickCells, brick[1] * kBrickCells, brick[2] * kBrickCells};
  quantise_cells(tree_.lattice(), corner, block);
  Patch& made = kept_.emplace_front();
  made.number = number;
  for (std::size_t a = 0; a < 3; ++a) made.corner[a] = corner[a];
  made.faces = ClosestFaces(block.position, block.faces, {0, 0, 0});
  made.bytes = bytes;
  used_bytes_ += bytes;
  where_[number] = kept_.begin();
  return made;
}

double SurfaceDistance::away(const Double3& p) {
  double best = std::numeric_limits<double>::infinity();
  const auto query = [&](std::size_t number) {
    Patch& near = patch(number);
    const ClosestFaces::Hit hit = near.faces.closest(p - near.corner, best, near.hint);
    if (hit.slot == ClosestFaces::kNone || !(hit.square < best)) return;
    best = hit.square;
    near.hint = hit.slot;
    last_patch_ = number;
  };
  if (tree_.levels_[0].empty()) return best;
  const std::size_t first = last_patch_;
  query(first);
  visit_nearest_boxes(
      tree_.levels_, PatchTree::kChildren, [&](const PatchTree::Box& box) { return square_to_box(box, p); },
      [&](double bound) { return bound < best; },
      [&](std::size_t number) {
        if (number != first) query(number);
      });
  return std::sqrt(best);
}

double SurfaceDistance::at(const Int3& node) {
  const double far =
      away({static_cast<double>(node[0]), static_cast<double>(node[1]), static_cast<double>(node[2])});
  return inside(node) ? -far : far;
}

}  // namespace tessera
