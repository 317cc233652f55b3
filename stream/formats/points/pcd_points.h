/// \file pcd_points.h
/// Points of PCD files (Point Cloud Library), version 0.5 to 0.7: ascii, binary, and binary_compressed, whose one LZF
/// block holds field after field: it is unpacked in order by one reader a field, in bounded memory, so it is one slice.
/// Fields x y z, normal_x normal_y normal_z, rgb or rgba (four bytes, also when they pass for a float), r g b. A
/// VIEWPOINT other than the default is the sensor's place; the points stay as they are, as in PCL.
#pragma once
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// \throws InputError naming file and line of the header: no DATA, lists of unequal length, a type or size that is not
///   known, no x y z; a compressed block that is no whole number of records, or damaged; reading: a line that is no
///   point (a torn last line is left out and counted as missing)
std::unique_ptr<PointFile> open_pcd_points(const ReadFile& file, const ReadOptions& options);

}  // namespace tessera
