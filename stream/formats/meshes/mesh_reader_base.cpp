#include "stream/formats/meshes/mesh_reader_base.h"

#include <cmath>

#include "stream/formats/scalar.h"

namespace tessera {

void FaceBatch::check(std::uint64_t a, std::uint64_t b, std::uint64_t c) const {
  if (keep_bad_) return;
  for (const std::uint64_t v : {a, b, c}) {
    if (v < vertices_) continue;
    const auto value = static_cast<std::int64_t>(v);
    throw InputError(place_() + ": a face names vertex " +
                     (value < 0 ? std::to_string(value) : std::to_string(v)) +
                     " (counted from 0), but there are " + std::to_string(vertices_) +
                     " vertices; see all such faces with tessera check");
  }
}

void FaceBatch::end_polygon() {
  if (corners_ > 2) return;
  if (!keep_bad_) {
    throw InputError(place_() + ": a face has " + std::to_string(corners_) + " corners; remove it");
  }
  if (corners_ > 0) triangle(first_, first_, corners_ == 2 ? last_ : first_);
}

std::uint32_t colour_byte(double unit) {
  if (!(unit > 0.0)) return 0;
  return unit >= 1.0 ? 255u : static_cast<std::uint32_t>(unit * 255.0 + 0.5);
}

bool parse_shift(std::string_view comment, Double3& shift) {
  constexpr std::string_view kName = "tessera_shift";
  if (!comment.starts_with(kName)) return false;
  comment.remove_prefix(kName.size());
  Double3 parsed;
  for (double& value : parsed) {
    while (!comment.empty() && comment.front() == ' ') comment.remove_prefix(1);
    if (!take_number(comment, value) || !std::isfinite(value)) return false;
  }
  shift = parsed;
  return true;
}

}  // namespace tessera
