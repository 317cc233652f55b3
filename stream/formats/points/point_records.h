/// \file point_records.h
/// Points out of binary records of one size: columns of any type at any offset, decoded block by block.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "stream/formats/byte_window.h"
#include "stream/formats/points/point_source.h"
#include "stream/formats/scalar.h"
#include "stream/formats/vertex_fields.h"

namespace tessera {

struct PointColumn {
  ScalarType type = ScalarType::kFloat32;
  int offset = -1;  ///< byte offset in the record; -1 = the record has none
  bool there() const { return offset >= 0; }
};

struct PointRecordLayout {
  std::size_t stride = 0;
  bool big_endian = false;
  std::array<PointColumn, 3> position;
  std::array<PointColumn, 3> normal;  ///< all or none
  std::array<PointColumn, 3> colour;  ///< all or none
  ColourScale colour_scale = ColourScale::kByte;
  bool scaled = false;  ///< positions are value * scale + shift
  Double3 scale = {1, 1, 1};
  Double3 shift = {0, 0, 0};
};

inline std::uint32_t pack_rgb(std::uint32_t r, std::uint32_t g, std::uint32_t b) {
  return r | g << 8 | b << 16 | 0xff000000u;
}

/// Appends `count` records to the chunk.
void append_records(const PointRecordLayout& layout, const char* records, std::size_t count,
                    PointChunk& chunk);

/// Values of a line of text: position, normal, colour.
using PointValues = std::array<double, 9>;
/// Appends one point with what the file has of these.
void append_values(const PointValues& values, const PointAttributes& has, ColourScale scale,
                   PointChunk& chunk);

/// The scale of the file's colours, from a fixed sample of it: 64 runs of 256 records at even distances (all
/// records of a small file). 16-bit and wider integers are taken for 8-bit values if no sampled component
/// exceeds 255; floats are taken for 0..255 if one exceeds 1 (colour_scale_for). Depends on the file alone, never on
/// slices or threads.
/// \param read  the bytes of `number` records from record `first` on, fewer where they end; called in ascending order
ColourScale sample_colour_scale(
    std::uint64_t count, const PointRecordLayout& layout,
    const std::function<std::string_view(std::uint64_t first, std::size_t number)>& read);
/// The same for records that lie in a file.
ColourScale sample_colour_scale(const ReadFile& file, std::uint64_t begin, std::uint64_t count,
                                const PointRecordLayout& layout);

/// Collects points into chunks of a fixed size and hands full ones to the sink.
class ChunkSink {
 public:
  ChunkSink(std::size_t chunk_points, const std::function<void(const PointChunk&)>& sink)
      : limit_(chunk_points > 0 ? chunk_points : 1), sink_(sink) {}
  PointChunk& chunk() { return chunk_; }
  /// Points that the chunk still takes, at least one.
  std::size_t remaining() const { return limit_ - chunk_.size(); }
  /// After points were appended: hands on a full chunk.
  void added() {
    if (chunk_.size() >= limit_) flush();
  }
  void flush() {
    points_ += chunk_.size();
    if (chunk_.size() > 0) sink_(chunk_);
    chunk_.clear();
  }
  std::uint64_t points() const { return points_; }  ///< handed on so far

 private:
  std::size_t limit_;
  const std::function<void(const PointChunk&)>& sink_;
  PointChunk chunk_;
  std::uint64_t points_ = 0;
};

/// Slices of [begin, end) in steps of a multiple of one unit; at least one slice, empty if the range is.
/// \param unit_bytes  bytes per unit, 0 if the range has no bytes
std::vector<InputSlice> even_slices(std::uint32_t file, std::uint64_t begin, std::uint64_t end,
                                    std::uint64_t unit_bytes, std::uint64_t target_bytes);

/// How many records a header that may lie stands for.
struct RecordCount {
  std::uint64_t usable = 0;   ///< records to read
  std::uint64_t missing = 0;  ///< declared, not in the file
  std::string warning;        ///< one sentence if declared and found differ
};
/// Of the records in bytes [begin, end) of the file, those that are points. A file that ends early is read as far as it
/// goes. Whole records beyond the declared count are points if the count is 0 (never filled in), or if they fill the
/// space exactly and lie within the bounds: else they are padding, texts or wave packets that follow the points.
/// \param closing  true if nothing else is declared to follow the records
/// \param bounds   declared by the file; without, ten times the size of a sample of the declared records around it
RecordCount verified_count(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
                           std::uint64_t declared, const PointRecordLayout& layout, bool closing,
                           const std::optional<PointBox>& bounds = {});

}  // namespace tessera
