#include "stream/survey/lowest_heights.h"

#include <algorithm>
#include <cmath>
#include <limits>

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

void clear_tile(char* tile) {
  std::int32_t* cells = reinterpret_cast<std::int32_t*>(tile);
  std::fill(cells, cells + LowestHeights::kTileBytes / sizeof(std::int32_t), kNoGround);
}

}  // namespace

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
  std::int32_t* tile = nullptr;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Sample& s = samples[i];
    if (tile == nullptr || !(samples[i - 1].tile == s.tile))
      tile = reinterpret_cast<std::int32_t*>(tiles_.change(s.tile, clear_tile));
    std::int32_t& lowest = tile[s.cell];
    if (lowest == kNoGround || s.height < lowest) lowest = s.height;
  }
  points_ += samples.size();
}

void LowestHeights::finish() {
  tiles_.flush();
  std::int32_t min_u = std::numeric_limits<std::int32_t>::max(), min_v = min_u;
  std::int32_t max_u = std::numeric_limits<std::int32_t>::min(), max_v = max_u;
  std::vector<std::int32_t> cells(kTileBytes / sizeof(std::int32_t));
  groups_ = 0;
  for (const TileKey key : tiles_.keys()) {
    tiles_.read(key, reinterpret_cast<char*>(cells.data()));
    std::vector<std::uint8_t> groups(static_cast<std::size_t>(kTile / kGroup * (kTile / kGroup)), 0);
    for (std::int32_t v = 0; v < kTile; ++v)
      for (std::int32_t u = 0; u < kTile; ++u) {
        if (cells[static_cast<std::size_t>(v * kTile + u)] == kNoGround) continue;
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

std::vector<std::int32_t> LowestHeights::read(const CellWindow& window, std::int32_t factor) const {
  std::vector<std::int32_t> lowest(
      static_cast<std::size_t>(window.width) * static_cast<std::size_t>(window.height), kNoGround);
  std::vector<std::int32_t> cells(kTileBytes / sizeof(std::int32_t));
  const std::int32_t u0 = window.u * factor, u1 = (window.u + window.width) * factor - 1;
  const std::int32_t v0 = window.v * factor, v1 = (window.v + window.height) * factor - 1;
  for (std::int32_t tv = floor_ratio(v0, kTile); tv <= floor_ratio(v1, kTile); ++tv)
    for (std::int32_t tu = floor_ratio(u0, kTile); tu <= floor_ratio(u1, kTile); ++tu) {
      if (!tiles_.read({tu, tv}, reinterpret_cast<char*>(cells.data()))) continue;
      for (std::int32_t v = std::max(v0, tv * kTile); v <= std::min(v1, tv * kTile + kTile - 1); ++v) {
        const std::int32_t* row = cells.data() + static_cast<std::ptrdiff_t>(v - tv * kTile) * kTile;
        std::int32_t* to =
            lowest.data() + static_cast<std::ptrdiff_t>(floor_ratio(v, factor) - window.v) * window.width;
        for (std::int32_t u = std::max(u0, tu * kTile); u <= std::min(u1, tu * kTile + kTile - 1); ++u) {
          const std::int32_t height = row[u - tu * kTile];
          std::int32_t& least = to[floor_ratio(u, factor) - window.u];
          if (height != kNoGround && (least == kNoGround || height < least)) least = height;
        }
      }
    }
  return lowest;
}

}  // namespace tessera
