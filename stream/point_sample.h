/// \file point_sample.h
/// Samples of a stream of points that do not depend on its order: what has the smallest hashes is kept.
/// Bounded memory in every task; the samples of tasks merge to the sample of the whole.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <unordered_set>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

struct HashedPoint {
  std::uint64_t hash = 0;
  Double3 p{};
};

/// The `limit` different points with the smallest hashes of their coordinates.
class PointSampler {
 public:
  explicit PointSampler(std::size_t limit) : limit_(limit) {}
  void add(const Double3& p);
  /// By hash, no position twice. The sampler is spent.
  std::vector<Double3> take();

 private:
  void shrink();
  std::size_t limit_;
  std::uint64_t threshold_ = ~std::uint64_t{0};
  std::vector<HashedPoint> held_;
};

/// All points of the cells (edge `size`, aligned to zero) with the smallest hashes, as many cells as hold at
/// most `limit` points together. A cell with more than an eighth of the limit counts as an eighth and is left
/// out.
class CellSampler {
 public:
  CellSampler(double size, std::size_t limit) : size_(size), limit_(limit) {}

  using CellIndex = std::array<std::int64_t, 3>;
  /// \pre coordinates below 2^52 cells
  CellIndex cell_of(const Double3& p) const;
  static std::uint64_t hash_of(const CellIndex& cell);
  void add(const Double3& p) { add(p, hash_of(cell_of(p))); }
  /// For callers that know the hash of the point's cell.
  void add(const Double3& p, std::uint64_t hash) {
    if (hash > threshold_) return;
    held_.push_back({hash, p});
    if (held_.size() >= 2 * limit_) shrink();
  }

  struct Cell {
    Double3 min{};
    std::vector<Double3> points;  ///< ascending coordinates, no position twice
  };
  double size() const { return size_; }
  /// By hash. The sampler is spent.
  std::vector<Cell> take();

  void save(const std::filesystem::path& file);
  /// Adds what another sampler of the same size and limit saved.
  void merge(const std::filesystem::path& file);
  static std::uint64_t bytes(std::size_t limit) { return 2 * limit * sizeof(HashedPoint) * 2; }

 private:
  void shrink();
  double size_;
  std::size_t limit_;
  std::uint64_t threshold_ = ~std::uint64_t{0};
  std::vector<HashedPoint> held_;
  std::unordered_set<std::uint64_t> crowded_;  ///< hashes of cells over the eighth; looked up, never walked
};

}  // namespace tessera
