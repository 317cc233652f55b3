#include "stream/points/point_sample.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <string>
#include <tuple>

#include "octree/error.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

std::uint64_t bits(double v) {
  return std::bit_cast<std::uint64_t>(v + 0.0);
}  // -0 is 0

bool before(const HashedPoint& a, const HashedPoint& b) {
  return std::tie(a.hash, a.p) < std::tie(b.hash, b.p);
}

constexpr double kAllHashes = 18446744073709551616.0;

constexpr PackedKind kKind = {"TSSAMPL3", "a sample"};

}  // namespace

void PointSampler::add(const Double3& p) {
  const std::uint64_t hash = mix(bits(p[0]) ^ mix(bits(p[1]) ^ mix(bits(p[2]))));
  if (hash > threshold_) return;
  points_.push_back({hash, p});
  if (points_.size() >= 4 * limit_) shrink();
}

void PointSampler::shrink() {
  // What stays is mostly among the first; the rest is looked at only where positions repeat.
  const auto middle =
      points_.begin() + static_cast<std::ptrdiff_t>(std::min(points_.size(), limit_ + limit_ / 4));
  std::nth_element(points_.begin(), middle, points_.end(), before);
  std::sort(points_.begin(), middle, before);
  const auto same = [](const HashedPoint& a, const HashedPoint& b) { return a.p == b.p; };
  auto end = std::unique(points_.begin(), middle, same);
  if (end - points_.begin() <= static_cast<std::ptrdiff_t>(limit_)) {
    std::sort(middle, points_.end(), before);
    end = std::unique(points_.begin(), std::move(middle, points_.end(), end), same);
  }
  points_.erase(end, points_.end());
  if (points_.size() <= limit_) return;
  points_.resize(limit_);
  threshold_ = points_.back().hash;
}

std::vector<Double3> PointSampler::take() {
  shrink();
  std::vector<Double3> points;
  points.reserve(points_.size());
  for (const HashedPoint& h : points_) points.push_back(h.p);
  points_.clear();
  return points;
}

CellSampler::CellSampler(double size, std::size_t limit, double max_share)
    : size_(size), limit_(limit), threshold_(threshold_of(max_share)) {
  points_.reserve(2 * limit);
}

std::uint64_t CellSampler::threshold_of(double share) {
  return share < 1.0 ? static_cast<std::uint64_t>(share * kAllHashes) : ~std::uint64_t{0};
}

double CellSampler::share() const {
  return (static_cast<double>(threshold_) + 1.0) / kAllHashes;
}

void CellSampler::shrink() {
  // What stays is mostly among the first; the rest is looked at only where crowded cells leave too little.
  const auto by_hash = [](const HashedPoint& a, const HashedPoint& b) { return a.hash < b.hash; };
  std::size_t sorted = std::min(points_.size(), limit_ + limit_ / 4);
  const auto first = points_.begin() + static_cast<std::ptrdiff_t>(sorted);
  // A saved sample comes back in order.
  if (!std::is_sorted(points_.begin(), points_.end(), by_hash)) {
    std::nth_element(points_.begin(), first, points_.end(), by_hash);
    std::sort(points_.begin(), first, by_hash);
  }
  const std::size_t maximum = std::max<std::size_t>(1, limit_ / 8);
  std::size_t sum = 0;
  std::size_t out = 0;
  for (std::size_t i = 0; i < points_.size();) {
    std::size_t end = i;
    for (; end < points_.size(); ++end) {
      if (end == sorted) {
        std::sort(first, points_.end(), by_hash);
        sorted = points_.size();
      }
      if (points_[end].hash != points_[i].hash) break;
    }
    const std::uint64_t hash = points_[i].hash;
    if (hash > threshold_) break;
    if (end - i > maximum) crowded_.insert(hash);
    const bool crowded = crowded_.count(hash) != 0;
    sum += crowded ? maximum : end - i;
    if (sum > limit_) {
      threshold_ = hash - 1;
      break;
    }
    // Of a crowded cell one point stays, so that the cell counts when no other of it comes.
    const std::size_t kept = crowded ? i + 1 : end;
    for (; i < kept; ++i) points_[out++] = points_[i];
    i = end;
  }
  points_.resize(out);
  std::erase_if(crowded_, [&](std::uint64_t hash) { return hash > threshold_; });
}

