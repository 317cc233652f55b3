/// \file remesh_options.h
/// What of remeshing users choose; part of a job's identity.
#pragma once
#include <cstdint>
#include <string>

#include "kernels/remesh/remesh.h"
#include "stream/runtime/option_table.h"

namespace tessera {

struct RemeshJobOptions {
  double edge = 0.0;                      ///< units of the mesh; 0 = from faces or tolerance
  std::uint64_t faces = 0;                ///< about so many
  double tolerance = 0.0;                 ///< units of the mesh; 0 = measured only
  bool adaptive = false;                  ///< lengths follow the curvature
  double min_edge = 0.0, max_edge = 0.0;  ///< units of the mesh; of lengths that adapt; 0 = from the mesh
  double max_normal_deviation_deg = 0.0;
  double feature_angle_deg = 25.0;
  int iterations = 4;  ///< in each pass
  int passes = 3;
  double min_angle_deg = 0.0;  ///< of every face, as far as the input and the tolerance let it; 0 = free
  std::uint64_t block_faces = 1u << 16;
  std::string crossings = "refuse";
  std::string even = "both";     ///< or "angles", "areas"
  std::string creases = "even";  ///< or "graded": shorter edges where they bend

  /// Without a tolerance a number of faces is kept by edges as long as it takes.
  bool keeps_faces() const { return faces > 0 && !(tolerance > 0.0); }
  /// With those that raise angles and those that even lengths which adapt: two each, so that the seams of the first lie
  /// inside the blocks of the second.
  int all_passes() const { return first_even_pass() + (adaptive ? kExtraPasses : 0); }
  int first_even_pass() const { return passes + (min_angle_deg > 0.0 ? kExtraPasses : 0); }
  bool evens_in(int pass) const { return pass >= first_even_pass(); }
  static constexpr int kExtraPasses = 2;
  static constexpr double kMaxLengthRatio = 1.5;  ///< of the mean edges of neighbours, where lengths adapt
  /// \throws UsageError naming the option
  void validate() const;
  /// Whether edges that follow the surface closely are to keep within a tenth of their length of it: where nothing is
  /// asked for that shapes would pay for it.
  bool may_be_fine() const { return !(tolerance > 0.0) && even == "both" && !(min_angle_deg > 0.0); }
  /// What blocks are remeshed with. \param edge  length of edges, the longest one where they adapt
  /// \param fine  may_be_fine(), and they are
  RemeshOptions kernel(double edge, double shortest, bool fine, bool float_positions) const;
};

OptionTable option_table(RemeshJobOptions& options);

}  // namespace tessera
