/// \file e57_points.h
/// Points of E57 files (ASTM E2807), any number of scans: cartesian or spherical positions as floats, integers or scaled
/// integers of any width, colours, normals (extension nor:), returns. Points that are marked as invalid are counted as
/// empty. Every scan is moved by its pose. Its scanner stood at the pose's translation where the file tells that the
/// scan is in its scanner's own frame: a pose that moves it, spherical positions or bounds, or rows and columns; scans
/// without any of these are taken for clouds of which nobody knows who saw them. Images are passed over.
/// Opening reads the XML section and the head of every packet, about a sixtieth of a file. Slices count records over
/// all scans. A count that the packets do not bear out is a lie: what is there is read, the rest counted as missing.
#pragma once
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// \throws InputError as read_e57_header, read_e57_scans and E57Section; for a scan without positions or with a pose
///   that is no motion; opening and reading: for a page whose checksum is wrong
std::unique_ptr<PointFile> open_e57_points(const ReadFile& file, const ReadOptions& options);

}  // namespace tessera
