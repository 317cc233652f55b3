/// \file union_find.h
/// Disjoint sets over 0..n-1, plain and with a sign between members.
#pragma once
#include <cstdint>
#include <numeric>
#include <utility>
#include <vector>

namespace tessera {

/// The root of a set is its smallest member, so results never depend on call order.
template <class Index>
class DisjointSets {
 public:
  DisjointSets() = default;
  explicit DisjointSets(std::size_t n) { reset(n); }
  void reset(std::size_t n) {
    parent_.resize(n);
    std::iota(parent_.begin(), parent_.end(), Index{0});
  }
  /// Room for n members without moving; pages that are not used cost no memory.
  void reserve(std::size_t n) { parent_.reserve(n); }
  /// Adds a set of one and returns it.
  Index add() {
    parent_.push_back(static_cast<Index>(parent_.size()));
    return parent_.back();
  }
  Index find(Index i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void unite(Index i, Index j) {
    i = find(i);
    j = find(j);
    if (i < j) {
      parent_[j] = i;
    } else {
      parent_[i] = j;
    }
  }
  [[nodiscard]] std::size_t size() const { return parent_.size(); }
  /// The root of every member: parents come before their children, so one ascending sweep does.
  const std::vector<Index>& roots() {
    for (Index& p : parent_) p = parent_[p];
    return parent_;
  }

 private:
  std::vector<Index> parent_;
};

using UnionFind = DisjointSets<std::uint32_t>;

/// Sets whose members carry a sign, +1 or -1, against their root. Who becomes root, the caller says.
class SignedUnionFind {
 public:
  struct SignedRoot {
    std::uint32_t root;
    int sign;  ///< against the root
  };
  explicit SignedUnionFind(std::size_t n) : parent_(n), sign_(n, 1) {
    std::iota(parent_.begin(), parent_.end(), 0u);
  }
  /// Makes it a set of one again. \pre so does every member of its set
  void isolate(std::uint32_t i) { parent_[i] = i, sign_[i] = 1; }
  SignedRoot find(std::uint32_t i) {
    int sign = 1;
    while (parent_[i] != i) {  // halving the path as it goes
      sign_[i] = static_cast<std::int8_t>(sign_[i] * sign_[parent_[i]]);
      parent_[i] = parent_[parent_[i]];
      sign *= sign_[i];
      i = parent_[i];
    }
    return {i, sign};
  }
  /// Hangs root `lower` below root `upper`. \param sign  between the two
  void hang(std::uint32_t lower, std::uint32_t upper, int sign) {
    parent_[lower] = upper;
    sign_[lower] = static_cast<std::int8_t>(sign);
  }

 private:
  std::vector<std::uint32_t> parent_;
  std::vector<std::int8_t> sign_;
};

}  // namespace tessera
