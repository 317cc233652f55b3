#include "kernels/boolean/exact_boolean.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <unordered_map>
#include <utility>

#include "kernels/boolean/cut_face.h"
#include "kernels/boolean/exact_winding.h"
#include "kernels/boolean/solid_fans.h"
#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"
#include "octree/edge_faces.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

using Corners = std::array<std::uint32_t, 3>;

/// Where a piece of one surface lies against the other solid.
enum class Side : std::uint8_t { kUnknown, kOutside, kInside, kAlong, kAgainst };

struct Piece {
  Corners corner;
  std::uint32_t face;  ///< of MeshCuts::faces
  bool whole;          ///< the face itself
  Side side = Side::kUnknown;
};

class Boolean {
 public:
  Boolean(const SolidMesh& first, const SolidMesh& second, BooleanJoin join)
      : cuts_(find_mesh_cuts(first, second)), join_(join) {}

  BooleanResult run() {
    out_.stats.face_pairs = cuts_.face_pairs;
    out_.stats.coplanar_pairs = cuts_.coplanar_pairs;
    cut();
    for (const bool of_first : {true, false}) classify(of_first);
    select();
    finish();
    return std::move(out_);
  }

 private:
  bool is_first(const Piece& p) const { return p.face < cuts_.first_faces; }

  void cut() {
    pieces_.reserve(cuts_.faces.size());
    auto cut = cuts_.cut.begin();
    for (std::uint32_t f = 0; f < cuts_.faces.size(); ++f) {
      const MeshCuts::CutFace* here = cut != cuts_.cut.end() && cut->face == f ? &*cut++ : nullptr;
      const std::size_t begin = pieces_.size();
      if (here == nullptr || here->inner.empty()) {
        pieces_.push_back({cuts_.faces[f], f, true});
      } else {
        ++out_.stats.cut_faces;
        for (const Corners& t :
             triangulate_cut_face(cuts_.points, cuts_.faces[f], here->inner, here->segments))
          pieces_.push_back({t, f, false});
      }
      if (here == nullptr) continue;
      for (const std::uint32_t other : here->coplanar)
        for (std::size_t i = begin; i < pieces_.size(); ++i)
          if (lies_on(pieces_[i], other))
            pieces_[i].side = same_way(f, other) ? Side::kAlong : Side::kAgainst;
    }
  }

  /// \pre  its face and the other one lie in one plane
  bool lies_on(const Piece& piece, std::uint32_t other) const {
    for (const std::uint32_t v : piece.corner) {
      const auto meeting = cuts_.meetings.find(v);
      if (meeting == cuts_.meetings.end()) return false;
      const Carrier& on = is_first(piece) ? meeting->second.on_second : meeting->second.on_first;
      if (!on.within(other, cuts_.faces[other])) return false;
    }
    return true;
  }

  bool same_way(std::uint32_t f, std::uint32_t g) const {
    const Corners &a = cuts_.faces[f], &b = cuts_.faces[g];
    for (std::size_t k = 0; k < 3; ++k) {
      const int s = cuts_.points.orient2d(a[0], a[1], a[2], k, (k + 1) % 3);
      if (s != 0) return s == cuts_.points.orient2d(b[0], b[1], b[2], k, (k + 1) % 3);
    }
    return false;
  }

  bool is_segment(std::uint32_t a, std::uint32_t b) const {
    return std::binary_search(cuts_.segments.begin(), cuts_.segments.end(), PointPair(std::minmax(a, b)));
  }

  /// Pieces that are joined through edges off the cut lie on one side.
  void classify(bool of_first) {
    std::vector<std::uint32_t> piece;
    std::vector<Corners> corners;
    for (std::uint32_t i = 0; i < pieces_.size(); ++i)
      if (is_first(pieces_[i]) == of_first && pieces_[i].side == Side::kUnknown) {
        piece.push_back(i);
        corners.push_back(pieces_[i].corner);
      }
    if (piece.empty()) return;
    UnionFind joined(piece.size());
    EdgeFaces(cuts_.points.size(), corners)
        .for_each([&](std::uint32_t a, std::uint32_t b, std::span<const std::uint32_t> half) {
          if (half.size() < 2 || is_segment(a, b)) return;
          for (const std::uint32_t h : half) joined.unite(half[0] / 3, h / 3);
        });
    // Of each part a vertex that is not on the other surface, where there is one.
    constexpr std::uint32_t kNone = ~std::uint32_t{0};
    std::vector<std::uint32_t> off(piece.size(), kNone);
    for (std::uint32_t i = 0; i < piece.size(); ++i)
      for (const std::uint32_t v : corners[i])
        if (cuts_.points.is_given(v) && !cuts_.meetings.contains(v)) {
          std::uint32_t& best = off[joined.find(i)];
          best = std::min(best, v);
        }
    const std::span<const Corners> all = cuts_.faces;
    const ExactWinding other(cuts_.points,
                             of_first ? all.subspan(cuts_.first_faces) : all.first(cuts_.first_faces));
    for (std::uint32_t i = 0; i < piece.size(); ++i) {
      const std::uint32_t root = joined.find(i);  // the first of its set
      if (root == i) {
        const Corners& c = corners[i];
        const std::uint32_t p = off[i] != kNone ? off[i] : cuts_.points.add_middle(c[0], c[1], c[2]);
        pieces_[piece[i]].side = other.at(p) > 0 ? Side::kInside : Side::kOutside;
      } else {
        pieces_[piece[i]].side = pieces_[piece[root]].side;
      }
    }
  }

