/// \file change_tiles.h
/// Space around two clouds cut into boxes by what they hold, so that one is compared with the other box by box, each with
/// the points near it. Boxes carry no meaning: what is found hangs on none.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "octree/vector.h"

namespace tessera {

/// How many points of the old and of the new cloud lie in a cell of a coarse lattice through zero.
struct CloudCount {
  Int3 cell{};
  std::array<std::uint64_t, 2> points{};
};

/// Counts of at most some 65,000 cells: their size doubles until they are so few.
class CloudCounts {
 public:
  /// \param size  of a cell at first  \pre coordinates from 0 to 2^20 cells
  explicit CloudCounts(double size) : size_(size) {}
  void add(std::size_t cloud, const Double3& p);
  double size() const { return size_; }
  /// By cell.
  std::vector<CloudCount> cells() const;

 private:
  void halve();

  double size_;
  std::unordered_map<std::uint64_t, std::array<std::uint64_t, 2>> counts_;
  std::uint64_t last_key_ = ~std::uint64_t{0};
  std::array<std::uint64_t, 2>* last_ = nullptr;
};

struct ChangeTile {
  Int3 low{}, high{};                     ///< coarse cells [low, high)
  std::uint64_t own = 0;                  ///< points of the old cloud in it
  std::array<std::uint64_t, 2> loaded{};  ///< of either cloud in it and around it, at most
};

class ChangeTiles {
 public:
  /// \param halo  points so near to a tile are loaded with it  \param target  points to load, where that can be
  /// \param cell_size  of the cells that a tile's points are sorted into
  ChangeTiles(const CloudCounts& counts, double halo, std::uint64_t target, double cell_size);

  std::span<const ChangeTile> tiles() const { return tiles_; }
  /// Cells of a tile with its halo, as seen from above.
  std::uint64_t columns(const ChangeTile& tile) const;
  bool owns(const ChangeTile& tile, const Double3& p) const;
  /// Calls use(k) for the tiles that load a point, ascending.
  template <class Use>
  void for_tiles(const Double3& p, const Use& use) {
    const Int3 cell = cell_of(p);
    if (cell != last_cell_) enter(cell);
    for (const std::uint32_t k : last_)
      if (loads(tiles_[k], p)) use(k);
  }

 private:
  Int3 cell_of(const Double3& p) const;
  bool loads(const ChangeTile& tile, const Double3& p) const;
  void enter(const Int3& cell);
  void split(Int3 low, Int3 high, const std::vector<std::uint32_t>& around);
  bool near(const Int3& cell, const Int3& low, const Int3& high) const;

  double size_, halo_, cell_size_;
  std::uint64_t target_;
  std::int32_t reach_;  ///< the halo in coarse cells
  std::vector<CloudCount> cells_;
  std::vector<ChangeTile> tiles_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> of_cell_;
  Int3 last_cell_ = {-1, -1, -1};
  std::span<const std::uint32_t> last_;
};

}  // namespace tessera