std::vector<CellSampler::Cell> CellSampler::take() {
  shrink();
  std::vector<Cell> cells;
  for (auto h = points_.begin(); h != points_.end();) {
    const auto end = std::find_if(h, points_.end(), [&](const HashedPoint& o) { return o.hash != h->hash; });
    if (crowded_.count(h->hash) == 0) {
      Cell& cell = cells.emplace_back();
      cell.points.reserve(static_cast<std::size_t>(end - h));
      std::transform(h, end, std::back_inserter(cell.points), [](const HashedPoint& o) { return o.p; });
      std::sort(cell.points.begin(), cell.points.end());
      cell.points.erase(std::unique(cell.points.begin(), cell.points.end()), cell.points.end());
      for (std::size_t a = 0; a < 3; ++a) cell.min[a] = std::floor(cell.points.front()[a] / size_) * size_;
    }
    h = end;
  }
  points_.clear();
  return cells;
}

CellSampler::Saved CellSampler::save(PackedWriter& out) {
  shrink();
  std::vector<std::uint64_t> crowded(crowded_.begin(), crowded_.end());
  std::sort(crowded.begin(), crowded.end());
  return {threshold_, out.append(bytes_of(crowded)), out.append(bytes_of(points_))};
}

void CellSampler::merge(const PackedFile& in, const Saved& saved) {
  threshold_ = std::min(threshold_, saved.threshold);
  const auto crowded = in.load<std::uint64_t>(saved.crowded);
  crowded_.insert(crowded.begin(), crowded.end());
  const std::size_t old = points_.size();
  points_.resize(old + saved.points.bytes / sizeof(HashedPoint));
  in.read(saved.points, {std::as_writable_bytes(std::span(points_).subspan(old))});
  if (points_.size() >= 2 * limit_) shrink();
}

double max_sampled_share(std::size_t limit, std::uint64_t points) {
  constexpr double kRoom = 8.0;
  return points > 0 ? std::min(1.0, kRoom * static_cast<double>(limit) / static_cast<double>(points)) : 1.0;
}

LayeredSampler::LayeredSampler(double coarsest, const Limits& limits, std::uint64_t points)
    : per_second_(double{1 << kRatioBits} / coarsest), per_finest_(per_second_) {
  for (std::size_t k = 0; k < kLayers; ++k) {
    const double size = std::ldexp(coarsest, -kRatioBits * static_cast<int>(k));
    layers_.emplace_back(size, limits[k], k == 0 ? 1.0 : max_sampled_share(limits[k], points));
    per_finest_ = 1.0 / size;
  }
  enter({0, 0, 0});
}

void LayeredSampler::enter(CellSampler::CellIndex around) {
  around_ = around;
  around_hash_ = CellSampler::hash_of(around);
  for (std::int64_t& c : around) c >>= kRatioBits;
  coarsest_hash_ = CellSampler::hash_of(around);
  last_class_ = std::max(layers_[2].last_class(), layers_[3].last_class());
}

void LayeredSampler::save(const std::filesystem::path& file) {
  PackedWriter out(file, kKind, std::size_t{1} << 20);
  std::vector<CellSampler::Saved> table;
  for (CellSampler& layer : layers_) table.push_back(layer.save(out));
  out.finish(table);
}

void LayeredSampler::merge(const std::filesystem::path& file) {
  const PackedFile in(file, kKind, sizeof(CellSampler::Saved));
  const auto table = in.table<CellSampler::Saved>();
  for (std::size_t k = 0; k < kLayers; ++k) layers_[k].merge(in, table.at(k));
}

}  // namespace tessera
