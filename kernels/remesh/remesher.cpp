#include "kernels/remesh/remesher.h"

#include <algorithm>
#include <bit>
#include <limits>

#include "kernels/mesh/flat_faces.h"
#include "octree/lists.h"

namespace tessera {
namespace {

constexpr double kAnywhere = std::numeric_limits<double>::max();
/// Rounds of splits or of collapses: the first iteration brings edges of any length down to the target, the others tidy
/// up. Fixed, and ended early only where nothing is left to do in the block.
constexpr int kFirstRounds = 24, kLaterRounds = 1;
constexpr double kSplitAbove = 4.0 / 3.0, kCollapseBelow = 0.8;  ///< of the target
/// Scanners and extraction leave lattices of sheared squares, all valences six, all lengths within the limits: nothing in
/// the loop would ever change them. So the first iteration begins with far fewer vertices than there will be.
constexpr double kCoarseBelow = 1.8, kCoarseLongest = 2.4;
constexpr int kCoarseRounds = 4;
/// Flips along a strip at most, and iterations at the end that make no more than the short one.
constexpr std::size_t kShortGlide = 4, kLongGlide = 8;
constexpr int kLastIterations = 4;
/// Of a face's area that each half keeps when it is cut; in the middle it is one half.
constexpr double kMinShare = 1.0 / 64.0;
constexpr std::uint32_t kLengthClasses = 1u << 11;  ///< the upper bits of a float without a sign

}  // namespace

Remesher::Remesher(CollapseMesh& mesh, const MeshBlock& block, const Double3& origin,
                   const ReferenceSurface& surface, const RemeshOptions& options,
                   std::span<const std::uint64_t> pinned, bool guarded)
    : mesh_(mesh),
      origin_(origin),
      surface_(surface),
      options_(options),
      refine_limit_(options.refine_beyond ? options.tolerance : options.refine_within),
      guard_(mesh),
      guarded_(guarded),
      next_key_(options.first_key) {
  if (options.max_normal_deviation_deg > 0.0)
    min_normal_cosine_ = cosine_of_degrees(options.max_normal_deviation_deg);
  mesh_.reserve(options.max_faces);
  info_.resize(mesh_.vertices());
  const std::vector<std::uint8_t> lasting = surface.lasting_corners(block);
  for (std::uint32_t v = 0; v < info_.size(); ++v) {
    Info& info = info_[v];
    info.key = block.key[mesh_.block_vertex(v)];
    info.lasting = lasting[mesh_.block_vertex(v)] != 0;
    info.target = static_cast<float>(options.edge);
    info.whole = (mesh_.state(v) & kVertexLocked) == 0;
    info.pinned = !pinned.empty() && std::binary_search(pinned.begin(), pinned.end(), info.key);
    if (info.pinned) mesh_.add_state(v, kVertexLocked);
    if (block.vertex_class[mesh_.block_vertex(v)] == VertexClass::kCorner) mesh_.add_state(v, kVertexFixed);
  }
  live_faces_ = mesh_.faces().size();
  set_lines();
  find_feet(surface.faces_at(block));
}

/// Creases are marked on both sides or on one, where another block saw less of them; both count.
void Remesher::set_lines() {
  std::vector<std::uint8_t> creases(info_.size(), 0), borders(info_.size(), 0);
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f)
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t c = 4 * f + i, o = mesh_.opposite(c);
      if (o != kNoCorner && mesh_.crease_edge(c)) mesh_.mark_crease(o);
      if (o != kNoCorner && mesh_.crease_edge(o)) mesh_.mark_crease(c);
      if (!is_line(c) || (o != kNoCorner && o < c)) continue;
      for (const std::uint32_t v : {mesh_.vertex(next_corner(c)), mesh_.vertex(prev_corner(c))}) {
        std::uint8_t& count = mesh_.crease_edge(c) ? creases[v] : borders[v];
        count = static_cast<std::uint8_t>(std::min(count + 1, 3));
      }
    }
  for (std::uint32_t v = 0; v < info_.size(); ++v) {
    if (creases[v] == 0 && borders[v] == 0) continue;
    info_[v].foot = 0;  // for find_feet(): on a line, which has no single normal
    if (mesh_.state(v) & kVertexLocked) continue;
    const bool curvature = creases[v] + borders[v] != 2 || creases[v] == 1;
    mesh_.add_state(v, curvature ? unsigned{kVertexFixed} : creases[v] == 2 ? unsigned{kVertexCrease} : 0u);
    info_[v].line = (mesh_.state(v) & kVertexFixed) == 0;
  }
}

