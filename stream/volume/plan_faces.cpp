#include "stream/volume/plan_faces.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr std::size_t kMaxSliverSide = 256;

std::size_t sliver_side(std::uint64_t faces) {
  return std::clamp<std::size_t>(static_cast<std::size_t>(std::sqrt(static_cast<double>(faces))), 1,
                                 kMaxSliverSide);
}

/// Range of x that a triangle takes in a band of y.
struct Extent {
  double low = PlanBox::kInfinite, high = -PlanBox::kInfinite;
  void add(double x) { low = std::min(low, x), high = std::max(high, x); }
};

Extent extent_in_band(const std::array<Double2, 3>& corner, double y0, double y1) {
  Extent out;
  for (std::size_t k = 0; k < 3; ++k) {
    const Double2 &a = corner[k], &b = corner[(k + 1) % 3];
    if (a[1] >= y0 && a[1] <= y1) out.add(a[0]);
    for (const double y : {y0, y1}) {
      if ((a[1] < y) == (b[1] < y)) continue;
      out.add(a[0] + (y - a[1]) / (b[1] - a[1]) * (b[0] - a[0]));
    }
  }
  return out;
}

}  // namespace

PlanBox box_of(std::span<const Double2> points) {
  PlanBox box;
  for (const Double2& p : points) box.add(p);
  return box;
}

std::vector<SpaceTriangle> triangles_of(const MeshBlock& block, const Double3& origin) {
  std::vector<SpaceTriangle> triangles;
  triangles.reserve(block.faces.size());
  for (const auto& f : block.faces)
    triangles.push_back(
        {block.position[f[0]] - origin, block.position[f[1]] - origin, block.position[f[2]] - origin});
  return triangles;
}

std::vector<PlanFace> plan_faces(std::span<const SpaceTriangle> triangles) {
  std::vector<PlanFace> faces;
  faces.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles) {
    PlanFace face{PlanTriangle(a, b, c), {}, 0.5 * norm(cross(b - a, c - a))};
    face.box = box_of(face.triangle.shadow());
    faces.push_back(face);
  }
  return faces;
}

PlanGrid::PlanGrid(const std::vector<PlanFace>& faces, const PlanBox& box) : faces_(faces), box_(box) {
  side_ = std::max<std::size_t>(1, static_cast<std::size_t>(std::sqrt(static_cast<double>(faces.size()))));
  first_.assign(side_ * side_ + 1, 0);
  const auto deal = [&](const auto& use) {
    for (std::uint32_t f = 0; f < faces.size(); ++f)
      if (faces[f].box.meets(box)) for_cells(faces[f].box, [&](std::size_t cell) { use(cell, f); });
  };
  deal([&](std::size_t cell, std::uint32_t) { ++first_[cell + 1]; });
  for (std::size_t k = 0; k + 1 < first_.size(); ++k) first_[k + 1] += first_[k];
  listed_.resize(first_.back());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  deal([&](std::size_t cell, std::uint32_t f) { listed_[next[cell]++] = f; });
}

SliverGrid::SliverGrid(std::vector<PlanFace> faces)
    : faces_(std::move(faces)), side_(sliver_side(faces_.size())) {
  for (const PlanFace& f : faces_) box_.add(f.box.low), box_.add(f.box.high);
  first_.assign(side_ * side_ + 1, 0);
  for (const PlanFace& f : faces_) for_cells(f, [&](std::size_t at) { ++first_[at + 1]; });
  for (std::size_t k = 0; k + 1 < first_.size(); ++k) first_[k + 1] += first_[k];
  listed_.resize(first_.back());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (std::uint32_t f = 0; f < faces_.size(); ++f)
    for_cells(faces_[f], [&](std::size_t at) { listed_[next[at]++] = f; });
}

std::uint64_t SliverGrid::bytes(std::uint64_t faces) {
  // A thin triangle meets at most three cells in every row.
  const std::uint64_t side = sliver_side(faces);
  return faces * sizeof(PlanFace) + (3 * side * faces + 2 * side * side) * sizeof(std::uint32_t);
}

std::size_t SliverGrid::cell(double at, std::size_t axis) const {
  const double width = box_.high[axis] - box_.low[axis];
  const double t = width > 0.0 ? (at - box_.low[axis]) / width * static_cast<double>(side_) : 0.0;
  return std::min(static_cast<std::size_t>(std::max(t, 0.0)), side_ - 1);
}

template <class Use>
void SliverGrid::for_cells(const PlanFace& face, Use&& use) const {
  const double step = (box_.high[1] - box_.low[1]) / static_cast<double>(side_);
  const double slack = 1e-9 * std::max(box_.high[0] - box_.low[0], box_.high[1] - box_.low[1]);
  for (std::size_t y = cell(face.box.low[1] - slack, 1); y <= cell(face.box.high[1] + slack, 1); ++y) {
    const double low = box_.low[1] + static_cast<double>(y) * step;
    const Extent x = extent_in_band(face.triangle.shadow(), low - slack, low + step + slack);
    if (x.low > x.high) continue;
    for (std::size_t c = cell(x.low - slack, 0); c <= cell(x.high + slack, 0); ++c) use(y * side_ + c);
  }
}

void SliverGrid::collect(const PlanBox& box, std::vector<std::uint32_t>& found) const {
  found.clear();
  const std::size_t x0 = cell(box.low[0], 0), x1 = cell(box.high[0], 0), y0 = cell(box.low[1], 1),
                    y1 = cell(box.high[1], 1);
  for (std::size_t y = y0; y <= y1; ++y)
    found.insert(found.end(), listed_.begin() + first_[y * side_ + x0],
                 listed_.begin() + first_[y * side_ + x1 + 1]);
  if (x0 == x1 && y0 == y1) return;
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
}

}  // namespace tessera
