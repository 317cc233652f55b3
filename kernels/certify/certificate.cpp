// Pieces are convex polygons in columns, so that all corners and the centroid are measured against one
// triangle in a few vector operations:
//
//        a___________b          T is cut where the closest triangle changes: the sides of F1 seen along the
//        |  F1 \ F2 |           normal of T. A piece that lies over one triangle alone is done at once.
//        |______\___|  T
#include "kernels/certify/certificate.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>

#include "kernels/certify/convex_piece.h"
#include "kernels/certify/distance_samples.h"
#include "octree/portable_math.h"
#include "octree/rounding.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr std::uint64_t kQueriesPerCheck = 256;
constexpr std::size_t kRecent = 4096;
constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kNone = ClosestFaces::kNone;
using Piece = ConvexPiece;
constexpr int kMaxCuts = 160;          // in a row; derived into certificate_rounding
constexpr int kFreeCuts = 24;          // after so many in a row every third is across the longest diagonal
constexpr double kMinPiece = 0x1p-13;  // of the tolerance: smaller pieces are bounded by their radius
constexpr double kPhase = 0.25;  // the first target is this share of the tolerance, then its square, ...

/// Halves with fewer corners: along the diagonal from corner 0, so that no new corner is made.
void cut_diagonal(const Piece& piece, Piece& first, Piece& second) {
  const int middle = piece.corners / 2;
  first.corners = second.corners = 0;
  first.cuts = second.cuts = piece.cuts;
  first.hint = second.hint = piece.hint;
  for (int i = 0; i <= middle; ++i) first.add(piece.at(i));
  for (int i = middle; i < piece.corners; ++i) second.add(piece.at(i));
  second.add(piece.at(0));
  first.close();
  second.close();
}

/// Area, or length of a segment.
double measure(const Piece& piece) {
  if (piece.corners == 2) return norm(piece.at(1) - piece.at(0));
  Double3 sum{};
  const Double3 a = piece.at(0);
  for (int i = 1; i + 1 < piece.corners; ++i) {
    const Double3 c = cross(piece.at(i) - a, piece.at(i + 1) - a);
    for (std::size_t k = 0; k < 3; ++k) sum[k] += c[k];
  }
  return 0.5 * norm(sum);
}

class Certifier {
 public:
  Certifier(const SurfaceFaces& surface, const Box3* core, const ClosestFaces& reference,
            const CertificateOptions& options)
      : surface_(surface),
        reference_(reference),
        options_(options),
        core_(core),
        max_square_(options.max_distance * options.max_distance),
        hit_(surface.position.size()) {
    for (std::size_t k = 0; k < 3; ++k) {
      low_[k] = core ? core->low[k] - reference.origin()[k] : -kInfinite;
      high_[k] = core ? core->high[k] - reference.origin()[k] : kInfinite;
    }
  }

  DeviationReport run(std::vector<float>* face_bound) {
    std::vector<float> own;
    std::vector<float>& bound = face_bound ? *face_bound : own;
    bound.assign(surface_.faces.size(), 0.0f);
    sample_corners();
    // A bound that is right at the tolerance would come out above it.
    const double rounding = certificate_rounding(std::max(reference_.largest_coordinate(), largest_));
    provable_ = bound_within(options_.tolerance, rounding);
    counting_ = true;
    const double minimum = std::max(kMinTarget * options_.tolerance, options_.enough);
    floor_ = std::max(kPhase * options_.tolerance, minimum);
    for (std::size_t i = 0; i < bound.size(); ++i) bound[i] = bound_face(i);
    counting_ = false;
    if (options_.samples > 0)
      measure_samples(spread_samples(surface_, core_, samples_of(options_, bound.size(), reference_.size())),
                      !bound.empty() && surface_.faces[0][1] == surface_.faces[0][2], reference_, options_,
                      report_);
    while (options_.tightness * report_.lower < floor_ && floor_ > minimum) {
      floor_ = std::max(kPhase * floor_, minimum);
      const double target = this->target(true);
      for (std::size_t i = 0; i < bound.size(); ++i)
        if (static_cast<double>(bound[i]) > target && std::isfinite(bound[i]))
          bound[i] = std::min(bound[i], bound_face(i));
    }
    double upper = 0.0;
    for (float& b : bound) {
      upper = std::max(upper, static_cast<double>(b));
      b = rounded_up(static_cast<double>(b) + rounding);
      if (!(static_cast<double>(b) <= options_.tolerance)) ++report_.faces_exceeding;
    }
    report_.upper = report_.faces == 0 ? 0.0 : upper + rounding;
    return report_;
  }