/// \param own  per vertex of the block, a face of the reference that it is a corner of
void Remesher::find_feet(const std::vector<std::uint32_t>& own) {
  for (std::uint32_t v = 0; v < info_.size(); ++v) {
    step();
    Info& info = info_[v];
    const bool on_line = info.foot == 0;
    info.foot = ReferenceSurface::kNone;
    if (info.line && surface_.has_lines()) info.foot = surface_.closest_on_lines(mesh_.at(v)).slot;
    if (info.line && info.foot == ReferenceSurface::kNone) {
      // Its line is not in this part of the reference.
      info.line = false;
      mesh_.add_state(v, kVertexFixed);
    }
    if (!on_line && !(mesh_.state(v) & kVertexFixed)) {
      info.foot = own[mesh_.block_vertex(v)];
      if (info.foot == ReferenceSurface::kNone) info.foot = surface_.closest(mesh_.at(v), kAnywhere).slot;
      if (info.foot != ReferenceSurface::kNone) info.normal = surface_.normal(info.foot);
    }
    set_target(info, mesh_.at(v));
  }
}

/// From the foot of the vertex, where lengths adapt.
void Remesher::set_target(Info& info, const Double3& at) const {
  if (!surface_.is_graded()) return;
  if (info.foot != ReferenceSurface::kNone) {
    info.target = info.line ? surface_.length_on_line(info.foot, at) : surface_.length_in_face(info.foot, at);
  } else {  // corners, and what is locked on lines
    const ReferenceSurface::Foot foot = surface_.closest(at, kAnywhere);
    if (foot.slot != ReferenceSurface::kNone) info.target = surface_.length_in_face(foot.slot, at);
  }
}

void Remesher::run(RemeshReport& report) {
  for (std::uint32_t v = 0; v < info_.size(); ++v)
    report.locked_vertices += (mesh_.state(v) & kVertexLocked) != 0;
  if (options_.min_angle_deg > 0.0 || options_.max_length_ratio > 0.0) {
    if (options_.max_length_ratio > 0.0)
      even_lengths(report);
    else
      raise_angles(report);
    report.guard_spent = guard_spent_;
    return;
  }
  for (int i = 0; i < options_.iterations; ++i) {
    const int rounds = i == 0 ? kFirstRounds : kLaterRounds;
    split_long(rounds, report);
    // Later passes find no lattice but along seams; where lengths adapt they undo what the tolerance had split.
    if (i == 0 && (options_.find_creases || options_.sizing_tolerance > 0.0)) coarsen(report);
    collapse_short({kCollapseBelow, kSplitAbove}, rounds, report);
    if (options_.collapse_needles && blunt(rounds, report) > 0)
      collapse_short({kCollapseBelow, kSplitAbove}, i == 0 ? kCoarseRounds : kLaterRounds, report);
    if (i == 0) {
      sort_by_position();
    } else {
      compact();
    }
    flip_all(report);
    // The first leaves lengths that splits and collapses change all over; the last ones undo what long strips leave.
    if (i > 0) glide_all(i + kLastIterations < options_.iterations ? kLongGlide : kShortGlide, report);
    // Coarse work first: what early iterations leave is split and collapsed again.
    const int fewer = i + 2 < options_.iterations ? 1 : 0;
    for (int r = fewer; r < options_.relaxations; ++r) relax_all(report);
    if (i == 1 && is_hopeless(report)) return;
  }
  finish(report);
  if (options_.refine_beyond || options_.refine_within > 0.0) {
    refine(report);
    mend_all(report);
    if (options_.refine_beyond) refine(report);  // what mending took away from the tolerance
  }
  report.guard_spent = guard_spent_;
  std::vector<Edge>().swap(edges_);  // their memory is needed for what comes out
  std::vector<Edge>().swap(listed_);
}

/// Later iterations cut what the ones before had no room to cut.
bool Remesher::is_hopeless(const RemeshReport& report) const {
  return options_.hopeless_faces > 0 && report.locked_vertices == 0 && report.by_capacity > 0 &&
         live_faces_ > options_.hopeless_faces;
}

