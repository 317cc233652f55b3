#include "kernels/remesh/remesh.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/face_boxes.h"
#include "kernels/mesh/flat_faces.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "kernels/remesh/remesher.h"
#include "octree/error.h"

namespace tessera {
namespace {

Double3 low_corner(const MeshBlock& block) {
  Double3 origin = block.position[0];
  for (const Double3& p : block.position)
    for (std::size_t a = 0; a < 3; ++a) {
      if (!std::isfinite(p[a])) throw InputError("remeshing: a vertex without finite coordinates");
      origin[a] = std::fmin(origin[a], p[a]);
    }
  return origin;
}

Double3 as_stored(const Double3& p, bool floats) {
  return floats ? wide(narrow(p)) : p;
}

/// What is left of the mesh as a block; positions come from the old one where they did not move.
MeshBlock to_block(const CollapseMesh& mesh, const Remesher& remesher, const MeshBlock& old,
                   const MeshBlock& reference, const ReferenceSurface& surface, const Double3& origin,
                   bool floats) {
  MeshBlock out;
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) {
    const std::uint32_t from = mesh.block_vertex(v);
    const bool moved = remesher.moved(v);
    out.key.push_back(remesher.key(v));
    out.position.push_back(moved ? as_stored(origin + mesh.at(v), floats) : old.position[from]);
    const std::uint8_t state = mesh.state(v);
    out.vertex_class.push_back(state & kVertexLocked   ? old.vertex_class[from]
                               : state & kVertexFixed  ? VertexClass::kCorner
                               : state & kVertexCrease ? VertexClass::kCrease
                                                       : VertexClass::kSmooth);
    if (old.rgba.empty()) continue;
    const ReferenceSurface::Foot foot = moved && !reference.rgba.empty()
                                            ? surface.closest(mesh.at(v), std::numeric_limits<double>::max())
                                            : ReferenceSurface::Foot{};
    out.rgba.push_back(foot.slot != ReferenceSurface::kNone ? surface.colour(foot.slot, foot.at)
                       : from != kNoCorner                  ? old.rgba[from]
                                                            : 0xffffffffu);
  }
  for (const CollapseFace& f : mesh.faces()) {
    if (f.state & kStateDead) continue;
    out.faces.push_back({f.vertex[0], f.vertex[1], f.vertex[2]});
    unsigned flags = f.state & kStateSynthetic ? unsigned{kFaceSynthetic} : 0u;
    constexpr unsigned kEdge[3] = {kFaceBorder12, kFaceBorder20, kFaceBorder01};
    for (std::size_t i = 0; i < 3; ++i) {
      if (f.state & unsigned{kStateBorder} << i) flags |= kEdge[i];
      if (f.state & unsigned{kStateCrease} << i) flags |= kEdge[i] << 5;
    }
    out.face_flags.push_back(static_cast<std::uint8_t>(flags));
  }
  canonicalise(out);
  return out;
}

/// How many vertices lie exactly where another one does, less one for each such place.
std::size_t count_copies(const MeshBlock& block) {
  std::vector<Double3> places = block.position;
  std::sort(places.begin(), places.end());
  std::size_t copies = 0;
  for (std::size_t i = 1; i < places.size(); ++i) copies += places[i] == places[i - 1];
  return copies;
}

}  // namespace

void RemeshOptions::validate() const {
  const auto need = [](bool good, const char* field, const char* range) {
    if (!good) throw UsageError(std::string("remeshing: ") + field + " must be " + range);
  };
  need(edge > 0.0 && std::isfinite(edge), "edge", "a length above 0");
  need(sizing_tolerance >= 0.0 && std::isfinite(sizing_tolerance), "sizing_tolerance",
       "a length of 0 or more");
  need(sizing_tolerance == 0.0 || (min_edge > 0.0 && min_edge <= edge), "min_edge",
       "above 0 and at most edge");
  need(crease_tolerance >= 0.0 && std::isfinite(crease_tolerance), "crease_tolerance",
       "a length of 0 or more");
  need(tolerance >= 0.0 && std::isfinite(tolerance), "tolerance", "a length of 0 or more");
  need(refine_within >= 0.0 && std::isfinite(refine_within), "refine_within", "a length of 0 or more");
  need(angle_weight > 0.0 && std::isfinite(angle_weight), "angle_weight", "above 0");
  need(last_relaxations >= 0, "last_relaxations", "0 or more");
  need(size_relaxations >= 0, "size_relaxations", "0 or more");
  need(sine_weight >= 0.0 && std::isfinite(sine_weight), "sine_weight", "0 or more");
  need(feature_angle_deg >= 0.0 && feature_angle_deg <= 180.0, "feature_angle_deg", "in [0, 180]");
  need(max_normal_deviation_deg >= 0.0 && max_normal_deviation_deg <= 180.0, "max_normal_turn_deg",
       "in [0, 180]");
  need(min_angle_deg >= 0.0 && min_angle_deg < 60.0, "min_angle_deg", "in [0, 60)");
  need(max_length_ratio == 0.0 || (max_length_ratio >= 1.1 && max_length_ratio < 100.0), "max_length_ratio",
       "0 or in [1.1, 100)");
  need(kept_angle_deg >= 0.0 && kept_angle_deg < 60.0, "kept_angle_deg", "in [0, 60)");
  need(max_length_ratio == 0.0 || min_angle_deg == 0.0, "min_angle_deg", "0 with max_length_ratio");
  need(iterations >= 0 && relaxations >= 0, "iterations", "0 or more");
}

