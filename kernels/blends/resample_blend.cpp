// Passes: the fishbone is fitted; its grid is made; faces under the grid go; the zipper joins grid and rest; what came out is
// held to be a manifold, not to fold, and to be within the tolerance. Whatever fails leaves the blend as it was.
#include "kernels/blends/resample_blend.h"

#include <algorithm>
#include <cmath>

#include "kernels/blends/blend_grid.h"
#include "kernels/blends/blend_hole.h"
#include "kernels/certify/certificate_pair.h"
#include "kernels/merge/zipper.h"
#include "kernels/mesh/closest_face.h"
#include "kernels/mesh/face_corners.h"
#include "kernels/mesh/mesh_block_ops.h"

namespace tessera {
namespace {

using Face = std::array<std::uint32_t, 3>;

constexpr std::uint32_t kNone = 0xffffffffu;
constexpr double kClear = 0.5;      ///< of a row: between the grid and what stays
constexpr double kOffEdges = 1.5;   ///< vertices under the grid, edges off it at the most, and half an arc
constexpr double kGapRows = 2.5;    ///< of the zipper: what was cleared, and the width of faces beside it
constexpr double kMinFacing = 0.2;  ///< cosine between a new face and the surface at its corners
constexpr double kCreaseArc = 0.6;  ///< of a row: shorter arcs were creases
constexpr double kOnCrease = 0.35;  ///< of a row: vertices so near to it are on it
constexpr double kBridgeRibs = 3.0;
constexpr int kMaxCuts = 4;          ///< times that ribs are left out where a blend cannot be changed
constexpr double kShrunk = 0.5;      ///< of its length: a second fit that leaves less is not the better one
constexpr double kRoomy = 1.25;      ///< of the tolerance: how far off is still told
constexpr double kEdgesApart = 1.3;  ///< local edges that differ by more from what was thought: fit again

class Resampler {
 public:
  Resampler(const MeshBlock& block, BlendCurve curve, const BlendOptions& options, double edge, bool follows)
      : block_(block),
        curve_(std::move(curve)),
        options_(options),
        edge_(edge),
        follows_(follows),
        corners_(block) {}

  ResampledBlend run() {
    out_.report.outcome = work();
    if (out_.report.outcome != BlendOutcome::kChanged) {
      out_.removed.clear();
      out_.added = {};
      out_.report.faces_removed = out_.report.faces_added = 0;
    }
    return std::move(out_);
  }

 private:
  BlendOutcome work() {
    find_normals();
    if (const BlendOutcome o = fit(); o != BlendOutcome::kChanged) return o;
    for (int cut = 0;;) {
      const BlendOutcome o = attempt();
      const bool fails_somewhere = o == BlendOutcome::kAtBorder || o == BlendOutcome::kNotStitched ||
                                   o == BlendOutcome::kFolds || o == BlendOutcome::kBeyondTolerance;
      if (!fails_somewhere) return o;
      // Arcs and straight flanks have the least noise; where they do not do, the surface beside them comes along.
      if (o == BlendOutcome::kBeyondTolerance && !follows_) {
        follows_ = true;
        continue;
      }
      if (++cut > kMaxCuts || !keep_sound_ribs()) return o;
      follows_ = options_.edit != BlendEdit::kNone;
    }
  }

  /// As the fishbone is now. Where it fails, the ribs there are marked as bad.
  BlendOutcome attempt() {
    bad_.assign(bone_.planes.size(), 0);
    ring_.clear(), old_.clear(), added_.clear();
    pieces_ = {};
    const double max_distance = flank_beyond(bone_, options_, spacing_) + (1.0 + kClear) * spacing_;
    near_ = position(max_distance + 2.0 * edge_);
    grid_ = make_blend_grid(bone_, near_, options_, spacing_, follows_);
    describe();
    if (grid_.sharp && options_.edit == BlendEdit::kNone) return BlendOutcome::kSharp;
    // Again, as far as faces that begin under the grid can reach.
    near_ = position(max_distance + longest_edge_near());
    if (const BlendOutcome o = clear(); o != BlendOutcome::kChanged) return o;
    if (const BlendOutcome o = stitch(); o != BlendOutcome::kChanged) return o;
    if (folds()) return BlendOutcome::kFolds;
    if (!certify()) return BlendOutcome::kBeyondTolerance;
    hand_out();
    const NormalJumps &was = out_.report.before, &is = out_.report.after;
    const bool better = is.along.noise <= was.along.noise && is.across.noise <= was.across.noise;
    return better || options_.edit != BlendEdit::kNone ? BlendOutcome::kChanged : BlendOutcome::kNoBetter;
  }

