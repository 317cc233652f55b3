#include "kernels/certify/overlay_proof.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <unordered_map>

#include "kernels/certify/near_proof.h"
#include "kernels/certify/overlay_outline.h"
#include "kernels/mesh/box_mask.h"
#include "octree/rounding.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoFace = kNoPair;
constexpr float kOpen = std::numeric_limits<float>::infinity();
constexpr int kMaxSteps = 512;
constexpr std::uint32_t kSampling = 16;

class Overlay {
 public:
  Overlay(const SurfaceFaces& coarse, const SurfaceFaces& fine, const Box3* core, double margin,
          const Double3& origin, const CertificateOptions& options, bool fine_too)
      : coarse_(coarse), fine_(fine), core_(core), margin_(margin), origin_(origin), fine_too_(fine_too) {
    vertices_.reserve(fine.position.size());
    points_ = std::make_unique_for_overwrite<Point[]>(fine.position.size());
    for (const Double3& p : fine.position) {
      vertices_.push_back({p - origin, 0, 0});
      take_largest(vertices_.back().at);
    }
    for (const Double3& p : coarse.position) take_largest(p - origin);
    rounding_ = certificate_rounding(largest_);
    grown_ = 0x1p-47 * largest_;
    sure_area_ = 64.0 * grown_ * largest_;  // no edge is longer than 2 sqrt(3) of the largest coordinate
    if (core_ != nullptr && fine_too_) sides_ = beyond_sides(fine.position, core->low, core->high);
    limit_ = options.tolerance - rounding_;
    across_fine_ = pair_edges(fine);
    across_coarse_ = pair_edges(coarse);
    state_.resize(fine.faces.size());
    seed_.assign(coarse.faces.size(), kNoFace);
    out_.coarse.bound.assign(coarse.faces.size(), kOpen);
    if (fine_too_) out_.fine.bound.assign(fine.faces.size(), kOpen);
  }

  OverlayProof run() {
    find_starts();
    for (std::uint32_t t = 0; t < coarse_.faces.size(); ++t) overlay_face(t);
    if (fine_too_)
      for (std::uint32_t f = 0; f < fine_.faces.size(); ++f) finish_fine(f);
    return std::move(out_);
  }

 private:
  struct Vertex {
    Double3 at;  ///< relative to the origin
    std::uint32_t stamp, slot;
  };
  struct Point {
    Flat at;
    double z;
    unsigned outside;   ///< bit i: beyond side i of the outline
    unsigned touching;  ///< or within rounding of it
  };
  /// Of a fine face: what is known of it over the coarse faces so far.
  struct State {
    std::uint32_t stamp = 0;
    std::uint32_t overlaps = kNoFace;  ///< 4 t + edge: it lies over coarse face t and across that edge
    float height = 0.0f;               ///< largest there
    float bound = kOpen;
    unsigned corners = 0;         ///< bit i: corner i lies over `overlaps`
    std::uint32_t met = kNoFace;  ///< the last of met_ that is of this face
  };
  /// A coarse face that a fine one lies partly over.
  struct Met {
    std::uint32_t coarse, before;
  };

  void take_largest(const Double3& p) {
    for (const double c : p) largest_ = std::max(largest_, std::abs(c));
  }

  /// Fine faces to start from: those at the corners of coarse faces, where positions are the same.
  void find_starts() {
    struct Hash {
      std::size_t operator()(const Double3& p) const {
        std::uint64_t h = 0;
        for (const double c : p)
          h = (h ^ std::bit_cast<std::uint64_t>(c + 0.0)) * 0x9e3779b97f4a7c15u, h ^= h >> 29;
        return h;
      }
    };
    std::unordered_map<Double3, std::uint32_t, Hash> corner;
    corner.reserve(coarse_.position.size());
    for (std::uint32_t v = 0; v < coarse_.position.size(); ++v) corner.emplace(coarse_.position[v], v);
    start_.assign(coarse_.position.size(), kNoFace);
    std::vector<std::uint32_t> start_of(fine_.position.size(), kNoFace);
    // A first sieve: most fine vertices are no corners.
    constexpr std::size_t kBits = 16;
    std::vector<bool> sieve(std::size_t{1} << kBits);
    for (const auto& [p, v] : corner) sieve[Hash{}(p) >> (64 - kBits)] = true;
    for (std::uint32_t v = 0; v < fine_.position.size(); ++v) {
      if (!sieve[Hash{}(fine_.position[v]) >> (64 - kBits)]) continue;
      const auto found = corner.find(fine_.position[v]);
      if (found != corner.end()) start_of[v] = found->second;
    }
    for (std::uint32_t f = 0; f < fine_.faces.size(); ++f)
      for (const std::uint32_t v : fine_.faces[f])
        if (start_of[v] != kNoFace) start_[start_of[v]] = f;
  }

