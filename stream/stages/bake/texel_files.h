/// \file texel_files.h
/// Colours of the rasters of the charts of a block on disk.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>

#include "stream/files/packed_file.h"

namespace tessera {

inline constexpr PackedKind kTexelKind = {"TSTEXEL2", "a file of texels"};

struct TexelEntry {
  Section pixels;   ///< r | g<<8 | b<<16 | a<<24, rows of ascending v; alpha 0: none
  Section normals;  ///< the same of a normal map; empty without
  std::uint32_t width = 0, height = 0;
};

std::string texel_file(std::size_t block);

}  // namespace tessera