  /// The longest run of ribs away from bad ones stays; where none is known to be bad, all but the first and the last.
  bool keep_sound_ribs() {
    const std::size_t n = bad_.size();
    const bool closed = bone_.planes.closed();
    std::vector<std::uint8_t> sound(n, 1);
    for (std::size_t i = 0; i < n; ++i) {
      if (!bad_[i]) continue;
      sound[i] = 0;
      if (closed || i > 0) sound[(i + n - 1) % n] = 0;
      if (closed || i + 1 < n) sound[(i + 1) % n] = 0;
    }
    if (std::find(bad_.begin(), bad_.end(), 1) == bad_.end()) {
      if (closed) return false;
      sound.front() = sound.back() = 0;
    }
    const RibRun run = longest_run(sound, closed);
    if (run.count < kMinRibs || run.count == n) return false;
    bone_.keep(run.first, run.count);
    return true;
  }

  void mark_bad(std::uint32_t vertex) {
    if (rib_of_[vertex] != kNone) bad_[rib_of_[vertex]] = 1;
  }
  /// \param piece  a vertex of the pieces
  void mark_bad_piece(std::uint32_t piece) {
    if (piece < old_.size())
      mark_bad(old_[piece]);
    else
      bad_[(piece - old_.size()) / grid_.rows] = 1;
  }

  void find_normals() {
    normal_.assign(block_.key.size(), Double3{});
    for (const Face& f : block_.faces) {
      const Double3 n = face_normal(block_.position, f);
      for (const std::uint32_t v : f) normal_[v] = normal_[v] + n;
    }
    for (Double3& n : normal_) n = unit_or_zero(n);
    dress_curve();
  }
  /// Where a track by hand has no normals it takes those of the vertices around.
  void dress_curve() {
    const double max_distance = curve_.half_width + edge_;
    for (std::size_t i = 0; i < curve_.normal.size(); ++i) {
      Double3& n = curve_.normal[i];
      if (dot(n, n) > 0.0) continue;
      for (std::size_t v = 0; v < normal_.size(); ++v)
        if (squared_distance(block_.position[v], curve_.centre[i]) < max_distance * max_distance)
          n = n + normal_[v];
      n = unit_or_zero(n);
    }
  }
  static Double3 face_normal(std::span<const Double3> at, const Face& f) {
    return triangle_normal(at[f[0]], at[f[1]], at[f[2]]);
  }

  BlendOutcome fit() {
    double flank = 0.0;
    Fishbone coarser;
    for (int again = 0; again < 2; ++again) {
      spacing_ = options_.spacing > 0.0 ? options_.spacing : edge_;
      FishboneOptions o{spacing_, edge_, 0.0, flank};
      FishboneOutcome found = fit_fishbone(block_.position, normal_, curve_, o, bone_);
      if (found == FishboneOutcome::kFound && options_.edit != BlendEdit::kNone) {
        o.min_flank = flank_beyond(bone_, options_, spacing_) + spacing_;
        found = fit_fishbone(block_.position, normal_, curve_, o, bone_);
      }
      const bool shrank = found == FishboneOutcome::kFound && again > 0 &&
                          bone_.planes.length() < kShrunk * coarser.planes.length();
      if ((found != FishboneOutcome::kFound || shrank) && again > 0) {
        // Where edges are short along the blend alone, ribs so near to each other see too little of its flanks.
        bone_ = std::move(coarser);
        edge_ = bone_.edge, spacing_ = options_.spacing > 0.0 ? options_.spacing : edge_;
        break;
      }
      if (found == FishboneOutcome::kTooShort) return BlendOutcome::kTooShort;
      if (found == FishboneOutcome::kNoFlanks) return BlendOutcome::kNoFlanks;
      if (found == FishboneOutcome::kRibsCross) return BlendOutcome::kRibsCross;
      const double local = local_edge();
      const bool apart = local > kEdgesApart * edge_ || edge_ > kEdgesApart * local;
      if (!(local > 0.0) || !apart) break;
      coarser = bone_;
      flank = bone_.flank;
      edge_ = local;
    }
    return BlendOutcome::kChanged;
  }

