/// \file merge_job.h
/// Overlapping meshes, not quite matching, become one: originals stay but for a band along the joints.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/runtime/job.h"
#include "stream/runtime/option_table.h"

namespace tessera {

struct MergeOptions {
  std::string priority;
  double blend = 0.0;
  double distance = 0.0;
  double resolution = 0.0;
  std::string crossings = "refuse";
  std::uint64_t meshes = 2;  ///< how many inputs: part of the job, since its stages follow from it

  void validate() const {}
};
OptionTable option_table(MergeOptions& options);

/// Inputs that --priority names, best first: by their names, with or without folder and extension, or their numbers
/// from 1. \throws UsageError for a word that is none of them, or two of them
std::vector<std::size_t> read_priority(const std::string& priority,
                                       const std::vector<std::filesystem::path>& inputs);

/// Import of every input, scale, joints, cover, strip, zip, write. The report's `merge` tells of ranks and joints.
JobDescription merge_job(const MergeOptions& options);

}  // namespace tessera
