/// \file text_points.h
/// Points of text files: XYZ, PTS, CSV, ASC and their kin. One point per line, fields apart by white space,
/// or by commas, semicolons or tabs in the way of CSV (an empty field is not a number). Lines that start with
/// # or // are comments, blank lines are passed over.
///
/// Numbers may have decimal commas (where no comma separates fields, see TextDialectVote) and Fortran's exponents.
///
/// Columns are named, first rule that applies: by ReadOptions::columns; by a header line (also one in a
/// comment, as CloudCompare writes) of names like x y z nx ny nz intensity r g b red Rf easting longitude,
/// upper or lower case; by the extension (.xyzrgb, .xyzn) or the count line of PTS (x y z [intensity] [r g b], also
/// without the count in .pts); else x y z first, and further columns by what the first 10,000 rows and 64 samples of the
/// file hold: three columns of unit vectors are normals, three of whole numbers up to 255 or of fractions up to 1 are
/// colours, all others are left out. PointFileInfo::format says what was found, left_out what was not taken. Colours are
/// 0..255, 0..1 or 16 bits by the same rows. Slices are byte ranges, cut at line boundaries.
#pragma once
#include <memory>

#include "stream/files/read_file.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// Extensions of text scans, with the dot: .xyz .pts .csv .asc .xyzrgb .xyzn .txt .dat .neu, of which the last three may
/// be anything else too.
bool is_text_points_extension(const std::string& extension);

/// Whether the first KiB has no control character but tabs and ends of lines.
bool is_printable(const ReadFile& file);

/// True if the first lines look like text with at least three numbers each, after comments, a header or a
/// count.
bool looks_like_text_points(const ReadFile& file);

/// \throws InputError naming file and line when no columns x y z are found; reading throws it for a line that is no
///   point (a torn last line is left out and counted as missing)
/// \throws UsageError when options.columns lacks x, y or z, or has a name twice
std::unique_ptr<PointFile> open_text_points(const ReadFile& file, const ReadOptions& options);

}  // namespace tessera