  /// Keeps the pieces that bound the result, turned where the second solid is taken away.
  void select() {
    std::vector<Piece> kept;
    for (Piece p : pieces_) {
      const bool first = is_first(p);
      const Side wanted = join_ == BooleanJoin::kUnite       ? Side::kOutside
                          : join_ == BooleanJoin::kIntersect ? Side::kInside
                          : first                            ? Side::kOutside
                                                             : Side::kInside;
      const Side shared = join_ == BooleanJoin::kSubtract ? Side::kAgainst : Side::kAlong;
      if (p.side != wanted && !(first && p.side == shared)) continue;
      if (!first && join_ == BooleanJoin::kSubtract) std::swap(p.corner[1], p.corner[2]);
      kept.push_back(p);
    }
    pieces_ = std::move(kept);
  }

  void finish() {
    std::unordered_map<std::uint32_t, std::uint32_t> number;
    std::unordered_map<std::uint32_t, std::uint32_t> seen;  // how often a point became a vertex
    SolidMesh& mesh = out_.mesh;
    std::vector<std::uint8_t> made;
    std::vector<Corners> corners;
    corners.reserve(pieces_.size());
    for (const Piece& p : pieces_) corners.push_back(p.corner);
    SolidFans fans(cuts_.points, corners);
    EdgeFaces(cuts_.points.size(), corners)
        .for_each([&](std::uint32_t low, std::uint32_t, std::span<const std::uint32_t> half) {
          if (!fans.is_balanced(half, low)) throw std::logic_error("a boolean came out open");
          fans.join_around(half, low);
        });
    for (std::uint32_t f = 0; f < pieces_.size(); ++f) {
      Corners c;
      for (std::uint32_t k = 0; k < 3; ++k) {
        const std::uint32_t root = fans.vertex_of(3 * f + k), point = pieces_[f].corner[k];
        const auto [at, fresh] = number.emplace(root, static_cast<std::uint32_t>(mesh.points.size()));
        if (fresh) {
          mesh.points.push_back(cuts_.points.near(point));
          made.push_back(!cuts_.points.is_given(point));
          out_.stats.made_vertices += made.back();
          out_.stats.split_vertices += seen[point]++ > 0;
        }
        c[k] = at->second;
      }
      mesh.faces.push_back(c);
      ++(pieces_[f].whole ? out_.stats.kept_faces : out_.stats.made_faces);
    }
    out_.made = std::move(made);
  }

  MeshCuts cuts_;
  const BooleanJoin join_;
  std::vector<Piece> pieces_;
  BooleanResult out_;
};

std::string place_text(const Double3& p) {
  return std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]);
}

/// Surfaces that are in each other the wrong way.
std::optional<std::string> nesting_fault(const SolidMesh& mesh) {
  UnionFind joined(mesh.faces.size());
  EdgeFaces(mesh.points.size(), mesh.faces)
      .for_each([&](std::uint32_t, std::uint32_t, std::span<const std::uint32_t> half) {
        for (const std::uint32_t h : half) joined.unite(half[0] / 3, h / 3);
      });
  // Of each surface its volume, counted from one of its corners so that large coordinates lose nothing.
  std::vector<double> volume(mesh.faces.size(), 0.0);
  for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
    const std::uint32_t root = joined.find(f);
    const Double3& from = mesh.points[mesh.faces[root][0]];
    const Corners& c = mesh.faces[f];
    volume[root] += dot(mesh.points[c[0]] - from, cross(mesh.points[c[1]] - from, mesh.points[c[2]] - from));
  }
  PointTable points(mesh.points);
  const ExactWinding winding(points, mesh.faces);
  for (std::uint32_t f = 0; f < mesh.faces.size(); ++f) {
    if (joined.find(f) != f) continue;
    const Corners& c = mesh.faces[f];
    const std::uint32_t middle = points.add_middle(c[0], c[1], c[2]);
    const int around = winding.at(middle, [&](std::uint32_t g) { return joined.find(g) != f; });
    if (around == 0 && volume[f] > 0.0) continue;
    if (around == 1 && volume[f] < 0.0) continue;
    const std::string where = " (at " + place_text(mesh.points[c[0]]) + ")";
    if (around == 0) return "faces of a part look inward" + where;
    return "parts of it lie in each other the same way round" + where;
  }
  return std::nullopt;
}

}  // namespace

