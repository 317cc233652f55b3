/// \file front_tree.h
/// The fronts of a multifrontal factor: which unknowns each eliminates, which others it touches, whose rest it takes: the
/// supernodes of an elimination (supernodes.h), found in whole numbers alone, so that they are the same on every machine.
/// Sources: Duff, Reid, "The Multifrontal Solution of Indefinite Sparse Symmetric Linear Equations", 1983; Liu, "The
/// Multifrontal Method for Sparse Matrix Solution", 1992.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "solvers/linear_solver.h"

namespace tessera {

class FrontTree {
 public:
  /// Orders and finds the fronts, by the pattern alone. \pre symmetric pattern with a full diagonal
  /// \param ordering  kMinimumDegree or kNestedDissection
  /// \throws ResourceError out of memory or of 32-bit indices
  FrontTree(const SparseMatrix& a, Ordering ordering);

  [[nodiscard]] std::size_t count() const { return fronts_.size(); }  ///< children before parents
  [[nodiscard]] std::size_t unknowns() const { return unknown_.size(); }
  [[nodiscard]] std::size_t size(std::size_t front) const {
    return rows_start_[front + 1] - rows_start_[front];
  }
  [[nodiscard]] std::size_t eliminated(std::size_t front) const { return fronts_[front].eliminated; }
  [[nodiscard]] std::size_t contribution(std::size_t front) const { return size(front) - eliminated(front); }
  /// Fronts before it whose rest it takes, the last on the stack.
  [[nodiscard]] std::size_t children(std::size_t front) const { return fronts_[front].children; }
  /// Places in the order of elimination, ascending; the first ones are eliminated.
  [[nodiscard]] std::span<const std::int32_t> rows(std::size_t front) const {
    return std::span(rows_).subspan(rows_start_[front], size(front));
  }
  [[nodiscard]] std::int32_t unknown(std::int32_t slot) const {
    return unknown_[static_cast<std::size_t>(slot)];
  }
  [[nodiscard]] std::int32_t slot(std::int32_t unknown) const {
    return slot_[static_cast<std::size_t>(unknown)];
  }

  /// Where a front's columns begin in a store of all columns, each from its diagonal down; of count(): the end.
  [[nodiscard]] std::uint64_t first(std::size_t front) const { return first_[front]; }
  double flops() const { return flops_; }                         ///< of a Cholesky factor
  [[nodiscard]] std::size_t largest() const { return largest_; }  ///< rows of a front
  [[nodiscard]] std::size_t largest_columns() const {
    return largest_columns_;
  }  ///< entries of first() of a front
  /// Most numbers that wait on the stack at a time: lower triangles, or whole squares.
  [[nodiscard]] std::size_t stack_of_triangles() const { return triangles_; }
  [[nodiscard]] std::size_t stack_of_squares() const { return squares_; }
  [[nodiscard]] std::uint64_t bytes() const;

  /// b in the order of elimination, and back. Both n x width, interleaved; `to` has `stride` numbers a row.
  void to_order(std::span<const double> b, int width, std::span<double> to, std::size_t stride) const;
  void from_order(std::span<const double> x, std::size_t stride, std::span<double> b, int width) const;

 private:
  struct Front {
    std::uint32_t eliminated = 0, children = 0;
  };
  void measure();

  std::vector<std::int32_t> unknown_;  ///< in the order of elimination
  std::vector<std::int32_t> slot_;     ///< of each unknown in it
  std::vector<Front> fronts_;
  std::vector<std::size_t> rows_start_;
  std::vector<std::int32_t> rows_;
  std::vector<std::uint64_t> first_;
  std::size_t largest_ = 0, largest_columns_ = 0, triangles_ = 0, squares_ = 0;
  double flops_ = 0.0;
};

/// What fronts leave to those above them.
class ContributionStack {
 public:
  /// \param maximum  numbers that wait at a time: stack_of_triangles() or stack_of_squares()
  explicit ContributionStack(std::size_t maximum) { numbers_.reserve(maximum); }

  /// Takes those of the last `children` fronts off, last first. \param use  called with (front, its numbers)
  template <class Use>
  void take(std::size_t children, const Use& use) {
    for (std::size_t child = 0; child < children; ++child) {
      const auto [front, first] = waiting_.back();
      use(front, std::span<const double>(numbers_).subspan(first));
      numbers_.resize(first);
      waiting_.pop_back();
    }
  }
  /// What is appended from now on is of this front.
  void push(std::size_t front) { waiting_.push_back({front, numbers_.size()}); }
  void append(const double* first, const double* last) { numbers_.insert(numbers_.end(), first, last); }

 private:
  struct Contribution {
    std::size_t front, first;
  };
  std::vector<double> numbers_;
  std::vector<Contribution> waiting_;
};

}  // namespace tessera
