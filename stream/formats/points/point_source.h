/// \file point_source.h
/// Scans in: one interface for every point format. Readers stream through bounded buffers and never hold a
/// file. A header is a claim: counts and bounds are verified by reading, differences are reported, not fatal.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "octree/lattice.h"
#include "stream/formats/points/crs.h"

namespace tessera {

/// What a laser scanner says of one echo of a pulse.
struct Echo {
  std::uint8_t kind = 0;    ///< class: 2 ground, 6 building, 7 and 18 noise (ASPRS)
  std::uint8_t number = 0;  ///< of this return, from 1; 0 = not filled in
  std::uint8_t of = 0;      ///< returns of the pulse
  bool first() const { return number <= 1; }
  bool last() const { return number >= of; }
  bool operator==(const Echo&) const = default;
};

/// A bounded batch of points in the scan's own frame, structure of arrays. Optional arrays are empty or as
/// long as x. Non-finite coordinates are passed on as they are: the survey drops and counts them.
struct PointChunk {
  std::vector<double> x, y, z;
  std::vector<float> nx, ny, nz;      ///< as given, not normalised; zero = unknown
  std::vector<std::uint32_t> rgba;    ///< r | g<<8 | b<<16 | a<<24, alpha 255 where colour is known
  std::vector<std::uint16_t> sensor;  ///< index into PointFileInfo::sensors, or kNoSensor
  std::vector<Echo> echo;
  /// Where it is asked for; whole numbers up to 65,535 as they are, all else stretched from its limits to 0..65,535.
  std::vector<std::uint16_t> intensity;
  std::size_t size() const { return x.size(); }
  void clear();
  /// Element i of every array that `from` has.
  void append(const PointChunk& from, std::size_t i);
};

/// Positions that are whole numbers of 32 bits: number * step + shift, in double.
struct PositionGrid {
  Double3 step{};
  Double3 shift{};
  bool known() const { return step[0] != 0 && step[1] != 0 && step[2] != 0; }
};

/// All that lies between its corners, these included.
struct PointBox {
  static constexpr double kInfinite = std::numeric_limits<double>::infinity();
  Double3 min = {-kInfinite, -kInfinite, -kInfinite};
  Double3 max = {kInfinite, kInfinite, kInfinite};
};

/// Which optional arrays a file fills.
struct PointAttributes {
  bool normals = false;
  bool grid_normals = false;  ///< these, or some, are made from rows and columns (ReadOptions::grid_normals)
  bool colour = false;
  bool intensity = false;     ///< said to be there
  bool intensity_16 = false;  ///< handed on as PointChunk::intensity where it is asked for
  bool sensor = false;
  bool echo = false;
};

struct PointFileInfo {
  std::filesystem::path path;
  std::string format;  ///< "PLY binary little endian", "LAS 1.2 point format 3", ...
  std::uint64_t bytes = 0;
  std::uint64_t unpacked_bytes = 0;   ///< of compressed points: of their records
  bool octree = false;                ///< of levels, coarse points first (COPC)
  bool packed = false;                ///< dear to read: jobs unpack it once
  PositionGrid grid;                  ///< of its positions, if they lie on one
  std::uint64_t declared_points = 0;  ///< what the header says; 0 if it does not say
  bool has_bounds = false;
  Double3 declared_min{}, declared_max{};
  PointAttributes attributes;
  Crs crs;
  std::vector<Double3> sensors;       ///< sensor origins, scan frame (PTX, E57: one per scan)
  std::vector<std::string> warnings;  ///< what the header gets wrong, one sentence each
  std::vector<std::string> left_out;  ///< names of fields that mean nothing here, as the file spells them
  bool placeholders = false;          ///< some of its points may stand for "no return" (PTX, E57, PCD)
  /// What the header declares, as far as a file of its size can pack it.
  std::uint64_t credible_points() const { return std::min(declared_points, 4 * bytes); }
  /// What all slices add up to.
  std::uint64_t planned_bytes() const { return unpacked_bytes > 0 ? unpacked_bytes : bytes; }
};

/// Part of a file that can be read on its own; begin and end are in the format's own unit (point index or byte).
struct InputSlice {
  std::uint32_t file = 0;  ///< index into the job's list of inputs
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  std::uint64_t bytes = 0;  ///< input bytes it covers, unpacked, for planning
};

/// Fate of what a slice held.
struct ReadCounts {
  std::uint64_t points = 0;    ///< handed to the sink
  std::uint64_t withheld = 0;  ///< flagged withheld or synthetic-deleted by the format (LAS)
  std::uint64_t empty = 0;     ///< placeholders that stand for "no return" (PTX 0 0 0)
  /// Declared by the header, not in the file (truncated); text files read in slices cannot know and count a
  /// torn last line only: see missing_points.
  std::uint64_t missing = 0;
  std::uint64_t surplus = 0;       ///< lines of `points` that hold more values than the header declares (PLY)
  std::uint64_t other_class = 0;   ///< of `points`, left out by PointInputs: of a class that is not wanted
  std::uint64_t other_return = 0;  ///< else of a return that is not wanted
  std::uint64_t outside = 0;       ///< else outside the box or the polygons wanted
  std::uint64_t thinned = 0;       ///< else not the one of its cube that is kept
  std::vector<std::string> warnings;
};

struct ReadOptions {
  std::vector<std::string> columns;  ///< of text files, e.g. x y z nx ny nz r g b; empty = header or x y z
  std::size_t chunk_points = 65536;  ///< points per chunk handed to the sink
  bool release_cache = false;        ///< tell the system to drop what was read from its page cache
  bool colours =
      true;  ///< false: whoever reads needs none, and formats to which they are dear leave them out
  bool intensities = false;   ///< fill PointChunk::intensity
  bool grid_normals = false;  ///< scans without normals get them from their rows and columns (E57, PTX)
  std::optional<PointBox> bounds = {};  ///< COPC: what lies outside may be left out
  double resolution_limit = 0.0;        ///< COPC: levels up to the first one with such a spacing; 0 = all
  bool unpacked = false;  ///< points of packed files are not read from them any more: opening looks at none
};

/// One input file, looked at and closed again: a job may hold thousands. May be used from several threads at once.
class PointFile {
 public:
  virtual ~PointFile() = default;
  virtual const PointFileInfo& info() const = 0;
  /// Slices of about `target_bytes`; one where the format must be read in order. `file` is copied into each.
  virtual std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const = 0;
  /// Streams a slice to the sink, in chunks; the chunk is reused after the sink returns.
  /// \throws InputError naming file and byte offset or line, for content that cannot be read past
  virtual ReadCounts read(const InputSlice& slice,
                          const std::function<void(const PointChunk&)>& sink) const = 0;
};

/// Opens a point file by content first, extension second. What gzip or zstd packed (text, PTX, PLY) is unpacked on the
/// way, in one slice, after it was unpacked once to be measured.
/// \throws InputError for an unreadable, empty, unknown or unsupported file
std::unique_ptr<PointFile> open_point_file(const std::filesystem::path& path, const ReadOptions& options);

/// Points that the header promises and the file does not hold. \param total  sums over all slices of the file
std::uint64_t missing_points(const PointFileInfo& info, const ReadCounts& total);

/// One of refuted_claims().
inline constexpr const char* kWideBounds = "the bounds that the header declares are wider than the points";
/// What reading refuted of the header's claims, beyond info.warnings, one sentence each: the count, the bounds (by more
/// than a millionth of their size). \param read_min, read_max  of all finite points; min > max if there are none
std::vector<std::string> refuted_claims(const PointFileInfo& info, const ReadCounts& total,
                                        const Double3& read_min, const Double3& read_max);

/// "fields left out, as nothing here takes them: ring, time"; names cut to what can be read. \pre there are some
std::string left_out_sentence(const PointFileInfo& info);

struct InputList {
  std::vector<std::filesystem::path> files;
  /// A sentence for every folder and deep glob: how many files of which kinds.
  std::vector<std::string> notes;
};

/// Expands files, folders, globs and @list files to a list of paths without repeats, in the order given; the order never
/// changes a result. Folders are searched at any depth for ply las laz e57 pcd xyz xyzrgb xyzn pts ptx csv asc (text and
/// ply with .gz or .zst too), sorted; hidden files and work directories are passed over; those of EPT and Potree octrees
/// (scan_folder.h) give their nodes, as ept.json and cloud.js do. Globs: ** stands for any number of folders; folders
/// that match count only where no file does. Lists: a file, folder or glob a line, relative to the list's folder, # starts
/// a comment. \throws InputError naming the argument that matches nothing
InputList list_inputs(const std::vector<std::string>& arguments);
std::vector<std::filesystem::path> expand_inputs(const std::vector<std::string>& arguments);

}  // namespace tessera
