#include "kernels/boolean/self_union.h"

#include <algorithm>
#include <map>
#include <numeric>
#include <utility>

#include "kernels/boolean/cut_face.h"
#include "kernels/boolean/exact_winding.h"
#include "kernels/boolean/self_cuts.h"
#include "kernels/boolean/solid_fans.h"
#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"
#include "octree/edge_faces.h"
#include "octree/union_find.h"

namespace tessera {
namespace {

using UnionCorners = std::array<std::uint32_t, 3>;
constexpr std::uint32_t kNoNumber = ~std::uint32_t{0};

std::string at_text(const Double3& p) {
  return " (at " + std::to_string(p[0]) + " " + std::to_string(p[1]) + " " + std::to_string(p[2]) + ")";
}

/// What keeps a mesh from being united, in the words of `fault`.
struct Unfit {
  std::string why;
};

class SelfUniter {
 public:
  SelfUniter(const SolidMesh& mesh, PositionStep step) : mesh_(mesh), step_(step) { weld(); }

  SelfUnion run() {
    out_.gone.assign(mesh_.faces.size(), 0);
    find_pairs();
    if (pairs_.empty()) return std::move(out_);
    try {
      find_parts();
      cut();
      classify();
      select();
      settle();
    } catch (const Unfit& unfit) {
      SelfUnion out;
      out.fault = unfit.why;
      out.stats.pairs = out_.stats.pairs;
      return out;
    }
    return std::move(out_);
  }

 private:
  struct Piece {
    UnionCorners corner;  ///< numbers of points
    std::uint32_t face;
    bool whole;  ///< the face itself
    bool coplanar = false;
    bool kept = false;
  };

  /// Vertices at one position get the number of the first of them.
  void weld() {
    std::vector<std::uint32_t> order(mesh_.points.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      const Double3 &p = mesh_.points[a], &q = mesh_.points[b];
      return p != q ? p < q : a < b;
    });
    std::vector<std::uint32_t> first(mesh_.points.size());
    for (std::size_t i = 0; i < order.size(); ++i)
      first[order[i]] =
          i > 0 && mesh_.points[order[i]] == mesh_.points[order[i - 1]] ? first[order[i - 1]] : order[i];
    welded_.points = mesh_.points;
    welded_.faces = mesh_.faces;
    for (UnionCorners& f : welded_.faces)
      for (std::uint32_t& v : f) v = first[v];
  }

  const Double3& at(std::uint32_t v) const { return mesh_.points[v]; }
  bool has_area(std::uint32_t f) const {
    const UnionCorners& c = welded_.faces[f];
    return c[0] != c[1] && c[1] != c[2] && c[2] != c[0] && !collinear(at(c[0]), at(c[1]), at(c[2]));
  }

  void find_pairs() {
    std::vector<ContactFace> faces;
    std::vector<std::uint32_t> number;
    for (std::uint32_t f = 0; f < welded_.faces.size(); ++f) {
      if (!has_area(f)) continue;
      const UnionCorners& c = welded_.faces[f];
      faces.push_back({{at(c[0]), at(c[1]), at(c[2])}, {c[0], c[1], c[2]}});
      number.push_back(f);
    }
    block_contacts(faces, kAllSpace, [&](std::uint32_t i, std::uint32_t j, FaceContact) {
      pairs_.emplace_back(number[i], number[j]);
    });
    std::sort(pairs_.begin(), pairs_.end());
    out_.stats.pairs = pairs_.size();
  }