  double off() const { return kOffEdges * edge_ + 0.5 * bone_.mean_arc(); }
  std::vector<RibVertex> position(double max_distance) const {
    return locate_vertices(bone_, block_.position, normal_, max_distance, off());
  }

  double local_edge() const {
    std::vector<std::uint8_t> in(block_.key.size(), 0);
    for (const RibVertex& v : position(edge_))
      if (in_length(v.position.rib)) in[v.vertex] = 1;
    double sum = 0.0, count = 0.0;
    for (const Face& f : block_.faces)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t a = f[k], b = f[(k + 1) % 3];
        if (!in[a] || !in[b]) continue;
        sum += norm(block_.position[b] - block_.position[a]), count += 1.0;
      }
    return count > 0.0 ? sum / count : 0.0;
  }
  bool in_length(double rib) const {
    return bone_.planes.closed() || (rib >= 0.0 && rib <= static_cast<double>(bone_.planes.size() - 1));
  }

  double longest_edge_near() const {
    std::vector<std::uint8_t> in(block_.key.size(), 0);
    for (const RibVertex& v : near_)
      if (in_length(v.position.rib)) in[v.vertex] = 1;
    double square = edge_ * edge_;
    for (const Face& f : block_.faces)
      for (std::size_t k = 0; k < 3; ++k)
        if (in[f[k]] || in[f[(k + 1) % 3]])
          square = std::max(square, squared_distance(block_.position[f[k]], block_.position[f[(k + 1) % 3]]));
    return std::sqrt(square);
  }

  void describe() {
    BlendReport& r = out_.report;
    r.closed = grid_.closed, r.convex = bone_.convex, r.sharp = grid_.sharp;
    r.straightened = bone_.straightened;
    r.ribs = grid_.ribs, r.rows = grid_.rows;
    r.length = bone_.planes.length();
    r.radius = bone_.mean_radius();
    r.new_radius = grid_.radius_of_arcs();
    r.arc_angle = bone_.mean_arc_angle();
    r.rms = bone_.rms;
  }

