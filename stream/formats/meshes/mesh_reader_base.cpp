#include "stream/formats/meshes/mesh_reader_base.h"

#include <cmath>

#include "kernels/mesh/polygon_triangulation.h"
#include "stream/formats/scalar.h"

namespace tessera {

void FaceBatch::check(std::uint64_t a, std::uint64_t b, std::uint64_t c) const {
  if (keep_bad_) return;
  for (const std::uint64_t v : {a, b, c}) {
    if (v < vertices_) continue;
    const auto value = static_cast<std::int64_t>(v);
    throw InputError(location_() + ": a face names vertex " +
                     (value < 0 ? std::to_string(value) : std::to_string(v)) +
                     " (counted from 0), but there are " + std::to_string(vertices_) +
                     " vertices; see all such faces with tessera check");
  }
}

void FaceBatch::too_long() const {
  static_assert(kLongest == kMaxPolygonCorners);
  throw InputError(location_() + ": a face has more than " + std::to_string(kMaxPolygonCorners) +
                   " corners; divide it");
}

void FaceBatch::fan() {
  for (std::size_t i = 2; i < corners_.size(); ++i) triangle(corners_[0], corners_[i - 1], corners_[i]);
}

void FaceBatch::end_other() {
  const std::size_t n = corners_.size();
  if (n < 3) {
    if (!keep_bad_)
      throw InputError(location_() + ": a face has " + std::to_string(n) + " corners; remove it");
    if (n > 0) triangle(corners_[0], corners_[0], corners_[n - 1]);
    return;
  }
  distinct_.clear();
  bool bad = false;
  for (const std::uint64_t v : corners_) {
    bad = bad || v >= vertices_;
    if (distinct_.empty() || v != distinct_.back()) distinct_.push_back(v);
  }
  while (distinct_.size() > 1 && distinct_.back() == distinct_.front()) distinct_.pop_back();
  triangles_.clear();
  if (!bad && distinct_.size() == 3) triangles_.push_back({distinct_[0], distinct_[1], distinct_[2]});
  if (!bad && distinct_.size() > 3) polygons_->triangulate(distinct_, triangles_);
  if (triangles_.empty()) return fan();  // which tells of what is bad, or keeps it for a check
  for (const MeshFace& t : triangles_) triangle(t[0], t[1], t[2]);
}

std::uint32_t colour_byte(double unit) {
  if (!(unit > 0.0)) return 0;
  return unit >= 1.0 ? 255u : static_cast<std::uint32_t>(unit * 255.0 + 0.5);
}

bool parse_triple(std::string_view line, std::string_view name, Double3& values) {
  if (!line.starts_with(name)) return false;
  line.remove_prefix(name.size());
  Double3 parsed;
  for (double& value : parsed) {
    while (!line.empty() && line.front() == ' ') line.remove_prefix(1);
    if (!take_number(line, value) || !std::isfinite(value)) return false;
  }
  values = parsed;
  return true;
}

bool parse_shift(std::string_view comment, Double3& shift) {
  return parse_triple(comment, "tessera_shift", shift);
}

}  // namespace tessera
