/// \file point_sample.h
/// Samples of a stream of points that do not depend on its order: what has the smallest hashes is kept.
/// Bounded memory in every task; the samples of tasks merge to the sample of the whole.
#pragma once
#include <array>
#include <cmath>
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
  CellSampler(double size, std::size_t limit) : size_(size), limit_(limit) { held_.reserve(2 * limit); }

  /// \pre coordinates below 2^50 cells
  void add(const Double3& p) {
    const Double3 turned = turn(p);
    const CellIndex cell = cell_of(turned);
    if (cell != last_cell_) {
      last_cell_ = cell;
      last_hash_ = hash_of(cell);
    }
    if (last_hash_ > threshold_) return;
    held_.push_back({last_hash_, turned});
    if (held_.size() >= 2 * limit_) shrink();
  }

  struct Cell {
    Double3 min{};                ///< in the turned frame, as the points
    std::vector<Double3> points;  ///< ascending coordinates, no position twice
  };
  /// By hash. The sampler is spent.
  std::vector<Cell> take();

  void save(const std::filesystem::path& file);
  /// Adds what another sampler of the same size and limit saved.
  void merge(const std::filesystem::path& file);
  /// Memory of a sampler; merging takes half as much again, taking the cells another third.
  static std::uint64_t bytes(std::size_t limit) { return 2 * limit * sizeof(HashedPoint); }

 private:
  using CellIndex = std::array<std::int64_t, 3>;
  /// The rotation of the quaternion (1, 2, 3, 5): every axis has a part of every other.
  static Double3 turn(const Double3& p) {
    return {(-29.0 * p[0] + 2.0 * p[1] + 26.0 * p[2]) / 39.0,
            (22.0 * p[0] - 19.0 * p[1] + 26.0 * p[2]) / 39.0,
            (14.0 * p[0] + 34.0 * p[1] + 13.0 * p[2]) / 39.0};
  }
  CellIndex cell_of(const Double3& turned) const {
    return {static_cast<std::int64_t>(std::floor(turned[0] / size_)),
            static_cast<std::int64_t>(std::floor(turned[1] / size_)),
            static_cast<std::int64_t>(std::floor(turned[2] / size_))};
  }
  static std::uint64_t hash_of(const CellIndex& cell);
  void shrink();
  double size_;
  CellIndex last_cell_ = {0, 0, 0};
  std::uint64_t last_hash_ = hash_of({0, 0, 0});
  std::size_t limit_;
  std::uint64_t threshold_ = ~std::uint64_t{0};
  std::vector<HashedPoint> held_;
  std::unordered_set<std::uint64_t> crowded_;  ///< hashes of cells over the eighth; looked up, never walked
};

}  // namespace tessera