RemeshReport remesh(MeshBlock& block, const MeshBlock& reference, const RemeshOptions& options,
                    std::span<const std::uint64_t> pinned) {
  options.validate();
  RemeshReport report;
  block.face_bound.clear();
  for (std::uint8_t& flags : block.face_flags)
    flags = static_cast<std::uint8_t>(flags & ~unsigned{kFaceDone});
  canonicalise(block);
  report.faces_in = report.faces_out = block.faces.size();
  if (block.faces.empty()) return report;
  const Double3 origin = low_corner(block);
  const bool adaptive = options.sizing_tolerance > 0.0;
  const ReferenceSurface surface(reference, origin, options.feature_angle_deg,
                                 kMinCreaseEdges * (adaptive ? options.min_edge : options.edge),
                                 {options.max_length_ratio > 0.0 ? 0.0 : options.sizing_tolerance,
                                  options.min_edge, options.edge, options.crease_tolerance});
  if (options.find_creases) surface.mark(block);
  const auto remeshed = [&](bool guarded, RemeshReport& r) {
    CollapseMesh mesh(block, origin);
    Remesher remesher(mesh, block, origin, surface, options, pinned, guarded);
    remesher.run(r);
    MeshBlock out = to_block(mesh, remesher, block, reference, surface, origin, options.float_positions);
    mend_flat_faces(out);
    return out;
  };
  // Few blocks come to cross themselves: to look at the result costs less than to ask at every step.
  const RemeshReport none = report;
  MeshBlock result = remeshed(false, report);
  const bool useless =
      options.useless_faces > 0 && report.locked_vertices == 0 && result.faces.size() > options.useless_faces;
  if (!useless) {
    const std::size_t pairs = count_contacts(result), copies = count_copies(result);
    if ((pairs > 0 && count_contacts(block, pairs) < pairs) || (copies > 0 && count_copies(block) < copies)) {
      RemeshReport again = none;
      MeshBlock guarded = remeshed(true, again);
      if (count_contacts(guarded, pairs + copies) + count_copies(guarded) < pairs + copies) {
        result = std::move(guarded);
        report = again;
      }
    }
  }
  block = std::move(result);
  report.faces_out = block.faces.size();
  return report;
}

std::uint64_t remesh_bytes(std::uint64_t max_faces, std::uint64_t reference_faces, bool refines, bool evens) {
  // Of a face: 32 bytes, half a vertex with what is known of it (41 + 48 + 5). Beside it, one after the other: an edge and a half,
  // three where borders are everywhere, in both lists of edges (16 each; freed for the sort by place); in refinement a hierarchy
  // over the faces and where they lie (28 + 13); the block that comes out, sorted (16 + half of 60, twice). Where it crosses itself
  // all that once more beside what came out first, guarded. Half a point of the reference for the hierarchy to find; to even lengths four and a half, of 8 bytes, and the first of each
  // face (4).
  const std::uint64_t lists = 96, search = refines ? ClosestFaces::bytes_per_face() + (evens ? 45 : 41) : 0,
                      sorted = 92, first = 46;
  const std::uint64_t working = max_faces * (32 + 47 + std::max({lists, search, sorted}) + first) +
                                FaceBoxes::bytes(max_faces, FaceBoxes::Order::kMorton) +
                                reference_faces * (!refines ? 0
                                                   : evens  ? 36
                                                            : 12);
  // Nothing of that is there while the reference is made.
  return std::max(reference_faces * ReferenceSurface::bytes_per_face(),
                  reference_faces * ReferenceSurface::held_bytes_per_face() + working) +
         (std::uint64_t{1} << 20);
}

}  // namespace tessera
