#include "stream/check/compared_before.h"

#include <algorithm>
#include <utility>

namespace tessera {
namespace {

std::array<double, 6> name_of(const MeshBox& box) {
  return {box.low[0], box.low[1], box.low[2], box.high[0], box.high[1], box.high[2]};
}

}  // namespace

ComparedBefore::ComparedBefore(MeshStore before, const MeshStore& reference, double max_distance,
                               std::uint64_t cell_faces)
    : before_(std::move(before)), max_distance_(max_distance), reference_diagonal_(reference.diagonal()) {
  const std::vector<CompareCell> cells = make_compare_cells(before_, reference, max_distance, cell_faces);
  cells_ = cells.size();
  for (std::size_t c = 0; c < cells_; ++c)
    by_box_.emplace(name_of(cells[c].box), static_cast<std::int64_t>(c));
}

std::int64_t ComparedBefore::same(const MeshStore& now, const MeshBox& cell) const {
  const auto found = by_box_.find(name_of(cell));
  if (found == by_box_.end()) return -1;
  // Areas are counted in units of the larger diagonal.
  if (std::max(before_.diagonal(), reference_diagonal_) != std::max(now.diagonal(), reference_diagonal_))
    return -1;
  const MeshBox near = grown(cell, kCompareHalo * max_distance_);
  const std::vector<std::size_t> then = before_.select(near), here = now.select(near);
  const auto equal = [&](std::size_t a, std::size_t b) {
    const MeshPatchEntry &x = before_.patches()[a], &y = now.patches()[b];
    return x.key == y.key && x.vertex_hash == y.vertex_hash && x.face_hash == y.face_hash;
  };
  return std::equal(then.begin(), then.end(), here.begin(), here.end(), equal) ? found->second : -1;
}

}  // namespace tessera
