/// \file cell_ladder.h
/// How many cells of ever longer edges hold points, of what the survey has counted and sampled: what point_clumps.h asks for.
#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/points/point_clumps.h"
#include "stream/points/brick_histogram.h"
#include "stream/points/point_sample.h"

namespace tessera {

/// In cells of the lattice (h): from blocks of 8 cells upwards.
PointClumps clumps_of_bricks(const std::vector<BrickCount>& bricks);
/// The same from 2 cells upwards. \param cells  sampled ones, in quanta   \param size  their edge, 16 cells
PointClumps clumps_of_samples(const std::vector<CellSampler::Cell>& cells, double size,
                              const std::vector<BrickCount>& bricks);

/// One sentence about clumps and what to do about them; empty where there are none. \param clumps  in scan units
std::string clump_sentence(const PointClumps& clumps);
void save_clumps(const std::filesystem::path& path, const PointClumps& clumps);
/// That of a job, as the survey left it in its work directory.
std::string clump_sentence(const std::filesystem::path& work);
inline constexpr const char* kClumpFile = "clumps.json";

/// robust_window(). A resolution that was measured within clumps is nobody's choice: where it is too fine for the extent,
/// not the next larger one is named, but what the points carry.
BrickWindow scan_window(const std::vector<BrickCount>& bricks, double h, bool measured);

}  // namespace tessera
