/// \file cylinder_positions.h
/// Where the points of a cloud lie along an axis, of those in a cylinder around it.
/// Source: Lague, Brodu, Leroux, "Accurate 3D comparison of complex topography with terrestrial laser scanner", 2013, 3.2.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/change/near_cells.h"

namespace tessera {

struct Cylinder {
  Double3 middle{};
  Double3 axis{};  ///< unit
  double radius = 0.0;
  double depth = 0.0;  ///< from its middle to either end
};

struct AxialPositions {
  std::uint64_t count = 0;
  double mean = 0.0;  ///< along the axis, 0 at the middle; with `median` the median
  double spread =
      0.0;  ///< standard deviation (by n - 1; 0 of one point); with `median` the interquartile range
};

/// Of the points within the cylinder, its surface included. Quartiles are between two points by straight line.
/// \param near  of the cells, all that hold points of the cylinder  \param work  scratch, kept between calls
AxialPositions axial_positions(const PointCells& cells, const NearCells& near, const Cylinder& cylinder,
                               bool median, std::vector<double>& work);

}  // namespace tessera
