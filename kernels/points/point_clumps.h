/// \file point_clumps.h
/// Points in clumps, as where one scan is there several times, moved by less than it is sampled at: nearest neighbours
/// then tell of the copies, not of the surface. Cells that hold points tell: of a surface a quarter as many are left with
/// every doubling of their edge (box counting), of clumps as many as before while cells are smaller than the clumps are apart.
#pragma once
#include <span>

namespace tessera {

struct PointClumps {
  double spacing =
      0.0;  ///< from a clump to the next, in the unit of the edge; 0 = the points are in no clumps
  double points = 0.0;  ///< of a clump
};

/// \param occupied  cells of the edges e, 2 e, 4 e, ... that hold points, falling
/// \param edge      e
/// \param points    of the scan
/// \param typical   points of the median cell that holds any, of an edge that a clump fits in: strewn points are alone there
[[nodiscard]] PointClumps find_clumps(std::span<const double> occupied, double edge, double points,
                                      double typical);

}  // namespace tessera
