/// \file laz_points.h
/// Points of LAZ files, COPC among them: point formats 0 to 10, coded point by point or in layers, in chunks of one size
/// or of many. Records are those of the uncompressed file, and so is what becomes of them. Slices are runs of chunks.
/// Where the chunk table is missing, layered chunks are found one after the other and others read in one slice. Memory
/// is that of windows and models, whatever a chunk claims. What ends early is read as far as it goes; what cannot be
/// points is an error.
#pragma once
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/points/las_header.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// \throws InputError naming file, byte offset and what is wrong: no or unknown "laszip encoded" record, no chunk table
///   where chunks of many sizes need one; in read() also chunks that are damaged
std::unique_ptr<PointFile> open_laz_points(const ReadFile& file, LasHeader header,
                                           const ReadOptions& options);

}  // namespace tessera
