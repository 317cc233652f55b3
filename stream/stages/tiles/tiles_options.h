/// \file tiles_options.h
/// What of 3D Tiles users choose; part of a job's identity.
#pragma once
#include <cstdint>

#include "stream/runtime/option_table.h"

namespace tessera {

struct TilesOptions {
  std::uint64_t tile_faces = 1u << 16;
  bool normals = false;
  double texture = 0.0;  ///< texture_option.h: width of a texel of the finest level; 0 = colours of vertices

  bool has_texture() const { return texture != 0.0; }

  /// \throws UsageError naming the option
  void validate() const {}
};

OptionTable option_table(TilesOptions& options);

}  // namespace tessera
