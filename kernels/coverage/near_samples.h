/// \file near_samples.h
/// Which of a few samples lie within a distance of any of many faces, exactly: the faces come by one at a time.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/vector.h"

namespace tessera {

class NearSamples {
 public:
  /// \param samples  finite; they must outlive it  \param distance  > 0; nearer than that is near
  NearSamples(std::span<const Double3> samples, double distance);

  void add(const std::array<Double3, 3>& face);
  /// Per sample: 1 if a face came near it.
  std::span<const std::uint8_t> near() const { return near_; }

 private:
  int cell(std::size_t axis, double at) const;  ///< clamped to those that there are

  std::span<const Double3> samples_;
  double distance_;
  Double3 low_{};
  double edge_ = 1.0;
  Int3 cells_ = {1, 1, 1};
  std::vector<std::uint32_t> start_, sample_;  ///< by cell
  std::vector<std::uint8_t> near_;
};

}  // namespace tessera
