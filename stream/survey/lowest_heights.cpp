#include "stream/survey/lowest_heights.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <memory>

#include <fmt/format.h>

#include "kernels/points/ground_filter.h"
#include "kernels/points/height_classes.h"
#include "octree/error.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

constexpr double kMaxCell = 0x1p29;
constexpr double kMaxHeight = 0x1p29 - 1.0;  ///< of find_ground()
constexpr std::int32_t kGroup = 8;

constexpr std::uint16_t kMostCounted = std::numeric_limits<std::uint16_t>::max();

}  // namespace

struct LowestHeights::Tile {
  std::int32_t lowest[kTile * kTile];
  std::uint16_t count[kTile * kTile];

  static void clear(char* bytes) {
    Tile& tile = *reinterpret_cast<Tile*>(bytes);
    std::fill(std::begin(tile.lowest), std::end(tile.lowest), kNoGround);
    std::fill(std::begin(tile.count), std::end(tile.count), std::uint16_t{0});
  }
};

double ScanCells::place(double coordinate, const LasHeader& header) const {
  const double at = coordinate / cell;
  if (!(std::fabs(at) < kMaxCell))
    throw InputError(fmt::format("{}: a point lies at {:.17g}, too far out for cells of {:g}",
                                 header.info.path.string(), coordinate, cell));
  return at;
}

std::int32_t ScanCells::height(double z) const {
  const double steps = std::floor(z / step() + 0.5);
  return std::fabs(steps) < kMaxHeight ? static_cast<std::int32_t>(steps) : kNoGround;
}

bool is_set_aside(const char* record, bool wide) {
  const unsigned flags = static_cast<std::uint8_t>(record[LasRecordField::kFlags]);
  const std::uint8_t kind = las_class(record, wide);
  if (!wide) return (flags & 0xa0u) != 0 || kind == kClassNoise;
  return (flags & 5u) != 0 || kind == kClassNoise || kind == kClassHighNoise;
}

Double3 record_position(const LasRecords& scan, const char* record) {
  const PointRecordLayout& layout = scan.header().layout;
  Double3 p{};
  for (std::size_t a = 0; a < 3; ++a)
    p[a] = load_scalar<std::int32_t>(record + 4 * a) * layout.scale[a] + layout.shift[a];
  return p;
}

void LowestHeights::hold(std::uint64_t bytes) {
  tiles_.hold(static_cast<std::size_t>(std::max<std::uint64_t>(1, bytes / kTileBytes)));
}

void LowestHeights::place(const LasRecords& scan, const LasBatch& batch, bool all,
                          std::vector<Sample>& out) const {
  out.clear();
  for_each_taken(scan, batch, all, [&](std::size_t, const Double3& p) {
    const auto u = static_cast<std::int32_t>(std::floor(cells_.place(p[0], scan.header())));
    const auto v = static_cast<std::int32_t>(std::floor(cells_.place(p[1], scan.header())));
    const std::int32_t height = cells_.height(p[2]);
    if (height == kNoGround) return;
    const TileKey tile = {floor_ratio(u, kTile), floor_ratio(v, kTile)};
    out.push_back(
        {tile, static_cast<std::uint32_t>((v - tile.v * kTile) * kTile + u - tile.u * kTile), height});
  });
  gather_by_tile(out);
}

void LowestHeights::add(std::span<const Sample> samples) {
  static_assert(sizeof(Tile) == kTileBytes);
  Tile* tile = nullptr;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& s = samples[i];
    if (tile == nullptr || !(samples[i - 1].tile == s.tile))
      tile = reinterpret_cast<Tile*>(tiles_.change(s.tile, Tile::clear));
    std::int32_t& lowest = tile->lowest[s.cell];
    if (lowest == kNoGround || s.height < lowest) lowest = s.height;
    if (tile->count[s.cell] < kMostCounted) ++tile->count[s.cell];
  }
  points_ += samples.size();
}

void LowestHeights::finish() {
  tiles_.flush();
  std::int32_t min_u = std::numeric_limits<std::int32_t>::max(), min_v = min_u;
  std::int32_t max_u = std::numeric_limits<std::int32_t>::min(), max_v = max_u;
  const auto tile = std::make_unique<Tile>();
  groups_ = 0;
  for (const TileKey key : tiles_.keys()) {
    tiles_.read(key, reinterpret_cast<char*>(tile.get()));
    std::vector<std::uint8_t> groups(static_cast<std::size_t>(kTile / kGroup * (kTile / kGroup)), 0);
    for (std::int32_t v = 0; v < kTile; ++v)
      for (std::int32_t u = 0; u < kTile; ++u) {
        if (tile->lowest[v * kTile + u] == kNoGround) continue;
        groups[static_cast<std::size_t>(v / kGroup * (kTile / kGroup) + u / kGroup)] = 1;
        min_u = std::min(min_u, key.u * kTile + u), max_u = std::max(max_u, key.u * kTile + u);
        min_v = std::min(min_v, key.v * kTile + v), max_v = std::max(max_v, key.v * kTile + v);
      }
    groups_ += static_cast<std::uint64_t>(std::count(groups.begin(), groups.end(), 1));
  }
  if (points_ > 0) window_ = {min_u, min_v, max_u - min_u + 1, max_v - min_v + 1};
}

double LowestHeights::density() const {
  return static_cast<double>(points_) / (static_cast<double>(groups_) * kGroup * kGroup);
}