  Double3 local(const Double3& p) const { return p - origin_; }

  /// Lays out the plane of a coarse face and the part of it that counts. \return false where it has none
  bool lay_out(std::uint32_t t) {
    const auto& face = coarse_.faces[t];
    const Double3 p[3] = {local(coarse_.position[face[0]]), local(coarse_.position[face[1]]),
                          local(coarse_.position[face[2]])};
    whole_ = true;
    bool meets = true, near_edge = false;
    if (core_ != nullptr)
      for (std::size_t k = 0; k < 3; ++k) {
        const double low = std::min({p[0][k], p[1][k], p[2][k]}),
                     high = std::max({p[0][k], p[1][k], p[2][k]});
        const double from = core_->low[k] - origin_[k], to = core_->high[k] - origin_[k];
        meets = meets && low <= to && high >= from;
        whole_ = whole_ && low >= from && high <= to;
        near_edge = near_edge || low < from - margin_ || high > to + margin_;
      }
    base_ = p[0];
    const Double3 u = p[1] - p[0];
    normal_ = cross(u, p[2] - p[0]);
    const double size = norm(u), twice = norm(normal_);
    area_ = meets ? 0.5 * twice : 0.0;
    if (!meets) return false;
    solid_ = size > 0.0 && twice > 0.0;
    if (!solid_) return true;
    for (std::size_t k = 0; k < 3; ++k) normal_[k] /= twice, ex_[k] = u[k] / size;
    ey_ = cross(normal_, ex_);
    outline_ = Outline{};
    for (unsigned i = 0; i < 3; ++i) {
      const Double3 r = p[i] - base_;
      corner_[i] = {dot(r, ex_), dot(r, ey_)};
      outline_.add(corner_[i], i);
      // A sliver whose normal does not tell its plane.
      solid_ = solid_ && std::abs(dot(r, normal_)) <= 0x1p-48 * largest_;
    }
    double longest = 0.0;
    for (std::size_t i = 0; i < 3; ++i) longest = std::max(longest, norm(p[(i + 1) % 3] - p[i]));
    needle_ = twice < 0.125 * longest * longest;
    if (!whole_) {
      Outline inside = outline_;
      clip_to_box(inside, 0.0);
      area_ = inside.corners < 3 ? 0.0 : std::max(0.0, inside.area());
      if (inside.corners < 3) return false;
      if (near_edge) clip_to_box(outline_, margin_);
    }
    return true;
  }

