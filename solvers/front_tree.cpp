#include "solvers/front_tree.h"

#include <algorithm>
#include <cassert>
#include <utility>

#include "solvers/dense_front.h"
#include "solvers/fill_ordering.h"
#include "solvers/supernodes.h"

namespace tessera {
namespace {

/// Entries of the lower triangle, by columns.
constexpr std::size_t triangle(std::size_t size) {
  return size * (size + 1) / 2;
}

}  // namespace

FrontTree::FrontTree(const SparseMatrix& a, Ordering ordering) {
  const std::vector<std::int32_t> order = fill_ordering(a, ordering);
  EliminationTree tree = elimination_tree(a, order);
  unknown_ = postorder(tree, order);
  slot_.resize(unknown_.size());
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    slot_[static_cast<std::size_t>(unknown_[i])] = static_cast<std::int32_t>(i);
  for (const double count : tree.count) flops_ += count * count;
  Supernodes supernodes = find_supernodes(a, unknown_, tree);
  rows_start_ = std::move(supernodes.start);
  rows_ = std::move(supernodes.rows);
  std::vector<std::size_t> front_of(unknown_.size());
  fronts_.resize(rows_start_.size() - 1);
  for (std::size_t k = 0; k < fronts_.size(); ++k) {
    const std::int32_t first = supernodes.first[k], end = supernodes.first[k + 1];
    fronts_[k].eliminated = static_cast<std::uint32_t>(end - first);
    std::fill(front_of.begin() + first, front_of.begin() + end, k);
  }
  for (std::size_t k = 0; k < fronts_.size(); ++k)
    if (contribution(k) > 0) ++fronts_[front_of[static_cast<std::size_t>(rows(k)[eliminated(k)])]].children;
  measure();
}

/// What the fronts take, one after the other.
void FrontTree::measure() {
  first_.assign(1, 0);
  std::vector<std::size_t> waiting;
  std::size_t triangles = 0, squares = 0;
  for (std::size_t k = 0; k < fronts_.size(); ++k) {
    const std::size_t columns = trapezoid_entries(size(k), eliminated(k));
    first_.push_back(first_.back() + columns);
    largest_ = std::max(largest_, size(k));
    largest_columns_ = std::max(largest_columns_, columns);
    assert(waiting.size() >= children(k));
    for (std::size_t child = 0; child < children(k); ++child) {
      triangles -= triangle(contribution(waiting.back()));
      squares -= contribution(waiting.back()) * contribution(waiting.back());
      waiting.pop_back();
    }
    if (contribution(k) == 0) continue;
    waiting.push_back(k);
    triangles += triangle(contribution(k));
    squares += contribution(k) * contribution(k);
    triangles_ = std::max(triangles_, triangles);
    squares_ = std::max(squares_, squares);
  }
  assert(waiting.empty());
}

std::uint64_t FrontTree::bytes() const {
  return sizeof(std::int32_t) * (unknown_.size() + slot_.size() + rows_.size()) +
         (sizeof(Front) + sizeof(std::size_t) + sizeof(std::uint64_t)) * fronts_.size();
}

void FrontTree::to_order(std::span<const double> b, int width, std::span<double> to,
                         std::size_t stride) const {
  const auto w = static_cast<std::size_t>(width);
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    std::copy_n(b.data() + static_cast<std::size_t>(unknown_[i]) * w, w, to.data() + i * stride);
}

void FrontTree::from_order(std::span<const double> x, std::size_t stride, std::span<double> b,
                           int width) const {
  const auto w = static_cast<std::size_t>(width);
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    std::copy_n(x.data() + i * stride, w, b.data() + static_cast<std::size_t>(unknown_[i]) * w);
}

}  // namespace tessera