  /// Faces that hang together by edges; which parts are closed, and which meet something.
  void find_parts() {
    const std::size_t n = welded_.faces.size();
    UnionFind joined(n);
    std::vector<std::uint8_t> open(n, 0), flat(n, 0), meets(n, 0);
    EdgeFaces(welded_.points.size(), welded_.faces)
        .for_each([&](std::uint32_t low, std::uint32_t, std::span<const std::uint32_t> half) {
          std::size_t up = 0;
          for (const std::uint32_t h : half) {
            joined.unite(half[0] / 3, h / 3);
            up += welded_.faces[h / 3][h % 3] == low;
          }
          if (2 * up != half.size()) open[half[0] / 3] = 1;
        });
    for (const auto& [f, g] : pairs_) meets[f] = meets[g] = 1;
    for (std::uint32_t f = 0; f < n; ++f) flat[f] = !has_area(f);
    part_of_.resize(n);
    for (std::uint32_t f = 0; f < n; ++f) {
      part_of_[f] = joined.find(f);
      for (auto* of : {&open, &flat, &meets}) (*of)[part_of_[f]] = (*of)[part_of_[f]] || (*of)[f];
    }
    closed_.resize(n), active_.resize(n);
    for (std::uint32_t f = 0; f < n; ++f) {
      const std::uint32_t part = part_of_[f];
      closed_[f] = !open[part];
      active_[f] = meets[part];
      if (!meets[part]) continue;
      if (open[part])
        throw Unfit{"a part of the surface is not closed there, so nothing tells inside from outside"};
      if (flat[part]) throw Unfit{"a part of the surface has faces without area"};
    }
    for (const auto& [f, g] : pairs_) joined.unite(f, g);
    for (std::uint32_t f = 0; f < n; ++f)
      part_of_[f] = joined.find(f);  // from here on parts that meet are one
    double volume = 0.0;
    const Double3& from = at(welded_.faces[0][0]);
    for (std::uint32_t f = 0; f < n; ++f) {
      const UnionCorners& c = welded_.faces[f];
      if (closed_[f]) volume += dot(at(c[0]) - from, cross(at(c[1]) - from, at(c[2]) - from));
    }
    inside_out_ = volume < 0.0;
  }

  void cut() {
    cuts_ = find_self_cuts(welded_, pairs_);
    out_.stats.coplanar_pairs = cuts_.coplanar_pairs;
    auto cut = cuts_.cut.begin();
    for (std::uint32_t f = 0; f < welded_.faces.size(); ++f) {
      const MeshCuts::CutFace* here = cut != cuts_.cut.end() && cut->face == f ? &*cut++ : nullptr;
      if (!active_[f]) continue;
      const std::size_t begin = pieces_.size();
      if (here == nullptr || here->inner.empty()) {
        pieces_.push_back({welded_.faces[f], f, true});
      } else {
        ++out_.stats.cut_faces;
        for (const UnionCorners& t :
             triangulate_cut_face(cuts_.points, welded_.faces[f], here->inner, here->segments))
          pieces_.push_back({t, f, false});
      }
      if (here == nullptr) continue;
      for (std::size_t i = begin; i < pieces_.size(); ++i)
        pieces_[i].coplanar = std::any_of(here->coplanar.begin(), here->coplanar.end(),
                                          [&](std::uint32_t other) { return lies_in(pieces_[i], other); });
    }
  }

  /// \pre  its face and the other one lie in one plane
  bool lies_in(const Piece& piece, std::uint32_t other) const {
    const auto axes = flat_axes(cuts_.points, welded_.faces[other]);
    return std::all_of(piece.corner.begin(), piece.corner.end(), [&](std::uint32_t v) {
      return lies_on_face(cuts_.points, welded_.faces[other], v, axes[0], axes[1]);
    });
  }

  /// Pieces that hang together off the cuts have the same on both sides, so one of them is asked.
  void classify() {
    std::vector<UnionCorners> corners;
    for (const Piece& p : pieces_) corners.push_back(p.corner);
    UnionFind joined(pieces_.size());
    EdgeFaces(cuts_.points.size(), corners)
        .for_each([&](std::uint32_t low, std::uint32_t high, std::span<const std::uint32_t> half) {
          if (half.size() != 2) return;
          if (std::binary_search(cuts_.segments.begin(), cuts_.segments.end(), PointPair(low, high))) return;
          joined.unite(half[0] / 3, half[1] / 3);
        });
    const ExactWinding winding(cuts_.points, welded_.faces);
    for (std::uint32_t i = 0; i < pieces_.size(); ++i) {
      const std::uint32_t root = joined.find(i);  // the first of its set
      pieces_[i].kept = root == i ? bounds_solid(pieces_[i], winding) : pieces_[root].kept;
    }
  }

