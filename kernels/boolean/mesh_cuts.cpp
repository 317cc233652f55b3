#include "kernels/boolean/mesh_cuts.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <tuple>

#include "kernels/mesh/face_boxes.h"
#include "kernels/mesh/face_contact.h"
#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr double kBeyondAll = std::numeric_limits<double>::infinity();

struct CutBox {
  Double3 low = {kBeyondAll, kBeyondAll, kBeyondAll}, high = {-kBeyondAll, -kBeyondAll, -kBeyondAll};
  void add(const Double3& p) {
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  }
  bool meets(const CutBox& o) const {
    for (std::size_t k = 0; k < 3; ++k)
      if (low[k] > o.high[k] || high[k] < o.low[k]) return false;
    return true;
  }
};

CutBox box_of(const SolidMesh& mesh) {
  CutBox box;
  for (const auto& f : mesh.faces)
    for (const std::uint32_t v : f) box.add(mesh.points[v]);
  return box;
}

class CutFinder {
  using Corners = std::array<std::uint32_t, 3>;

 public:
  CutFinder(const SolidMesh& first, const SolidMesh& second) {
    std::vector<Double3> given = first.points;
    given.insert(given.end(), second.points.begin(), second.points.end());
    out_.first_vertices = static_cast<std::uint32_t>(first.points.size());
    out_.first_faces = static_cast<std::uint32_t>(first.faces.size());
    out_.faces = first.faces;
    out_.faces.reserve(first.faces.size() + second.faces.size());
    for (Corners f : second.faces) {
      for (std::uint32_t& v : f) v += out_.first_vertices;
      out_.faces.push_back(f);
    }
    out_.points = PointTable(std::move(given));
    search(box_of(first), box_of(second));
  }

  MeshCuts run() {
    for (const PointPair& p : pairs_) meet(p.first, p.second);
    out_.face_pairs = pairs_.size();
    collect();
    return std::move(out_);
  }

 private:
  /// Pairs of faces of both meshes that meet, ascending: those of one ask a tree over those of the other.
  void search(const CutBox& first, const CutBox& second) {
    CutBox common;
    for (std::size_t k = 0; k < 3; ++k) {
      common.low[k] = std::max(first.low[k], second.low[k]);
      common.high[k] = std::min(first.high[k], second.high[k]);
      if (!(common.low[k] <= common.high[k])) return;
    }
    const auto near = [&](std::uint32_t begin, std::size_t end) {
      std::vector<std::uint32_t> out;
      for (std::uint32_t f = begin; f < end; ++f) {
        CutBox box;
        for (const std::uint32_t v : out_.faces[f]) box.add(at(v));
        if (box.meets(common)) out.push_back(f);
      }
      return out;
    };
    const std::vector<std::uint32_t> ours = near(0, out_.first_faces),
                                     theirs = near(out_.first_faces, out_.faces.size());
    if (ours.empty() || theirs.empty()) return;
    const FaceBoxes range(common.low, common.high);
    std::vector<FaceBoxes::Box> boxes;
    boxes.reserve(theirs.size());
    for (const std::uint32_t g : theirs) boxes.push_back(range.box(contact_face(g).corner));
    FaceBoxes tree = range;
    tree.build(boxes, FaceBoxes::Order::kMorton);
    for (const std::uint32_t f : ours) {
      const ContactFace here = contact_face(f);
      tree.for_meeting(range.box(here.corner), [&](std::uint32_t i) {
        if (face_contact(here, contact_face(theirs[i])) != FaceContact::kNone)
          pairs_.emplace_back(f, theirs[i]);
        return true;
      });
    }
    std::sort(pairs_.begin(), pairs_.end());
  }
  ContactFace contact_face(std::uint32_t f) const {
    const Corners& c = out_.faces[f];
    return {{at(c[0]), at(c[1]), at(c[2])}, {c[0], c[1], c[2]}};
  }

  const Double3& at(std::uint32_t v) const { return out_.points.near(v); }

  int side(const Corners& plane, std::uint32_t v) const {
    return orient3d_sign(at(plane[0]), at(plane[1]), at(plane[2]), at(v));
  }

  static Double2 flat(const Double3& p, std::size_t axis) { return {p[(axis + 1) % 3], p[(axis + 2) % 3]}; }
  int turn(std::uint32_t a, std::uint32_t b, std::uint32_t c, std::size_t axis) const {
    return orient2d_sign(flat(at(a), axis), flat(at(b), axis), flat(at(c), axis));
  }
  /// Along which the face has an area.
  std::size_t axis_of(const Corners& f) const {
    const Double3 n = cross(at(f[1]) - at(f[0]), at(f[2]) - at(f[0]));
    std::array<std::size_t, 3> axes = {0, 1, 2};
    std::stable_sort(axes.begin(), axes.end(),
                     [&](std::size_t a, std::size_t b) { return std::fabs(n[a]) > std::fabs(n[b]); });
    for (const std::size_t k : axes)
      if (turn(f[0], f[1], f[2], k) != 0) return k;
    return axes[0];
  }