/// Down to a mesh too coarse, and by splits back to one that remembers nothing of the lattice it came from.
void Remesher::coarsen(RemeshReport& report) {
  collapse_short({kCoarseBelow, kCoarseLongest}, kCoarseRounds, report);
  compact();
  split_long(kFirstRounds, report);
}

/// The edge across from the corner.
Remesher::Edge Remesher::edge_at(std::uint32_t c) const {
  const std::uint32_t a = mesh_.vertex(next_corner(c)), b = mesh_.vertex(prev_corner(c));
  // Eight classes to a factor of two of the square.
  return {std::bit_cast<std::uint32_t>(static_cast<float>(square_of(a, b))) >> 20, c, a, b};
}

/// What is listed, by the class of its length, then in the order of faces: neighbours after each other.
void Remesher::sort_listed(bool longest_first) {
  std::vector<std::uint32_t> begin(kLengthClasses + 1);
  if (edges_.capacity() < listed_.size())
    std::vector<Edge>().swap(edges_);  // none is there beside a larger one
  edges_.resize(listed_.size());
  counting_sort<Edge>(listed_, edges_, begin, [&](const Edge& e) {
    return longest_first ? kLengthClasses - 1 - e.length_class : e.length_class;
  });
}

/// Room in the list for all edges there are: it would be there twice while it grows.
void Remesher::make_room_in_list() {
  std::size_t sides = 0;
  for (const CollapseFace& face : mesh_.faces()) {
    if (face.state & kStateDead) continue;
    for (const std::uint32_t o : face.opposite) sides += o == kNoCorner ? 2 : 1;
  }
  if (listed_.capacity() >= sides / 2) return;
  std::vector<Edge>().swap(listed_);
  listed_.reserve(sides / 2);
}

/// All edges that are wanted.
template <class Wanted>
void Remesher::list_edges(const Wanted& wanted, bool longest_first) {
  listed_.clear();
  make_room_in_list();
  for (std::uint32_t f = 0; f < mesh_.faces().size(); ++f) {
    step();
    const CollapseFace& face = mesh_.face(f);
    if (face.state & kStateDead) continue;
    for (std::uint32_t i = 0; i < 3; ++i) {
      const std::uint32_t c = 4 * f + i, o = face.opposite[i];
      if (o == kNoCorner ? !mesh_.border_edge(c) : o < c) continue;
      if (wanted(mesh_.vertex(next_corner(c)), mesh_.vertex(prev_corner(c)))) listed_.push_back(edge_at(c));
    }
  }
  sort_listed(longest_first);
}

/// Whether the corner still lies across the edge; others turn up in the next round.
bool Remesher::current(const Edge& e) const {
  return (mesh_.face(e.corner >> 2).state & kStateDead) == 0 && mesh_.vertex(next_corner(e.corner)) == e.a &&
         mesh_.vertex(prev_corner(e.corner)) == e.b;
}

/// All edges in the first round; then those with faces that the round before cut, the others being short or refused for good.
void Remesher::split_long(int rounds, RemeshReport& report) {
  changed_.assign(info_.size(), 0);
  for (round_ = 0; round_ < rounds; ++round_) {
    list_edges(
        [&](std::uint32_t a, std::uint32_t b) {
          if (changed_[a] < round_ || changed_[b] < round_) return false;
          return too_long(a, b) && !info_[a].pinned && !info_[b].pinned;
        },
        true);
    std::size_t done = 0;
    for (const Edge& e : edges_) {
      step();
      if (!has_longer_neighbour(e)) done += split_if_free(e, report);
    }
    report.splits += done;
    if (done == 0) return;
  }
}

bool Remesher::too_long(std::uint32_t a, std::uint32_t b) const {
  const double maximum = kSplitAbove * target(a, b);
  return square_of(a, b) > maximum * maximum;
}

/// Whether a face at the edge has a longer one that had to stay: at a seam, or beside such an edge. Splits of the others
/// would go on until nothing but slivers is left along it; a later pass, which has the seam inside, does all of them.
bool Remesher::has_longer_neighbour(const Edge& e) const {
  for (const std::uint32_t corner : {e.corner, mesh_.opposite(e.corner)}) {
    if (corner == kNoCorner) continue;
    for (const std::uint32_t c : {next_corner(corner), prev_corner(corner)}) {
      const Edge other = edge_at(c);
      if (other.length_class > e.length_class && too_long(other.a, other.b)) return true;
    }
  }
  return false;
}

