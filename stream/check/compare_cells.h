/// \file compare_cells.h
/// Space cut into boxes by what two meshes hold, so that one box at a time can be loaded and compared.
#pragma once
#include <cstdint>
#include <vector>

#include "kernels/certify/certificate_pair.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

struct CompareCell {
  MeshBox box;              ///< neighbours share their planes bit by bit
  std::uint64_t bytes = 0;  ///< to load both meshes within reach of it, with an index each
  std::uint64_t faces = 0;  ///< of both meshes in the patches within reach: at least as many as are loaded
};

/// What is loaded around a cell, in reaches.
inline constexpr double kCompareHalo = kPairHalo;

/// CompareCell::bytes. \param faces  of both meshes \param block_bytes  MeshStore::block_bytes of them
std::uint64_t compare_cell_bytes(std::uint64_t block_bytes, std::uint64_t faces);

/// Cells that tile all places where either mesh may be, in Morton order. Cells hold about `cell_faces` faces
/// of both meshes, unless they would be smaller than a few reaches. A pure function of the tables of both
/// stores. \param max_distance  >= 0, scan units
std::vector<CompareCell> make_compare_cells(const MeshStore& mesh, const MeshStore& reference,
                                            double max_distance, std::uint64_t cell_faces);

}  // namespace tessera