 private:
  Double3 local(std::uint32_t vertex) const { return surface_.position[vertex] - reference_.origin(); }
  bool in_core(const Double3& p) const {
    return p[0] >= low_[0] && p[0] <= high_[0] && p[1] >= low_[1] && p[1] <= high_[1] && p[2] >= low_[2] &&
           p[2] <= high_[2];
  }

  /// Does the face's box meet the core?
  bool near_core(const std::array<std::uint32_t, 3>& face) const {
    if (core_ == nullptr) return true;
    const Double3 &a = surface_.position[face[0]], &b = surface_.position[face[1]],
                  &c = surface_.position[face[2]];
    bool meets = true;
    for (std::size_t k = 0; k < 3; ++k)
      meets = meets && std::min({a[k], b[k], c[k]}) <= core_->high[k] &&
              std::max({a[k], b[k], c[k]}) >= core_->low[k];
    return meets;
  }

  /// What a piece must be proven to stay within: the tolerance at most, unless it is known to exceed it.
  double target(bool exceeds) const {
    const double wanted = std::max(options_.tightness * report_.lower, floor_);
    return exceeds ? wanted : std::min(wanted, provable_);
  }

  void found(double distance, const Double3& p) {
    if (distance <= report_.lower) return;
    report_.lower = distance;
    for (std::size_t k = 0; k < 3; ++k) report_.witness[k] = p[k] + reference_.origin()[k];
    report_.witness_face = face_;
  }

  /// Closest triangle within reach; a point of the core that has none is beyond.
  ClosestFaces::Hit query(const Double3& p, std::uint32_t hint) {
    if (report_.queries++ % kQueriesPerCheck == 0 && options_.check_stop) options_.check_stop();
    return reference_.closest(p, max_square_, hint);
  }

  /// Closest triangles of all corners: hints for the pieces, and a first idea of the largest distance.
  void sample_corners() {
    std::vector<bool> seen(surface_.position.size());
    // Meshes that are not manifold were split into as many vertices at one place as there are sheets, close to each other.
    std::vector<std::uint32_t> recent(kRecent, kNone);
    std::uint32_t hint = kNone;
    for (face_ = 0; face_ < surface_.faces.size(); ++face_) {
      if (!near_core(surface_.faces[face_])) continue;
      for (const std::uint32_t v : surface_.faces[face_]) {
        if (seen[v]) continue;
        seen[v] = true;
        std::uint32_t& same = recent[place(surface_.position[v])];
        if (same != kNone && surface_.position[same] == surface_.position[v]) {
          hit_[v] = hit_[same];
          continue;
        }
        same = v;
        const Double3 p = local(v);
        for (const double c : p) largest_ = std::max(largest_, std::abs(c));
        const ClosestFaces::Hit hit = query(p, hint);
        hit_[v] = hit.slot;
        if (hit.slot != kNone) hint = hit.slot;
        if (in_core(p)) found(hit.slot == kNone ? options_.max_distance : std::sqrt(hit.square), p);
      }
    }
  }

  /// Where `recent` of sample_corners() keeps a vertex.
  static std::size_t place(const Double3& p) {
    std::uint64_t bits = 0;
    for (const double x : p) bits = mix(bits ^ std::bit_cast<std::uint64_t>(x));
    return bits % kRecent;
  }

  float bound_face(std::size_t index) {
    const auto& face = surface_.faces[index];
    if (!near_core(face)) return 0.0f;
    face_ = static_cast<std::uint32_t>(index);
    bound_ = 0.0;
    Piece& piece = fresh();
    piece.cuts = 0;
    piece.corners = 0;
    piece.hint = kNone;
    std::array<Double3, 3> corner{};
    bool whole = true;
    for (std::size_t c = 0; c < 3; ++c) {
      corner[c] = local(face[c]);
      whole = whole && in_core(corner[c]);
      if (c < 2 || face[1] != face[2]) piece.add(corner[c]);
      if (piece.hint == kNone) piece.hint = hit_[face[c]];
    }
    piece.close();
    normal_ = cross(corner[1] - corner[0], corner[2] - corner[0]);
    const double size = norm(normal_);
    normal_ = normal_ * (size > 0.0 ? 1.0 / size : 0.0);
    if (!whole && !clip_to_core()) {
      stack_.pop_back();
      return 0.0f;
    }
    if (counting_) ++report_.faces;
    if (whole && try_corners(face)) return rounded_up(bound_);
    while (!stack_.empty()) bound_piece();
    return rounded_up(bound_);
  }

