/// \file grid_stream.h
/// Points of a scan on their way through a window over its grid: they leave with normals (grid_normals.h), three lines
/// after they came. Every normal is a function of the lines around its point, wherever reading begins.
#pragma once
#include <cstdint>
#include <deque>
#include <vector>

#include "kernels/points/grid_normals.h"
#include "stream/formats/points/point_records.h"

namespace tessera {

class GridStream {
 public:
  /// Lines to read before the first point wanted, and behind the last one.
  static constexpr std::uint64_t kLinesAround = kGridRadius + 1;
  /// Memory at most: positions and points of all lines of the window.
  static constexpr std::uint64_t kBytes = (kGridLines + 1) * kMaxGridCells * (24 + 72);

  /// \param scanner  in the frame of the points   \param maximum  records of a line, at most kMaxGridCells; a line with more is none
  /// \param begins   reading begins with a line; else the first one is cut, and counts for nothing
  GridStream(const Double3& scanner, std::uint64_t maximum, bool begins, ChunkSink& out)
      : scanner_(scanner), max_(maximum), cut_(!begins), out_(out) {}

  /// The next record in the order of the file, valid or not, lies in this line.
  void next(std::int64_t line);
  /// Its sample: element i of a chunk without normals. \param wanted  it goes on to the sink; else it is a neighbour only
  void add(std::int64_t cell, const PointChunk& from, std::size_t i, bool wanted);
  /// \param ends  reading ends with a line; else the last one is cut
  void finish(bool ends);

 private:
  struct Line {
    std::int64_t index = 0;
    std::uint64_t records = 0;
    bool whole = true;
    GridLine grid;
    PointChunk points;  ///< those that are wanted
    std::vector<std::int64_t> cells;
  };
  void emit(std::size_t at);
  void drop_old();

  Double3 scanner_;
  std::uint64_t max_;
  bool cut_;
  ChunkSink& out_;
  std::deque<Line> lines_;   ///< in the order of the file
  std::size_t emitted_ = 0;  ///< of lines_
};

}  // namespace tessera
