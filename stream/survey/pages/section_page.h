/// \file section_page.h
/// The page of `section`: a drawing to scale of every section, a map of the axis, a table.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "stream/page/survey_page.h"
#include "stream/survey/mesh_section.h"

namespace tessera {

class SectionPage : public SectionView {
 public:
  /// Of more sections every second, fifth, ... is shown, so that the page stays bounded.
  static constexpr std::size_t kMaxSections = 200;

  SectionPage(std::filesystem::path mesh, const SectionOptions& options);
  std::uint64_t bytes() const override;
  void begin(std::span<const SectionExtent> sections, std::span<const AxisPiece> axis) override;
  void add(const SectionLine& line, const SectionFrame& frame) override;
  /// Once, after the lines.
  SurveyPage finish(const SectionReport& report);

 private:
  struct Shown {
    SectionExtent extent;
    PlanDrawing drawing;
    std::uint64_t lines = 0, closed = 0;
    double length = 0.0, area = 0.0;  ///< of the lines, and what closed ones enclose, clockwise ones as holes
    Double2 from{}, to{};             ///< ends in plan; of upright ones
  };
  Shown* shown_of(std::int64_t section);
  std::string name_of(const Shown& shown) const;
  PageDrawing drawing_of(Shown& shown) const;
  PageTable table() const;
  PlanDrawing map() const;

  std::filesystem::path mesh_;
  SectionOptions options_;
  std::size_t sections_ = 0, stride_ = 1;
  std::vector<AxisPiece> axis_;
  std::vector<Shown> shown_;
};

}  // namespace tessera
