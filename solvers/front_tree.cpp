#include "solvers/front_tree.h"

#include <algorithm>
#include <cassert>
#include <string>

#include "octree/error.h"
#include "solvers/cholmod_view.h"
#include "solvers/dense_front.h"
#include "solvers/single_thread.h"

namespace tessera {
namespace {

/// CHOLMOD's analysis of a pattern.
class Analysis {
 public:
  Analysis(const SparseMatrix& a, Ordering ordering) {
    const SingleThread single;
    cholmod_start(&common_);
    common_.print = 0;
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.nmethods = 1;
    common_.postorder = 1;
    common_.method[0].ordering = ordering == Ordering::kNestedDissection ? CHOLMOD_METIS : CHOLMOD_AMD;
    cholmod_sparse view = cholmod_view(a);
    factor_ = cholmod_analyze(&view, &common_);
  }
  ~Analysis() {
    cholmod_free_factor(&factor_, &common_);
    cholmod_finish(&common_);
  }
  Analysis(const Analysis&) = delete;
  Analysis& operator=(const Analysis&) = delete;

  const cholmod_factor* factor() const { return factor_; }
  double flops() const { return common_.fl; }

 private:
  cholmod_common common_;
  cholmod_factor* factor_ = nullptr;
};

/// Entries of the lower triangle, by columns.
constexpr std::size_t triangle(std::size_t size) {
  return size * (size + 1) / 2;
}

}  // namespace

FrontTree::FrontTree(const SparseMatrix& a, Ordering ordering) {
  const Analysis analysis(a, ordering);
  const cholmod_factor* f = analysis.factor();
  if (f == nullptr)
    throw ResourceError("no factor of " + std::to_string(a.rows) +
                        " unknowns: out of memory, or it has more than 2^31 entries");
  flops_ = analysis.flops();
  const auto* permutation = static_cast<const std::int32_t*>(f->Perm);
  unknown_.assign(permutation, permutation + a.rows);
  slot_.resize(unknown_.size());
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    slot_[static_cast<std::size_t>(unknown_[i])] = static_cast<std::int32_t>(i);
  const auto* super = static_cast<const std::int32_t*>(f->super);
  const auto* pi = static_cast<const std::int32_t*>(f->pi);
  const auto* s = static_cast<const std::int32_t*>(f->s);
  rows_start_.assign(pi, pi + f->nsuper + 1);
  rows_.assign(s, s + rows_start_.back());
  std::vector<std::size_t> front_of(unknown_.size());
  fronts_.resize(f->nsuper);
  for (std::size_t k = 0; k < fronts_.size(); ++k) {
    fronts_[k].eliminated = static_cast<std::uint32_t>(super[k + 1] - super[k]);
    std::fill(front_of.begin() + super[k], front_of.begin() + super[k + 1], k);
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
