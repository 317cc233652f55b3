/// \file point_writer.h
/// Point files out: PLY (binary little endian), LAS 1.4, LAZ, COPC, PTX, XYZ. Encoding is pure and may run on any
/// thread; the encoded batches are then appended in order. Memory is one output buffer, and for LAZ eight chunks; for COPC a sort of
/// 128 MiB and some nodes, its points wait on disk, beside the file, until it is finished.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "stream/formats/points/point_source.h"

namespace tessera {

/// Known before the first point.
struct PointFileHeader {
  /// Which arrays of the chunks are written: sensor indices never are, echoes and intensity_16 in LAS, LAZ and PLY.
  PointAttributes attributes;
  bool double_positions = false;  ///< PLY only; text always has all digits, LAS its scale
  Double3 las_offset = {0, 0, 0};
  double las_scale = 0.001;           ///< step of LAS coordinates, scan units
  std::vector<std::string> comments;  ///< one line each, where the format has comments
  std::string wkt;                    ///< coordinate system, COPC only; empty = none is named
  /// Of numbers that every point has besides, doubles: properties in PLY, extra bytes in LAS and LAZ.
  std::vector<std::string> scalars;
};

/// One grid of a PTX file, written before its points. A point with a NaN coordinate stands for "no return".
struct PtxScan {
  std::uint64_t columns = 0, rows = 0;  ///< points come column by column, rows from below
  Double3 origin = {0, 0, 0};           ///< of the scanner; axes are those of the world
};

/// A batch ready for the file.
struct EncodedPoints {
  std::vector<char> bytes;
  std::uint64_t points = 0;
  Double3 min{}, max{};                       ///< of the finite points, if points > 0
  std::array<std::uint64_t, 15> by_return{};  ///< LAS: points of return 1, 2, ...
};

/// Turns points into the bytes of a format: pure, so any thread may do it.
class PointEncoder {
 public:
  virtual ~PointEncoder() = default;
  /// `scan` matters to PTX only: coordinates are stored relative to its origin.
  /// \param scalars  those of the first point of the chunk as the header names them, then those of the next one
  virtual void encode(const PointChunk& chunk, const PtxScan& scan, std::span<const double> scalars,
                      EncodedPoints& out) const = 0;
  void encode(const PointChunk& chunk, const PtxScan& scan, EncodedPoints& out) const {
    encode(chunk, scan, {}, out);
  }
};

/// Writes to a file beside `path` and gives it its name in finish(); the destructor removes what is
/// unfinished.
class PointWriter {
 public:
  virtual ~PointWriter() = default;
  /// Starts a grid (PTX); other formats ignore it.
  virtual void begin_scan(const PtxScan&) {}
  /// \throws ResourceError when the disk is full
  virtual void append(const EncodedPoints& points) = 0;
  /// Completes the header, flushes, syncs, renames. Returns the size of the file.
  virtual std::uint64_t finish() = 0;
};

/// By extension: .ply, .las, .laz, .copc.laz, .ptx, .xyz (also .txt).
/// \throws UsageError for another extension, or for attributes that the format cannot hold (normals in LAS, LAZ
/// and PTX; scalars in text)
std::unique_ptr<PointEncoder> make_point_encoder(const std::filesystem::path& path,
                                                 const PointFileHeader& header);
/// Same rules; creates the file.
std::unique_ptr<PointWriter> create_point_file(const std::filesystem::path& path,
                                               const PointFileHeader& header);

/// Whether a file of this name is to be COPC: it ends in .copc.laz.
bool is_copc_name(const std::filesystem::path& path);

/// Gives the chunk the arrays that the output has and its file has not: unknown normals, no colour, one return.
void fill_missing(PointChunk& chunk, const PointAttributes& attributes);

/// The finest power of ten that holds coordinates over such an extent as whole numbers of 32 bits.
/// \throws UsageError where none does
double fitting_las_scale(const Double3& min, const Double3& max);

}  // namespace tessera
