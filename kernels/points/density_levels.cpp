#include "kernels/points/density_levels.h"

#include <bit>
#include <cstddef>

namespace tessera {
namespace {

/// Cells of half the edge that are occupied, for every one of the edge: 3.25 of at most four. Measured on a town seen from one place: 3 loses
/// a twentieth of the surface to holes, 3.5 a sixth of the faces.
constexpr std::uint64_t kCoveredFiner = 13, kCoveredCoarser = 4;
constexpr std::uint64_t kMinCells = 4;  ///< fewer do not tell

class Splitter {
 public:
  Splitter(const PointBlock& points, int levels, int minimum) : levels_(levels), min_(minimum) {
    const std::size_t n = points.size();
    at_.reserve(n);
    differ_.reserve(n);
    for (std::size_t i = 0; i < n; ++i) {
      at_.push_back({quanta(points.x[i]), quanta(points.y[i]), quanta(points.z[i])});
      std::uint32_t bits = 0;
      for (std::size_t a = 0; i > 0 && a < 3; ++a) bits |= at_[i][a] ^ at_[i - 1][a];
      differ_.push_back(static_cast<std::uint8_t>(std::bit_width(bits)));
    }
  }

  void split(std::size_t first, std::size_t last, int level, const Int3& brick,
             std::vector<DensityNode>& out) {
    if (level <= min_ || first == last) return;
    const std::uint64_t cells = occupied(first, last, cell_bits(level));
    if (cells < kMinCells ||
        kCoveredCoarser * occupied(first, last, cell_bits(level - 1)) < kCoveredFiner * cells)
      return;
    DensityNode node{level, {}};
    const int depth = levels_ - 1 - level, shift = cell_bits(level) + kBrickBits;
    for (std::size_t a = 0; a < 3; ++a)
      node.at[a] = brick[a] * (1 << depth) + static_cast<std::int32_t>(at_[first][a] >> shift);
    out.push_back(node);
    for (std::size_t i = first; i < last;) {
      std::size_t end = i + 1;
      while (end < last && differ_[end] < shift) ++end;
      split(i, end, level - 1, brick, out);
      i = end;
    }
  }
  std::size_t size() const { return at_.size(); }

 private:
  static std::uint32_t quanta(float cells) { return static_cast<std::uint32_t>(cells * kQuantaPerCell); }
  int cell_bits(int level) const { return kQuantumBits - (levels_ - 1 - level); }
  /// Cells of 2^bits quanta that hold points: canonical order visits each once.
  std::uint64_t occupied(std::size_t first, std::size_t last, int bits) const {
    std::uint64_t count = 1;
    for (std::size_t i = first + 1; i < last; ++i) count += differ_[i] > bits;
    return count;
  }

  int levels_, min_;
  std::vector<std::array<std::uint32_t, 3>> at_;
  std::vector<std::uint8_t> differ_;  ///< highest bit in which a point differs from the one before
};

}  // namespace

std::vector<DensityNode> split_by_density(const PointBlock& points, const Int3& brick, int levels,
                                          int minimum) {
  std::vector<DensityNode> out;
  Splitter splitter(points, levels, minimum);
  splitter.split(0, splitter.size(), levels - 1, brick, out);
  return out;
}

}  // namespace tessera
