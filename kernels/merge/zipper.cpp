// Faces around a border edge (u, v), which runs with its face on the left; the gap lies on the right:
//
//        u ---------> v          the new face is (v, u, w); of the angles at which vertices across the gap see the edge,
//         \    gap   /           that at w is the largest, so no other vertex that it sees lies in the circle through
//          \        /            u, v and w: a Delaunay triangle.
//           `- w --'
#include "kernels/merge/zipper.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <queue>
#include <unordered_map>

#include "kernels/holes/hole_triangulation.h"
#include "kernels/merge/edge_crossings.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;

constexpr std::uint32_t kNone = 0xffffffffu;
/// Cosine between a new face and those across its edges: 80 degrees.
constexpr double kMinDihedralCosine = 0.17;
/// Where edges of originals are left open, layers cross at the cut: what is allowed there, step by step, and how far a vertex
/// may lie, in gaps.
constexpr std::array<double, 3> kLastDihedralCosines = {0.0, -0.35, -0.7};
constexpr std::array<double, 3> kLastGaps = {1.5, 2.0, 3.0};
constexpr double kMinHeight = 0.02;  ///< of a new face over its edge, edge lengths: lower is a line
/// Circles of this many times the gap, or the longest edge beside, pass through vertices of one side: of a dent in its border.
constexpr double kMaxRound = 2.0;
/// Edges of a loop that is filled: of the size of the strip's own faces.
constexpr std::size_t kMaxLoop = 12;
constexpr double kMinBoundary = -0.5;  ///< cosine between what fills a loop and what is around it
constexpr std::size_t kCrumb = 6;      ///< pieces of fewer faces are no surface
constexpr int kFillRounds = 3;
constexpr int kMaxRounds = 40;  ///< of removal; each leaves fewer faces

std::uint64_t half_edge(std::uint32_t from, std::uint32_t to) {
  return std::uint64_t{from} << 32 | to;
}

class Zipper {
 public:
  Zipper(const ZipPieces& pieces, double gap)
      : position_(pieces.position),
        faces_(pieces.faces),
        edges_(pieces.edges),
        given_(pieces.faces.size()),
        gap_(gap),
        gone_(pieces.faces.size(), 0),
        star_(pieces.position.size()),
        fixed_(pieces.position.size(), 0),
        bared_(pieces.position.size(), 0),
        fronts_at_(pieces.position.size()),
        crossings_(pieces.position) {
    for (std::uint32_t f = 0; f < given_; ++f) {
      link(f);
      normal_.push_back(unit_or_zero(face_normal(faces_[f])));
      for (std::size_t k = 0; k < 3; ++k)
        if (edges_[f] & (ZipPieces::kGoesOn << k)) fixed_[faces_[f][k]] = fixed_[faces_[f][(k + 1) % 3]] = 1;
    }
  }

  Zipped run() {
    clean();
    drop_crumbs();
    clean();
    lay_out();
    stitch(false);
    close_loops();
    const double gap = gap_;
    for (std::size_t step = 0; step < kLastDihedralCosines.size() && open_edges() > 0; ++step) {
      min_dihedral_cosine_ = kLastDihedralCosines[step];
      gap_ = kLastGaps[step] * gap;
      stitch(true);
      unstitch();
      close_loops();
    }
    Zipped out;
    out.removed.assign(gone_.begin(), gone_.begin() + static_cast<std::ptrdiff_t>(given_));
    for (std::size_t f = 0; f < given_; ++f) out.report.removed += gone_[f];
    for (std::size_t f = given_; f < faces_.size(); ++f)
      if (!gone_[f]) out.added.push_back(faces_[f]);
    out.report.added = out.added.size();
    out.report.open_edges = open_edges() + bared_edges_;
    for (std::uint32_t v = 0; v < star_.size(); ++v) out.report.pinched += is_pinched(v);
    return out;
  }

