#include "stream/points/point_sample.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <iterator>
#include <string>
#include <unordered_map>
#include <utility>

#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

std::uint64_t bits(double v) {
  return std::bit_cast<std::uint64_t>(v + 0.0);
}  // -0 is 0

constexpr auto by_hash = [](const HashedPoint& a, const HashedPoint& b) {
  return a.hash != b.hash ? a.hash < b.hash : a.p < b.p;
};

/// Floor of a number below 2^51 as a signed integer's bits, by what all lanes of a vector can do: added to 1.5 * 2^52 a
/// number leaves the nearest whole one in the last bits, and where that is larger the difference has a sign.
std::uint64_t floor_bits(double v) {
  constexpr double kOnes = 6755399441055744.0;
  v += 0.0;  // -0 has a sign
  const double moved = v + kOnes;
  const auto nearest = std::bit_cast<std::uint64_t>(moved) - std::bit_cast<std::uint64_t>(kOnes);
  return nearest - (std::bit_cast<std::uint64_t>(v - (moved - kOnes)) >> 63);
}
/// A quarter of it, downwards.
std::uint64_t quarter_bits(std::uint64_t signed_bits) {
  constexpr std::uint64_t kPositive = std::uint64_t{1} << 62;
  return ((signed_bits + kPositive) >> 2) - (kPositive >> 2);
}

/// Points after one another of one cell.
struct Run {
  std::uint64_t hash = 0;
  std::size_t begin = 0, size = 0;
};

constexpr double kAllHashes = 18446744073709551616.0;

constexpr PackedKind kKind = {"TSSAMPL3", "a sample"};

}  // namespace

void PointSampler::add(const Double3& p) {
  add(mix(bits(p[0]) ^ mix(bits(p[1]) ^ mix(bits(p[2])))), p);
}

void PointSampler::add(std::uint64_t hash, const Double3& p) {
  if (hash > threshold_) return;
  points_.push_back({hash, p});
  if (points_.size() >= 4 * limit_) shrink();
}

void PointSampler::add(std::span<const double> x, std::span<const double> y, std::span<const double> z) {
  constexpr std::size_t kMost = RotatedPoints::kMost;
  std::array<std::array<double, kMost>, 3> p{};
  std::array<std::uint64_t, kMost> hashes;
  for (std::size_t first = 0; first < x.size(); first += kMost) {
    const std::size_t n = std::min(kMost, x.size() - first);
    std::copy_n(x.data() + first, n, p[0].begin());
    std::copy_n(y.data() + first, n, p[1].begin());
    std::copy_n(z.data() + first, n, p[2].begin());
    for (std::size_t i = 0; i < kMost; ++i)
      hashes[i] = mix(bits(p[0][i]) ^ mix(bits(p[1][i]) ^ mix(bits(p[2][i]))));
    for (std::size_t i = 0; i < n; ++i) add(hashes[i], {p[0][i], p[1][i], p[2][i]});
  }
}