  void clip_to_box(Outline& outline, double margin) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const double low = core_->low[k] - origin_[k] - margin, high = core_->high[k] - origin_[k] + margin;
      outline.clip([&](const Flat& p) { return base_[k] + p.x * ex_[k] + p.y * ey_[k] - low; });
      outline.clip([&](const Flat& p) { return high - (base_[k] + p.x * ex_[k] + p.y * ey_[k]); });
    }
  }

  /// Lines of the sides; those of the face's own edges through its corners.
  bool lay_sides() {
    const int n = outline_.corners;
    for (int i = 0; i < n; ++i) {
      Flat a = outline_.at[i], b = outline_.at[i + 1 == n ? 0 : i + 1];
      if (outline_.tag[i] != kCutSide) a = corner_[outline_.tag[i]], b = corner_[(outline_.tag[i] + 1) % 3];
      const double dx = b.x - a.x, dy = b.y - a.y, size = std::sqrt(dx * dx + dy * dy);
      if (!(size > 0.0)) return false;
      side_[i] = {-dy / size, dx / size, 0.0};
      side_[i][2] = -(side_[i][0] * a.x + side_[i][1] * a.y);
    }
    return n >= 3 && n < kMaxSides;
  }
  double beyond(int i, const Flat& p) const { return side_[i][0] * p.x + side_[i][1] * p.y + side_[i][2]; }

  const Point& projected(std::uint32_t v) {
    Vertex& vertex = vertices_[v];
    if (vertex.stamp != stamp_) {
      vertex.stamp = stamp_;
      vertex.slot = point_count_++;
      const Double3 r = vertex.at - base_;
      Point p{{dot(r, ex_), dot(r, ey_)}, dot(r, normal_), 0, 0};
      for (int i = 0; i < outline_.corners; ++i) {
        const double side = beyond(i, p.at);
        if (side < -grown_) p.outside |= 1u << i;
        if (side < grown_) p.touching |= 1u << i;
      }
      points_[vertex.slot] = p;
    }
    return points_[vertex.slot];
  }

  /// Walks to the fine face over the point `to`. \return kNoFace where there is no way
  std::uint32_t walk(std::uint32_t from, const Flat& to) {
    std::uint32_t f = from, came = kNoFace;
    for (int step = 0; step < kMaxSteps && f != kNoFace; ++step) {
      const auto& v = fine_.faces[f];
      const Flat p[3] = {projected(v[0]).at, projected(v[1]).at, projected(v[2]).at};
      const double up = orient2d(p[0], p[1], p[2]) < 0.0 ? -1.0 : 1.0;
      double minimum = 0.0;
      std::uint32_t side = kNoFace;
      bool safe = true;
      for (std::uint32_t i = 0; i < 3; ++i) {
        const Flat &a = p[i], &b = p[i == 2 ? 0 : i + 1];
        const double dx = b.x - a.x, dy = b.y - a.y, size = std::sqrt(dx * dx + dy * dy);
        const double inside = up * orient2d(a, b, to);
        safe = safe && inside > 4.0 * grown_ * size;
        if (size > 0.0 && inside / size < minimum && across_fine_[f][i] >> 2 != came)
          minimum = inside / size, side = i;
      }
      if (safe) return f;
      if (side == kNoFace) return kNoFace;
      came = f;
      f = across_fine_[f][side] == kNoFace ? kNoFace : across_fine_[f][side] >> 2;
    }
    return kNoFace;
  }

  /// A fine face not far from the centre, where no corner is shared: of a sample.
  std::uint32_t nearby() {
    if (sample_.empty()) {
      std::vector<std::array<std::uint32_t, 3>> some;
      for (std::size_t f = 0; f < fine_.faces.size(); f += kSampling) some.push_back(fine_.faces[f]);
      sample_ = ClosestFaces(fine_.position, some, origin_);
    }
    Double3 p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = base_[k] + centre_.x * ex_[k] + centre_.y * ey_[k];
    const ClosestFaces::Hit hit =
        sample_.closest(p, std::numeric_limits<double>::infinity(), ClosestFaces::kNone);
    return hit.slot == ClosestFaces::kNone ? kNoFace : sample_.face(hit.slot) * kSampling;
  }

  std::uint32_t find_seed(std::uint32_t t) {
    constexpr double kWeights[3][3] = {{0.36, 0.31, 0.33}, {0.5, 0.2, 0.3}, {0.2, 0.55, 0.25}};
    const int n = outline_.corners;
    for (const auto& w : kWeights) {
      const Flat &a = outline_.at[0], &b = outline_.at[n / 3], &c = outline_.at[2 * n / 3];
      centre_ = {w[0] * a.x + w[1] * b.x + w[2] * c.x, w[0] * a.y + w[1] * b.y + w[2] * c.y};
      bool inside = true;
      for (int i = 0; i < n; ++i) inside = inside && beyond(i, centre_) > 4.0 * grown_;
      if (!inside) continue;
      for (const std::uint32_t v : coarse_.faces[t])
        if (start_[v] != kNoFace)
          if (const std::uint32_t f = walk(start_[v], centre_); f != kNoFace) return f;
      // As a rule a face beside was laid out before, and what lies over it is near.
      for (const std::uint32_t adjacent : across_coarse_[t])
        if (adjacent != kNoFace && seed_[adjacent >> 2] != kNoFace)
          if (const std::uint32_t f = walk(seed_[adjacent >> 2], centre_); f != kNoFace) return f;
      if (const std::uint32_t f = walk(nearby(), centre_); f != kNoFace) return f;
    }
    return kNoFace;
  }

  /// Does the segment meet the inside of the outline? May say so where it only comes near. What only touches
  /// a side leaves a strip of rounding's width.
  bool meets(const Point& p, const Point& q) const {
    if ((p.outside & q.outside) != 0 || (!needle_ && (p.touching & q.touching) != 0)) return false;
    if (p.outside == 0 || q.outside == 0) return true;
    const double dx = q.at.x - p.at.x, dy = q.at.y - p.at.y;
    const double slack = 2.0 * grown_ * (std::abs(dx) + std::abs(dy));
    bool left = false, right = false;
    for (int i = 0; i < outline_.corners; ++i) {
      const double side = dx * (outline_.at[i].y - p.at.y) - dy * (outline_.at[i].x - p.at.x);
      left = left || side > -slack;
      right = right || side < slack;
    }
    return left && right;
  }

  /// Largest height on the part of the segment over the outline; false where there is none.
  bool height_on(const Point& p, const Point& q, double& height) const {
    double from = 0.0, to = 1.0;
    for (unsigned bits = p.outside | q.outside; bits != 0; bits &= bits - 1) {
      const int i = std::countr_zero(bits);
      const double a = beyond(i, p.at) + grown_, b = beyond(i, q.at) + grown_;
      if (a < 0.0 && b < 0.0) return false;
      const double t = a / (a - b);
      if (a < 0.0)
        from = std::max(from, t);
      else
        to = std::min(to, t);
    }
    if (from > to) return false;
    height = std::max({height, std::abs(p.z + from * (q.z - p.z)), std::abs(p.z + to * (q.z - p.z))});
    return true;
  }

  /// Largest height of a face that lies partly over the outline; false where it does not at all.
  bool height_across(const Point* const* p, unsigned outside, double& height) const {
    bool overlaps = false;
    for (std::size_t i = 0; i < 3; ++i) {
      const Point &a = *p[i], &b = *p[i == 2 ? 0 : i + 1];
      if (a.outside == 0) height = std::max(height, std::abs(a.z)), overlaps = true;
      if ((a.outside | b.outside) != 0 && (a.outside & b.outside) == 0)
        overlaps = height_on(a, b, height) || overlaps;
    }
    // Corners of the outline over the face.
    if ((outside & (outside - 1)) == 0) return overlaps;  // beyond one side alone
    const double full = orient2d(p[0]->at, p[1]->at, p[2]->at), up = full < 0.0 ? -1.0 : 1.0;
    const double size = longest(p), slack = -4.0 * grown_ * size;
    for (int i = 0; i < outline_.corners; ++i) {
      const int before = i == 0 ? outline_.corners - 1 : i - 1;
      if ((outside >> i & 1u) == 0 || (outside >> before & 1u) == 0) continue;
      double w[3];
      bool inside = true;
      for (std::size_t c = 0; c < 3; ++c) {
        w[c] = up * orient2d(p[(c + 1) % 3]->at, p[(c + 2) % 3]->at, outline_.at[i]);
        inside = inside && w[c] >= slack;
      }
      if (!inside) continue;
      overlaps = true;
      if (std::abs(full) > 0x1p-10 * size * size) {
        const double z = (w[0] * p[0]->z + w[1] * p[1]->z + w[2] * p[2]->z) / (w[0] + w[1] + w[2]);
        height = std::max(height, std::abs(z));
      } else {  // a sliver's height there is not well determined
        for (std::size_t c = 0; c < 3; ++c) height = std::max(height, std::abs(p[c]->z));
      }
    }
    return overlaps;
  }

  void overlay_face(std::uint32_t t) {
    if (!lay_out(t)) {
      out_.coarse.bound[t] = 0.0f;
      return;
    }
    if (!solid_ || !lay_sides()) return;
    ++stamp_;
    point_count_ = 0;
    const std::uint32_t seed = seed_[t] = find_seed(t);
    if (seed == kNoFace) return;
    double height = 0.0;
    if (!cover(t, seed, height)) return;
    if (!(height <= limit_)) return;
    out_.coarse.bound[t] = rounded_up(height + rounding_);
    count(out_.coarse.report, area_);
  }

  /// Looks at all fine faces over the outline. \return whether they cover it
  bool cover(std::uint32_t t, std::uint32_t seed, double& height) {
    bool covered = true;
    const auto& s = fine_.faces[seed];
    const double up = orient2d(projected(s[0]).at, projected(s[1]).at, projected(s[2]).at) < 0.0 ? -1.0 : 1.0;
    stack_.assign(1, seed);
    state_[seed].stamp = stamp_;
    while (!stack_.empty()) {
      const std::uint32_t f = stack_.back();
      stack_.pop_back();
      const auto& v = fine_.faces[f];
      const Point* const p[3] = {&projected(v[0]), &projected(v[1]), &projected(v[2])};
      const double area = up * orient2d(p[0]->at, p[1]->at, p[2]->at);
      if (!(area > sure_area_) && !(area > 4.0 * grown_ * longest(p))) covered = covered && !near_centre(p);
      look_at(t, f, p, height);
      for (std::uint32_t i = 0; i < 3; ++i) {
        if (!meets(*p[i], *p[i == 2 ? 0 : i + 1])) continue;
        const std::uint32_t other = across_fine_[f][i];
        if (other == kNoFace) {
          covered = false;
        } else if (state_[other >> 2].stamp != stamp_) {
          state_[other >> 2].stamp = stamp_;
          stack_.push_back(other >> 2);
        }
      }
    }
    return covered;
  }

  static double longest(const Point* const* p) {
    double maximum = 0.0;
    for (std::size_t i = 0; i < 3; ++i) {
      const Flat &a = p[i]->at, &b = p[i == 2 ? 0 : i + 1]->at;
      maximum = std::max({maximum, std::abs(b.x - a.x), std::abs(b.y - a.y)});
    }
    return 1.5 * maximum;
  }

  /// Might the face count at the point where the covering is counted?
  bool near_centre(const Point* const* p) const {
    const auto [lx, hx] = std::minmax({p[0]->at.x, p[1]->at.x, p[2]->at.x});
    const auto [ly, hy] = std::minmax({p[0]->at.y, p[1]->at.y, p[2]->at.y});
    return centre_.x >= lx - grown_ && centre_.x <= hx + grown_ && centre_.y >= ly - grown_ &&
           centre_.y <= hy + grown_;
  }

  void look_at(std::uint32_t t, std::uint32_t f, const Point* const* p, double& height) {
    const unsigned outside = p[0]->outside | p[1]->outside | p[2]->outside;
    State& state = state_[f];
    double own = 0.0;
    if (outside == 0) {
      own = std::max({std::abs(p[0]->z), std::abs(p[1]->z), std::abs(p[2]->z)});
      state.bound = std::min(state.bound, rounded_up(own));
    } else if (!height_across(p, outside, own)) {
      return;
    } else if (fine_too_) {
      note_edge(t, f, p, outside, own);
      met_.push_back({t, state.met});
      state.met = static_cast<std::uint32_t>(met_.size() - 1);
    }
    height = std::max(height, own);
  }

  bool beyond_cuts_alone(unsigned outside) const {
    for (unsigned bits = outside; bits != 0; bits &= bits - 1)
      if (outline_.tag[static_cast<std::size_t>(std::countr_zero(bits))] != kCutSide) return false;
    return true;
  }

  /// The face reaches beyond the outline. Where only the margin cuts that off, what it has in the core lies
  /// over the outline. Where it reaches beyond the coarse face: together with the neighbour there it may be proven.
  void note_edge(std::uint32_t t, std::uint32_t f, const Point* const* p, unsigned outside, double height) {
    if (beyond_cuts_alone(outside) &&
        std::max({std::abs(p[0]->z), std::abs(p[1]->z), std::abs(p[2]->z)}) < margin_ * (1.0 - 0x1p-20)) {
      state_[f].bound = std::min(state_[f].bound, rounded_up(height));
      return;
    }
    if ((outside & (outside - 1)) != 0) return;
    const unsigned tag = outline_.tag[std::countr_zero(outside)];
    if (tag == kCutSide) return;
    unsigned corners = 0;
    for (unsigned i = 0; i < 3; ++i) corners |= p[i]->outside == 0 ? 1u << i : 0u;
    State& state = state_[f];
    const std::uint32_t here = 4 * t + tag;
    if (state.overlaps == kNoFace) {
      state.overlaps = here;
      state.height = rounded_up(height);
      state.corners = corners;
    } else if (across_coarse_[t][tag] == state.overlaps) {
      for (unsigned i = 0; i < 3; ++i) {
        if (((corners | state.corners) >> i & 1u) != 0) continue;
        const double off =
            beyond(std::countr_zero(outside), p[i]->at);  // over neither: as far as from the edge
        height = std::max(height, std::sqrt(off * off + p[i]->z * p[i]->z));
      }
      state.bound = std::min(state.bound, std::max(state.height, rounded_up(height)));
    }
  }

  static void count(DeviationReport& report, double area) {
    report.area += area;
    ++report.faces;
    ++report.pieces;
  }

  float bound_by_near(const std::array<Double3, 3>& corner, std::uint32_t met) {
    std::array<std::uint32_t, NearProof::kMaxNear> near;
    std::size_t count = 0;
    for (; met != kNoFace && count < near.size(); met = met_[met].before) near[count++] = met_[met].coarse;
    if (count < 2) return kOpen;  // what lies over one alone was told from heights
    if (!near_) near_.emplace(coarse_, origin_);
    return rounded_up(near_->bound(corner, {near.data(), count}, limit_));
  }

  /// Faces in the core or across its boundary whose bound is known are proven.
  void finish_fine(std::uint32_t f) {
    const auto& v = fine_.faces[f];
    bool inside = true, meets = true;
    if (core_ != nullptr) {
      const unsigned s = sides_[v[0]], t = sides_[v[1]], u = sides_[v[2]];
      inside = (s | t | u) == 0;
      meets = (s & t & u) == 0;
    }
    if (!meets) {
      out_.fine.bound[f] = 0.0f;
      return;
    }
    State& state = state_[f];
    const Double3 p[3] = {vertices_[v[0]].at, vertices_[v[1]].at, vertices_[v[2]].at};
    if (!(static_cast<double>(state.bound) <= limit_))
      state.bound = bound_by_near({p[0], p[1], p[2]}, state.met);
    if (!(static_cast<double>(state.bound) <= limit_)) return;
    const double area =
        inside ? 0.5 * norm(cross(p[1] - p[0], p[2] - p[0])) : area_in_box(p, *core_, origin_);
    out_.fine.bound[f] = rounded_up(static_cast<double>(state.bound) + rounding_);
    count(out_.fine.report, area);
  }

  const SurfaceFaces& coarse_;
  const SurfaceFaces& fine_;
  const Box3* core_;
  const double margin_;
  const Double3 origin_;
  const bool fine_too_;
  double largest_ = 0.0, rounding_ = 0.0, grown_ = 0.0, limit_ = 0.0;
  double sure_area_ = 0.0;  ///< twice: above it no face is a sliver that rounding could turn
  std::vector<Vertex> vertices_;
  std::vector<std::uint8_t> sides_;  ///< per fine vertex: of the core, beyond which it lies
  std::vector<Across> across_fine_, across_coarse_;
  std::vector<State> state_;
  std::vector<std::uint32_t> start_;  ///< per coarse vertex: a fine face there, or kNoFace
  std::vector<std::uint32_t> seed_;   ///< per coarse face: the fine face over its centre, or kNoFace
  ClosestFaces sample_;
  std::vector<Met> met_;
  std::optional<NearProof> near_;
  OverlayProof out_;
  // Of the coarse face at hand.
  std::uint32_t stamp_ = 0;
  std::unique_ptr<Point[]> points_;  ///< room for all fine vertices, of which few are touched
  std::uint32_t point_count_ = 0;
  std::vector<std::uint32_t> stack_;
  Double3 base_{}, ex_{}, ey_{}, normal_{};
  std::array<Flat, 3> corner_{};
  Outline outline_;
  std::array<std::array<double, 3>, kMaxSides> side_{};
  Flat centre_{};
  double area_ = 0.0;  ///< in the core
  bool whole_ = false, solid_ = false;
  bool needle_ = false;  ///< with an angle so small that rounding matters at its tip
};

}  // namespace

OverlayProof prove_by_overlay(const SurfaceFaces& coarse, const SurfaceFaces& fine, const Box3* core,
                              double margin, const Double3& origin, const CertificateOptions& options,
                              bool fine_too) {
  return Overlay(coarse, fine, core, margin, origin, options, fine_too).run();
}

}  // namespace tessera
