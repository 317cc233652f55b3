// The end with a tolerance: edges are split where mesh or reference are too far from the other. New vertices lie on the
// reference, so that the surfaces come nearer.
#include <algorithm>
#include <array>
#include <limits>

#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/triangle_foot.h"
#include "kernels/remesh/remesher.h"

namespace tessera {
namespace {

constexpr int kRefineRounds = 12;  ///< each leaves about a third of what the one before found
/// Where nobody asked for a tolerance: so many splits bring a surface within one, or it is far coarser than that.
constexpr std::size_t kFacesPerSplit = 50, kAlwaysSplits = 20;
constexpr double kOutside = 4.0;  ///< tolerances: what is farther away lies beside the block

}  // namespace

void Remesher::refine(RemeshReport& report) {
  refining_ = true;
  std::size_t most_splits = options_.refine_beyond ? std::numeric_limits<std::size_t>::max()
                                                   : live_faces_ / kFacesPerSplit + kAlwaysSplits;
  changed_.assign(info_.size(), 0);
  const std::span<const Double3> all = surface_.vertices();
  std::vector<Double3> points(all.begin(), all.end());
  for (round_ = 0; round_ < kRefineRounds; ++round_) {
    std::vector<Edge>().swap(edges_);  // their memory is needed here
    std::vector<Edge>().swap(listed_);
    // Per face: bits of the corners across from the edges.
    std::vector<std::uint8_t> wanted(mesh_.faces().size(), 0);
    want_beyond(wanted);
    want_missed(points, wanted);
    const std::size_t faces =
        wanted.size() - static_cast<std::size_t>(std::count(wanted.begin(), wanted.end(), 0));
    if (faces > most_splits) return;
    const std::size_t done = split_wanted(wanted, report);
    if (done == 0) return;
    most_splits -= std::min(most_splits, done);
  }
}

/// The corner across from the longest edge.
std::uint32_t Remesher::longest_corner(std::uint32_t f) const {
  const std::uint32_t* v = mesh_.face(f).vertex;
  std::uint32_t corner = 0;
  double maximum = -1.0;
  for (std::uint32_t i = 0; i < 3; ++i) {
    const double square = square_of(v[(i + 1) % 3], v[(i + 2) % 3]);
    if (square > maximum) maximum = square, corner = i;
  }
  return corner;
}

/// Whether the round before did not change the face.
bool Remesher::is_as_before(const CollapseFace& face) const {
  return std::all_of(face.vertex, face.vertex + 3, [&](std::uint32_t v) { return changed_[v] < round_; });
}

/// Marks the longest edge of every face that has a point beyond the tolerance; skips faces that the round before did not
/// change.
void Remesher::want_beyond(std::vector<std::uint8_t>& wanted) const {
  for (std::uint32_t f = 0; f < wanted.size(); ++f) {
    step();
    const CollapseFace& face = mesh_.face(f);
    if ((face.state & kStateDead) || is_as_before(face)) continue;
    const std::uint32_t* v = face.vertex;
    if (beyond({{v[0], v[1], v[2]}, {mesh_.at(v[0]), mesh_.at(v[1]), mesh_.at(v[2])}}))
      wanted[f] = static_cast<std::uint8_t>(1u << longest_corner(f));
  }
}

/// Whether a point of the face lies beyond the tolerance: like within(), of more points.
bool Remesher::beyond(const NewFace& face) const {
  std::uint32_t hint = ReferenceSurface::kNone;
  const double limit = refine_limit_;
  if (bulge(face, hint) < 0.5 * limit) return false;
  constexpr int kParts = 5;
  for (int i = 0; i <= kParts; ++i)
    for (int j = 0; i + j <= kParts; ++j) {
      const int k = kParts - i - j;
      if (i == kParts || j == kParts || k == kParts) continue;
      const Double3 p = (face.at[0] * i + face.at[1] * j + face.at[2] * k) * (1.0 / kParts);
      if (!near_enough(p, limit, hint)) return true;
    }
  return false;
}

/// Marks an edge of the nearest face for every point of the reference beyond the tolerance: the feature edge if that is what
/// the point is nearest to, else the longest one. At seams the face may lie in another block, which marks it itself.
/// \param points  come back as those that were missed
void Remesher::want_missed(std::vector<Double3>& points, std::vector<std::uint8_t>& wanted) const {
  if (points.empty()) return;
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::uint32_t> number;
  for (std::uint32_t f = 0; f < wanted.size(); ++f) {
    const CollapseFace& face = mesh_.face(f);
    if ((face.state & kStateDead) || is_as_before(face))
      continue;  // no point came nearer to what is as before
    faces.push_back({face.vertex[0], face.vertex[1], face.vertex[2]});
    number.push_back(f);
  }
  std::vector<Double3> at(mesh_.vertices());
  for (std::uint32_t v = 0; v < at.size(); ++v) at[v] = mesh_.at(v);
  const ClosestFaces surface(at, faces, Double3{});
  const double square = refine_limit_ * refine_limit_;
  std::uint32_t hint = ClosestFaces::kNone;
  std::erase_if(points, [&](const Double3& p) {
    step();
    const ClosestFaces::Hit near = surface.closest(p, square, hint);
    if (near.slot != ClosestFaces::kNone) {
      hint = near.slot;
      return true;
    }
    const ClosestFaces::Hit missed = surface.closest(p, kOutside * kOutside * square, hint);
    if (missed.slot == ClosestFaces::kNone) return true;
    const std::uint32_t f = number[surface.face(missed.slot)];
    const std::uint32_t* v = mesh_.face(f).vertex;
    if (std::any_of(v, v + 3, [&](std::uint32_t w) { return (mesh_.state(w) & kVertexLocked) != 0; }))
      return true;
    const TriangleFoot foot = foot_in_triangle(p, at[v[0]], at[v[1]], at[v[2]]);
    const std::uint32_t across = static_cast<std::uint32_t>(foot.edge + 2) % 3;
    const bool line = foot.edge >= 0 && is_line(4 * f + across);
    wanted[f] = static_cast<std::uint8_t>(wanted[f] | 1u << (line ? across : longest_corner(f)));
    return false;
  });
}

/// Leaves edges shorter than the tolerance alone: corners lie on the reference, so splitting those brings nothing nearer.
std::size_t Remesher::split_wanted(const std::vector<std::uint8_t>& wanted, RemeshReport& report) {
  const double minimum = refine_limit_ * refine_limit_;
  listed_.clear();
  make_room_in_list();
  for (std::uint32_t c = 0; c < 4 * wanted.size(); ++c) {
    if ((c & 3u) == 3u || (mesh_.face(c >> 2).state & kStateDead)) continue;
    const std::uint32_t o = mesh_.opposite(c);
    if (o == kNoCorner ? !mesh_.border_edge(c) : o < c) continue;
    if (square_of(mesh_.vertex(next_corner(c)), mesh_.vertex(prev_corner(c))) < minimum) continue;
    const auto is_wanted = [&](std::uint32_t corner) {
      return (wanted[corner >> 2] >> (corner & 3u) & 1u) != 0;
    };
    if (is_wanted(c) || (o != kNoCorner && is_wanted(o))) listed_.push_back(edge_at(c));
  }
  sort_listed(true);
  std::size_t done = 0;
  for (const Edge& e : edges_) {
    step();
    done += split_if_free(e, report);
  }
  report.splits += done;
  return done;
}

}  // namespace tessera