  /// Faces under the grid, and a little around it, that hang together.
  BlendOutcome clear() {
    constexpr double kFar = 1e300;
    std::vector<Double2> position(block_.key.size(), {kFar, kFar});
    rib_of_.assign(block_.key.size(), kNone);
    double mean = 0.0;
    for (const double e : grid_.extent) mean += e / static_cast<double>(grid_.ribs);
    const double step = bone_.planes.spacing();
    for (const RibVertex& v : near_) {
      const double last = static_cast<double>(grid_.ribs - 1);
      const auto rib = static_cast<std::size_t>(std::clamp(std::round(v.position.rib), 0.0, last));
      position[v.vertex] = {v.position.rib * step, v.across.run * mean / grid_.extent[rib]};
      rib_of_[v.vertex] = static_cast<std::uint32_t>(rib);
    }
    const double clear = kClear * std::min(spacing_, edge_);
    const double length = step * static_cast<double>(grid_.closed ? grid_.ribs : grid_.ribs - 1);
    removed_.assign(block_.faces.size(), 0);
    for (std::size_t f = 0; f < removed_.size(); ++f) {
      std::array<Double2, 3> t;
      bool known = true, within = false;
      for (std::size_t k = 0; k < 3; ++k) {
        t[k] = position[block_.faces[f][k]];
        known = known && t[k][0] != kFar;
        within = within || (t[k][0] != kFar && std::fabs(t[k][1]) <= mean + clear &&
                            (grid_.closed || (t[k][0] >= -clear && t[k][0] <= length + clear)));
      }
      if (known && grid_.closed)
        for (std::size_t k = 1; k < 3; ++k) t[k][0] -= length * std::round((t[k][0] - t[0][0]) / length);
      removed_[f] = within || (known && meets_rectangle(t, grid_.closed ? -kFar : -clear,
                                                        grid_.closed ? kFar : length + clear, mean + clear));
    }
    keep_largest_piece(block_, corners_, removed_);
    // A border's vertex at the hole would have two fans while it is open.
    std::vector<std::uint8_t> at_border(block_.key.size(), 0);
    for (std::size_t f = 0; f < removed_.size(); ++f)
      for (std::size_t k = 0; k < 3; ++k)
        if (across(f, k) == kNone)
          at_border[block_.faces[f][k]] = at_border[block_.faces[f][(k + 1) % 3]] = 1;
    std::size_t count = 0;
    bool ends = false;
    for (std::size_t f = 0; f < removed_.size(); ++f) {
      if (!removed_[f]) continue;
      ++count;
      const Face& t = block_.faces[f];
      if (!at_border[t[0]] && !at_border[t[1]] && !at_border[t[2]]) continue;
      ends = true;
      for (const std::uint32_t v : t) mark_bad(v);
    }
    if (ends) return BlendOutcome::kAtBorder;
    return count > 0 ? BlendOutcome::kChanged : BlendOutcome::kNotStitched;
  }

  std::uint32_t across(std::size_t f, std::size_t k) const { return face_across(block_, corners_, f, k); }

  /// The ring of faces around the hole, and the grid, become pieces for the zipper.
  BlendOutcome stitch() {
    std::vector<std::uint8_t> near(block_.key.size(), 0), ring(block_.faces.size(), 0);
    for (int round = 0; round < 2; ++round) {
      for (std::size_t f = 0; f < ring.size(); ++f)
        if (removed_[f] || ring[f])
          for (const std::uint32_t v : block_.faces[f]) near[v] = 1;
      for (std::size_t f = 0; f < ring.size(); ++f)
        for (const std::uint32_t v : block_.faces[f]) ring[f] |= near[v];
    }
    const Double3 origin = curve_.centre[0];
    std::vector<std::uint32_t> position(block_.key.size(), kNone);
    for (std::uint32_t f = 0; f < ring.size(); ++f) {
      if (!ring[f] || removed_[f]) continue;
      Face face;
      for (std::size_t k = 0; k < 3; ++k) {
        std::uint32_t& at = position[block_.faces[f][k]];
        if (at == kNone) {
          at = static_cast<std::uint32_t>(old_.size());
          old_.push_back(block_.faces[f][k]);
        }
        face[k] = at;
      }
      std::uint8_t edges = ZipPieces::kOriginal | (block_.face_flags[f] & 7);
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t g = across(f, k);
        const bool ends = block_.face_flags[f] >> k & 1;
        if (!ends && (g == kNone || (!ring[g] && !removed_[g])))
          edges = static_cast<std::uint8_t>(edges | ZipPieces::kGoesOn << k);
      }
      pieces_.faces.push_back(face);
      pieces_.edges.push_back(edges);
      ring_.push_back(f);
    }
    for (const std::uint32_t v : old_) pieces_.position.push_back(block_.position[v] - origin);
    for (const Double3& p : grid_.node) pieces_.position.push_back(p - origin);
    const auto first = static_cast<std::uint32_t>(old_.size());
    for (const Face& f : grid_.faces()) {
      pieces_.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
      pieces_.edges.push_back(0);
    }
    bridge_creases(position);
    zipped_ = zip(pieces_, kGapRows * std::max({spacing_, edge_, bone_.planes.spacing()}));
    for (std::size_t f = 0; f < ring_.size(); ++f)
      if (zipped_.removed[f]) removed_[ring_[f]] = 1;
    for (std::size_t f = 0; f < pieces_.faces.size(); ++f) {
      if (zipped_.removed[f]) continue;
      if (f < ring_.size()) continue;
      added_.push_back(pieces_.faces[f]);
    }
    added_.insert(added_.end(), zipped_.added.begin(), zipped_.added.end());
    return is_closed() ? BlendOutcome::kChanged : BlendOutcome::kNotStitched;
  }