SolidMesh canonical_solid(const SolidMesh& mesh) {
  std::vector<std::uint8_t> used(mesh.points.size(), 0);
  for (const Corners& f : mesh.faces)
    for (const std::uint32_t v : f) used[v] = 1;
  std::vector<std::uint32_t> order;
  for (std::uint32_t v = 0; v < mesh.points.size(); ++v)
    if (used[v]) order.push_back(v);
  // Zeros of both signs are equal: the sign decides which one of them stays.
  const auto signs = [&](std::uint32_t v) {
    const Double3& p = mesh.points[v];
    return std::array<bool, 3>{std::signbit(p[0]), std::signbit(p[1]), std::signbit(p[2])};
  };
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    const Double3 &p = mesh.points[a], &q = mesh.points[b];
    return p != q ? p < q : signs(a) < signs(b);
  });
  SolidMesh out;
  std::vector<std::uint32_t> number(mesh.points.size(), 0);
  for (const std::uint32_t v : order) {
    if (out.points.empty() || out.points.back() != mesh.points[v]) out.points.push_back(mesh.points[v]);
    number[v] = static_cast<std::uint32_t>(out.points.size() - 1);
  }
  for (const Corners& f : mesh.faces) {
    Corners c = {number[f[0]], number[f[1]], number[f[2]]};
    if (c[0] == c[1] || c[1] == c[2] || c[2] == c[0]) continue;
    std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
    out.faces.push_back(c);
  }
  std::sort(out.faces.begin(), out.faces.end());
  return out;
}

std::optional<std::string> solid_fault(const SolidMesh& mesh) {
  std::uint64_t flat = 0, open = 0;
  const Corners* first_flat = nullptr;
  for (const Corners& f : mesh.faces)
    if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0] ||
        collinear(mesh.points[f[0]], mesh.points[f[1]], mesh.points[f[2]])) {
      ++flat;
      if (first_flat == nullptr) first_flat = &f;
    }
  if (mesh.faces.empty()) return "it has no faces";
  std::string open_at;
  EdgeFaces(mesh.points.size(), mesh.faces)
      .for_each([&](std::uint32_t low, std::uint32_t, std::span<const std::uint32_t> half) {
        std::size_t up = 0;
        for (const std::uint32_t h : half) up += mesh.faces[h / 3][h % 3] == low;
        if (2 * up == half.size()) return;
        if (open++ == 0) open_at = place_text(mesh.points[low]);
      });
  if (open > 0)
    return "it is not closed, or not all its faces look the same way, at " + std::to_string(open) +
           " edges (the first at " + open_at + ")";
  if (flat > 0)
    return std::to_string(flat) + " of its faces have no area (the first at " +
           place_text(mesh.points[(*first_flat)[0]]) + ")";
  std::vector<ContactFace> faces;
  faces.reserve(mesh.faces.size());
  for (const Corners& f : mesh.faces)
    faces.push_back({{mesh.points[f[0]], mesh.points[f[1]], mesh.points[f[2]]}, {f[0], f[1], f[2]}});
  std::uint64_t pairs = 0;
  std::uint32_t first = 0;
  block_contacts(faces, kAllSpace, [&](std::uint32_t i, std::uint32_t j, FaceContact) {
    if (pairs++ == 0 || std::min(i, j) < first) first = std::min(i, j);
  });
  if (pairs > 0)
    return std::to_string(pairs) + " pairs of its faces cross, overlap or touch (the first at " +
           place_text(faces[first].corner[0]) + ")";
  return nesting_fault(mesh);
}

BooleanResult exact_boolean(const SolidMesh& first, const SolidMesh& second, BooleanJoin join) {
  return Boolean(first, second, join).run();
}

}  // namespace tessera
