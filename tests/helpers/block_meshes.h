/// \file block_meshes.h
/// Small mesh blocks with known geometry, and pieces of them.
#pragma once
#include <functional>

#include "kernels/mesh/mesh_block.h"

namespace tessera::test {

/// Canonical block of the faces; key of vertex i is 10 i + 7. Edges with one face get their border flag.
MeshBlock make_block(const std::vector<Double3>& position,
                     const std::vector<std::array<std::uint32_t, 3>>& faces);

/// (columns + 1) x (rows + 1) vertices at (i, j, height(i, j)), two right-angled triangles a square, all
/// diagonals alike.
MeshBlock grid_block(int columns, int rows, const std::function<double(double, double)>& height);

/// Octahedron, every face split into 4^levels, on the unit sphere.
MeshBlock sphere_block(int levels);

/// Surface of the unit cube, every side n x n squares.
MeshBlock cube_block(int n);

/// Sheets of edge x edge squares, 0.2 above each other, rough: coarser versions of them meet.
MeshBlock rough_sheets(int edge, int sheets, double roughness, std::uint64_t seed);

/// The faces all of whose vertices pass, with keys and border flags of the whole.
MeshBlock piece_of(const MeshBlock& whole, const std::function<bool(std::uint32_t)>& pass);

/// Moves every coordinate by at most `amplitude`, from the vertex's key alone.
void add_noise(MeshBlock& block, double amplitude, std::uint64_t seed);

}  // namespace tessera::test