  /// Where a crease was edited and goes on beyond an end, a fan leads from the end's arc, or its middle, to the next vertex of
  /// the crease: the gaps on both flanks are flat then, and nothing is stitched across the edge.
  /// \param position  of vertices among the pieces
  void bridge_creases(const std::vector<std::uint32_t>& position) {
    if (grid_.closed || bone_.mean_arc() > kCreaseArc * spacing_) return;
    std::vector<std::uint8_t> at_hole(block_.key.size(), 0);
    for (std::size_t f = 0; f < removed_.size(); ++f)
      if (removed_[f])
        for (const std::uint32_t v : block_.faces[f]) at_hole[v] = 1;
    const double last = static_cast<double>(grid_.ribs - 1);
    for (const bool begins : {true, false}) {
      std::uint32_t best = kNone;
      double minimum = kOnCrease * spacing_;
      for (const RibVertex& v : near_) {
        const double beyond = begins ? -v.position.rib : v.position.rib - last;
        if (!at_hole[v.vertex] || position[v.vertex] == kNone || !(beyond > 0.0) || beyond > kBridgeRibs)
          continue;
        const double off = std::max(std::fabs(v.across.run), std::fabs(v.across.distance));
        if (off < minimum) minimum = off, best = v.vertex;
      }
      if (best == kNone) continue;
      const std::size_t rib = begins ? 0 : grid_.ribs - 1;
      const std::size_t first = grid_.arcs > 0 ? grid_.first_arc : grid_.first_arc - 1;
      const std::size_t end = grid_.first_arc + std::max<std::size_t>(1, grid_.arcs);
      // Along the hole's border from the crease's vertex, and to it: the fan is to hang together with what is there.
      std::uint32_t onwards = kNone, before = kNone;
      for (const std::uint32_t c : corners_.at(best)) {
        const std::uint32_t f = c >> 2, k = c & 3;
        if (removed_[f]) continue;
        const std::uint32_t next = across(f, k), last_one = across(f, (k + 2) % 3);
        if (next != kNone && removed_[next]) onwards = block_.faces[f][(k + 1) % 3];
        if (last_one != kNone && removed_[last_one]) before = block_.faces[f][(k + 2) % 3];
      }
      if (onwards == kNone || before == kNone) continue;
      const std::uint32_t c = position[best];
      const auto node = [&](std::size_t row) {
        return static_cast<std::uint32_t>(old_.size() + grid_.at(rib, row));
      };
      const auto add = [&](const Face& f) {
        pieces_.faces.push_back(f);
        pieces_.edges.push_back(0);
      };
      for (std::size_t row = first; row < end; ++row)
        add(begins ? Face{node(row), node(row + 1), c} : Face{node(row + 1), node(row), c});
      add({c, position[before], node(begins ? first : end)});
      add({position[onwards], c, node(begins ? end : first)});
    }
  }

  /// Every edge of what comes out has its other side, but where the pieces go on or the surface ends.
  bool is_closed() {
    std::vector<Face> faces;
    std::vector<std::uint8_t> edges;
    for (std::size_t f = 0; f < ring_.size(); ++f)
      if (!zipped_.removed[f]) faces.push_back(pieces_.faces[f]), edges.push_back(pieces_.edges[f]);
    faces.insert(faces.end(), added_.begin(), added_.end());
    edges.resize(faces.size(), 0);
    for (std::uint8_t& e : edges)
      e = static_cast<std::uint8_t>((e / ZipPieces::kEnds | e / ZipPieces::kGoesOn) & 7u);
    const std::vector<std::uint32_t> loose = loose_vertices(faces, edges, pieces_.position.size());
    for (const std::uint32_t v : loose) mark_bad_piece(v);
    return loose.empty();
  }

