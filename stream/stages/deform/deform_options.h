/// \file deform_options.h
/// What of an edit users choose; part of a job's identity.
#pragma once
#include <cstdint>
#include <string>

#include "stream/runtime/option_table.h"

namespace tessera {

struct DeformOptions {
  std::string mode = "deform";  ///< or "prepare", "apply", "onto"
  std::string edit;             ///< the edit, JSON; with apply the pose
  std::string base = "auto";
  std::uint64_t base_vertices = 100000;
  std::string islands = "follow";
  std::string crossings = "count";
  bool dry_run = false;
  // Of the mode "onto".
  std::uint64_t order = 2;
  double wavelength = 0.0;    ///< units of the mesh; 0 = as short as held-out cells of the scan confirm
  double max_distance = 0.0;  ///< units of the mesh; 0 = a tenth of its diagonal

  /// \throws UsageError naming the option
  void validate() const;
};

OptionTable option_table(DeformOptions& options);

}  // namespace tessera