  /// What the zeros among the signs of a point against the three sides say. \pre no sign is on the other side
  static Carrier carrier_of(std::uint32_t face, const Corners& f, const std::array<int, 3>& sign) {
    std::size_t zeros = 0, last = 0;
    for (std::size_t k = 0; k < 3; ++k)
      if (sign[k] == 0) ++zeros, last = k;
    if (zeros == 0) return Carrier::face(face);
    if (zeros == 1) return Carrier::edge(f[last], f[(last + 1) % 3]);
    return Carrier::vertex(sign[0] != 0 ? f[2] : sign[1] != 0 ? f[0] : f[1]);
  }
  static bool both_signs(const std::array<int, 3>& s) {
    return std::max({s[0], s[1], s[2]}) > 0 && std::min({s[0], s[1], s[2]}) < 0;
  }

  /// Where a vertex in the plane of a face lies on it.
  std::optional<Carrier> vertex_on(std::uint32_t v, std::uint32_t face) const {
    const Corners& f = out_.faces[face];
    const std::size_t axis = axis_of(f);
    std::array<int, 3> sign;
    const int whole = turn(f[0], f[1], f[2], axis);
    for (std::size_t k = 0; k < 3; ++k) {
      sign[k] = turn(f[k], f[(k + 1) % 3], v, axis);
      if (sign[k] == -whole) return std::nullopt;
    }
    return carrier_of(face, f, sign);
  }
  /// Where an edge that passes the plane of a face passes the face.
  std::optional<Carrier> edge_through(std::uint32_t v, std::uint32_t w, std::uint32_t face) const {
    const Corners& f = out_.faces[face];
    std::array<int, 3> sign;
    for (std::size_t k = 0; k < 3; ++k) sign[k] = orient3d_sign(at(v), at(w), at(f[k]), at(f[(k + 1) % 3]));
    if (both_signs(sign)) return std::nullopt;
    return carrier_of(face, f, sign);
  }

  void add(const Carrier& on_first, const Carrier& on_second) {
    const auto key = std::pair(on_first, on_second);
    auto known = numbers_.find(key);
    if (known == numbers_.end()) {
      known = numbers_.emplace(key, make(on_first, on_second)).first;
      out_.meetings.emplace(known->second, MeshCuts::Meeting{on_first, on_second});
    }
    if (std::find(here_.begin(), here_.end(), known->second) == here_.end()) here_.push_back(known->second);
  }

  std::uint32_t make(const Carrier& on_first, const Carrier& on_second) {
    using Kind = Carrier::Kind;
    if (on_first.kind == Kind::kVertex) {
      if (on_second.kind == Kind::kVertex) renamed_.emplace(on_second.first, on_first.first);
      return on_first.first;
    }
    if (on_second.kind == Kind::kVertex) return on_second.first;
    const ExactGrid& grid = out_.points.grid();
    const auto edge_and_face = [&](const Carrier& e, const Carrier& f) {
      const Corners& c = out_.faces[f.first];
      return grid.on_plane(at(e.first), at(e.second), at(c[0]), at(c[1]), at(c[2]));
    };
    if (on_first.kind == Kind::kFace) return out_.points.add(edge_and_face(on_second, on_first));
    if (on_second.kind == Kind::kFace) return out_.points.add(edge_and_face(on_first, on_second));
    return out_.points.add(
        grid.on_line(at(on_first.first), at(on_first.second), at(on_second.first), at(on_second.second)));
  }

  /// Points that two faces have in common, and the segments between them.
  void meet(std::uint32_t f, std::uint32_t g) {
    const Corners a = out_.faces[f], b = out_.faces[g];
    here_.clear();
    std::array<int, 3> of_a, of_b;
    for (std::size_t k = 0; k < 3; ++k) of_a[k] = side(b, a[k]), of_b[k] = side(a, b[k]);
    for (std::size_t k = 0; k < 3; ++k) {
      if (of_a[k] == 0)
        if (const auto on = vertex_on(a[k], g)) add(Carrier::vertex(a[k]), *on);
      if (of_b[k] == 0)
        if (const auto on = vertex_on(b[k], f)) add(*on, Carrier::vertex(b[k]));
    }
    if (of_a == std::array<int, 3>{0, 0, 0}) {
      meet_in_plane(f, g);
      return;
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t next = (k + 1) % 3;
      if (of_a[k] * of_a[next] < 0)
        if (const auto on = edge_through(a[k], a[next], g)) add(Carrier::edge(a[k], a[next]), *on);
      if (of_b[k] * of_b[next] < 0)
        if (const auto on = edge_through(b[k], b[next], f)) add(*on, Carrier::edge(b[k], b[next]));
    }
    if (here_.size() == 2) add_segment(f, g, here_[0], here_[1]);
  }

