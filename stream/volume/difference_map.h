/// \file difference_map.h
/// Heights of a mesh less those of a base, cell by cell, as a GeoTIFF: what a volume is made of, to look at.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/meshes/mesh_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/volume/base_surface.h"
#include "stream/volume/toe_surface.h"
#include "stream/volume/volume_areas.h"

namespace tessera {

/// What is mapped: over a surface, toes, or the level where there is neither.
struct DifferenceMap {
  const BaseSurface* surface = nullptr;
  const std::vector<ToeSurface>* toes = nullptr;  ///< by area; may be empty
  const std::vector<VolumeArea>* areas =
      nullptr;  ///< cells with centres elsewhere have no value; empty = everywhere
  double level = 0.0;
  double low = 0.0, high = 0.0;  ///< heights of the base
  Double3 origin{};              ///< of surface, toes and areas
  double cell = 0.0;             ///< edge; edges of cells lie at whole multiples of it
  std::string crs;
  std::uint64_t memory_bytes = 0;
};

/// Under the centre of every cell the height of the highest face less that of the base's highest one, 32 bit floats, -9999 where
/// either is missing. The bytes hang on meshes and cell alone.
/// \returns lines for the user
/// \throws as write_rasters; EmptyError where no centre lies over both
std::string write_difference(const MeshStore& mesh, const DifferenceMap& map,
                             const std::filesystem::path& scratch, WorkerPool& pool, MemoryBudget& budget,
                             const std::filesystem::path& output);

}  // namespace tessera
