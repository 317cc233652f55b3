/// \file box_solid.h
/// A box of twelve faces, for tests of solids.
#pragma once
#include "kernels/boolean/mesh_cuts.h"

namespace tessera::test {

inline SolidMesh box_solid(const Double3& low, const Double3& high) {
  SolidMesh m;
  for (int c = 0; c < 8; ++c)
    m.points.push_back({c & 1 ? high[0] : low[0], c & 2 ? high[1] : low[1], c & 4 ? high[2] : low[2]});
  m.faces = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
             {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  return m;
}

}  // namespace tessera::test
