/// \file vdb_file.h
/// A narrow-band level set as an OpenVDB file (version 224, active values only), written leaf by leaf: the library itself
/// holds the whole tree in memory. Layout: openvdb/tree/*.h, openvdb/io/Compression.h of OpenVDB 10.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>

#include "octree/lattice.h"

namespace tessera {

/// 8^3 nodes. Words and values run along z as OpenVDB's do: bit 8 y + z of word x, value 64 x + 8 y + z.
struct LevelSetLeaf {
  Int3 origin{};  ///< node coordinates of the min corner, multiples of 8, not negative
  std::int32_t unused = 0;
  std::array<std::uint64_t, 8> active{};   ///< nodes in the band
  std::array<std::uint64_t, 8> outside{};  ///< nodes with positive values, in the band or not
  std::array<float, 512> value{};          ///< of nodes in the band
};
static_assert(sizeof(LevelSetLeaf) == 16 + 128 + 2048);

struct LevelSetFile {
  Lattice lattice;
  float background = 0.0f;  ///< of nodes outside beyond the band; inside it is negative
  /// Per leaf, in any order, no repeats.
  std::span<const Int3> origins;
  std::function<void(std::size_t, LevelSetLeaf&)> load;
  /// Whether a node of no leaf lies inside; the same for all nodes between leaves that touch.
  std::function<bool(const Int3&)> inside;
  std::function<void()> pause;
};

/// Memory: 16 bytes a leaf, and the buffer of the file. \returns bytes written
/// \throws UsageError, ResourceError as OutputFile
std::uint64_t write_level_set(const std::filesystem::path& path, const LevelSetFile& file);

/// Memory of it.
std::uint64_t write_level_set_bytes(std::uint64_t leaves);

}  // namespace tessera
