/// \file sheet_marks.h
/// Where a mesh is one sheet, seen along an axis: faces there meet others in what they share alone, and still do after edits that
/// keep the outline of what they replace and look along the axis. It spares most edits of a terrain the search of CrossingGuard.
///
/// Cells of the plane as in block_contacts.cpp: certain where all faces that touch one look along the axis, no edge there has one
/// side alone, and a sample of it is covered at most once. An edit whose new faces look along the axis within the outline of the
/// old ones leaves how often that is; others are told here. Signs are certain, what is in doubt is left.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "kernels/decimate/collapse_mesh.h"
#include "kernels/mesh/face_contact.h"
#include "octree/vector.h"

namespace tessera {

class SheetMarks {
 public:
  SheetMarks() = default;
  /// As the mesh is. \cost O(n), some 30 ns a face; a third of a byte a face
  explicit SheetMarks(const CollapseMesh& mesh);

  /// Whether the faces surely look along the axis.
  [[nodiscard]] bool look_along(std::span<const ContactFace> faces) const;
  /// Whether the faces, of the mesh or of an edit that leaves certainty, surely meet others in what they share alone.
  [[nodiscard]] bool certain(std::span<const ContactFace> faces) const;
  /// An edit within these corners that does not leave it.
  void doubt(std::span<const Double3> corners);

 private:
  static constexpr std::uint8_t kDoubt = 2;  ///< from so many on
  struct Range {
    std::uint32_t x0, x1, y0, y1;
  };
  bool find_axis(const CollapseMesh& mesh);
  bool mark_faces(const CollapseMesh& mesh);
  void cover(const Range& r, const Double3& a, const Double3& b, const Double3& c);
  bool looks_along(const Double3& a, const Double3& b, const Double3& c) const;
  bool left_of(const Double3& a, const Double3& b, const std::array<double, 2>& p) const;
  Range range(std::span<const Double3> corners) const;
  void doubt(const Range& r);

  bool useful_ = false;
  std::size_t x_ = 0, y_ = 1;
  std::array<double, 2> low_{};
  double edge_ = 0.0, per_edge_ = 0.0;  ///< of cells
  std::array<std::uint32_t, 2> size_{};
  std::vector<std::uint8_t> marks_;  ///< by cell: how many faces cover its sample, or doubt
};

}  // namespace tessera