  /// All that was there, near what goes.
  std::vector<Face> old_faces() const {
    std::vector<Face> out;
    for (std::size_t f = 0; f < removed_.size(); ++f)
      if (removed_[f]) out.push_back(block_.faces[f]);
    for (std::size_t f = 0; f < ring_.size(); ++f)
      if (!zipped_.removed[f]) out.push_back(block_.faces[ring_[f]]);
    return out;
  }

  /// A new face turns away from what its corners say: of old ones the surface as it was, of nodes the grid.
  bool folds() {
    std::vector<Double3> normal;
    bool any = false;
    for (const std::uint32_t v : old_) normal.push_back(normal_[v]);
    normal.resize(pieces_.position.size(), Double3{});
    for (std::size_t f = ring_.size(); f < pieces_.faces.size(); ++f)
      for (const std::uint32_t v : pieces_.faces[f])
        normal[v] = normal[v] + unit_or_zero(face_normal(pieces_.position, pieces_.faces[f]));
    for (const Face& f : added_) {
      const Double3 n = unit_or_zero(face_normal(pieces_.position, f));
      Double3 sum{};
      for (const std::uint32_t v : f) sum = sum + unit_or_zero(normal[v]);
      if (dot(n, unit_or_zero(sum)) >= kMinFacing) continue;
      any = true;
      for (const std::uint32_t v : f) mark_bad_piece(v);
    }
    return any;
  }

  bool certify() {
    const bool edited = options_.edit != BlendEdit::kNone;
    const std::vector<Face> old = old_faces();
    std::vector<Double3> position;
    for (const std::uint32_t v : old_) position.push_back(block_.position[v]);
    position.insert(position.end(), grid_.node.begin(), grid_.node.end());
    std::vector<Face> now = added_;
    for (std::size_t f = 0; f < ring_.size(); ++f)
      if (!zipped_.removed[f]) now.push_back(pieces_.faces[f]);
    CertificateOptions o;
    o.tolerance = options_.tolerance;
    if (edited) o.tolerance = std::max(o.tolerance, 2.0 * (bone_.mean_arc() + spacing_ + options_.radius));
    o.max_distance = kRoomy * o.tolerance;
    o.area_unit = std::max(1e-300, edge_ * edge_ * 1e-6);
    o.samples = 0;
    const DeviationPair pair =
        certify_pair({position, now}, {block_.position, old}, nullptr, curve_.centre[0], o);
    out_.report.distance = std::max(pair.there.upper, pair.back.upper);
    if (edited || out_.report.distance <= options_.tolerance) return true;
    for (std::size_t f = 0; f < now.size(); ++f)
      if (static_cast<double>(pair.there_bound[f]) > options_.tolerance)
        for (const std::uint32_t v : now[f]) mark_bad_piece(v);
    for (std::size_t f = 0; f < old.size(); ++f)
      if (static_cast<double>(pair.back_bound[f]) > options_.tolerance)
        for (const std::uint32_t v : old[f]) mark_bad(v);
    return false;
  }

  void hand_out() {
    BlendReport& r = out_.report;
    std::vector<Face> was;
    for (std::size_t f = 0; f < removed_.size(); ++f) {
      if (!removed_[f]) continue;
      const Face& t = block_.faces[f];
      was.push_back(t);
      std::array<std::uint64_t, 3> c = {block_.key[t[0]], block_.key[t[1]], block_.key[t[2]]};
      std::sort(c.begin(), c.end());
      out_.removed.push_back(c);
    }
    std::sort(out_.removed.begin(), out_.removed.end());
    MeshBlock& b = out_.added;
    for (const std::uint32_t v : old_) {
      b.key.push_back(block_.key[v]);
      b.position.push_back(block_.position[v]);
      b.vertex_class.push_back(block_.vertex_class[v]);
      if (!block_.rgba.empty()) b.rgba.push_back(block_.rgba[v]);
    }
    for (std::size_t i = 0; i < grid_.node.size(); ++i) {
      b.key.push_back(options_.first_key + i);
      b.position.push_back(grid_.node[i]);
      b.vertex_class.push_back(grid_.sharp && i % grid_.rows == grid_.first_arc ? VertexClass::kCrease
                                                                                : VertexClass::kSmooth);
    }
    if (!block_.rgba.empty()) colour(was);
    b.faces = added_;
    b.face_flags.assign(added_.size(), 0);
    r.faces_removed = was.size();
    r.faces_added = added_.size();
    r.before = normal_jumps(bone_, block_.position, was);
    r.after = normal_jumps(bone_, b.position, b.faces);
    canonicalise(b);
  }

