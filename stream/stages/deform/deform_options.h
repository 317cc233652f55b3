/// \file deform_options.h
/// What of an edit users choose; part of a job's identity.
#pragma once
#include <cstdint>
#include <string>

#include "stream/runtime/option_table.h"

namespace tessera {

struct DeformOptions {
  std::string mode = "deform";  ///< or "prepare", "apply"
  std::string edit;             ///< the edit, JSON; with apply the pose
  std::string base = "auto";
  std::uint64_t base_vertices = 100000;
  std::string islands = "follow";
  std::string crossings = "count";
  bool dry_run = false;

  /// \throws UsageError naming the option
  void validate() const;
};

OptionTable option_table(DeformOptions& options);

}  // namespace tessera
