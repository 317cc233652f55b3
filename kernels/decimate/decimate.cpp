// Sources: Garland and Heckbert 1997 (quadrics); Trettner and Kobbelt, "Fast and Robust QEM Minimization using
// Probabilistic Quadrics", 2020; Kobbelt, Campagna and Seidel, "A General Framework for Mesh Decimation", 1998 (halfedge
// collapses; binary legality, continuous priority); Botsch's thesis, 3.2.2.
#include "kernels/decimate/decimate.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>
#include <string>

#include "kernels/decimate/colour_guard.h"
#include "kernels/decimate/crossing_guard.h"
#include "kernels/decimate/decimator.h"
#include "kernels/decimate/feature_edges.h"
#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/flat_faces.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/error.h"

namespace tessera {
namespace {

void check_sizes(const MeshBlock& b, const char* name) {
  const std::size_t n = b.position.size(), m = b.faces.size();
  if (b.key.size() != n || b.vertex_class.size() != n || (!b.rgba.empty() && b.rgba.size() != n) ||
      b.face_flags.size() != m || (!b.face_bound.empty() && b.face_bound.size() != m))
    throw InputError(std::string("decimation: arrays of different length in the ") + name);
  if (!fits_collapse_mesh(n, m))
    throw InputError(std::string("decimation: a thousand million faces or more in the ") + name);
  for (const auto& f : b.faces)
    if (f[0] >= n || f[1] >= n || f[2] >= n || f[0] == f[1] || f[1] == f[2] || f[2] == f[0])
      throw InputError(std::string("decimation: a face without three different vertices in the ") + name);
}

void check_keys(const MeshBlock& canonical) {
  const auto twin = std::adjacent_find(canonical.key.begin(), canonical.key.end());
  if (twin != canonical.key.end())
    throw InputError("decimation: two vertices of the block have the key " + std::to_string(*twin));
}

/// Per vertex of the mesh the one with the same key in the reference, or kNoCorner. Both blocks are
/// canonical.
std::vector<std::uint32_t> same_vertices(const CollapseMesh& mesh, const MeshBlock& block,
                                         const CollapseMesh& original, const MeshBlock& reference) {
  std::vector<std::uint32_t> in_original(reference.key.size());
  for (std::uint32_t v = 0; v < original.vertices(); ++v) in_original[original.block_vertex(v)] = v;
  std::vector<std::uint32_t> by_block(block.key.size(), kNoCorner), out(block.key.size());
  std::size_t at = 0;
  for (std::size_t v = 0; v < by_block.size(); ++v) {
    while (at < reference.key.size() && reference.key[at] < block.key[v]) ++at;
    if (at < reference.key.size() && reference.key[at] == block.key[v]) by_block[v] = in_original[at];
  }
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v) out[v] = by_block[mesh.block_vertex(v)];
  return out;
}

/// Puts what is left of the mesh into the block; positions come from the block where they did not move.
void write_back(const CollapseMesh& mesh, MeshBlock& b) {
  b.faces.clear();
  b.face_flags.clear();
  b.face_bound.clear();
  for (const CollapseFace& f : mesh.faces()) {
    if (f.state & kStateDead) continue;
    unsigned flags = f.state & kStateSynthetic ? unsigned{kFaceSynthetic} : 0u;
    if (f.state & kStateDone) flags |= kFaceDone;
    if (f.state & kStateBorder << 0) flags |= kFaceBorder12;
    if (f.state & kStateBorder << 1) flags |= kFaceBorder20;
    if (f.state & kStateBorder << 2) flags |= kFaceBorder01;
    b.faces.push_back(
        {mesh.block_vertex(f.vertex[0]), mesh.block_vertex(f.vertex[1]), mesh.block_vertex(f.vertex[2])});
    b.face_flags.push_back(static_cast<std::uint8_t>(flags));
    b.face_bound.push_back(f.bound);
  }
  canonicalise(b);
}

/// \returns whether more faces may meet than did, where not all are guarded
bool decimate_mesh(CollapseMesh& mesh, MeshBlock& block, const MeshBlock& reference,
                   const DecimateOptions& options, std::span<const std::uint64_t> pinned,
                   const Double3& origin, bool guard_all, DecimateReport& report) {
  std::optional<CollapseMesh> apart;
  std::vector<std::uint32_t> reference_vertex(mesh.vertices());
  std::vector<std::uint8_t> sharp;
  if (&reference == &block) {
    std::iota(reference_vertex.begin(), reference_vertex.end(), 0u);
  } else if (options.tolerance > 0.0 || options.feature_angle_deg > 0.0) {
    check_sizes(reference, "reference");
    if (!std::is_sorted(reference.key.begin(), reference.key.end()))
      throw InputError("decimation: the keys of the reference must ascend");
    apart.emplace(reference, origin, CollapseMesh::Order::kNearEnough);
    std::vector<std::uint32_t> same(apart->vertices());
    std::iota(same.begin(), same.end(), 0u);
    sharp = sharp_vertices(*apart, options.feature_angle_deg);
    mark_features(*apart, reference, sharp, same, options.feature_angle_deg);
    reference_vertex = same_vertices(mesh, block, *apart, reference);
  }
  const CollapseMesh& original = apart ? *apart : mesh;
  if (!apart) sharp = sharp_vertices(mesh, options.feature_angle_deg);
  mark_features(mesh, block, sharp, reference_vertex, options.feature_angle_deg);
  for (std::uint32_t v = 0; v < mesh.vertices() && !pinned.empty(); ++v)
    if (std::binary_search(pinned.begin(), pinned.end(), block.key[mesh.block_vertex(v)]))
      mesh.add_state(v, kVertexLocked);
  for (std::uint32_t v = 0; v < mesh.vertices(); ++v)
    report.locked_vertices += (mesh.state(v) & kVertexLocked) != 0;
  Decimator decimator(mesh, original, std::move(reference_vertex), options, block, origin, guard_all);
  apart.reset();
  decimator.run(report);
  return !guard_all && decimator.may_meet();
}

}  // namespace

