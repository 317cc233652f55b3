/// \file ptx_points.h
/// Points of PTX files: any number of scans, each with a header of ten lines (columns, rows, scanner
/// position, three axes, 4 x 4 matrix of row vectors, translation last) and columns * rows lines `x y z
/// intensity [r g b]` in the scanner's frame. Points are moved by the matrix; lines `0 0 0 ..` stand for no
/// return and are counted as empty. The sensor is the scanner position of the header, or the matrix'
/// translation where that position is zero; a scan whose points refute it (scan_pose.h) has none, which is told. Opening reads the file once to find the scans: a line of one
/// number starts a new one, whatever the counts of the header before say. Slices are byte ranges within one
/// scan, cut at line boundaries; a file under gzip or zstd is one slice.
#pragma once
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// True if the file starts with a complete PTX header.
bool looks_like_ptx(const ReadFile& file);

/// \throws InputError naming file and line: header cut off or no numbers, a matrix that is no motion (it is not
///   finite or has no volume), more than 65535 scans. Reading throws it for a line that is no point.
std::unique_ptr<PointFile> open_ptx_points(const ReadFile& file, const ReadOptions& options);

}  // namespace tessera
