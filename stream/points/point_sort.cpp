#include "stream/points/point_sort.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

namespace tessera {
namespace {

constexpr int kIndexBits = 16;
constexpr int kKeyBits = 48;

std::uint64_t key_of(std::uint64_t v) {
  return v;
}
template <typename Keyed>
std::uint64_t key_of(const Keyed& k) {
  return k.key;
}

/// Least significant digit first, 12 bits at a time; digits that all agree are skipped. Small arrays go to a
/// comparison sort, for which the 4096 counters would be too many.
template <typename T>
void radix_sort(std::vector<T>& values, std::vector<T>& other, int low_bit) {
  constexpr int kDigit = 12;
  constexpr std::size_t kBuckets = std::size_t{1} << kDigit;
  constexpr int kPasses = kKeyBits / kDigit;
  const std::size_t n = values.size();
  if (n < 1500) {
    std::sort(values.begin(), values.end(), [](const T& a, const T& b) { return key_of(a) < key_of(b); });
    return;
  }
  other.resize(n);
  std::array<std::array<std::uint32_t, kBuckets>, kPasses> count{};
  for (const T& v : values)
    for (int p = 0; p < kPasses; ++p)
      ++count[static_cast<std::size_t>(p)][key_of(v) >> (low_bit + p * kDigit) & (kBuckets - 1)];
  for (int p = 0; p < kPasses; ++p) {
    auto& c = count[static_cast<std::size_t>(p)];
    const int shift = low_bit + p * kDigit;
    if (c[key_of(values[0]) >> shift & (kBuckets - 1)] == n) continue;
    std::uint32_t sum = 0;
    for (auto& entry : c) {
      const std::uint32_t here = entry;
      entry = sum;
      sum += here;
    }
    for (const T& v : values) other[c[key_of(v) >> shift & (kBuckets - 1)]++] = v;
    values.swap(other);
  }
}

}  // namespace

void MergedPoint::add_attributes(const PointRecord& p) {
  count_ = 1;
  if (p.normal != kNoNormal) {
    const Float3 n = decode_normal(p.normal);
    for (std::size_t a = 0; a < 3; ++a)
      normal_[a] = static_cast<std::int64_t>(std::floor(static_cast<double>(n[a]) * 1048576.0 + 0.5));
  }
  if (p.rgba >> 24 != 0) {
    coloured_ = 1;
    for (unsigned c = 0; c < 3; ++c) colour_[c] = p.rgba >> (8 * c) & 0xff;
  }
}

void MergedPoint::add(const MergedPoint& other) {
  count_ += other.count_;
  coloured_ += other.coloured_;
  for (std::size_t a = 0; a < 3; ++a) {
    normal_[a] += other.normal_[a];
    colour_[a] += other.colour_[a];
  }
  first_.sensor = std::min(first_.sensor, other.first_.sensor);
  const unsigned a = first_.flags;
  const unsigned b = other.first_.flags;
  first_.flags = static_cast<std::uint16_t>((a & b & (kPointNotLast | kPointSynthetic | kPointUnseen)) |
                                            ((a | b) & kPointGround));
}

PointRecord MergedPoint::result() const {
  if (count_ <= 1) return first_;
  PointRecord p = first_;
  const double x = static_cast<double>(normal_[0]);
  const double y = static_cast<double>(normal_[1]);
  const double z = static_cast<double>(normal_[2]);
  const double size = std::sqrt(x * x + y * y + z * z);
  p.normal = size > 0.0 ? encode_normal(static_cast<float>(x / size), static_cast<float>(y / size),
                                        static_cast<float>(z / size))
                        : kNoNormal;
  p.rgba = 0;
  if (coloured_ > 0) {
    p.rgba = 0xff000000u;
    for (unsigned c = 0; c < 3; ++c)
      p.rgba |= static_cast<std::uint32_t>((colour_[c] + coloured_ / 2) / coloured_) << (8 * c);
  }
  return p;
}

std::span<const PointRecord> BrickSorter::sort(std::span<const PointRecord> points) {
  const std::size_t n = points.size();
  sorted_.resize(std::max(sorted_.size(), n));
  std::size_t out = 0;
  MergedPoint merged;
  bool merging = false;
  const auto emit = [&](const PointRecord& p) {
    if (out > 0 && sorted_[out - 1].q == p.q) {
      if (!merging) merged = MergedPoint(sorted_[out - 1]);
      merging = true;
      merged.add(MergedPoint(p));
      return;
    }
    if (merging) sorted_[out - 1] = merged.result();
    merging = false;
    sorted_[out++] = p;
  };
  if (n <= kSmall) {
    small_.resize(n);
    for (std::size_t i = 0; i < n; ++i) small_[i] = key_in_brick(points[i].q) << kIndexBits | i;
    radix_sort(small_, small_other_, kIndexBits);
    for (const std::uint64_t v : small_) emit(points[v & (kSmall - 1)]);
  } else {
    large_.resize(n);
    for (std::size_t i = 0; i < n; ++i) large_[i] = {key_in_brick(points[i].q), i};
    radix_sort(large_, large_other_, 0);
    for (const Keyed& v : large_) emit(points[v.index]);
  }
  if (merging) sorted_[out - 1] = merged.result();
  return {sorted_.data(), out};
}

}  // namespace tessera
