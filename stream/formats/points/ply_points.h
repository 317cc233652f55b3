/// \file ply_points.h
/// Points of PLY files: the vertices of a cloud or a mesh; ascii, binary little and big endian.
/// Read: x y z of any type; nx ny nz (or normal_x ..); red green blue, r g b or diffuse_red .., of any type,
/// 16-bit and float ones scaled as point_records.h says. All other properties and elements are passed over,
/// lists too. Slices: binary records without lists by index; ascii files of nothing but vertices at line
/// boundaries; anything else in one piece.
#pragma once
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// \throws InputError naming file and line for a header that cannot be understood or has no vertices with x y z
std::unique_ptr<PointFile> open_ply_points(const ReadFile& file, const ReadOptions& options);

}  // namespace tessera
