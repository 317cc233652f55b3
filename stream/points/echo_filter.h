/// \file echo_filter.h
/// Which points of a laser scan are wanted, by their class and the return of their pulse.
#pragma once
#include <bitset>
#include <string>
#include <vector>

#include "stream/formats/points/point_source.h"

namespace tessera {

inline constexpr std::uint8_t kGroundClass = 2;

class EchoFilter {
 public:
  /// \param classes  numbers up to 255; none = all but noise (7 and 18)
  /// \param returns  all, first or last; a single return is both
  /// \throws UsageError  naming a class that is no such number
  EchoFilter(const std::vector<std::string>& classes, const std::string& returns);

  /// The chunk, or in `scratch` what is left of it; counts what is not. Points that tell neither class nor return stay.
  const PointChunk& apply(const PointChunk& chunk, PointChunk& scratch, ReadCounts& counts) const;

  /// For inputs of which none tells classes and returns. \throws UsageError where some are asked for
  void refuse() const;
  /// \throws EmptyError  where nothing is left of points read
  void require_wanted(std::uint64_t read, std::uint64_t left_out) const;

 private:
  std::bitset<256> classes_;
  std::string asked_classes_;  ///< as given
  std::string returns_;
};

}  // namespace tessera
