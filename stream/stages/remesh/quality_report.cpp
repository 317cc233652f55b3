#include "stream/stages/remesh/quality_report.h"

#include "stream/files/json.h"

namespace tessera {

Json quality_report(const TriangleQuality& q, double target) {
  if (q.faces == 0) return Json::object();
  const auto faces = static_cast<double>(q.faces);
  std::uint64_t vertices = 0, narrow = 0;
  for (const std::uint64_t n : q.valences) vertices += n;
  constexpr std::size_t kNarrow = 25;  // degrees
  for (std::size_t i = 0; i < kNarrow; ++i) narrow += q.minimum[i];
  Json out = {{"edge", target},
              {"faces", q.faces},
              {"mean_angle_deviation_deg", static_cast<double>(q.angle_off) * 1e-3 / (3.0 * faces)},
              {"smallest_angle_deg", static_cast<double>(q.smallest) * 1e-3},
              {"share_below_25_deg", static_cast<double>(narrow) / faces},
              {"mean_edge_deviation", static_cast<double>(q.length_off) * 1e-6 / (3.0 * faces)},
              {"mean_area_deviation", static_cast<double>(q.area_off) * 1e-6 / faces}};
  if (vertices > 0) {
    out["valence_six_share"] = static_cast<double>(q.valences[6]) / static_cast<double>(vertices);
    out["mean_voronoi_area_deviation"] = q.mean_cell_deviation();
    out["voronoi_areas_by_100th_of_hexagon"] = q.cells;
  }
  std::uint64_t edges = 0, uneven = 0;
  constexpr std::size_t kEven = 10;  // 1.5
  for (std::size_t i = 0; i < q.ratios.size(); ++i)
    edges += q.ratios[i], uneven += i < kEven ? 0 : q.ratios[i];
  if (edges > 0) {
    out["uneven_edge_share"] = static_cast<double>(uneven) / static_cast<double>(edges);
    out["largest_length_ratio"] = static_cast<double>(q.largest_ratio) * 1e-6;
    out["length_ratios_by_20th"] = q.ratios;
  }
  out["angles_by_degree"] = q.angles;
  out["smallest_angles_by_degree"] = q.minimum;
  out["edges_by_50th_of_length"] = q.lengths;
  out["valences"] = q.valences;
  return out;
}

Json remesh_counts(const RemeshReport& r) {
  return {{"faces_done", r.faces_in},
          {"faces_out", r.faces_out},
          {"locked_vertices", r.locked_vertices},
          {"splits", r.splits},
          {"collapses", r.collapses},
          {"flips", r.flips},
          {"moves", r.moves},
          {"refused_by_fold", r.by_fold},
          {"refused_by_tolerance", r.by_tolerance},
          {"refused_by_crossing", r.by_crossing},
          {"guards_spent", r.guard_spent ? 1 : 0},
          {"refused_by_room", r.by_capacity}};
}

Json raised_counts(const RemeshReport& r) {
  return {
      {"sharp_in", r.sharp_in}, {"sharp_held", r.sharp_held}, {"sharp_by_tolerance", r.sharp_by_tolerance}};
}

Json evened_counts(const RemeshReport& r) {
  return {{"uneven_in", r.uneven_in},
          {"uneven_held", r.uneven_held},
          {"uneven_at_lines", r.uneven_at_lines},
          {"uneven_by_tolerance", r.uneven_by_tolerance}};
}

}  // namespace tessera
