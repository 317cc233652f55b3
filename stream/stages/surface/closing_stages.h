/// \file closing_stages.h
/// Passes "multipole", "rims" and "close": which cells close the surface where the data ends. Empty with --holes keep.
///   multipole  oriented points -> multipoles by brick, the global summary of the winding number
///   rims       points -> local field of every tile -> its signs by brick, and the cells where the surface ends
///   close      rims -> closing cells by brick: grown brick by brick, in rounds, until nothing is added. The set does
///              not depend on the order (closing.h), so neither does it on tiles or threads
#pragma once
#include <string>

#include "kernels/closing/closing.h"
#include "stream/points/plan.h"
#include "stream/runtime/stage.h"

namespace tessera {

/// Farthest that the closing of an open sheet reaches when no distance is given, cells.
inline constexpr double kDefaultSheetLimit = 20.0;

/// `--holes` as the stages read it.
struct HolesMode {
  bool close = false;
  double limit = 0.0;  ///< scan units; 0 = none given

  /// \throws UsageError for anything but keep, close and fill-to:D
  explicit HolesMode(const std::string& text);
};

/// How a job closes: decided by the close stage, read by the surface stage.
ClosingOptions load_closing_options(const std::filesystem::path& work);

std::unique_ptr<Stage> make_multipole_stage(const JobState& state);
std::unique_ptr<Stage> make_rims_stage(const JobState& state);
std::unique_ptr<Stage> make_close_stage(const JobState& state);

}  // namespace tessera