bool Remesher::split_if_free(const Edge& e, RemeshReport& report) {
  const std::uint32_t o = mesh_.opposite(e.corner);
  if (!current(e) || info_[e.a].pinned || info_[e.b].pinned || info_[mesh_.vertex(e.corner)].pinned ||
      (o != kNoCorner && info_[mesh_.vertex(o)].pinned))
    return false;
  if (live_faces_ + 2 > options_.max_faces) {
    ++report.by_capacity;
    return false;
  }
  const std::uint32_t apex = mesh_.vertex(e.corner), other = o != kNoCorner ? mesh_.vertex(o) : apex;
  if (!split(e)) return false;
  for (const std::uint32_t v : {e.a, e.b, apex, other, static_cast<std::uint32_t>(info_.size() - 1)})
    mark_changed(v);
  return true;
}

/// Whether the faces at an edge may be split from their apexes to there. Each half keeps a share of its face: a needle cut again
/// and again where the reference is nearest, which can be an end of the edge, would come down to edges without length.
bool Remesher::is_split_sound(std::uint32_t c, const Double3& at) const {
  for (const std::uint32_t d : {c, mesh_.opposite(c)}) {
    if (d == kNoCorner) continue;
    const Double3 &p = mesh_.at(mesh_.vertex(d)), &q = mesh_.at(mesh_.vertex(next_corner(d))),
                  &r = mesh_.at(mesh_.vertex(prev_corner(d)));
    const Double3 old = triangle_normal(p, q, r);
    const double min_area = kMinShare * norm(old);
    const auto is_sound = [&](const Double3& second, const Double3& third) {
      const FaceExtent extent = face_extent(p, second, third);
      return extent.twice_area > std::max(kFlatRoom * kFlatAltitude * extent.longest2, min_area) &&
             dot(triangle_normal(p, second, third), old) > 0.0;
    };
    if (!is_sound(q, at) || !is_sound(at, r)) return false;
  }
  return true;
}

/// Whether a split in the middle would leave a face without area of one that has some.
bool Remesher::too_thin_to_split(std::uint32_t c) const {
  for (const std::uint32_t d : {c, mesh_.opposite(c)}) {
    if (d == kNoCorner) continue;
    const Double3 &p = mesh_.at(mesh_.vertex(d)), &q = mesh_.at(mesh_.vertex(next_corner(d))),
                  &r = mesh_.at(mesh_.vertex(prev_corner(d))), middle = (q + r) * 0.5;
    if (face_extent(p, q, r).is_flat()) continue;
    for (const Double3& end : {q, r}) {
      const FaceExtent half = face_extent(p, end, middle);
      if (half.twice_area <= kFlatRoom * kFlatAltitude * half.longest2) return true;
    }
  }
  return false;
}

/// Where a split puts the new vertex if that is sound, and what is known of it there.
Double3 Remesher::split_place(const Edge& e, Info& info) const {
  const std::uint32_t c = e.corner;
  const Double3 pa = mesh_.at(e.a), pb = mesh_.at(e.b), middle = as_put((pa + pb) * 0.5);
  const double square = squared_distance(pa, pb);
  info.target = 0.5f * (info_[e.a].target + info_[e.b].target);
  info.moved = true;
  info.line = is_line(c);
  Double3 at = middle;
  if (info.line) {
    const Info& from = info_[e.a].line ? info_[e.a] : info_[e.b];
    ReferenceSurface::Foot foot =
        from.line ? surface_.slide(middle, from.foot) : surface_.closest_on_lines(middle);
    if (foot.square > 0.0625 * square) foot = surface_.closest_on_lines(middle);
    info.foot = foot.slot;
    if (foot.slot != ReferenceSurface::kNone && foot.square <= 0.0625 * square) at = as_put(foot.at);
  } else {
    const std::uint32_t hint = !info_[e.a].line && info_[e.a].foot != ReferenceSurface::kNone
                                   ? info_[e.a].foot
                               : info_[e.b].line ? ReferenceSurface::kNone
                                                 : info_[e.b].foot;
    const ReferenceSurface::Foot foot = surface_.near(middle, kAnywhere, 0.01 * square, hint);
    info.foot = foot.slot;
    if (foot.slot != ReferenceSurface::kNone) {
      info.normal = surface_.normal(foot.slot);
      if (foot.square <= 0.25 * square) at = as_put(foot.at);
    }
  }
  if (guarded_ && !refining_) at = middle;  // on the edge as it was it meets nothing new
  return at;
}

