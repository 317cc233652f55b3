/// \file las_points.h
/// Points of LAS 1.0 to 1.4, point formats 0 to 10, records with extra bytes. Sources: LAS Specification 1.0
/// to 1.4 (ASPRS). Positions are integer * scale + offset in double. Points flagged as withheld are dropped
/// and counted. Colours are 16 bits; files that store 8 bits in them are told by the rule of
/// sample_colour_scale. Counts: the 64-bit one in 1.4, else (or if that is 0) the 32-bit one; verified
/// against the space that the file has for points (verified_count). Slices count records.
#pragma once
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// \throws InputError naming file, byte offset, field and value: header cut off, unknown version or point format,
///   compressed points (LAZ), record shorter than its format, scale that is zero or no number
std::unique_ptr<PointFile> open_las_points(const ReadFile& file, const ReadOptions& options);

}  // namespace tessera
