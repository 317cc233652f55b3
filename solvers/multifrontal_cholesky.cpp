#include "solvers/multifrontal_cholesky.h"

#include <algorithm>
#include <cassert>
#include <memory>

#include "octree/error.h"
#include "solvers/cholmod_view.h"
#include "solvers/dense_front.h"
#include "solvers/single_thread.h"

namespace tessera {
namespace {

// A pivot this small beside the diagonal it came from is what rounding leaves of zero.
constexpr double kSmallestPivot = 1e-14;

/// Entries of the lower triangle, by columns.
constexpr std::size_t triangle(std::size_t size) {
  return size * (size + 1) / 2;
}

/// CHOLMOD's analysis of a pattern.
class Analysis {
 public:
  explicit Analysis(const SparseMatrix& a) {
    const SingleThread single;
    cholmod_start(&common_);
    common_.print = 0;
    common_.supernodal = CHOLMOD_SUPERNODAL;
    common_.nmethods = 1;
    common_.method[0].ordering = CHOLMOD_AMD;
    common_.postorder = 1;
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

}  // namespace

MultifrontalCholesky::MultifrontalCholesky(const SparseMatrix& a) {
  const Analysis analysis(a);
  const cholmod_factor* f = analysis.factor();
  if (f == nullptr)
    throw ResourceError("no Cholesky factor of " + std::to_string(a.rows) +
                        " unknowns: out of memory, or it has more than 2^31 entries");
  flops_ = analysis.flops();
  const auto* permutation = static_cast<const std::int32_t*>(f->Perm);
  unknown_.assign(permutation, permutation + a.rows);
  place_.resize(unknown_.size());
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    place_[static_cast<std::size_t>(unknown_[i])] = static_cast<std::int32_t>(i);
  const auto* super = static_cast<const std::int32_t*>(f->super);
  const auto* pi = static_cast<const std::int32_t*>(f->pi);
  const auto* s = static_cast<const std::int32_t*>(f->s);
  rows_start_.assign(pi, pi + f->nsuper + 1);
  rows_.assign(s, s + rows_start_.back());
  std::vector<std::size_t> front_of(unknown_.size());
  fronts_.resize(f->nsuper);
  for (std::size_t k = 0; k < fronts_.size(); ++k) {
    fronts_[k] = {super[k], super[k + 1] - super[k], 0};
    std::fill(front_of.begin() + super[k], front_of.begin() + super[k + 1], k);
  }
  for (std::size_t k = 0; k < fronts_.size(); ++k)
    if (rest(k) > 0)
      ++fronts_[front_of[static_cast<std::size_t>(rows(k)[static_cast<std::size_t>(fronts_[k].eliminated)])]]
            .children;
  measure();
}

/// What the fronts take, one after the other.
void MultifrontalCholesky::measure() {
  first_.assign(1, 0);
  std::vector<std::size_t> waiting;
  std::size_t stack = 0;
  for (std::size_t k = 0; k < fronts_.size(); ++k) {
    const std::size_t columns = trapezoid_entries(size(k), static_cast<std::size_t>(fronts_[k].eliminated));
    first_.push_back(first_.back() + columns);
    largest_ = std::max(largest_, size(k));
    largest_columns_ = std::max(largest_columns_, columns);
    assert(waiting.size() >= static_cast<std::size_t>(fronts_[k].children));
    for (std::int32_t child = 0; child < fronts_[k].children; ++child) {
      stack -= triangle(rest(waiting.back()));
      waiting.pop_back();
    }
    if (rest(k) == 0) continue;
    waiting.push_back(k);
    stack += triangle(rest(k));
    stack_ = std::max(stack_, stack);
  }
  assert(waiting.empty());
}

std::uint64_t MultifrontalCholesky::bytes() const {
  return sizeof(std::int32_t) * (unknown_.size() + place_.size() + rows_.size()) +
         (sizeof(Front) + sizeof(std::size_t) + sizeof(std::uint64_t)) * fronts_.size();
}

std::uint64_t MultifrontalCholesky::factor_bytes() const {
  return sizeof(double) * (stack_ + largest_ * largest_ + largest_) + eliminate_bytes(largest_) +
         sizeof(std::int32_t) * unknown_.size();
}

std::uint64_t MultifrontalCholesky::solve_bytes(int width) const {
  return sizeof(double) * (largest_columns_ + static_cast<std::size_t>(width) * (unknown_.size() + largest_));
}

/// The entries of the matrix in the columns that the front eliminates. \param place  of each row of the front in it
void MultifrontalCholesky::assemble(const SparseMatrix& a, std::size_t front, std::span<double> value,
                                    std::vector<std::int32_t>& place) const {
  const std::span<const std::int32_t> rows = this->rows(front);
  for (std::size_t i = 0; i < rows.size(); ++i)
    place[static_cast<std::size_t>(rows[i])] = static_cast<std::int32_t>(i);
  for (std::int32_t j = 0; j < fronts_[front].eliminated; ++j) {
    const auto unknown = static_cast<std::size_t>(unknown_[static_cast<std::size_t>(rows[j])]);
    double* column = value.data() + static_cast<std::size_t>(j) * rows.size();
    for (std::int32_t e = a.start[unknown]; e < a.start[unknown + 1]; ++e) {
      const std::int32_t row = place_[static_cast<std::size_t>(a.column[e])];
      if (row >= rows[j]) column[place[static_cast<std::size_t>(row)]] = a.value[e];
    }
  }
}

/// What a child leaves: a lower triangle by columns.
void MultifrontalCholesky::add_rest(std::size_t child, std::span<const double> rest, std::span<double> value,
                                    std::size_t size, const std::vector<std::int32_t>& place) const {
  const auto rows = this->rows(child).subspan(static_cast<std::size_t>(fronts_[child].eliminated));
  const double* from = rest.data();
  for (std::size_t j = 0; j < rows.size(); ++j) {
    double* column = value.data() + static_cast<std::size_t>(place[static_cast<std::size_t>(rows[j])]) * size;
    for (std::size_t i = j; i < rows.size(); ++i) column[place[static_cast<std::size_t>(rows[i])]] += *from++;
  }
}

std::int64_t MultifrontalCholesky::factor(const SparseMatrix& a, FactorStore& store) const {
  assert(store.size() == 0 && a.rows == static_cast<std::int32_t>(unknown_.size()));
  std::vector<double> value(largest_ * largest_), stack, packed, smallest;
  store.reserve(entries());
  stack.reserve(stack_);
  std::vector<std::int32_t> place(unknown_.size());
  std::vector<std::size_t> waiting;
  for (std::size_t k = 0; k < fronts_.size(); ++k) {
    const auto eliminated = static_cast<std::size_t>(fronts_[k].eliminated);
    DenseFront front{std::span(value).first(size(k) * size(k)), size(k), eliminated};
    std::fill(front.value.begin(), front.value.end(), 0.0);
    assemble(a, k, front.value, place);
    smallest.clear();
    for (std::size_t j = 0; j < eliminated; ++j) smallest.push_back(kSmallestPivot * front.column(j)[j]);
    for (std::int32_t child = 0; child < fronts_[k].children; ++child) {
      const std::size_t entries = triangle(rest(waiting.back()));
      add_rest(waiting.back(), std::span(stack).last(entries), front.value, front.size, place);
      stack.resize(stack.size() - entries);
      waiting.pop_back();
    }
    if (const std::ptrdiff_t bad = eliminate(front, smallest, packed); bad >= 0)
      return unknown_[static_cast<std::size_t>(fronts_[k].column + bad)];
    for (std::size_t j = 0; j < eliminated; ++j) store.append({front.column(j) + j, front.size - j});
    if (rest(k) == 0) continue;
    for (std::size_t j = eliminated; j < front.size; ++j)
      stack.insert(stack.end(), front.column(j) + j, front.column(j) + front.size);
    waiting.push_back(k);
  }
  return -1;
}

void MultifrontalCholesky::solve(FactorStore& store, std::span<double> b, int width) const {
  assert(store.size() == entries());
  const auto w = static_cast<std::size_t>(width);
  std::vector<double> room(largest_columns_), part(largest_ * w), x(b.size());
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    std::copy_n(b.data() + static_cast<std::size_t>(unknown_[i]) * w, w, x.data() + i * w);
  const auto with_front = [&](std::size_t k, const auto& solve) {
    const std::span<const std::int32_t> rows = this->rows(k);
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t c = 0; c < w; ++c)
        part[c * rows.size() + i] = x[static_cast<std::size_t>(rows[i]) * w + c];
    const std::span<const double> columns =
        store.read(first_[k], std::span(room).first(first_[k + 1] - first_[k]));
    solve(FrontColumns{columns, rows.size(), static_cast<std::size_t>(fronts_[k].eliminated)},
          std::span(part).first(rows.size() * w), width);
    for (std::size_t i = 0; i < rows.size(); ++i)
      for (std::size_t c = 0; c < w; ++c)
        x[static_cast<std::size_t>(rows[i]) * w + c] = part[c * rows.size() + i];
  };
  for (std::size_t k = 0; k < fronts_.size(); ++k) with_front(k, solve_forward);
  for (std::size_t k = fronts_.size(); k-- > 0;) with_front(k, solve_backward);
  for (std::size_t i = 0; i < unknown_.size(); ++i)
    std::copy_n(x.data() + i * w, w, b.data() + static_cast<std::size_t>(unknown_[i]) * w);
}

}  // namespace tessera
