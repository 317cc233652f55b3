/// \file normals_stage.h
/// Pass "normals": shape of every point's neighbourhood: normals where none are given, signs where a sensor or an up
/// direction decides them, brick-local patches where not, supporters for cleaning.
/// Pass "orient": votes between the patches of neighbouring bricks, their solution, and the outlier threshold.
#pragma once
#include "stream/runtime/stage.h"

namespace tessera {

/// No task at all when normals are given and cleaning is off.
std::unique_ptr<Stage> make_normals_stage(const JobState& state);
std::unique_ptr<Stage> make_orient_stage(const JobState& state);

}  // namespace tessera
