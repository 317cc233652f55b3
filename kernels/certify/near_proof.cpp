#include "kernels/certify/near_proof.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr int kMaxPieceCuts = 24, kMaxPieces = 48;

}  // namespace

NearProof::NearProof(const SurfaceFaces& other, const Double3& origin)
    : index_(other.position, other.faces, origin), slot_of_(other.faces.size()) {
  // The last face fills its leaf: its first slot will do.
  for (std::size_t slot = other.faces.size(); slot-- > 0;)
    slot_of_[index_.face(static_cast<std::uint32_t>(slot))] = static_cast<std::uint32_t>(slot);
}

double NearProof::bound(const std::array<Double3, 3>& corner, std::span<const std::uint32_t> near,
                        double limit) {
  count_ = 0;
  for (const std::uint32_t face : near) slots_[count_++] = slot_of_[face];
  normal_ = cross(corner[1] - corner[0], corner[2] - corner[0]);
  const double size = norm(normal_), limit2 = limit * limit;
  normal_ = normal_ * (size > 0.0 ? 1.0 / size : 0.0);
  stack_.resize(1);
  ConvexPiece& whole = stack_.front();
  whole.corners = whole.cuts = 0;
  for (const Double3& p : corner) whole.add(p);
  whole.close();
  double worst = 0.0;
  for (int pieces = 0; !stack_.empty(); ++pieces) {
    if (pieces == kMaxPieces) return kUnbounded;
    const ConvexPiece piece = stack_.back();
    stack_.pop_back();
    double square = 0.0;
    if (!prove(piece, limit2, square)) return kUnbounded;
    worst = std::max(worst, square);
  }
  return std::sqrt(worst);
}

/// Proves a piece, `square` is of its bound then, or lays two in its place. \return false where neither works
bool NearProof::prove(const ConvexPiece& piece, double limit2, double& square) {
  alignas(32) double squares[kMaxNear][kPieceColumn];
  double minimum = kUnbounded;
  std::size_t centre = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    index_.squares_to(slots_[i], piece.x, piece.y, piece.z, piece.corners + 1, squares[i]);
    minimum = std::min(minimum, *std::max_element(squares[i], squares[i] + piece.corners));
    if (squares[i][piece.corners] < squares[centre][piece.corners]) centre = i;
  }
  if (minimum <= limit2) {
    square = minimum;
    return true;
  }
  const double* from_centre = squares[centre];
  const auto worst = std::max_element(from_centre, from_centre + piece.corners) - from_centre;
  std::size_t other = centre;
  for (std::size_t i = 0; i < count_; ++i)
    if (squares[i][worst] < squares[other][worst]) other = i;
  // Some point is too far from all that are given, or two have the same side.
  if (from_centre[piece.corners] > limit2 || squares[other][worst] > limit2) return false;
  if (piece.cuts == kMaxPieceCuts || piece.corners > kMaxCorners - 2) return false;
  const Double3 middle = piece.centroid(), far = piece.at(static_cast<int>(worst));
  const std::array<Double3, 3> t = index_.corners(slots_[centre]);
  CutPlane plane;
  ConvexPiece inside, outside;
  const bool done = (side_plane(t, normal_, middle, far, plane) && cut(piece, plane, inside, outside)) ||
                    (other != centre && bisector(t, middle, index_.corners(slots_[other]), far, plane) &&
                     cut(piece, plane, inside, outside));
  if (!done) return false;
  stack_.push_back(outside);
  stack_.push_back(inside);
  return true;
}

}  // namespace tessera
