/// \file las_header.h
/// The header of a LAS or LAZ file, and its point records. Sources: LAS Specification 1.0 to 1.4 (ASPRS). Positions are
/// integer * scale + offset in double. Points flagged as withheld are dropped and counted.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "stream/files/read_file.h"
#include "stream/formats/points/point_records.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

/// Byte offsets of fields of the header (LAS Specification 1.4 R15).
struct LasField {
  enum : std::size_t {
    kGlobalEncoding = 6,
    kVersionMajor = 24,
    kVersionMinor = 25,
    kHeaderSize = 94,
    kPointOffset = 96,
    kRecordCount = 100,
    kPointFormat = 104,
    kRecordLength = 105,
    kLegacyCount = 107,
    kScale = 131,
    kOffset = 155,
    kBounds = 179,  ///< max x, min x, max y, min y, max z, min z
    kHeader12 = 227,
    kWaveform = 227,  ///< 1.3 and later
    kHeader13 = 235,
    kFirstEvlr = 235,  ///< 1.4
    kEvlrCount = 243,
    kCount = 247,
    kHeader14 = 375,
  };
};

/// And of point records, where all formats have them or those with wide classes (6 to 10).
struct LasRecordField {
  enum : std::size_t {
    kIntensity = 12,
    kReturns = 14,
    kFlags = 15,      ///< formats 0 to 5: the class too, in the five lower bits
    kWideClass = 16,  ///< formats 6 to 10
  };
};

/// The record that tells what extra bytes of points are: descriptions of 192 bytes each.
struct LasExtraField {
  static constexpr std::string_view kUserId = "LASF_Spec";
  static constexpr std::uint16_t kRecordId = 4;
  static constexpr std::size_t kBytes = 192;
};
/// Descriptions of doubles, one after the other. \pre names of less than 32 bytes
std::string las_extra_doubles(std::span<const std::string> names);
/// Of `count` bytes that nothing is known of, 1 to 255.
std::array<char, LasExtraField::kBytes> las_extra_unknown(std::size_t count);
/// Bytes of a point that a description stands for; 0 where it is none of the specification's.
std::size_t las_extra_size(const char* description);

struct LasHeader {
  PointFileInfo info;  ///< declared_points: the 64-bit count in 1.4, else (or if that is 0) the 32-bit one
  int point_format = 0;
  bool compressed = false;
  std::uint64_t begin = 0;         ///< of the points, at most the size of the file
  std::uint64_t end = 0;           ///< of what may hold points: the file, or what is declared to follow them
  std::uint64_t records_at = 0;    ///< of the variable length records, up to `begin`
  std::uint32_t record_count = 0;  ///< of them
  PointRecordLayout layout;        ///< of one point; its colour scale is still to be found
  bool intensities = false;        ///< whether append() hands them on

  /// \throws InputError naming file, byte offset, field and value: header cut off, unknown version or point format,
  ///   record shorter than its format, scale that is zero or no number
  explicit LasHeader(const ReadFile& file);
  /// Warns of bounds that are none. \param points  whether there are any
  void check_bounds(bool points);
  /// Appends records to the chunk that the sink fills; counts those withheld. \pre  count <= out.room()
  void append(const char* records, std::size_t count, ChunkSink& out, ReadCounts& counts) const;
  [[noreturn]] void fail(std::size_t offset, const std::string& what) const;

 private:
  template <class T>
  T field(std::size_t offset) const;
  void set_format();
  void set_layout();
  void set_count();
  void set_end(std::uint64_t size);

  std::array<char, 375> head_{};
  int minor_ = 0;
  std::uint8_t withheld_bit_ = 0;
  bool wide_ = false;  ///< four bits a return number and a byte for the class
};

}  // namespace tessera
