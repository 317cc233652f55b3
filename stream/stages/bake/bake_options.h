/// \file bake_options.h
/// What of baked textures users choose; part of a job's identity.
#pragma once
#include <cstdint>
#include <string>

#include "stream/runtime/option_table.h"

namespace tessera {

struct BakeOptions {
  double texel =
      0.0;  ///< units of the mesh; 0 = 0.4 to 0.8 times the mean spacing of the points on the surface
  double max_distance = 0.0;  ///< units of the mesh; 0 = so many spacings (BakeScale)
  std::uint32_t page_size = 2048;
  bool one_page = false;
  std::uint32_t margin = 2;  ///< texels
  double max_stretch = 1.12;
  std::string page_format = "png";
  std::uint32_t quality = 90;  ///< of JPEG
  bool normal_map = false;
  std::string colour = "rgb";
  std::uint64_t scans = 1;  ///< inputs behind the mesh
  bool fine_mesh = false;   ///< that input is a mesh

  bool is_jpeg() const { return page_format == "jpeg"; }
  bool shows_intensity() const { return colour == "intensity"; }
  /// Of a job whose result gets textures. \param texture  width of a texel, or kAutoTexture
  static BakeOptions of_texture(double texture, bool normal_map);
  /// \throws UsageError naming the option
  void validate() const;
};

OptionTable option_table(BakeOptions& options);

}  // namespace tessera
