/// \file scan_folder.h
/// Folders that are one scan: octrees of EPT and of Potree 1, whose nodes each hold points of their own, coarse ones
/// first, so that all nodes together are the scan. Sources: Entwine Point Tile specification 1.1 (Hobu); PotreeConverter
/// 1.7, "cloud.js".
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace tessera {

struct ScanFolder {
  std::string kind;                          ///< "an EPT octree", "a Potree octree"
  std::vector<std::filesystem::path> nodes;  ///< files of points, sorted
  std::vector<std::string> warnings;         ///< where hierarchy and files differ, one sentence each
};

/// Nothing for a folder that is none. What its hierarchy (EPT) lists is taken, else all files named as nodes are.
/// \throws InputError for one whose nodes are in a form that is not read, or whose description is damaged
std::optional<ScanFolder> open_scan_folder(const std::filesystem::path& folder);

/// Whether a file of this name describes the scan of its folder: ept.json, cloud.js.
bool describes_scan_folder(const std::filesystem::path& file);

}  // namespace tessera
