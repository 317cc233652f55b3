/// \file row_samples.h
/// The samples that reach one row of eight nodes (and the plane of rows it lies in), narrowed down step by
/// step in canonical order.
#pragma once
#include <array>

#include "kernels/field/sample_list.h"
#include "kernels/field/sheets.h"

namespace tessera {

/// Samples of one row, broadcast one at a time: x relative to the leaf, y and z to the row; yz2 = y^2 + z^2,
/// n_yz = ny y + nz z. So many that rows of dense scans are rarely filled in parts, which are gathered anew for every
/// node with a crease; few samples touch few cache lines all the same.
constexpr std::size_t kRowSamples = 2048;
struct RowSamples {
  alignas(32) std::array<float, kRowSamples + kLanes> x, y, z, yz2, nx, ny, nz, n_yz;
  std::size_t size = 0;
};

/// Where a row's samples lie: y0, z0 of its axis, the range of x, the squared radius about the axis.
struct RowSupport {
  float y0, z0, low_x, high_x, r2;
};

/// Keeps the samples of `list` from `*next` on that the row reaches, until the row's arrays are full; `*next`
/// says where to go on.
void fill_row(const SampleList& list, const RowSupport& support, std::size_t* next, RowSamples& row);

/// Samples within the radius of the plane z = z0. Leaves `point` of the slab alone.
void fill_slab(const SampleList& list, float z0, float radius, SampleList& slab);

/// Appends the row's samples within the radius of node `x0` to `out`, relative to the node, with their
/// weights.
void append_local(const RowSamples& row, float x0, float r2, LocalSamples& out);

}  // namespace tessera