void PointSampler::shrink() {
  // What stays is mostly among the first; the rest is looked at only where positions repeat.
  const auto middle =
      points_.begin() + static_cast<std::ptrdiff_t>(std::min(points_.size(), limit_ + limit_ / 4));
  std::nth_element(points_.begin(), middle, points_.end(), by_hash);
  std::sort(points_.begin(), middle, by_hash);
  const auto same = [](const HashedPoint& a, const HashedPoint& b) { return a.p == b.p; };
  auto end = std::unique(points_.begin(), middle, same);
  if (end - points_.begin() <= static_cast<std::ptrdiff_t>(limit_)) {
    std::sort(middle, points_.end(), by_hash);
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
  points_.reserve(2 * limit);  // reserved, not touched
}

std::uint64_t CellSampler::threshold_of(double share) {
  return share < 1.0 ? static_cast<std::uint64_t>(share * kAllHashes) : ~std::uint64_t{0};
}

double CellSampler::share() const {
  return (static_cast<double>(threshold_) + 1.0) / kAllHashes;
}

void CellSampler::shrink() {
  // Hashes are spread evenly. Only where a cell may be crowded, or the limit is reached, is anything put in order.
  constexpr int kBucketBits = 10;
  struct Bucket {
    std::size_t points = 0;
    bool crowded = false;  ///< some cell may be
  };
  const int shift = std::max(0, static_cast<int>(std::bit_width(threshold_)) - kBucketBits);
  const std::size_t maximum = std::max<std::size_t>(1, limit_ / 8);
  std::vector<Bucket> buckets((threshold_ >> shift) + 1);
  for (const HashedPoint& p : points_)
    if (p.hash <= threshold_) ++buckets[p.hash >> shift].points;
  for (Bucket& b : buckets) b.crowded = b.points > maximum;
  for (const std::uint64_t hash : crowded_)
    if (hash <= threshold_) buckets[hash >> shift].crowded = true;
  // Few: where a bucket is crowded, cells are, and others hold few points.
  using Count = std::pair<std::uint64_t, std::size_t>;  // of a cell: hash, points
  const auto counts_where = [&](const auto& wanted) {
    std::unordered_map<std::uint64_t, std::size_t> cells;
    std::size_t none = 0, *count = &none;
    std::uint64_t last = 0;
    for (const HashedPoint& p : points_) {
      if (p.hash > threshold_ || !wanted(p.hash >> shift)) continue;
      if (count == &none || p.hash != last) count = &cells[last = p.hash];
      ++*count;
    }
    std::vector<Count> counts(cells.begin(), cells.end());
    std::sort(counts.begin(), counts.end());
    return counts;
  };
  const std::vector<Count> crowds = counts_where([&](std::uint64_t b) { return buckets[b].crowded; });
  std::size_t sum = 0;
  // Adds what cells count, by hash. \return whether all of them are within the limit
  const auto all_fit = [&](std::span<const Count> cells) {
    for (const auto& [hash, points] : cells) {
      if (points > maximum) crowded_.insert(hash);
      sum += crowded_.count(hash) != 0 ? maximum : points;
      if (sum <= limit_) continue;
      threshold_ = hash - 1;
      return false;
    }
    return true;
  };
  std::span<const Count> left(crowds);
  for (std::size_t b = 0; b < buckets.size(); ++b) {
    if (buckets[b].crowded) {
      const auto end =
          std::find_if(left.begin(), left.end(), [&](const Count& c) { return c.first >> shift != b; });
      const auto size = static_cast<std::size_t>(end - left.begin());
      if (!all_fit(left.first(size))) break;
      left = left.subspan(size);
    } else if (sum + buckets[b].points <= limit_) {
      sum += buckets[b].points;
    } else if (!all_fit(counts_where([&](std::uint64_t of) { return of == b; }))) {
      break;
    }
  }
  // Of a crowded cell one point stays, so that the cell counts when no other of it comes.
  std::erase_if(crowded_, [&](std::uint64_t hash) { return hash > threshold_; });
  std::unordered_set<std::uint64_t> stayed;
  std::size_t out = 0;
  for (std::size_t i = 0, end = 0; i < points_.size(); i = end) {
    const std::uint64_t hash = points_[i].hash;
    for (end = i + 1; end < points_.size() && points_[end].hash == hash;) ++end;
    if (hash > threshold_) continue;
    std::size_t kept = end;
    if (crowded_.count(hash) != 0) kept = stayed.insert(hash).second ? i + 1 : i;
    for (std::size_t k = i; k < kept; ++k) points_[out++] = points_[k];
  }
  points_.resize(out);
}

std::vector<CellSampler::Cell> CellSampler::take() {
  shrink();
  const auto by_hash = [](const HashedPoint& a, const HashedPoint& b) { return a.hash < b.hash; };
  std::size_t ends = 0;
  for (std::size_t i = 1; i < points_.size(); ++i) ends += points_[i].hash != points_[i - 1].hash;
  // Where hardly two of a cell follow one another, their runs would take as much memory as they do.
  if (ends > points_.size() / 4) std::sort(points_.begin(), points_.end(), by_hash);
  std::vector<Run> runs;
  runs.reserve(std::min(ends, points_.size() / 4) + 1);
  for (std::size_t i = 0, end = 0; i < points_.size(); i = end) {
    for (end = i + 1; end < points_.size() && points_[end].hash == points_[i].hash;) ++end;
    if (crowded_.count(points_[i].hash) == 0) runs.push_back({points_[i].hash, i, end - i});
  }
  std::sort(runs.begin(), runs.end(), [](const Run& a, const Run& b) { return a.hash < b.hash; });
  std::vector<Cell> cells;
  for (auto r = runs.begin(); r != runs.end();) {
    const auto end = std::find_if(r, runs.end(), [&](const Run& o) { return o.hash != r->hash; });
    std::vector<Double3>& points = cells.emplace_back().points;
    std::size_t size = 0;
    for (auto o = r; o != end; ++o) size += o->size;
    points.reserve(size);
    for (; r != end; ++r)
      for (std::size_t i = r->begin; i < r->begin + r->size; ++i) points.push_back(points_[i].p);
    std::sort(points.begin(), points.end());
    points.erase(std::unique(points.begin(), points.end()), points.end());
    for (std::size_t a = 0; a < 3; ++a) cells.back().min[a] = std::floor(points.front()[a] / size_) * size_;
  }
  points_ = {};
  return cells;
}

CellSampler::Saved CellSampler::save(PackedWriter& out) {
  if (points_.size() > limit_) shrink();
  std::vector<std::uint64_t> crowded(crowded_.begin(), crowded_.end());
  std::sort(crowded.begin(), crowded.end());
  return {threshold_, out.append(bytes_of(crowded)), out.append(bytes_of(points_))};
}

void CellSampler::merge(const PackedFile& in, const Saved& saved) {
  threshold_ = std::min(threshold_, saved.threshold);
  const auto crowded = in.load<std::uint64_t>(saved.crowded);
  crowded_.insert(crowded.begin(), crowded.end());
  const std::size_t more = saved.points.bytes / sizeof(HashedPoint);
  if (points_.size() + more > 2 * limit_) shrink();  // what is reserved is enough
  const std::size_t old = points_.size();
  points_.resize(old + more);
  in.read(saved.points, {std::as_writable_bytes(std::span(points_).subspan(old))});
  points_.erase(std::remove_if(points_.begin() + static_cast<std::ptrdiff_t>(old), points_.end(),
                               [&](const HashedPoint& p) { return p.hash > threshold_; }),
                points_.end());
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
}

void RotatedPoints::take(std::span<const double> x, std::span<const double> y, std::span<const double> z) {
  std::copy(x.begin(), x.end(), from_[0].begin());
  std::copy(y.begin(), y.end(), from_[1].begin());
  std::copy(z.begin(), z.end(), from_[2].begin());
  for (std::size_t i = 0; i < kMost; ++i) {
    const Double3 r = LayeredSampler::rotate({from_[0][i], from_[1][i], from_[2][i]});
    p[0][i] = r[0], p[1][i] = r[1], p[2][i] = r[2];
  }
}

void RotatedPoints::find_cells(double per_unit) {
  for (std::size_t a = 0; a < 3; ++a)
    for (std::size_t i = 0; i < kMost; ++i) cells_[a][i] = floor_bits(p[a][i] * per_unit);
}

void RotatedPoints::hash_cells() {
  for (std::size_t i = 0; i < kMost; ++i)
    cell_hash[i] = mix(cells_[0][i] ^ mix(cells_[1][i] ^ mix(cells_[2][i])));
}

void RotatedPoints::hash_wider() {
  for (std::size_t i = 0; i < kMost; ++i)
    wider_hash[i] =
        mix(quarter_bits(cells_[0][i]) ^ mix(quarter_bits(cells_[1][i]) ^ mix(quarter_bits(cells_[2][i]))));
}

void LayeredSampler::add(std::span<const double> x, std::span<const double> y, std::span<const double> z) {
  RotatedPoints rotated;
  for (std::size_t first = 0; first < x.size(); first += RotatedPoints::kMost) {
    const std::size_t n = std::min(RotatedPoints::kMost, x.size() - first);
    rotated.take(x.subspan(first, n), y.subspan(first, n), z.subspan(first, n));
    rotated.find_cells(per_second_);
    static_assert(kRatioBits == 2);
    rotated.hash_cells();
    rotated.hash_wider();
    for (std::size_t i = 0; i < n; ++i) {
      const std::uint64_t around = rotated.cell_hash[i], coarsest = rotated.wider_hash[i];
      const std::uint64_t of_class = CellSampler::class_of(around);
      const bool in_coarsest = layers_[0].samples(coarsest);
      const bool in_second = layers_[1].samples(around);
      const bool in_finer = of_class <= std::max(layers_[2].last_class(), layers_[3].last_class());
      if (!in_coarsest && !in_second && !in_finer) continue;
      const Double3 p = {rotated.p[0][i], rotated.p[1][i], rotated.p[2][i]};
      if (in_coarsest) layers_[0].add(p, coarsest);
      if (in_second) layers_[1].add(p, around);
      if (in_finer) add_to_finer(p, of_class);
    }
  }
}

void LayeredSampler::add_to_finer(const Double3& p, std::uint64_t of_class) {
  // Powers of two lie between the sizes: cells of one lie in those of the other to the last bit.
  CellSampler::CellIndex cell = cell_of(p, per_finest_);
  for (std::size_t k = kLayers; k-- > 2;) {
    layers_[k].add(p, cell, of_class);
    for (std::int64_t& c : cell) c >>= kRatioBits;
  }
}

void LayeredSampler::save(const std::filesystem::path& file) {
  PackedWriter out(file, kKind, std::size_t{1} << 20);
  std::vector<CellSampler::Saved> table;
  for (CellSampler& layer : layers_) table.push_back(layer.save(out));
  out.finish(table);
}

void LayeredSampler::merge(std::span<const std::filesystem::path> files) {
  parallel_for(kLayers, [&](std::size_t k) {
    for (const std::filesystem::path& file : files) {
      const PackedFile in(file, kKind, sizeof(CellSampler::Saved));
      layers_[k].merge(in, in.table<CellSampler::Saved>().at(k));
    }
  });
}

}  // namespace tessera
