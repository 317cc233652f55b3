/// \file las_points.h
/// Points of LAS 1.0 to 1.4, point formats 0 to 10, records with extra bytes; compressed ones by laz_points.h. Colours
/// are 16 bits; files that store 8 bits in them are told by the rule of sample_colour_scale. Counts are verified against
/// the space that the file has for points (verified_count). Slices count records.
#pragma once
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// \throws InputError as LasHeader; for compressed points as open_laz_points
std::unique_ptr<PointFile> open_las_points(const ReadFile& file, const ReadOptions& options);

}  // namespace tessera
