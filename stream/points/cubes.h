/// \file cubes.h
/// Points by cubes of one edge, to keep one of each. Cubes lie at whole multiples of the edge in the scan's own frame, so
/// they are the same whatever else a job reads.
#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "stream/formats/points/point_source.h"

namespace tessera {

using Cube = std::array<std::int64_t, 3>;

/// The cube of a point. False for one that has none: not finite, or farther away than cubes can be counted.
bool cube_of(const Double3& p, double edge, Cube& cube);
/// Of its point to its middle.
double squared_distance_to_middle(const Double3& p, double edge, const Cube& cube);
std::uint64_t cube_hash(const Cube& cube);

/// Deals points to buckets by their cubes; points that have none go to bucket 0.
class CubeDealer {
 public:
  using Sink = std::function<void(std::uint32_t file, std::uint32_t bucket, const PointChunk&)>;
  CubeDealer(double edge, std::size_t buckets) : edge_(edge), buckets_(buckets) {}
  void deal(std::uint32_t file, const PointChunk& chunk, const Sink& sink);
  void finish(const Sink& sink);

 private:
  double edge_;
  std::uint32_t file_ = 0;
  std::vector<PointChunk> buckets_;
};
std::uint64_t cube_dealer_bytes(std::size_t buckets);

}  // namespace tessera