  /// Whether there is nothing on its outside and something on its inside, and no other piece is that already.
  bool bounds_solid(const Piece& piece, const ExactWinding& winding) {
    const UnionCorners& c = piece.corner;
    int layers = 1;
    bool first = true;
    if (piece.coplanar) {
      const auto cut =
          std::lower_bound(cuts_.cut.begin(), cuts_.cut.end(), piece.face,
                           [](const MeshCuts::CutFace& x, std::uint32_t f) { return x.face < f; });
      for (const std::uint32_t other : cut->coplanar) {
        if (!lies_in(piece, other)) continue;
        const bool along = looks(welded_.faces[other]) == looks(welded_.faces[piece.face]);
        layers += along ? 1 : -1;
        if (along && other < piece.face) first = false;
      }
    }
    const std::uint32_t middle = cuts_.points.add_middle(c[0], c[1], c[2]);
    const int found = winding.at(middle, [&](std::uint32_t f) { return closed_[f] != 0; });
    // The point counts as above the faces that it lies on, beside upright ones as to the right of them.
    int outside = looks(welded_.faces[piece.face]) ? found : found - layers;
    int inside = outside + layers;
    if (inside_out_) outside = -std::exchange(inside, -outside);
    return first && outside <= 0 && inside >= 1;
  }

  /// Whether its front is where the point of ExactWinding is: up, else to the right, else to the back.
  bool looks(const UnionCorners& f) const {
    for (const auto& [u, v] : {std::pair<std::size_t, std::size_t>{0, 1}, {1, 2}, {2, 0}}) {
      const int turn = cuts_.points.orient2d(f[0], f[1], f[2], u, v);
      if (turn != 0) return turn > 0;
    }
    return false;
  }

  void select() {
    std::vector<std::uint8_t> holds(mesh_.faces.size(), 0);
    for (const Piece& p : pieces_)
      if (p.kept) holds[part_of_[p.face]] = 1;
    for (const Piece& p : pieces_) {
      if (!holds[part_of_[p.face]])
        throw Unfit{"a part lies within another one the same way round" +
                    at_text(at(welded_.faces[p.face][0]))};
      out_.stats.inner_faces += !p.kept && p.whole;
      out_.gone[p.face] = 1;
    }
    std::erase_if(pieces_, [](const Piece& p) { return !p.kept; });
    name_corners();
  }

  /// The corner of its face where a corner of a piece is; 3 if it is none.
  std::size_t corner_of_face(const Piece& piece, std::size_t k) const {
    const UnionCorners& c = welded_.faces[piece.face];
    return static_cast<std::size_t>(std::find(c.begin(), c.end(), piece.corner[k]) - c.begin());
  }
  std::uint32_t given_vertex(std::uint32_t corner) const {
    const Piece& piece = pieces_[corner / 3];
    const std::size_t k = corner_of_face(piece, corner % 3);
    return k < 3 ? mesh_.faces[piece.face][k] : kNoNumber;
  }

  static std::uint32_t next(std::uint32_t half) { return half % 3 == 2 ? half - 2 : half + 1; }

  void join_fans(SolidFans& fans, const std::vector<UnionCorners>& corners) {
    EdgeFaces(cuts_.points.size(), corners)
        .for_each([&](std::uint32_t low, std::uint32_t, std::span<const std::uint32_t> half) {
          if (!fans.is_balanced(half, low)) throw Unfit{"it came out open" + at_text(cuts_.points.near(low))};
          if (half.size() == 2) {
            fans.join(half[0], half[1]);
            return;
          }
          crowded_.emplace_back(half.begin(), half.end());
          // Faces that were neighbours stay so: those of vertices that lie at one position under several numbers.
          std::vector<std::uint32_t> left(half.begin(), half.end());
          for (std::size_t i = 0; i < left.size(); ++i)
            for (std::size_t j = i + 1; j < left.size(); ++j) {
              const std::uint32_t h = left[i], g = left[j];
              if (!pieces_[h / 3].whole || !pieces_[g / 3].whole ||
                  given_vertex(h) != given_vertex(next(g)) || given_vertex(next(h)) != given_vertex(g))
                continue;
              fans.join(h, g);
              left.erase(left.begin() + static_cast<std::ptrdiff_t>(j));
              left.erase(left.begin() + static_cast<std::ptrdiff_t>(i--));
              break;
            }
          if (!left.empty()) fans.join_around(left, low);
        });
  }