std::uint32_t LowestHeights::median_count(std::int32_t factor) const {
  // Squares within tiles stand for all.
  std::vector<std::uint64_t> squares(std::size_t{kMostCounted} + 1, 0);
  const auto tile = std::make_unique<Tile>();
  std::uint64_t all = 0;
  for (const TileKey key : tiles_.keys()) {
    tiles_.read(key, reinterpret_cast<char*>(tile.get()));
    for (std::int32_t v = 0; v + factor <= kTile; v += factor)
      for (std::int32_t u = 0; u + factor <= kTile; u += factor) {
        std::uint64_t points = 0;
        for (std::int32_t y = v; y < v + factor; ++y)
          for (std::int32_t x = u; x < u + factor; ++x) points += tile->count[y * kTile + x];
        if (points == 0) continue;
        ++squares[static_cast<std::size_t>(std::min<std::uint64_t>(points, kMostCounted))];
        ++all;
      }
  }
  std::uint64_t below = 0;
  for (std::size_t points = 0; points < squares.size(); ++points) {
    below += squares[points];
    if (2 * below > all) return static_cast<std::uint32_t>(points);
  }
  return 0;
}

std::array<double, LowestHeights::kReliefFactors.size()> LowestHeights::high_shares(std::int32_t rise) const {
  const auto tile = std::make_unique<Tile>();
  std::array<std::uint64_t, kReliefFactors.size()> all{}, high{};
  std::array<std::int32_t, kRelief * kRelief> heights;  // of the cells of a block
  for (const TileKey key : tiles_.keys()) {
    tiles_.read(key, reinterpret_cast<char*>(tile.get()));
    // Whole blocks within tiles stand for all.
    for (std::int32_t v = 0; v + kRelief <= kTile; v += kRelief)
      for (std::int32_t u = 0; u + kRelief <= kTile; u += kRelief)
        for (std::size_t k = 0; k < kReliefFactors.size(); ++k) {
          const std::int32_t factor = kReliefFactors[k], side = kRelief / factor;
          heights.fill(kNoGround);
          std::int32_t lowest = kNoGround;
          for (std::int32_t y = 0; y < kRelief; ++y)
            for (std::int32_t x = 0; x < kRelief; ++x) {
              const std::int32_t z = tile->lowest[(v + y) * kTile + u + x];
              if (z == kNoGround) continue;
              std::int32_t& cell = heights[static_cast<std::size_t>(y / factor * side + x / factor)];
              if (cell == kNoGround || z < cell) cell = z;
              if (lowest == kNoGround || z < lowest) lowest = z;
            }
          for (const std::int32_t z : heights)
            all[k] += z != kNoGround, high[k] += z != kNoGround && z - lowest > rise;
        }
  }
  std::array<double, kReliefFactors.size()> shares{};
  for (std::size_t k = 0; k < shares.size(); ++k)
    if (all[k] > 0) shares[k] = static_cast<double>(high[k]) / static_cast<double>(all[k]);
  return shares;
}

/// Calls use(cell of the window, tile, cell of the tile) for all cells that a window of wider ones is made of.
template <class Use>
void LowestHeights::for_each_cell(const CellWindow& window, std::int32_t factor, const Use& use) const {
  const auto tile = std::make_unique<Tile>();
  const std::int32_t u0 = window.u * factor, u1 = (window.u + window.width) * factor - 1;
  const std::int32_t v0 = window.v * factor, v1 = (window.v + window.height) * factor - 1;
  for (std::int32_t tv = floor_ratio(v0, kTile); tv <= floor_ratio(v1, kTile); ++tv)
    for (std::int32_t tu = floor_ratio(u0, kTile); tu <= floor_ratio(u1, kTile); ++tu) {
      if (!tiles_.read({tu, tv}, reinterpret_cast<char*>(tile.get()))) continue;
      for (std::int32_t v = std::max(v0, tv * kTile); v <= std::min(v1, tv * kTile + kTile - 1); ++v) {
        const std::ptrdiff_t row =
            static_cast<std::ptrdiff_t>(floor_ratio(v, factor) - window.v) * window.width - window.u;
        for (std::int32_t u = std::max(u0, tu * kTile); u <= std::min(u1, tu * kTile + kTile - 1); ++u)
          use(static_cast<std::size_t>(row + floor_ratio(u, factor)), *tile,
              static_cast<std::size_t>((v - tv * kTile) * kTile + u - tu * kTile));
      }
    }
}

std::vector<std::int32_t> LowestHeights::read(const CellWindow& window, std::int32_t factor) const {
  std::vector<std::int32_t> lowest(
      static_cast<std::size_t>(window.width) * static_cast<std::size_t>(window.height), kNoGround);
  for_each_cell(window, factor, [&](std::size_t to, const Tile& tile, std::size_t from) {
    const std::int32_t height = tile.lowest[from];
    if (height != kNoGround && (lowest[to] == kNoGround || height < lowest[to])) lowest[to] = height;
  });
  return lowest;
}

std::vector<std::uint32_t> LowestHeights::read_counts(const CellWindow& window, std::int32_t factor) const {
  std::vector<std::uint32_t> counts(
      static_cast<std::size_t>(window.width) * static_cast<std::size_t>(window.height), 0);
  for_each_cell(window, factor,
                [&](std::size_t to, const Tile& tile, std::size_t from) { counts[to] += tile.count[from]; });
  return counts;
}

}  // namespace tessera
