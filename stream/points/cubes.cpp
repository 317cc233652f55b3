#include "stream/points/cubes.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr double kMaxCubes = 4e15;  // from zero: below it doubles hold all whole numbers
/// Points that wait in all buckets together.
constexpr std::size_t kWaiting = std::size_t{1} << 18;
constexpr std::size_t kMinWaiting = 256;
constexpr std::uint64_t kPointBytes = 64;

std::size_t waiting(std::size_t buckets) {
  return std::max(kMinWaiting, kWaiting / std::max<std::size_t>(1, buckets));
}

}  // namespace

bool cube_of(const Double3& p, double edge, Cube& cube) {
  for (std::size_t a = 0; a < 3; ++a) {
    const double at = std::floor(p[a] / edge);
    if (!(std::fabs(at) < kMaxCubes)) return false;
    cube[a] = static_cast<std::int64_t>(at);
  }
  return true;
}

double squared_distance_to_middle(const Double3& p, double edge, const Cube& cube) {
  double sum = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    const double d = p[a] / edge - (static_cast<double>(cube[a]) + 0.5);
    sum += d * d;
  }
  return sum;
}

std::uint64_t cube_hash(const Cube& cube) {
  std::uint64_t h = 0;
  for (const std::int64_t c : cube) {
    // The finish of SplitMix64 (Vigna): every bit of the coordinate changes every bit of the hash.
    h += static_cast<std::uint64_t>(c) + 0x9e3779b97f4a7c15u;
    h = (h ^ h >> 30) * 0xbf58476d1ce4e5b9u;
    h = (h ^ h >> 27) * 0x94d049bb133111ebu;
    h ^= h >> 31;
  }
  return h;
}

void CubeDealer::deal(std::uint32_t file, const PointChunk& chunk, const Sink& sink) {
  if (file != file_) finish(sink);
  file_ = file;
  const std::size_t maximum = waiting(buckets_.size());
  for (std::size_t i = 0; i < chunk.size(); ++i) {
    Cube cube;
    const bool has = cube_of({chunk.x[i], chunk.y[i], chunk.z[i]}, edge_, cube);
    const std::size_t b = has ? static_cast<std::size_t>(cube_hash(cube) % buckets_.size()) : 0;
    buckets_[b].append(chunk, i);
    if (buckets_[b].size() < maximum) continue;
    sink(file_, static_cast<std::uint32_t>(b), buckets_[b]);
    buckets_[b].clear();
  }
}

void CubeDealer::finish(const Sink& sink) {
  for (std::size_t b = 0; b < buckets_.size(); ++b) {
    if (buckets_[b].size() > 0) sink(file_, static_cast<std::uint32_t>(b), buckets_[b]);
    buckets_[b].clear();
  }
}

std::uint64_t cube_dealer_bytes(std::size_t buckets) {
  // Arrays double as they grow.
  return buckets == 0 ? 0 : 2 * kPointBytes * waiting(buckets) * buckets;
}

}  // namespace tessera
