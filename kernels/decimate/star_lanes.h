/// \file star_lanes.h
/// A closed star of four to eight faces in the lanes of vector registers: what its collapses cost, and how far one of
/// them moves the surface, all faces at once.
///
/// The same tests as check_new_faces() (collapse_legality.h) and fan_deviation() (collapse_deviation.h), in floats relative to the centre and in
/// units of the tolerance. What comes within rounding of a decision is left to those.
///
/// Rounding. With R the largest coordinate of the star relative to its centre and u = 2^-24, a height over the polygon
/// is off by less than 16 u R, as in link_polygon.h; judge() adds that.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/decimate/quadric.h"
#include "octree/lanes.h"

namespace tessera {

class StarLanes {
 public:
  enum class Answer : std::uint8_t { kGood, kRefused, kDoubt };
  struct Cheapest {
    double cost;
    std::size_t at;  ///< place in the ring
  };

  /// \param unit           length in whose terms all is computed: the tolerance, > 0
  /// \param min_mean_ratio  DecimateOptions::min_mean_ratio
  StarLanes(double unit, double min_mean_ratio);

  /// \return false where the star is open or has too few or too many faces, or its size is out of proportion to the unit
  bool load(const CollapseMesh& mesh, std::uint32_t u, const Star& star);

  /// What the collapse into each vertex of the ring costs by endpoint quadrics (collapse_costs.h).
  /// \param q  quadric of the centre, which lies at `from`
  void costs(const Quadric& q, const Double3& from, std::array<double, 8>& cost) const;
  /// The cheapest of them, the first of the ring among equals.
  [[nodiscard]] Cheapest cheapest(const Quadric& q, const Double3& from) const;

  /// Whether all faces surely turn by less than the angle of this cosine from the first; else they may or may not.
  [[nodiscard]] bool is_surely_flat(float cosine) const;

  /// Is the collapse of the centre into ring vertex `at` neither a fold nor thin?
  /// \param[out] deviation  where it is kGood: every point of the star before or after lies within it of the other
  Answer judge(std::size_t at, double& deviation) const;

 private:
  Float8 cost_lanes(const Quadric& q, const Double3& from) const;

  const double unit_;
  const float per_unit_, min_;
  const double unit4_;
  std::size_t size_ = 0;
  float largest_ = 0.0f;
  Float8x3 ring_;  ///< relative to the centre
  Float8 error_;
};

}  // namespace tessera