  void meet_in_plane(std::uint32_t f, std::uint32_t g) {
    const Corners a = out_.faces[f], b = out_.faces[g];
    const std::size_t axis = axis_of(a);
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j) {
        const std::uint32_t p = a[i], q = a[(i + 1) % 3], r = b[j], s = b[(j + 1) % 3];
        if (turn(p, q, r, axis) * turn(p, q, s, axis) < 0 && turn(r, s, p, axis) * turn(r, s, q, axis) < 0)
          add(Carrier::edge(p, q), Carrier::edge(r, s));
      }
    // What an edge of either has in common with the other face.
    for (const bool of_first : {true, false}) {
      const Corners& c = of_first ? a : b;
      for (std::size_t k = 0; k < 3; ++k) {
        std::vector<std::uint32_t> on;
        const Carrier e = Carrier::edge(c[k], c[(k + 1) % 3]);
        for (const std::uint32_t p : here_) {
          const MeshCuts::Meeting& m = out_.meetings.at(p);
          const Carrier& carrier = of_first ? m.on_first : m.on_second;
          const bool at_end = carrier.kind == Carrier::Kind::kVertex &&
                              (carrier.first == e.first || carrier.first == e.second);
          if (carrier == e || at_end) on.push_back(p);
        }
        if (on.size() == 2) add_segment(f, g, on[0], on[1]);
      }
    }
    if (here_.size() < 3) return;
    ++out_.coplanar_pairs;
    coplanar_.emplace_back(f, g);
    coplanar_.emplace_back(g, f);
  }

  void add_segment(std::uint32_t f, std::uint32_t g, std::uint32_t p, std::uint32_t q) {
    const PointPair segment = std::minmax(p, q);
    out_.segments.push_back(segment);
    segments_.emplace_back(f, segment);
    segments_.emplace_back(g, segment);
  }

  /// Deals everything to the faces.
  void collect() {
    std::sort(out_.segments.begin(), out_.segments.end());
    out_.segments.erase(std::unique(out_.segments.begin(), out_.segments.end()), out_.segments.end());
    std::sort(segments_.begin(), segments_.end());
    segments_.erase(std::unique(segments_.begin(), segments_.end()), segments_.end());
    std::sort(coplanar_.begin(), coplanar_.end());
    std::map<Carrier, std::vector<std::uint32_t>> on;
    for (const auto& [key, p] : numbers_)
      for (const Carrier& carrier : {key.first, key.second})
        if (carrier.kind != Carrier::Kind::kVertex) on[carrier].push_back(p);
    std::vector<std::uint32_t> faces;
    for (const auto& [f, g] : pairs_) faces.push_back(f), faces.push_back(g);
    std::sort(faces.begin(), faces.end());
    faces.erase(std::unique(faces.begin(), faces.end()), faces.end());
    auto segment = segments_.begin();
    auto partner = coplanar_.begin();
    for (const std::uint32_t f : faces) {
      MeshCuts::CutFace cut;
      cut.face = f;
      const auto take = [&](const Carrier& carrier) {
        if (const auto found = on.find(carrier); found != on.end())
          cut.inner.insert(cut.inner.end(), found->second.begin(), found->second.end());
      };
      const Corners& c = out_.faces[f];
      take(Carrier::face(f));
      for (std::size_t k = 0; k < 3; ++k) take(Carrier::edge(c[k], c[(k + 1) % 3]));
      std::sort(cut.inner.begin(), cut.inner.end());
      for (; segment != segments_.end() && segment->first == f; ++segment)
        cut.segments.push_back(segment->second);
      for (; partner != coplanar_.end() && partner->first == f; ++partner)
        cut.coplanar.push_back(partner->second);
      out_.cut.push_back(std::move(cut));
    }
    // Vertices of the second mesh that lie at vertices of the first go by their names.
    if (renamed_.empty()) return;
    for (std::size_t f = out_.first_faces; f < out_.faces.size(); ++f)
      for (std::uint32_t& v : out_.faces[f])
        if (const auto found = renamed_.find(v); found != renamed_.end()) v = found->second;
    for (auto& [p, meeting] : out_.meetings) {
      Carrier& c = meeting.on_second;
      if (c.kind == Carrier::Kind::kFace) continue;
      const auto name = [&](std::uint32_t v) {
        const auto found = renamed_.find(v);
        return found == renamed_.end() ? v : found->second;
      };
      c = c.kind == Carrier::Kind::kVertex ? Carrier::vertex(name(c.first))
                                           : Carrier::edge(name(c.first), name(c.second));
    }
  }

  MeshCuts out_;
  std::vector<PointPair> pairs_;
  std::map<std::pair<Carrier, Carrier>, std::uint32_t> numbers_;
  std::unordered_map<std::uint32_t, std::uint32_t> renamed_;  ///< vertices of the second mesh
  std::vector<std::uint32_t> here_;                           ///< points of the two faces at hand
  std::vector<std::pair<std::uint32_t, PointPair>> segments_;
  std::vector<PointPair> coplanar_;
};

}  // namespace

MeshCuts find_mesh_cuts(const SolidMesh& first, const SolidMesh& second) {
  return CutFinder(first, second).run();
}

}  // namespace tessera
