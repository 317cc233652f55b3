#include "stream/points/reconstruct_options.h"

#include "octree/error.h"

namespace tessera {

void ReconstructOptions::validate() const {
  if (up == Double3{0, 0, 0}) throw UsageError("--up 0,0,0: has no direction");
  if (tolerance == 0.0 && (keep_raw || reference != "surface"))
    throw UsageError(
        std::string(keep_raw ? "--keep-raw" : "--reference") +
        ": means something with --tolerance only, without it the mesh of full resolution is the result");
}

ReconstructOptions reconstruct_options(const JobState& state) {
  return from_settings<ReconstructOptions>(state.settings);
}

}  // namespace tessera
