/// \file triangulations.h
/// One smooth surface in triangulations that have little in common, for tests of what must not hang on them.
#pragma once
#include <functional>
#include <string>
#include <vector>

#include "octree/vector.h"
#include "tests/helpers/mesh_files.h"

namespace tessera::test {

/// A surface over the unit square.
struct SmoothSurface {
  std::string name;
  bool round = false;   ///< closed around t, with a pole at both ends of s; else a sheet
  double length = 1.0;  ///< along s
  double widest = 1.0;  ///< along t
  std::function<Double3(double s, double t)> point;
  std::function<double(double s)> width;  ///< along t
};

/// A capsule along x of radius 1 from x = 0 to 12; one whose section is nearly a square; a ball of radius 1; a sheet of 10 by 10
/// with waves.
[[nodiscard]] SmoothSurface smooth_tube();
[[nodiscard]] SmoothSurface smooth_bar();
[[nodiscard]] SmoothSurface smooth_ball();
[[nodiscard]] SmoothSurface smooth_sheet();

enum class Triangulation : std::uint8_t {
  kFine,       ///< even, edges as long as told
  kCoarse,     ///< even, twelve times as long
  kSlivers,    ///< rows far apart and close together by turns, all diagonals one way: faces of 1 : 7
  kIrregular,  ///< six times as long in the mean, vertices strewn about their places, valences of 4 to 9
  kRefined,    ///< as coarse, but for a band in the middle, which is four times as fine
};
inline constexpr Triangulation kTriangulations[] = {Triangulation::kFine, Triangulation::kCoarse,
                                                    Triangulation::kSlivers, Triangulation::kIrregular,
                                                    Triangulation::kRefined};
[[nodiscard]] std::string name_of(Triangulation kind);

[[nodiscard]] WholeMesh triangulated(const SmoothSurface& surface, Triangulation kind, double edge);

}  // namespace tessera::test
