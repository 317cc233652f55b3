/// \file line_clearance.h
/// How far every segment of the lines of a map is from the nearest segment of another line, for any number of lines: segments are dealt to
/// the cells of a grid and sorted outside of memory.
#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "octree/vector.h"
#include "stream/files/external_sort.h"

namespace tessera {

class LineClearance {
 public:
  /// \param reach  distances from here on count as this; > 0  \param spacing  about how long segments are
  LineClearance(double reach, double spacing, std::filesystem::path temp, std::uint64_t memory_bytes);

  /// The next line. Lines that are one point have no segment.
  void add(std::span<const Double2> points, bool closed);
  /// Ends adding, and begins again with the first line.
  void measure(const std::function<void()>& check_stop);
  /// Of the next line, by segment. \pre as many lines as were added, with as many segments
  std::vector<double> next(std::size_t segments);

 private:
  struct Segment {
    std::int64_t row = 0, column = 0;
    std::uint64_t number = 0;  ///< of all segments
    std::uint64_t line = 0;
    Double2 from{}, to{};
    bool operator<(const Segment& o) const;
  };
  struct Distance {
    std::uint64_t number = 0;
    double distance = 0.0;
    bool operator<(const Distance& o) const {
      return number != o.number ? number < o.number : distance < o.distance;
    }
  };
  void measure_cell(const std::vector<Segment>& cell);

  double reach_, cell_;
  std::filesystem::path scratch_;
  ExternalSort<Segment> segments_;
  ExternalSort<Distance> distances_;
  std::uint64_t lines_ = 0, numbers_ = 0, read_ = 0;
  std::unique_ptr<SpillFile> file_;  ///< distances in the order of segments
};

}  // namespace tessera
