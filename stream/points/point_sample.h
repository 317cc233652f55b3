/// \file point_sample.h
/// Samples of a stream of points that do not depend on its order: what has the smallest hashes is kept.
/// Bounded memory in every task; the samples of tasks merge to the sample of the whole.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <span>
#include <unordered_set>
#include <vector>

#include "octree/lattice.h"
#include "octree/portable_math.h"
#include "stream/files/packed_file.h"

namespace tessera {

struct HashedPoint {
  std::uint64_t hash = 0;
  Double3 p{};
};

/// The cell of a lattice through zero that a point lies in. \param per_unit  cells a unit
inline std::array<std::int64_t, 3> cell_of(const Double3& p, double per_unit) {
  const auto along = [&](std::size_t a) { return static_cast<std::int64_t>(std::floor(p[a] * per_unit)); };
  return {along(0), along(1), along(2)};
}

/// The `limit` different points with the smallest hashes of their coordinates.
class PointSampler {
 public:
  explicit PointSampler(std::size_t limit) : limit_(limit) {}
  void add(const Double3& p);
  /// The same of many, an axis each.
  void add(std::span<const double> x, std::span<const double> y, std::span<const double> z);
  /// By hash, no position twice. The sampler is spent.
  std::vector<Double3> take();

 private:
  void add(std::uint64_t hash, const Double3& p);
  void shrink();
  std::size_t limit_;
  std::uint64_t threshold_ = ~std::uint64_t{0};
  std::vector<HashedPoint> points_;
};

/// All points of the cells (edge `size`, aligned to zero) with the smallest hashes, as many cells as hold at
/// most `limit` points together. A cell with more than an eighth of the limit counts as an eighth and is left
/// out.
class CellSampler {
 public:
  using CellIndex = std::array<std::int64_t, 3>;
  /// \param max_share  of all cells that may be sampled at most, in (0, 1]
  CellSampler(double size, std::size_t limit, double max_share = 1.0);

  /// Classes of cells, by the first bits of their hashes: one after another is sampled until the limit is reached.
  static constexpr int kClassBits = 4;
  static std::uint64_t hash_of(const CellIndex& cell) {
    return mix(static_cast<std::uint64_t>(cell[0]) ^
               mix(static_cast<std::uint64_t>(cell[1]) ^ mix(static_cast<std::uint64_t>(cell[2]))));
  }
  /// The last hash of so large a share of all cells.
  static std::uint64_t threshold_of(double share);
  static std::uint64_t class_of(std::uint64_t hash) { return hash >> (64 - kClassBits); }
  /// The last class of which cells are sampled.
  std::uint64_t last_class() const { return class_of(threshold_); }

  /// \param cell  where the point lies, in cells of this size   \param of_class  of the cell
  void add(const Double3& p, const CellIndex& cell, std::uint64_t of_class) {
    if (of_class > last_class()) return;
    if (cell != last_cell_) {
      last_cell_ = cell;
      last_hash_ = of_class << (64 - kClassBits) | hash_of(cell) >> kClassBits;
    }
    add(p, last_hash_);
  }
  /// Whether points of a cell of this hash are kept, as far as is known.
  bool samples(std::uint64_t hash) const { return hash <= threshold_; }
  void add(const Double3& p, std::uint64_t hash) {
    if (!samples(hash)) return;
    points_.push_back({hash, p});
    if (points_.size() >= 2 * limit_) shrink();
  }

  struct Cell {
    Double3 min{};
    std::vector<Double3> points;  ///< ascending coordinates, no position twice
  };
  /// By hash. The sampler is spent.
  std::vector<Cell> take();
  double size() const { return size_; }
  /// Of all cells, the share that is sampled: every one as likely as every other.
  double share() const;
  bool any_crowded() const { return !crowded_.empty(); }

  /// What save leaves of a sampler in a file.
  struct Saved {
    std::uint64_t threshold = 0;
    Section crowded, points;
  };
  Saved save(PackedWriter& out);
  /// Adds what another sampler of the same size and limit saved.
  void merge(const PackedFile& in, const Saved& saved);
  /// Memory of a sampler, within what its limit allows; merging and taking the cells take half as much again.
  static std::uint64_t bytes(std::size_t limit) { return 2 * limit * sizeof(HashedPoint); }

