/// \file thin_columns.h
/// Columns of a scan seen from above below what is thinner than a column: wires, rails, ropes. A column depends on nothing
/// farther away than 13 columns.
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/points/surface_model.h"

namespace tessera {

/// A column is below a wire where the scan shows a layer three cells and more above the ground around, the ground through it in
/// three in five of such columns around, nothing in between, in a line of columns that is nowhere seven wide.
/// \param layers  edge^2, u fastest
/// \param ground  gets the lowest bottom around every column, where any column shows something three cells above its bottom
/// \returns 1 for these columns and for those beside them that show the ground alone; nothing where there are none to look at
std::vector<std::uint8_t> find_thin_columns(std::span<const ColumnLayers> layers, int edge,
                                            std::vector<std::int32_t>& ground);

}  // namespace tessera
