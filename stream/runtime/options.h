/// \file options.h
/// Every option of a job, with its default, once. The command line and job files bind to these fields.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "octree/lattice.h"

namespace tessera {

/// How a job runs. Nothing here changes a byte of the result.
struct RunOptions {
  std::uint64_t memory_bytes = 0;  ///< cap on peak RSS; 0 = detect (physical, cgroup, SLURM, ulimit) x 0.8
  int threads = 0;                 ///< 0 = all cores
  int tile_cells = 0;              ///< edge of an execution tile, multiple of 64; 0 = by the cap
  std::filesystem::path temp;      ///< where the work directory goes; empty = beside the output
  bool force = false;              ///< discard a work directory of another job, overwrite the output
  bool keep = false;               ///< keep the work directory
  bool processes = false;          ///< run every task as its own process (`tessera task`)
  std::string until;               ///< stop (exit code 7) once this stage is committed
  std::string progress = "auto";   ///< bar, plain, json, none; auto = bar on a terminal, else plain
  std::filesystem::path log;       ///< log file; empty = <work>/log.txt
  std::filesystem::path report;    ///< copy of report.json; empty = <output>.report.json
  int verbosity = 0;               ///< -1 quiet .. 2
};

/// What a job computes. Every field changes the result and is part of the job's identity.
struct ReconstructOptions {
  double resolution = 0.0;          ///< lattice spacing h, scan units; 0 = auto
  double radius = 0.0;              ///< support radius, scan units; 0 = auto (at least 3 h when h is auto)
  std::string method = "emc";       ///< emc or mc
  double feature_angle_deg = 25.0;  ///< opening angle from which a cell holds a feature
  double corner_angle_deg = 45.0;   ///< deviation from the crease plane from which it is a corner
  std::uint64_t min_component = 0;  ///< faces; smaller islands are dropped; 0 = auto, 1 = keep all
  std::uint32_t max_hole = 0;       ///< boundary loops of at most this many edges are filled; 0 = none
  std::string holes = "keep";       ///< keep, close, or fill-to:D: close, but no farther than D from the data
  std::string outliers = "auto";    ///< auto or off: statistical, isolated and flying points
  std::string normals = "auto";     ///< auto (given ones, else estimated), given, estimate
  std::vector<Double3> viewpoints;  ///< sensor origins given on the command line
  bool has_up = false;              ///< orient by `up`
  Double3 up = {0, 0, 1};           ///< normals point to this side (airborne scans)
  double max_uncertain = 0.5;       ///< share of points whose sign may stay in doubt; above it the job fails
  std::uint64_t max_brick_points = 1u << 22;  ///< hot bricks are thinned to this, deterministically
  std::vector<std::string> columns;           ///< names of text columns
  double tolerance = 0.0;  ///< scan units; the mesh shrinks within this distance of itself; 0 = it stays
  std::string reference =
      "surface";              ///< with a tolerance: surface, or points (they too stay within it, one way)
  bool keep_raw = false;      ///< with a tolerance: the full-resolution mesh is written too
  bool local_output = false;  ///< write positions relative to the global shift, floats; the report has it
};

}  // namespace tessera