  /// New vertices take the colour of the nearest corner of the face under them.
  void colour(const std::vector<Face>& was) {
    const ClosestFaces there(block_.position, was, curve_.centre[0]);
    for (const Double3& p : grid_.node) {
      const auto hit = there.closest(p - curve_.centre[0], 1e300, ClosestFaces::kNone);
      const Face& f = was[there.face(hit.slot)];
      std::uint32_t nearest = f[0];
      for (const std::uint32_t v : f)
        if (squared_distance(block_.position[v], p) < squared_distance(block_.position[nearest], p))
          nearest = v;
      out_.added.rgba.push_back(block_.rgba[nearest]);
    }
  }

  const MeshBlock& block_;
  BlendCurve curve_;
  const BlendOptions& options_;
  double edge_, spacing_ = 0.0;
  bool follows_;                       ///< the surface beside arcs and straight flanks
  std::vector<std::uint8_t> bad_;      ///< per rib: where an attempt failed
  std::vector<std::uint32_t> rib_of_;  ///< per vertex of the block near the grid: its rib
  FaceCorners corners_;
  std::vector<Double3> normal_;
  Fishbone bone_;
  std::vector<RibVertex> near_;
  BlendGrid grid_;
  std::vector<std::uint8_t> removed_;  ///< per face of the block
  std::vector<std::uint32_t> ring_;    ///< faces of the block among the pieces
  std::vector<std::uint32_t> old_;     ///< vertices of the block among the pieces: before the nodes
  ZipPieces pieces_;
  Zipped zipped_;
  std::vector<Face> added_;  ///< in vertices of the pieces
  ResampledBlend out_;
};

}  // namespace

std::string_view sentence_of(BlendOutcome outcome) {
  switch (outcome) {
    case BlendOutcome::kChanged:
      return "changed";
    case BlendOutcome::kTooShort:
      return "it is shorter than four ribs";
    case BlendOutcome::kNoFlanks:
      return "the surface beside it is no flank of a rolling ball";
    case BlendOutcome::kSharp:
      return "it is a sharp edge, there is no noise to take away";
    case BlendOutcome::kRibsCross:
      return "it turns too sharply for its width, ribs would cross";
    case BlendOutcome::kAtBorder:
      return "it reaches a border of the surface";
    case BlendOutcome::kNotStitched:
      return "its grid could not be stitched to the mesh all around";
    case BlendOutcome::kFolds:
      return "a new face would turn away from the surface";
    case BlendOutcome::kBeyondTolerance:
      return "it would be farther from the input than the tolerance";
    case BlendOutcome::kNoBetter:
      return "its normals vary no more than they would then";
  }
  return "";
}

double blend_halo(const BlendCurve& curve, const BlendOptions& options, double edge) {
  return 4.0 * curve.half_width + 4.0 * options.radius + 16.0 * edge;
}

ResampledBlend resample_blend(const MeshBlock& block, const BlendCurve& curve, const BlendOptions& options,
                              double edge) {
  return Resampler(block, curve, options, edge, options.edit != BlendEdit::kNone).run();
}

std::uint64_t resample_blend_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return vertices * (24 + 4 + 96 + 16 + 8) + faces * (12 + 4 + 12 + 48) + zip_bytes(vertices, 2 * faces) +
         faces * (2 * ClosestFaces::bytes_per_face() + 200);
}

}  // namespace tessera
