/// \file projected_inputs.h
/// Scans of a job in one plane: a surface needs lengths along all axes, so what is in degrees is projected or refused.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "stream/formats/points/point_source.h"

namespace tessera {

struct CrsOptions {
  std::string crs = {};      ///< --crs: what the files are in, whatever they say; empty = what they say
  std::string project = {};  ///< --project: "auto", "off", a system (EPSG:n); empty = degrees are refused
  std::vector<std::string> columns = {};  ///< that text files were opened with
};

/// Gives every file its system, and where they are to be projected that of the plane: points, sensors and bounds are
/// then handed on in it. `auto` projects what is in degrees to the UTM zone of the middle of all files (their declared
/// bounds, else their first points).
/// \param notes     gets a sentence for what was decided
/// \param inspect  whether to look at points of files that name no system, which may be degrees all the same
/// \throws InputError  naming a file in degrees that nobody asked to project, with the way out; or one without a system
///   where all are to be projected
/// \throws UsageError  for options that name no system, or none of a plane
std::vector<std::unique_ptr<PointFile>> in_one_plane(std::vector<std::unique_ptr<PointFile>> files,
                                                     const CrsOptions& options, bool inspect,
                                                     std::vector<std::string>& notes);

/// Whether points that name no system are degrees and metres by their look: x within 180 and y within 90, a box a hundred
/// times as high as wide, and yet one height at every place, which a pole does not have.
/// \param p  some of the points, spread over the scan
bool look_like_degrees(const std::vector<Double3>& p);

}  // namespace tessera
