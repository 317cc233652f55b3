/// \file import_ranges.h
/// Vertices and faces of a mesh file are read and dealt out range by range, on all threads.
#pragma once
#include <cstdint>

namespace tessera {

inline constexpr std::uint64_t kImportRange = 1u << 15;                    ///< vertices or faces
inline constexpr std::uint64_t kImportLaneBytes = std::uint64_t{5} << 20;  ///< of one range on its way

}  // namespace tessera
