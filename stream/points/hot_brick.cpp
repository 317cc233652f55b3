#include "stream/points/hot_brick.h"

#include <algorithm>
#include <tuple>

#include "octree/portable_math.h"

namespace tessera {
namespace {

constexpr std::size_t kCells = std::size_t{1} << (3 * kBrickBits);

std::uint32_t cell_in_brick(const Int3& q) {
  const auto at = [&](std::size_t a) {
    return static_cast<std::uint32_t>(q[a] >> kQuantumBits & (kBrickCells - 1));
  };
  return at(0) | at(1) << kBrickBits | at(2) << (2 * kBrickBits);
}

std::uint64_t hash_of(const Int3& q) {
  return mix(key_in_brick(q));
}

}  // namespace

HotBrick::HotBrick(std::uint64_t limit, std::size_t chunk)
    : limit_(limit), chunk_(chunk), cell_points_(kCells) {}

std::uint64_t HotBrick::bytes(std::uint64_t limit, std::uint64_t chunk) {
  return kCells * 8 +
         (std::max<std::uint64_t>(limit, kCells) + chunk) * (sizeof(Entry) + sizeof(PointRecord));
}

void HotBrick::count(std::span<const PointRecord> points) {
  for (const PointRecord& p : points) ++cell_points_[cell_in_brick(p.q)];
}

void HotBrick::choose_per_cell() {
  const auto kept = [&](std::uint64_t c) {
    std::uint64_t sum = 0;
    for (const std::uint64_t n : cell_points_) sum += std::min(n, c);
    return sum;
  };
  std::uint64_t low = 1;  // always allowed
  std::uint64_t high = limit_ + 1;
  while (low + 1 < high) {
    const std::uint64_t middle = low + (high - low) / 2;
    (kept(middle) <= limit_ ? low : high) = middle;
  }
  per_cell_ = low;
}

void HotBrick::add(std::span<const PointRecord> points) {
  if (per_cell_ == 0) choose_per_cell();
  for (const PointRecord& p : points) {
    entries_.push_back({cell_in_brick(p.q), hash_of(p.q), 1, MergedPoint(p)});
    if (entries_.size() >= pruned_ + chunk_) prune();
  }
}

void HotBrick::prune() {
  // The hash is a bijection of the position, so equal hashes are equal positions.
  std::sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
    return std::tie(a.cell, a.hash) < std::tie(b.cell, b.hash);
  });
  std::size_t out = 0;
  std::uint64_t in_cell = 0;
  bool kept = false;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const bool same_cell = i > 0 && entries_[i].cell == entries_[i - 1].cell;
    if (same_cell && entries_[i].hash == entries_[i - 1].hash) {
      if (!kept) {
        thinned_ += entries_[i].points;
        continue;
      }
      entries_[out - 1].point.add(entries_[i].point);
      entries_[out - 1].points += entries_[i].points;
      continue;
    }
    in_cell = same_cell ? in_cell + 1 : 1;
    kept = in_cell <= per_cell_;
    if (kept)
      entries_[out++] = entries_[i];
    else
      thinned_ += entries_[i].points;
  }
  entries_.resize(out);
  pruned_ = out;
}

std::vector<PointRecord> HotBrick::take() {
  prune();
  std::vector<PointRecord> points;
  points.reserve(entries_.size());
  for (const Entry& h : entries_) {
    points.push_back(h.point.result());
    merged_ += h.points - 1;
  }
  entries_.clear();
  pruned_ = 0;
  std::sort(points.begin(), points.end(),
            [](const PointRecord& a, const PointRecord& b) { return key_in_brick(a.q) < key_in_brick(b.q); });
  return points;
}

}  // namespace tessera