  Piece& fresh() { return stack_.emplace_back(); }

  /// The part of the piece on top that lies in the core; false when there is none.
  bool clip_to_core() {
    for (std::size_t k = 0; k < 3; ++k)
      for (const bool upper : {false, true}) {
        CutPlane plane;
        plane.normal[k] = upper ? 1.0 : -1.0;
        plane.offset = upper ? high_[k] : -low_[k];
        Piece inside, outside;
        if (cut(stack_.back(), plane, inside, outside)) {
          stack_.back() = inside;
        } else if (plane.height(stack_.back().centroid()) > 0.0) {
          return false;
        }
      }
    return true;
  }

  /// Largest squared distance of the corners to one triangle.
  double worst_square(const Piece& piece, std::uint32_t slot) {
    alignas(32) double square[kPieceColumn];
    reference_.squares_to(slot, piece.x, piece.y, piece.z, piece.corners, square);
    worst_ = 0;
    for (int i = 1; i < piece.corners; ++i)
      if (square[i] > square[worst_]) worst_ = i;
    return square[worst_];
  }

  /// Is the face within the target of the triangle closest to one of its corners? Then it is done.
  bool try_corners(const std::array<std::uint32_t, 3>& face) {
    const double target = this->target(false);
    std::uint32_t best = kNone;
    double best_square = kInfinite;
    std::uint32_t last = kNone;
    for (const std::uint32_t v : face) {
      const std::uint32_t slot = hit_[v];
      if (slot == kNone || slot == last) continue;
      last = slot;
      const double square = worst_square(stack_.back(), slot);
      if (square >= best_square) continue;
      best_square = square;
      best = slot;
    }
    if (best == kNone) return false;
    stack_.back().hint = best;
    if (best_square > target * target) return false;
    accept(stack_.back(), std::sqrt(best_square));
    stack_.pop_back();
    return true;
  }

  void count(const Piece& piece) {
    if (!counting_) return;
    report_.area += measure(piece);
    ++report_.pieces;
  }

  /// \param bound  of all its points
  void accept(const Piece& piece, double bound) {
    bound_ = std::max(bound_, bound);
    count(piece);
  }

  void give_up(const Piece& piece, const Double3& where) {
    report_.beyond = true;
    found(options_.max_distance, where);
    bound_ = kInfinite;
    count(piece);
  }

  /// Proves the piece on top, or cuts it in two.
  void bound_piece() {
    const Piece piece = stack_.back();
    stack_.pop_back();
    if (piece.corners > kMaxCorners - 2) {
      Piece first, second;
      cut_diagonal(piece, first, second);
      stack_.push_back(second);
      stack_.push_back(first);
      return;
    }
    bool exceeds = false;
    const auto within = [&](double square) {
      const double t = target(exceeds);
      return square <= t * t;
    };
    double square = kInfinite;
    if (piece.hint != kNone) {
      square = worst_square(piece, piece.hint);
      if (within(square)) return accept(piece, std::sqrt(square));
    }
    const Double3 middle = piece.centroid();
    const ClosestFaces::Hit centre = query(middle, piece.hint);
    if (centre.slot == kNone) return give_up(piece, middle);
    found(std::sqrt(centre.square), middle);
    const double tolerance_square = options_.tolerance * options_.tolerance;
    exceeds = centre.square > tolerance_square;
    if (centre.slot != piece.hint) square = worst_square(piece, centre.slot);
    const int worst = worst_;
    if (within(square)) return accept(piece, std::sqrt(square));
    double radius_square = 0.0;
    for (int i = 0; i < piece.corners; ++i) {
      const Double3 d = piece.at(i) - middle;
      radius_square = std::max(radius_square, dot(d, d));
    }
    const double lipschitz = std::sqrt(centre.square) + std::sqrt(radius_square);
    if (within(lipschitz * lipschitz)) return accept(piece, lipschitz);
    const ClosestFaces::Hit corner = query(piece.at(worst), centre.slot);
    if (corner.slot == kNone) return give_up(piece, piece.at(worst));
    found(std::sqrt(corner.square), piece.at(worst));
    exceeds = exceeds || corner.square > tolerance_square;
    const double minimum = kMinPiece * options_.tolerance;
    if (within(square) || piece.cuts >= kMaxCuts - 1 || radius_square <= minimum * minimum)
      return accept(piece, std::min(std::sqrt(square), lipschitz));
    split(piece, centre.slot, corner.slot, worst);
  }

