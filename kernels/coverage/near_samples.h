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
  /// Faces over positions.
  void add(std::span<const Double3> position, std::span<const std::array<std::uint32_t, 3>> faces);
  /// Per sample: 1 if a face came near it.
  [[nodiscard]] std::span<const std::uint8_t> near() const { return near_; }

 private:
  /// Cells that a box touches, clamped to those that there are.
  std::array<Int3, 2> cells(const Double3& low, const Double3& high) const;
  template <class Use>
  void for_cells(const std::array<Int3, 2>& range, const Use& use) const;

  void meet(std::size_t cell, const std::array<Double3, 3>& face);

  std::span<const Double3> samples_;
  double distance_;
  Double3 low_{}, high_{};  ///< of all that lies within the distance of a sample, by coordinates
  double per_edge_ = 1.0;
  Int3 cells_ = {1, 1, 1};
  /// By cell: those within the distance of it, by coordinates, that no face was near yet when last looked at.
  std::vector<std::uint32_t> start_, end_, sample_;
  std::vector<std::uint8_t> near_;
};

}  // namespace tessera