 private:
  static constexpr std::int64_t kNoCell = std::numeric_limits<std::int64_t>::min();
  void shrink();
  double size_;
  CellIndex last_cell_ = {kNoCell, kNoCell, kNoCell};
  std::uint64_t last_hash_ = 0;
  std::size_t limit_;
  std::uint64_t threshold_ = ~std::uint64_t{0};
  std::vector<HashedPoint> points_;
  std::unordered_set<std::uint64_t> crowded_;  ///< hashes of cells over the eighth; looked up, never walked
};

/// Of all cells, the share in which a sample of `limit` points is looked for where the whole stream has `points`, with room
/// for cells that hold fewer than others; 1 where that is not known (0).
double max_sampled_share(std::size_t limit, std::uint64_t points);

/// Samples of cells of several sizes, each a quarter of the one before, in a turned frame, so that no wall lies along
/// the cells: where one size is too crowded or too empty to tell anything, another is not. Fine cells have the class of
/// the second layer's cell around them, so most points of a large scan are passed over by a look at that one.
class LayeredSampler {
 public:
  static constexpr std::size_t kLayers = 4;
  static constexpr int kRatioBits = 2;
  using Limits = std::array<std::size_t, kLayers>;

  /// \param coarsest  size of the first layer, a power of two   \param limits  points per layer
  /// \param points  of the whole stream, 0 where that is not known: cells that are most likely of no use are then passed
  /// over from the beginning, in all layers but the first, whose cells are mostly too crowded to count
  LayeredSampler(double coarsest, const Limits& limits, std::uint64_t points);
  /// \pre coordinates below 2^50 cells of the second layer
  void add(const Double3& p) { add({&p[0], 1}, {&p[1], 1}, {&p[2], 1}); }
  /// The same of many, an axis each.
  void add(std::span<const double> x, std::span<const double> y, std::span<const double> z);
  void save(const std::filesystem::path& file);
  /// Adds what other samplers of the same sizes and limits saved, on the threads of the enclosing WorkerPool.
  void merge(std::span<const std::filesystem::path> files);
  std::vector<CellSampler>& layers() { return layers_; }
  /// The rotation of the quaternion (1, 2, 3, 5): every axis has a part of every other.
  static Double3 rotate(const Double3& p) {
    constexpr double kUnit = 1.0 / 39.0;
    return {(-29.0 * p[0] + 2.0 * p[1] + 26.0 * p[2]) * kUnit,
            (22.0 * p[0] - 19.0 * p[1] + 26.0 * p[2]) * kUnit,
            (14.0 * p[0] + 34.0 * p[1] + 13.0 * p[2]) * kUnit};
  }
  static std::uint64_t bytes(const Limits& limits) {
    std::uint64_t sum = 0;
    for (const std::size_t limit : limits) sum += CellSampler::bytes(limit);
    return sum;
  }

 private:
  void add_to_finer(const Double3& p, std::uint64_t of_class);
  std::vector<CellSampler> layers_;  ///< coarsest first
  double per_second_, per_finest_;   ///< cells a unit
};

/// Some points at a time in the turned frame, an axis each, so that lanes of vectors hold them.
class RotatedPoints {
 public:
  static constexpr std::size_t kMost = 256;
  using Axes = std::array<std::array<double, kMost>, 3>;
  using Hashes = std::array<std::uint64_t, kMost>;
  /// \pre kMost at most
  void take(std::span<const double> x, std::span<const double> y, std::span<const double> z);
  /// Looks up the cells of a lattice through zero that they lie in. \pre below 2^51   \param per_unit  cells a unit
  void find_cells(double per_unit);
  /// CellSampler::hash_of these.
  void hash_cells();
  /// The same of those of four times their edge.
  void hash_wider();
  // All but as many as were taken mean nothing.
  Axes p{};
  Hashes cell_hash{}, wider_hash{};

 private:
  Axes from_{};
  std::array<std::array<std::uint64_t, kMost>, 3> cells_{};  ///< bits of signed integers
};

}  // namespace tessera
