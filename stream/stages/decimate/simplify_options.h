/// \file simplify_options.h
/// What of decimation users choose; part of a job's identity.
#pragma once
#include <cstdint>
#include <string>

#include "kernels/decimate/decimate.h"
#include "stream/runtime/option_table.h"

namespace tessera {

struct SimplifyOptions {
  double tolerance =
      0.0;  ///< units of the mesh; 0 = only a face count is given; kAutoTolerance = measured in the job
  std::uint64_t target_faces = 0;
  std::string reference = "surface";
  double max_normal_deviation_deg = 0.0;
  double feature_angle_deg = 25.0;
  std::string priority = "quadric";
  std::string placement = "endpoint";
  double min_mean_ratio = 0.02;
  std::string crossings = "refuse";
  double colour_weight = 0.0;
  double colour_tolerance = kAutoColourTolerance;  ///< levels; 0 = any
  double loop_share = 1.0;  ///< of the tolerance that passes may use; above 1 the certificate sends them back
  std::string smooth = "off";  ///< smooth_before.h
  double texture = 0.0;        ///< texture_option.h: width of a texel, kAutoTexture; 0 = colours of vertices
  bool normal_map = false;     ///< beside it
  int passes = 3;  ///< each with the whole tolerance: a ramp left three times the faces on terrain
  std::uint64_t block_faces = 1u << 16;  ///< with at most eight times as many of the reference below it

  bool smooths() const { return smooth != "off"; }
  bool has_texture() const { return texture != 0.0; }
  /// \throws UsageError naming the option
  void validate() const;
  /// \pre the tolerance is known. What blocks are decimated with: the proof at the end is tight to a few percent, that much is left to it.
  DecimateOptions kernel(bool float_positions) const;
};

OptionTable option_table(SimplifyOptions& options);

}  // namespace tessera