  void push(Piece& inside, std::uint32_t near_inside, Piece& outside, std::uint32_t near_outside) {
    inside.hint = near_inside;
    outside.hint = near_outside;
    stack_.push_back(outside);
    stack_.push_back(inside);
  }

  void split(const Piece& piece, std::uint32_t near_centre, std::uint32_t near_worst, int worst) {
    // Now and then surely smaller: across the longest diagonal, whatever the triangles are.
    const bool bisect = piece.cuts >= kFreeCuts && piece.cuts % 3 == 0;
    const Double3 centre = piece.centroid();
    Double3 far = piece.at(worst);
    Piece inside, outside;
    CutPlane plane;
    if (!bisect) {
      if (side_plane(reference_.corners(near_centre), normal_, centre, far, plane) &&
          cut(piece, plane, inside, outside))
        return push(inside, near_centre, outside, near_worst);
      if (near_centre != near_worst &&
          bisector(reference_.corners(near_centre), centre, reference_.corners(near_worst), far, plane) &&
          cut(piece, plane, inside, outside))
        return push(inside, near_centre, outside, near_worst);
    } else {
      double maximum = 0.0;
      for (int i = 0; i < piece.corners; ++i) {
        const Double3 d = piece.at(i) - centre;
        if (dot(d, d) > maximum) maximum = dot(d, d), far = piece.at(i);
      }
    }
    plane.normal = far - centre;
    const double size = norm(plane.normal);
    if (size > 0.0) {
      plane.normal = plane.normal * (1.0 / size);
      plane.offset =
          bisect ? dot(plane.normal, centre) : 0.5 * (dot(plane.normal, far) + dot(plane.normal, centre));
      if (cut(piece, plane, inside, outside)) return push(inside, near_centre, outside, near_worst);
    }
    // As small as numbers get: bounded by what is known.
    accept(piece, std::sqrt(worst_square(piece, near_centre)));
  }

  const SurfaceFaces& surface_;
  const ClosestFaces& reference_;
  const CertificateOptions& options_;
  const Box3* core_;
  const double max_square_;
  std::vector<std::uint32_t> hit_;  ///< per vertex: slot of the closest triangle
  std::vector<Piece> stack_;
  DeviationReport report_;
  Double3 low_{}, high_{};
  Double3 normal_{};  ///< of the face
  std::uint32_t face_ = 0;
  double bound_ = 0.0;     ///< of the face so far
  double floor_ = 0.0;     ///< no piece needs a bound below
  double provable_ = 0.0;  ///< the largest bound that stays within the tolerance when it is rounded up
  double largest_ = 0.0;   ///< coordinate
  int worst_ = 0;
  bool counting_ = false;  ///< the first phase fills the report
};

}  // namespace

double DeviationReport::rms() const {
  return area > 0.0 ? std::sqrt(square_integral / area) : 0.0;
}

void DeviationReport::merge(const DeviationReport& other) {
  upper = std::max(upper, other.upper);
  if (other.lower > lower) {
    lower = other.lower;
    witness = other.witness;
    witness_face = other.witness_face;
  }
  beyond = beyond || other.beyond;
  faces += other.faces;
  faces_exceeding += other.faces_exceeding;
  area += other.area;
  samples += other.samples;
  square_integral += other.square_integral;
  for (std::size_t i = 0; i < histogram.size(); ++i) histogram[i] += other.histogram[i];
  pieces += other.pieces;
  queries += other.queries;
}

DeviationReport certify_deviation(const SurfaceFaces& surface, const Box3* core,
                                  const ClosestFaces& reference, const CertificateOptions& options,
                                  std::vector<float>* face_bound) {
  assert(options.tolerance > 0.0 && options.max_distance >= options.tolerance && options.tightness > 1.0);
  assert(options.area_unit > 0.0);
  return Certifier(surface, core, reference, options).run(face_bound);
}

}  // namespace tessera