 private:
  Double3 face_normal(const Face& f) const {
    return triangle_normal(position_[f[0]], position_[f[1]], position_[f[2]]);
  }
  void link(std::uint32_t f) {
    for (std::size_t k = 0; k < 3; ++k) {
      half_[half_edge(faces_[f][k], faces_[f][(k + 1) % 3])] = f;
      star_[faces_[f][k]].push_back(f);
    }
  }
  void remove(std::uint32_t f) {
    gone_[f] = 1;
    for (std::size_t k = 0; k < 3; ++k) {
      half_.erase(half_edge(faces_[f][k], faces_[f][(k + 1) % 3]));
      std::erase(star_[faces_[f][k]], f);
      if (!goes_on(f, k)) continue;
      ++bared_edges_;
      for (const std::uint32_t v : {faces_[f][k], faces_[f][(k + 1) % 3]})
        bared_[v] = static_cast<std::uint8_t>(std::min(bared_[v] + 1, 250));
    }
  }
  bool has(std::uint32_t from, std::uint32_t to) const { return half_.count(half_edge(from, to)) != 0; }

  /// The edge k of a face has nothing behind it, here or elsewhere, and is to have.
  bool is_open(std::uint32_t f, std::size_t k) const {
    const unsigned closed = f < given_ ? unsigned{edges_[f]} : 0u;
    return !(closed & (unsigned{ZipPieces::kEnds | ZipPieces::kGoesOn} << k)) &&
           !has(faces_[f][(k + 1) % 3], faces_[f][k]);
  }
  void close_loops() {
    // What is taken away again leaves loops too.
    for (int round = 0; round < kFillRounds; ++round) {
      fill_loops();
      if (!unstitch()) break;
    }
  }
  /// Faces at a vertex that hang together across its edges, counted; 2 stands for more.
  int fans(std::uint32_t v) const {
    const std::vector<std::uint32_t>& star = star_[v];
    if (star.empty()) return 0;
    const auto after = [&](std::uint32_t f) {
      const auto it = half_.find(half_edge(v, faces_[f][(corner(f, v) + 2) % 3]));
      return it == half_.end() ? kNone : it->second;
    };
    const auto before = [&](std::uint32_t f) {
      const auto it = half_.find(half_edge(faces_[f][(corner(f, v) + 1) % 3], v));
      return it == half_.end() ? kNone : it->second;
    };
    std::size_t count = 1;
    std::uint32_t at = after(star[0]);
    for (; at != kNone && at != star[0]; at = after(at)) ++count;
    if (at == kNone)
      for (at = before(star[0]); at != kNone; at = before(at)) ++count;
    return count < star.size() ? 2 : 1;
  }
  bool goes_on(std::uint32_t f, std::size_t k) const {
    return f < given_ && (unsigned{edges_[f]} & (unsigned{ZipPieces::kGoesOn} << k)) != 0;
  }
  /// Two fans, those counted too that faces close which are not here: each fan has two edges at which nothing follows, and one
  /// that is not here may end unseen.
  bool is_pinched(std::uint32_t v) const {
    if (!fixed_[v]) return fans(v) >= 2;
    int ends = bared_[v];
    for (const std::uint32_t f : star_[v]) {
      const std::size_t k = corner(f, v), before = (k + 2) % 3;
      ends += !goes_on(f, k) && !has(faces_[f][(k + 1) % 3], v);
      ends += !goes_on(f, before) && !has(v, faces_[f][before]);
    }
    return ends >= 3;
  }
  std::size_t corner(std::uint32_t f, std::uint32_t v) const {
    return faces_[f][0] == v ? 0 : faces_[f][1] == v ? 1 : 2;
  }
  bool is_removable(std::uint32_t f) const {
    return !fixed_[faces_[f][0]] && !fixed_[faces_[f][1]] && !fixed_[faces_[f][2]];
  }

  /// Until no vertex has two fans. Faces at vertices that go on elsewhere stay as long as others do.
  void clean() {
    for (int round = 0; round < kMaxRounds; ++round) {
      std::vector<std::uint32_t> out, last;
      for (std::uint32_t v = 0; v < star_.size(); ++v) {
        if (star_[v].empty() || !is_pinched(v)) continue;
        const std::size_t before = out.size();
        for (const std::uint32_t f : star_[v])
          if (is_removable(f)) out.push_back(f);
        if (out.size() == before) last.insert(last.end(), star_[v].begin(), star_[v].end());
      }
      if (out.empty()) out = std::move(last);
      if (out.empty()) return;
      std::sort(out.begin(), out.end());
      out.erase(std::unique(out.begin(), out.end()), out.end());
      for (const std::uint32_t f : out) remove(f);
    }
  }

