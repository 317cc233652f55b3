/// \file value_picture.h
/// Points with a value each as a picture for a page: cells of a ValueMap as discs in the colours of their values, from four sides
/// (six where they are not flat), worst places ringed and numbered.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/render/value_cells.h"

namespace tessera {

/// Of points that have no value.
inline constexpr std::uint32_t kNoValueColour = 0xff606060u;

struct ValuePicture {
  std::string png;
  std::vector<std::string> notices;  ///< of the renderer
};

/// \param scale  end of the scale of colours, either way: deviation_colour() with signs
/// \param memory_bytes  cap on the peak resident memory of the process \param temp  folder for scratch files
/// \throws ResourceError where OSMesa is missing, the cap is too small or the disk full; EmptyError for a map without cells
ValuePicture draw_values(const ValueMap& map, double scale, std::uint64_t memory_bytes,
                         const std::filesystem::path& temp);

}  // namespace tessera
