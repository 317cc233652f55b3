/// \file probe_stage.h
/// What comes before the survey when --resolution is auto: two looks at the scan.
/// Pass "probe": a uniform sample of points, from which the scale of the scan is guessed.
/// Pass "spacing": complete small cells of that scale, in which spacing and noise are measured; h follows.
/// With a given resolution both have no task and decide nothing.
#pragma once
#include <memory>

#include "kernels/points/spacing.h"
#include "stream/points/point_inputs.h"
#include "stream/runtime/stage.h"

namespace tessera {

std::unique_ptr<Stage> make_probe_stage(const JobState& job);
std::unique_ptr<Stage> make_spacing_stage(const JobState& job);
/// The same over inputs that are already open.
std::unique_ptr<Stage> make_probe_stage(const JobState& job, std::shared_ptr<const PointInputs> inputs);
std::unique_ptr<Stage> make_spacing_stage(const JobState& job, std::shared_ptr<const PointInputs> inputs);

/// Memory of both where they have something to do.
std::uint64_t spacing_bytes();

/// h that the spacing stage chose, and why. \throws InputError when it has not run
ChosenSpacing chosen_resolution(const std::filesystem::path& work);
/// Standard deviation of the points from quadrics of so many that they tell it, scan units; curvature adds to it.
/// \throws InputError when the spacing stage has not run
double probed_noise(const std::filesystem::path& work);
/// How many points the probe counted. \throws InputError when it has not run
std::uint64_t probed_points(const std::filesystem::path& work);

}  // namespace tessera