  void drop_crumbs() {
    std::vector<std::uint8_t> seen(given_, 0);
    std::vector<std::uint32_t> piece;
    for (std::uint32_t start = 0; start < given_; ++start) {
      if (seen[start] || gone_[start]) continue;
      piece.assign(1, start);
      seen[start] = 1;
      bool whole = true;
      for (std::size_t i = 0; i < piece.size(); ++i) {
        const Face& f = faces_[piece[i]];
        for (std::size_t k = 0; k < 3; ++k) {
          whole = whole && !fixed_[f[k]];
          const auto next = half_.find(half_edge(f[(k + 1) % 3], f[k]));
          if (next == half_.end() || seen[next->second]) continue;
          seen[next->second] = 1;
          piece.push_back(next->second);
        }
      }
      if (whole && piece.size() < kCrumb)
        for (const std::uint32_t f : piece) remove(f);
    }
  }

  // Front edges in cells of a grid.

  using Edge = FrontEdge;
  std::uint64_t cell_key(const std::array<std::int64_t, 3>& c) const {
    std::uint64_t key = 0;
    for (const std::int64_t x : c) key = key * 0x9e3779b97f4a7c15ULL + static_cast<std::uint64_t>(x);
    return key;
  }
  struct CellRange {
    Double3 low, high;  ///< whole numbers
    bool meets(const CellRange& o) const {
      bool apart = false;
      for (std::size_t k = 0; k < 3; ++k) apart = apart | (low[k] > o.high[k]) | (o.low[k] > high[k]);
      return !apart;
    }
    double count() const {
      return (high[0] - low[0] + 1.0) * (high[1] - low[1] + 1.0) * (high[2] - low[2] + 1.0);
    }
  };
  /// Cells that the box around p and q has a part of when it grows by a margin on all sides.
  CellRange cells(const Double3& p, const Double3& q, double margin) const {
    CellRange r;
    for (std::size_t k = 0; k < 3; ++k) {
      r.low[k] = std::floor((std::min(p[k], q[k]) - margin) / cell_);
      r.high[k] = std::floor((std::max(p[k], q[k]) + margin) / cell_);
    }
    return r;
  }
  template <class Use>
  void for_cells(const CellRange& r, const Use& use) const {
    std::array<std::int64_t, 3> a, b, c;
    for (std::size_t k = 0; k < 3; ++k) {
      a[k] = static_cast<std::int64_t>(r.low[k]);
      b[k] = static_cast<std::int64_t>(r.high[k]);
    }
    for (c[2] = a[2]; c[2] <= b[2]; ++c[2])
      for (c[1] = a[1]; c[1] <= b[1]; ++c[1])
        for (c[0] = a[0]; c[0] <= b[0]; ++c[0]) use(cell_key(c));
  }
  void add_front(std::uint32_t f, std::size_t k) {
    const Edge e = {faces_[f][k], faces_[f][(k + 1) % 3], f};
    const auto number = static_cast<std::uint32_t>(front_.size());
    front_.push_back(e);
    const Double3 &p = position_[e.from], &q = position_[e.to];
    const CellRange range = cells(p, q, 0.0);
    for_cells(range, [&](std::uint64_t key) { grid_[key].push_back(number); });
    extents_.push_back({range, norm(q - p)});
    longest_ = std::max(longest_, extents_.back().length);
    closed_.push_back(0);
    live_.push_back(number);
    for (const std::uint32_t v : {e.from, e.to}) fronts_at_[v].push_back(number);
  }
  /// What removals may have opened again.
  void find_live() {
    live_.clear();
    for (std::uint32_t e = 0; e < front_.size(); ++e) {
      closed_[e] = !is_front(front_[e]);
      if (!closed_[e]) live_.push_back(e);
    }
  }
  /// Front edges that a new face lies along.
  void close_fronts(std::uint32_t f) {
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t from = faces_[f][k], to = faces_[f][(k + 1) % 3];
      for (const std::uint32_t at : fronts_at_[from])
        if (front_[at].from == to && front_[at].to == from) closed_[at] = 1;
    }
    if (++closed_since_ < live_.size() / 4) return;
    closed_since_ = 0;
    std::erase_if(live_, [&](std::uint32_t at) { return closed_[at] != 0; });
  }
  bool is_front(const Edge& e) const { return !gone_[e.face] && !has(e.to, e.from); }

  void lay_out() {
    std::vector<double> lengths;
    for (std::uint32_t f = 0; f < given_; ++f)
      for (std::size_t k = 0; k < 3; ++k)
        if (!gone_[f] && is_open(f, k))
          lengths.push_back(norm(position_[faces_[f][(k + 1) % 3]] - position_[faces_[f][k]]));
    cell_ = gap_;
    if (!lengths.empty()) {
      const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
      std::nth_element(lengths.begin(), middle, lengths.end());
      cell_ = std::max(gap_, *middle);
    }
    for (std::uint32_t f = 0; f < given_; ++f)
      for (std::size_t k = 0; k < 3; ++k)
        if (!gone_[f] && is_open(f, k)) add_front(f, k);
  }

  struct Choice {
    double size = 0.0;  ///< diameter of the circle, of the worst for the last to be chosen
    std::uint32_t edge = 0, apex = kNone;
    bool operator>(const Choice& o) const { return size != o.size ? size > o.size : edge > o.edge; }
  };

  /// \param last  from edges of originals that are still open on
  void stitch(bool last) {
    find_live();
    std::vector<std::uint32_t> again;
    std::priority_queue<Choice, std::vector<Choice>, std::greater<>> queue;
    const auto consider = [&](std::uint32_t e) {
      const Choice c = best(e);
      if (c.apex != kNone) queue.push(c);
    };
    for (std::uint32_t e = 0; e < front_.size(); ++e)
      if (!last || (front_[e].face < given_ && (edges_[front_[e].face] & ZipPieces::kOriginal) != 0))
        consider(e);
    while (!queue.empty()) {
      const Choice top = queue.top();
      // Changes around it ask for an edge many times over.
      while (!queue.empty() && queue.top().edge == top.edge && queue.top().size == top.size) queue.pop();
      if (closed_[top.edge]) continue;
      const Choice now = best(top.edge);
      if (now.apex == kNone) continue;
      if (now.size > top.size) {
        queue.push(now);
        continue;
      }
      const Edge e = front_[top.edge];
      const auto f = static_cast<std::uint32_t>(faces_.size());
      faces_.push_back({e.to, e.from, now.apex});
      gone_.push_back(0);
      normal_.push_back(unit_or_zero(face_normal(faces_[f])));
      link(f);
      close_fronts(f);
      for (std::size_t k = 1; k < 3; ++k) {
        if (!is_open(f, k)) continue;
        add_front(f, k);
        consider(static_cast<std::uint32_t>(front_.size() - 1));
      }
      // What was refused may do now.
      again.clear();
      for (const std::uint32_t v : {e.from, e.to, now.apex})
        for (const std::uint32_t at : fronts_at_[v])
          if (!closed_[at]) again.push_back(at);
      std::sort(again.begin(), again.end());
      again.erase(std::unique(again.begin(), again.end()), again.end());
      for (const std::uint32_t at : again) consider(at);
    }
  }

  /// Front edges that have a part in cells with the box around an edge, grown by a margin, in the order of their numbers.
  void find_near(const Double3& u, const Double3& v, double margin) const {
    near_.clear();
    const CellRange range = cells(u, v, margin);
    // One needle at a border makes the margin as long, and what is near most of the cells.
    if (range.count() > static_cast<double>(live_.size())) {
      for (const std::uint32_t at : live_)
        if (!closed_[at] && extents_[at].range.meets(range)) near_.push_back(at);
      return;
    }
    for_cells(range, [&](std::uint64_t key) {
      const auto cell = grid_.find(key);
      if (cell == grid_.end()) return;
      for (const std::uint32_t at : cell->second)
        if (!closed_[at]) near_.push_back(at);
    });
    std::sort(near_.begin(), near_.end());
    near_.erase(std::unique(near_.begin(), near_.end()), near_.end());
  }

  Choice best(std::uint32_t number) const {
    const Edge& e = front_[number];
    Choice choice;
    choice.edge = number;
    if (closed_[number]) return choice;
    const Double3 &u = position_[e.from], &v = position_[e.to];
    const Double3 along = v - u, n = normal_[e.face];
    const double length = norm(along);
    const Double3 out = unit_or_zero(cross(along, n));
    find_near(u, v, gap_ + 0.75 * longest_);
    struct Apex {
      double cosine, wide;
      std::uint32_t vertex;
    };
    std::vector<Apex> apices;
    for (const std::uint32_t at : near_) {
      const Edge& other = front_[at];
      const double wide = extents_[at].length;
      for (const std::uint32_t w : {other.from, other.to}) {
        if (w == e.from || w == e.to) continue;
        const Double3& p = position_[w];
        const double height = dot(p - u, out);
        if (height < kMinHeight * length || height > gap_ + 0.75 * wide) continue;
        const Double3 a = unit_or_zero(u - p), b = unit_or_zero(v - p);
        apices.push_back({dot(a, b), wide, w});
      }
    }
    // One of the first few will do.
    const auto is_behind = [](const Apex& l, const Apex& r) {
      return l.cosine != r.cosine   ? l.cosine > r.cosine
             : l.vertex != r.vertex ? l.vertex > r.vertex
                                    : l.wide < r.wide;
    };
    crossings_.load(u, v, front_, near_);
    std::make_heap(apices.begin(), apices.end(), is_behind);
    std::uint32_t last = kNone;
    for (auto end = apices.end(); end != apices.begin();) {
      std::pop_heap(apices.begin(), end, is_behind);
      const Apex a = *--end;
      if (a.vertex == last) continue;
      last = a.vertex;
      if (!fits(e, a.vertex)) continue;
      const double sine = std::sqrt(std::max(1e-12, 1.0 - a.cosine * a.cosine));
      const double size = a.cosine < 0.0 ? length : length / sine;
      if (size > kMaxRound * std::max({gap_, length, a.wide})) break;
      choice.apex = a.vertex;
      choice.size = size;
      break;
    }
    return choice;
  }

  bool fits(const Edge& e, std::uint32_t w) const {
    const Face f = {e.to, e.from, w};
    if (has(f[1], f[2]) || has(f[2], f[0]) || has(f[0], f[1])) return false;
    const Double3 n = unit_or_zero(face_normal(f));
    if (dot(n, normal_[e.face]) < min_dihedral_cosine_) return false;
    for (std::size_t k = 1; k < 3; ++k) {
      const std::uint32_t from = f[k], to = f[(k + 1) % 3];
      if (const auto there = half_.find(half_edge(to, from)); there != half_.end()) {
        if (there->second < given_ && !is_open(there->second, edge_of(there->second, to))) return false;
        if (dot(n, normal_[there->second]) < min_dihedral_cosine_) return false;
        continue;
      }
      if (!is_free(from, to, n) || !is_free(to, from, n) || crossings_.crosses_any(from, to, n)) return false;
    }
    return true;
  }
  std::size_t edge_of(std::uint32_t f, std::uint32_t from) const { return corner(f, from); }

  /// No face at `at` lies where the way to `to` begins, as seen along n.
  bool is_free(std::uint32_t at, std::uint32_t to, const Double3& n) const {
    const Double3 d = position_[to] - position_[at];
    for (const std::uint32_t f : star_[at]) {
      if (dot(normal_[f], n) < 0.0) continue;
      const std::size_t k = corner(f, at);
      const Double3 a = position_[faces_[f][(k + 1) % 3]] - position_[at],
                    b = position_[faces_[f][(k + 2) % 3]] - position_[at];
      if (dot(cross(a, d), n) >= 0.0 && dot(cross(d, b), n) >= 0.0 && dot(a + b, d) > 0.0) return false;
    }
    return true;
  }

  /// Loops of a few edges that are left, with an edge that is no border of an original.
  void fill_loops() {
    std::unordered_map<std::uint32_t, Edge> next;  // by the end: fillings run against the faces
    const auto add = [&](const Edge& e) {
      if (!is_front(e)) return;
      const bool fresh = next.emplace(e.to, e).second;
      if (!fresh) next[e.to].face = kNone;  // borders touch there
    };
    for (const Edge& e : front_) add(e);
    for (std::uint32_t f = 0; f < given_; ++f)
      for (std::size_t k = 0; k < 3; ++k)
        if (edges_[f] & (ZipPieces::kEnds << k)) add({faces_[f][k], faces_[f][(k + 1) % 3], f});
    for (const Edge& start : front_) {
      if (!is_front(start)) continue;
      std::vector<Edge> loop;
      Edge at = start;
      bool closed = false;
      while (loop.size() < kMaxLoop) {
        loop.push_back(at);
        const auto it = next.find(at.from);
        if (it == next.end() || it->second.face == kNone) break;
        at = it->second;
        if ((closed = at.from == start.from)) break;
      }
      if (closed && loop.size() >= 3) fill(loop);
    }
  }

  void fill(const std::vector<Edge>& loop) {
    HoleLoop hole;
    for (const Edge& e : loop) {
      hole.position.push_back(position_[e.to]);
      const Face& f = faces_[e.face];
      for (const std::uint32_t v : f)
        if (v != e.from && v != e.to) hole.opposite.push_back(position_[v]);
    }
    for (std::uint32_t i = 0; i < loop.size(); ++i)
      for (std::uint32_t j = i + 2; j < loop.size(); ++j)
        if ((i > 0 || j + 1 < loop.size()) && (has(loop[i].to, loop[j].to) || has(loop[j].to, loop[i].to)))
          hole.taken.push_back({i, j});
    HoleTriangulation made = triangulate_hole(hole, boundary_normals(hole));
    // Three vertices nearly in line, where a border of the strip bends by nothing: thin, but closed.
    if (made.faces.empty() && loop.size() == 3 &&
        norm(triangle_normal(hole.position[0], hole.position[1], hole.position[2])) > 0.0)
      made.faces.push_back({0, 1, 2});
    if (made.boundary_cosine < kMinBoundary) return;  // the outside of a piece
    for (const auto& t : made.faces) {
      const auto f = static_cast<std::uint32_t>(faces_.size());
      faces_.push_back({loop[t[0]].to, loop[t[1]].to, loop[t[2]].to});
      gone_.push_back(0);
      normal_.push_back(unit_or_zero(face_normal(faces_[f])));
      link(f);
    }
  }

  /// Vertices at which new faces leave two fans lose them.
  bool unstitch() {
    bool any = false;
    for (int round = 0; round < kMaxRounds; ++round) {
      std::vector<std::uint32_t> out;
      for (std::uint32_t v = 0; v < star_.size(); ++v) {
        bool fresh = false;
        for (const std::uint32_t f : star_[v]) fresh = fresh || f >= given_;
        if (!fresh || fans(v) < 2) continue;
        for (const std::uint32_t f : star_[v])
          if (f >= given_) out.push_back(f);
      }
      if (out.empty()) break;
      any = true;
      std::sort(out.begin(), out.end());
      out.erase(std::unique(out.begin(), out.end()), out.end());
      for (const std::uint32_t f : out) remove(f);
    }
    return any;
  }

  std::uint64_t open_edges() const {
    std::uint64_t count = 0;
    for (std::uint32_t f = 0; f < given_; ++f)
      for (std::size_t k = 0; k < 3; ++k)
        count += !gone_[f] && (edges_[f] & ZipPieces::kOriginal) != 0 && is_open(f, k);
    return count;
  }

  const std::vector<Double3>& position_;
  std::vector<Face> faces_;
  std::vector<std::uint8_t> edges_;
  std::size_t given_;
  double gap_, min_dihedral_cosine_ = kMinDihedralCosine;
  std::vector<std::uint8_t> gone_;
  std::vector<Double3> normal_;
  std::unordered_map<std::uint64_t, std::uint32_t> half_;  ///< directed edge -> face on its left
  std::vector<std::vector<std::uint32_t>> star_;           ///< per vertex: its faces
  std::vector<std::uint8_t> fixed_;                        ///< per vertex: faces that are not here have it
  /// Per vertex: edges of faces that are not here with nothing behind them now.
  std::vector<std::uint8_t> bared_;
  std::uint64_t bared_edges_ = 0;
  double cell_ = 1.0, longest_ = 0.0;
  std::vector<Edge> front_;
  struct Extent {
    CellRange range;
    double length = 0.0;
  };
  // Of front edges, as they are while stitching.
  std::vector<Extent> extents_;
  std::vector<std::uint8_t> closed_;                   ///< is_front() no more
  std::vector<std::uint32_t> live_;                    ///< the others and a few that closed, ascending
  std::vector<std::vector<std::uint32_t>> fronts_at_;  ///< per vertex
  std::size_t closed_since_ = 0;                       ///< faces since live_ was thinned out
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> grid_;
  mutable std::vector<std::uint32_t> near_;  ///< front edges around the one at work
  mutable EdgeCrossings crossings_;          ///< with those
};

}  // namespace

Zipped zip(const ZipPieces& pieces, double gap) {
  return Zipper(pieces, gap).run();
}

}  // namespace tessera