/// False where that would leave faces without area.
bool Remesher::split(const Edge& e) {
  const std::uint32_t c = e.corner, o = mesh_.opposite(c);
  Info info;
  Double3 at = split_place(e, info);
  // In the middle nothing can fold.
  if (!is_split_sound(c, at)) {
    at = as_put((mesh_.at(e.a) + mesh_.at(e.b)) * 0.5);
    if (too_thin_to_split(c)) return false;
  }
  info.key = next_key_++;
  set_target(info, at);
  const bool crease = mesh_.crease_edge(c);
  const std::uint32_t m = mesh_.split(c, at);
  if (crease) mesh_.add_state(m, kVertexCrease);
  if (info.line && info.foot == ReferenceSurface::kNone) {
    info.line = false;
    mesh_.add_state(m, kVertexFixed);
  }
  info_.push_back(info);
  changed_.push_back(0);
  live_faces_ += o == kNoCorner ? 1 : 2;
  return true;
}

/// All edges in the first round; then those at vertices whose stars the round before changed: the others would be refused
/// again.
void Remesher::collapse_short(const CollapseLengths& lengths, int rounds, RemeshReport& report) {
  changed_.assign(info_.size(), 0);
  begin_guarding();
  for (round_ = 0; round_ < rounds && collapse_listed(lengths, report) > 0; ++round_) {
  }
}

std::size_t Remesher::collapse_listed(const CollapseLengths& lengths, RemeshReport& report) {
  list_edges(
      [&](std::uint32_t a, std::uint32_t b) {
        if (changed_[a] < round_ && changed_[b] < round_) return false;
        const double minimum = lengths.shortest * target(a, b);
        const bool both_kept = (mesh_.state(a) & kVertexKept) && (mesh_.state(b) & kVertexKept);
        return square_of(a, b) < minimum * minimum &&
               (!both_kept || corners_merge(a, b) || corners_merge(b, a));
      },
      false);
  std::size_t done = 0;
  for (const Edge& e : edges_) {
    step();
    if (!current(e)) continue;
    // The one that is bound less goes; of two alike the one with the higher key.
    const auto rank = [&](std::uint32_t v) {
      return mesh_.state(v) & kVertexKept ? 2 : info_[v].line ? 1 : 0;
    };
    const int ra = rank(e.a), rb = rank(e.b);
    const bool a_first = ra != rb ? ra < rb : info_[e.a].key > info_[e.b].key;
    Refusal refusal = Refusal::kNone;
    for (const bool a_goes : {a_first, !a_first}) {
      const std::uint32_t u = a_goes ? e.a : e.b, v = a_goes ? e.b : e.a;
      std::size_t at = 0;
      refusal = check_collapse(u, v, lengths.longest, at);
      if (refusal != Refusal::kNone) continue;
      for (std::size_t i = 0; i < star_.ring_size(); ++i) mark_changed(star_.ring[i]);
      collapse(at);
      if (blunting_) recount_lines(v);
      ++done;
      break;
    }
    count(refusal, report);
  }
  report.collapses += done;
  return done;
}

void Remesher::count(Refusal refusal, RemeshReport& report) {
  report.by_link += refusal == Refusal::kLink;
  report.by_fold += refusal == Refusal::kFold;
  report.by_tolerance += refusal == Refusal::kTolerance;
  report.by_crossing += refusal == Refusal::kCrossing;
}

/// What check_collapse() found sound.
void Remesher::collapse(std::size_t at) {
  live_faces_ -= star_.closed || (at > 0 && at < star_.faces) ? 2 : 1;
  mesh_.collapse(star_, at);
  if (guarded_) guard_.accept();
}

void Remesher::compact() {
  std::vector<std::uint32_t> kept;
  mesh_.compact(kept);
  for (std::size_t i = 0; i < kept.size(); ++i) info_[i] = info_[kept[i]];
  info_.resize(kept.size());
}

/// Most vertices are new by now: what is near in space lies near in memory again.
void Remesher::sort_by_position() {
  std::vector<Edge>().swap(edges_);  // their memory is needed here
  std::vector<Edge>().swap(listed_);
  std::vector<std::uint32_t> from;
  mesh_.sort_by_position(from);
  std::vector<Info> sorted(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) sorted[i] = info_[from[i]];
  info_.swap(sorted);
}

}  // namespace tessera
