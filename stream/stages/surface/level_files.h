/// \file level_files.h
/// Which bricks of a job with --levels are of which size. The points lie on the lattice of the coarsest level, h; the bricks
/// that the mesh is made of are leaves of an octree over the finest one, h / 2^(levels - 1), down from bricks of the
/// points.
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "octree/level_tree.h"
#include "stream/points/reconstruct_options.h"

namespace tessera {

/// A node that is no leaf.
struct SplitNode {
  std::uint64_t level = 0;  ///< 0 is the finest
  std::uint64_t key = 0;    ///< Morton code on its level
};

inline constexpr const char* kLevelFolder = "levels/";
inline constexpr const char* kLevelTreeFile = "levels/tree.bin";
std::string split_nodes_file(std::size_t task);

/// \return bytes written
std::uint64_t save_split_nodes(const std::filesystem::path& file, const std::vector<SplitNode>& nodes);
/// \throws InputError naming the file when it is damaged
std::vector<SplitNode> load_split_nodes(const std::filesystem::path& file);

/// From nodes in any order; leaves that touch come out one level apart at most.
LevelTree make_level_tree(int levels, std::span<const SplitNode> nodes);
/// The one of a work directory. \pre stage "levels" is done
LevelTree level_tree_of_work(const std::filesystem::path& work, int levels);

/// The lattice that the mesh is named on: that of the points, or finer.
Lattice finest_lattice(const Lattice& points, const ReconstructOptions& options);

}  // namespace tessera