  void name_corners() {
    std::vector<UnionCorners> corners;
    for (const Piece& p : pieces_) corners.push_back(p.corner);
    SolidFans fans(cuts_.points, corners);
    join_fans(fans, corners);
    // Each vertex of the result goes on under a number that it had, unless another one does.
    std::vector<std::uint32_t> name(3 * pieces_.size(), kNoNumber);
    for (std::uint32_t c = 0; c < name.size(); ++c)
      name[fans.vertex_of(c)] = std::min(name[fans.vertex_of(c)], given_vertex(c));
    std::vector<std::uint8_t> taken(mesh_.points.size(), 0);
    for (std::uint32_t c = 0; c < name.size(); ++c) {
      if (fans.vertex_of(c) != c) continue;
      if (name[c] != kNoNumber && !taken[name[c]]) {
        taken[name[c]] = 1;
        continue;
      }
      const std::uint32_t point = pieces_[c / 3].corner[c % 3];
      name[c] = static_cast<std::uint32_t>(mesh_.points.size() + out_.fresh.size());
      out_.fresh.push_back(cuts_.points.near(point));
      rounded_.push_back(!cuts_.points.is_given(point));
    }
    const auto named = [&](std::uint32_t corner) { return name[fans.vertex_of(corner)]; };
    // Where the fans of an edge of four faces hang together at both its ends, no copies of these tell them apart.
    for (const std::vector<std::uint32_t>& half : crowded_) {
      std::map<PointPair, int> faces;
      for (const std::uint32_t h : half)
        if (++faces[std::minmax(named(h), named(next(h)))] > 2)
          throw Unfit{"it touches itself along an edge" + at_text(cuts_.points.near(corners[h / 3][h % 3]))};
    }
    for (std::uint32_t i = 0; i < pieces_.size(); ++i) {
      const Piece& p = pieces_[i];
      UnionCorners c;
      for (std::uint32_t k = 0; k < 3; ++k) c[k] = named(3 * i + k);
      if (p.whole && c == mesh_.faces[p.face])
        out_.gone[p.face] = 0;
      else
        out_.made.push_back({c, p.face});
    }
  }

  void settle() {
    BooleanResult all;
    all.mesh.points = mesh_.points;
    all.mesh.points.insert(all.mesh.points.end(), out_.fresh.begin(), out_.fresh.end());
    all.made.assign(mesh_.points.size(), 0);
    all.made.insert(all.made.end(), rounded_.begin(), rounded_.end());
    for (std::uint32_t f = 0; f < mesh_.faces.size(); ++f)
      if (!out_.gone[f]) all.mesh.faces.push_back(mesh_.faces[f]);
    for (const SelfUnion::Face& f : out_.made) all.mesh.faces.push_back(f.corner);
    out_.stats.rounding = settle_rounding(all, step_);
    if (out_.stats.rounding.left > 0)
      throw Unfit{"positions on the cut cannot be rounded so that nothing meets" +
                  at_text(out_.stats.rounding.where.value_or(Double3{0, 0, 0}))};
    std::copy(all.mesh.points.begin() + static_cast<std::ptrdiff_t>(mesh_.points.size()),
              all.mesh.points.end(), out_.fresh.begin());
  }

  const SolidMesh& mesh_;
  const PositionStep step_;
  SolidMesh welded_;
  std::vector<PointPair> pairs_;
  std::vector<std::uint32_t> part_of_;
  std::vector<std::uint8_t> closed_, active_;  ///< of the part of each face: it is closed; it meets something
  bool inside_out_ = false;
  SelfCuts cuts_;
  std::vector<Piece> pieces_;
  std::vector<std::uint8_t> rounded_;  ///< of fresh vertices
  std::vector<std::vector<std::uint32_t>>
      crowded_;  ///< half-edges of pieces that stay, of edges of more than two faces
  SelfUnion out_;
};

}  // namespace

SelfUnion unite_self(const SolidMesh& mesh, PositionStep step) {
  return SelfUniter(mesh, step).run();
}

}  // namespace tessera