void DecimateOptions::validate() const {
  const auto need = [](bool good, const char* field, const char* range) {
    if (!good) throw UsageError(std::string("decimation: ") + field + " must be " + range);
  };
  need(tolerance >= 0.0 && std::isfinite(tolerance), "tolerance", "a length of 0 or more");
  need(max_cost_class < kCostClasses, "max_cost_class", "below 2048");
  need(noise >= 0.0 && std::isfinite(noise), "noise", "a length of 0 or more");
  need(feature_angle_deg >= 0.0 && feature_angle_deg <= 180.0, "feature_angle_deg", "in [0, 180]");
  need(max_normal_deviation_deg >= 0.0 && max_normal_deviation_deg <= 180.0, "max_normal_turn_deg",
       "in [0, 180]");
  need(min_mean_ratio >= 0.0 && min_mean_ratio < 1.0, "min_roundness", "in [0, 1)");
  need((colour_tolerance >= 0.0 && colour_tolerance <= 255.0) || colour_tolerance == kAutoColourTolerance,
       "colour_tolerance", "0 to 255");
  need(colour_weight >= 0.0 && std::isfinite(colour_weight), "colour_weight", "a length of 0 or more");
}

DecimateReport decimate(MeshBlock& block, const MeshBlock& reference, const DecimateOptions& given,
                        std::span<const std::uint64_t> pinned) {
  given.validate();
  check_sizes(block, "block");
  DecimateReport report;
  canonicalise(block);
  check_keys(block);
  block.face_bound.resize(block.faces.size(), 0.0f);
  report.faces_in = block.faces.size();
  report.vertices_in = block.position.size();
  if (block.faces.empty()) return report;
  Double3 origin = block.position[0];
  for (const Double3& p : block.position)
    for (std::size_t a = 0; a < 3; ++a) {
      if (!std::isfinite(p[a])) throw InputError("decimation: a vertex without finite coordinates");
      origin[a] = std::fmin(origin[a], p[a]);
    }
  report.flat_faces = mend_flat_faces(block);
  if (block.faces.empty()) return report;
  const bool itself = &reference == &block;
  DecimateOptions options = given;
  if (block.rgba.empty())
    options.colour_tolerance = 0.0;
  else if (given.colour_tolerance == kAutoColourTolerance)
    options.colour_tolerance = auto_colour_tolerance(reference.rgba.empty() ? block : reference);
  report.colour_tolerance = options.colour_tolerance;
  // What an earlier job settled, it did within its own tolerance: a level below, of tiles.
  if (itself)
    for (std::uint8_t& flags : block.face_flags)
      flags = static_cast<std::uint8_t>(flags & ~unsigned{kFaceDone});
  // Sweeps go by places; where there are none, sorting gains nothing.
  const bool fresh = std::all_of(block.face_bound.begin(), block.face_bound.end(),
                                 [](float bound) { return !(bound > 0.0f); });
  // Sweeps trust flat places; where the result shows that they should not have, all is done again and looked at.
  for (const bool guard_all : {options.allow_crossings, true}) {
    DecimateReport attempt = report;
    CollapseMesh mesh(block, origin,
                      fresh ? CollapseMesh::Order::kByPosition : CollapseMesh::Order::kNearEnough);
    if (decimate_mesh(mesh, block, reference, options, pinned, origin, guard_all, attempt)) {
      const std::size_t pairs = count_contacts(mesh);
      if (pairs > 0) mesh.shrink();  // the search of the block needs the memory
      if (pairs > 0 && count_contacts(block, pairs) < pairs) continue;
    }
    report = attempt;
    write_back(mesh, block);
    break;
  }
  report.faces_out = block.faces.size();
  report.vertices_out = block.position.size();
  for (const float b : block.face_bound) report.bound = std::fmax(report.bound, static_cast<double>(b));
  return report;
}

std::size_t decimate_bytes(std::size_t block_faces, std::size_t reference_faces) {
  // Half a vertex per face; closed meshes have fewer, open ones hardly more. Measured by the test of the same
  // name.
  return block_faces * 184 + reference_faces * 112 + (1u << 20);
}

std::uint32_t cost_class_for(const std::array<std::uint64_t, kCostClasses>& histogram, std::uint64_t faces,
                             std::uint64_t target_faces) {
  std::uint32_t c = 0;
  while (c + 1 < kCostClasses && faces > target_faces) {
    faces -= std::min(faces, histogram[c]);
    if (faces <= target_faces) break;
    ++c;
  }
  return c;
}

}  // namespace tessera
