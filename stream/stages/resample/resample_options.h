/// \file resample_options.h
/// What of resampling users choose; part of a job's identity.
#pragma once
#include <cstdint>
#include <string>

#include "kernels/blends/resample_blend.h"
#include "stream/runtime/option_table.h"

namespace tessera {

struct ResampleOptions {
  std::string blends = "auto";  ///< or JSON: the tracks that a file gave
  double tolerance = 0.0;       ///< units of the mesh; 0 = a thousandth of its diagonal
  double spacing = 0.0;         ///< units of the mesh; 0 = the mean edge around each blend
  double scale = 0.0;           ///< units of the mesh; 0 = four edges
  double round = 0.0;           ///< units of the mesh; 0 = not
  bool sharpen = false;
  std::string profile;  ///< JSON: knots that a file gave; empty = none
  std::uint64_t block_faces = 1u << 16;

  bool edits() const { return round > 0.0 || sharpen || !profile.empty(); }
  /// \throws UsageError naming the option
  void validate() const;
  /// What one blend is resampled with.
  BlendOptions kernel(double tolerance_of_mesh, bool float_positions) const;
};

OptionTable option_table(ResampleOptions& options);

}  // namespace tessera
