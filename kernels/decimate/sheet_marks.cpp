#include "kernels/decimate/sheet_marks.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr std::size_t kMinSheetFaces = 256;
constexpr std::size_t kFacesOfCell = 4, kMaxCellsOfAxis = 4096;
constexpr std::size_t kMaxCellsOfFace = 16;  ///< on average: needles across all of the block are not worth it
constexpr double kMinAlong = 0.6;            ///< of the area, seen along the axis
constexpr double kSureSign = 1e-14;          ///< of the terms of a determinant: more than their rounding
constexpr double kSampleAt = 0.61803398874989485;  ///< of a cell

bool alive(const CollapseFace& f) {
  return (f.state & kStateDead) == 0;
}

}  // namespace

SheetMarks::SheetMarks(const CollapseMesh& mesh) {
  useful_ = find_axis(mesh) && mark_faces(mesh);
}

bool SheetMarks::find_axis(const CollapseMesh& mesh) {
  Double3 sum{}, all{}, low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  std::size_t faces = 0;
  for (const CollapseFace& f : mesh.faces()) {
    if (!alive(f)) continue;
    ++faces;
    const std::array<Double3, 3> c = {mesh.at(f.vertex[0]), mesh.at(f.vertex[1]), mesh.at(f.vertex[2])};
    const Double3 n = triangle_normal(c[0], c[1], c[2]);
    for (std::size_t k = 0; k < 3; ++k) {
      sum[k] += n[k], all[k] += std::fabs(n[k]);
      low[k] = std::min({low[k], c[0][k], c[1][k], c[2][k]});
      high[k] = std::max({high[k], c[0][k], c[1][k], c[2][k]});
    }
  }
  if (faces < kMinSheetFaces) return false;
  std::size_t axis = 0;
  for (std::size_t k = 1; k < 3; ++k)
    if (std::fabs(sum[k]) > std::fabs(sum[axis])) axis = k;
  if (!(std::fabs(sum[axis]) > kMinAlong * all[axis])) return false;
  x_ = (axis + 1) % 3, y_ = (axis + 2) % 3;
  if (sum[axis] < 0.0) std::swap(x_, y_);
  low_ = {low[x_], low[y_]};
  const double width = high[x_] - low[x_], height = high[y_] - low[y_];
  const double cells = static_cast<double>(faces) / static_cast<double>(kFacesOfCell);
  edge_ = std::max(std::sqrt(width * height / cells), std::max(width, height) / kMaxCellsOfAxis);
  per_edge_ = 1.0 / edge_;
  // Far from zero a sample might be rounded out of its cell.
  const double far =
      std::max({std::fabs(low[x_]), std::fabs(low[y_]), std::fabs(high[x_]), std::fabs(high[y_])});
  if (!(width > 0.0 && height > 0.0 && edge_ > 0x1p-40 * far && std::isfinite(per_edge_))) return false;
  size_ = {static_cast<std::uint32_t>(width * per_edge_) + 1,
           static_cast<std::uint32_t>(height * per_edge_) + 1};
  marks_.assign(std::size_t{size_[0]} * size_[1], 0);
  return true;
}

bool SheetMarks::mark_faces(const CollapseMesh& mesh) {
  std::size_t visits = 0;
  for (std::uint32_t f = 0; f < mesh.faces().size(); ++f) {
    const CollapseFace& face = mesh.face(f);
    if (!alive(face)) continue;
    const std::array<Double3, 3> c = {mesh.at(face.vertex[0]), mesh.at(face.vertex[1]),
                                      mesh.at(face.vertex[2])};
    const Range r = range(c);
    visits += std::size_t{r.x1 - r.x0 + 1} * (r.y1 - r.y0 + 1);
    if (visits > kMaxCellsOfFace * mesh.faces().size()) return false;
    if (looks_along(c[0], c[1], c[2]))
      cover(r, c[0], c[1], c[2]);
    else
      doubt(r);
    for (std::size_t k = 0; k < 3; ++k)
      if (face.opposite[k] == kNoCorner) {
        const std::array<Double3, 2> side = {c[(k + 1) % 3], c[(k + 2) % 3]};
        doubt(range(side));
      }
  }
  return true;
}

/// Counts the samples that the face covers; what is in doubt counts.
void SheetMarks::cover(const Range& r, const Double3& a, const Double3& b, const Double3& c) {
  const double left = std::min({a[x_], b[x_], c[x_]}), right = std::max({a[x_], b[x_], c[x_]});
  for (std::uint32_t y = r.y0; y <= r.y1; ++y)
    for (std::uint32_t x = r.x0; x <= r.x1; ++x) {
      std::uint8_t& mark = marks_[std::size_t{y} * size_[0] + x];
      const std::array<double, 2> at = {low_[0] + (x + kSampleAt) * edge_, low_[1] + (y + kSampleAt) * edge_};
      if (mark >= kDoubt || at[0] < left || at[0] > right) continue;
      if (left_of(a, b, at) && left_of(b, c, at) && left_of(c, a, at)) ++mark;
    }
}

bool SheetMarks::looks_along(const Double3& a, const Double3& b, const Double3& c) const {
  const double left = (b[x_] - a[x_]) * (c[y_] - a[y_]), right = (b[y_] - a[y_]) * (c[x_] - a[x_]);
  return left - right > kSureSign * (std::fabs(left) + std::fabs(right));
}

bool SheetMarks::left_of(const Double3& a, const Double3& b, const std::array<double, 2>& p) const {
  const double left = (b[x_] - a[x_]) * (p[1] - a[y_]), right = (b[y_] - a[y_]) * (p[0] - a[x_]);
  return left - right >= -kSureSign * (std::fabs(left) + std::fabs(right));
}

/// Monotone, so that cells are where their points are; what lies beyond counts with the nearest.
SheetMarks::Range SheetMarks::range(std::span<const Double3> corners) const {
  std::array<double, 2> low = {corners[0][x_], corners[0][y_]}, high = low;
  for (const Double3& c : corners.subspan(1)) {
    low = {std::min(low[0], c[x_]), std::min(low[1], c[y_])};
    high = {std::max(high[0], c[x_]), std::max(high[1], c[y_])};
  }
  const auto cell = [&](double at, std::size_t a) {
    const double t = std::max((at - low_[a]) * per_edge_, 0.0);
    return static_cast<std::uint32_t>(std::min(t, static_cast<double>(size_[a] - 1)));
  };
  return {cell(low[0], 0), cell(high[0], 0), cell(low[1], 1), cell(high[1], 1)};
}

void SheetMarks::doubt(const Range& r) {
  for (std::uint32_t y = r.y0; y <= r.y1; ++y)
    for (std::uint32_t x = r.x0; x <= r.x1; ++x) marks_[std::size_t{y} * size_[0] + x] = kDoubt;
}

void SheetMarks::doubt(std::span<const Double3> corners) {
  if (useful_ && !corners.empty()) doubt(range(corners));
}

bool SheetMarks::look_along(std::span<const ContactFace> faces) const {
  return useful_ && std::all_of(faces.begin(), faces.end(), [&](const ContactFace& f) {
           return looks_along(f.corner[0], f.corner[1], f.corner[2]);
         });
}

bool SheetMarks::certain(std::span<const ContactFace> faces) const {
  if (!useful_) return false;
  for (const ContactFace& f : faces) {
    const Range r = range(f.corner);
    for (std::uint32_t y = r.y0; y <= r.y1; ++y)
      for (std::uint32_t x = r.x0; x <= r.x1; ++x)
        if (marks_[std::size_t{y} * size_[0] + x] >= kDoubt) return false;
  }
  return true;
}

}  // namespace tessera
