/// \file section_files.h
/// Lines of sections as a table and as a drawing. Both are written as OutputFile writes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "kernels/survey/section_frame.h"
#include "stream/files/output_file.h"

namespace tessera {

struct SectionLine {
  std::int64_t section = 0;  ///< its number
  double value = 0.0;        ///< of the section: its station (of a piece along: of its start), or its height
  double level = 0.0;        ///< third coordinate in the frame
  bool closed = false;
  std::vector<Double2>
      points;  ///< first two coordinates in the frame; of closed lines the first is not repeated
};

/// Rows of section, station, line, closed, offset, height, x, y, z: a point each, numbers as short as they come back exactly.
/// Closed lines come back to their first point. Lines are numbered in their section, from 0.
class SectionCsv {
 public:
  SectionCsv(const std::filesystem::path& output, SectionKind kind);
  /// \pre sections ascend
  void add(const SectionLine& line, const SectionFrame& frame);
  void finish() { file_.finish(); }

 private:
  OutputFile file_;
  SectionKind kind_;
  std::int64_t section_ = -1;
  std::uint64_t line_ = 0;
};

/// What a section covers on its drawing.
struct SectionExtent {
  std::int64_t section = 0;
  double value = 0.0;
  Double2 min{}, max{};
};

/// Sections below each other, their offsets in line; those along an axis in one row. Axes are scaled alike; coordinates are
/// whole multiples of a power of ten that the file tells, and which divides the drawing's width or height by 100,000 or more.
class SectionSvg {
 public:
  /// \param sections  of all lines to come, ascending, one at least
  SectionSvg(const std::filesystem::path& output, SectionKind kind, std::vector<SectionExtent> sections);
  /// \pre sections ascend
  void add(const SectionLine& line);
  void finish();

 private:
  std::int64_t right(double u) const;
  std::int64_t down(double v) const;  ///< from the top of the section at hand
  void begin_section(std::int64_t section);

  OutputFile file_;
  SectionKind kind_;
  std::vector<SectionExtent> sections_;
  Double2 min_{}, max_{};
  double unit_ = 1.0;
  std::int64_t font_ = 1, top_ = 0;
  std::size_t next_ = 0;  ///< section
};

}  // namespace tessera
