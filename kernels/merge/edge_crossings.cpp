#include "kernels/merge/edge_crossings.h"

#include <algorithm>
#include <cmath>

#include "kernels/mesh/triangle_foot.h"
#include "octree/lanes.h"

namespace tessera {
namespace {

constexpr double kOtherSheet = 1.0;  ///< of its length: edges so far above a new one do not cross it
constexpr double kSureArea = 1e-11;  ///< of the square of how far they reach

}  // namespace

void EdgeCrossings::load(const Double3& u, const Double3& v, const std::vector<FrontEdge>& edges,
                         const std::vector<std::uint32_t>& near) {
  near_.clear();
  if (near.size() > kFirst) {
    // What lies before an edge is in the way of most that is behind: it comes first.
    const Double3 middle = (u + v) * 0.5;
    by_distance_.clear();
    for (const std::uint32_t at : near) {
      const Double3 &c = position_[edges[at].from], &d = position_[edges[at].to];
      by_distance_.emplace_back(squared_distance(middle, foot_in_triangle(middle, c, d, d).at), at);
    }
    std::nth_element(by_distance_.begin(), by_distance_.begin() + kFirst, by_distance_.end());
    for (const auto& [square, at] : by_distance_) near_.push_back(edges[at]);
  } else {
    for (const std::uint32_t at : near) near_.push_back(edges[at]);
  }
  const std::size_t padded = (near_.size() + kDoubleLanes - 1) / kDoubleLanes * kDoubleLanes;
  double reach = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    from_[k].assign(padded, 0.0), to_[k].assign(padded, 0.0);
    for (std::size_t i = 0; i < near_.size(); ++i) {
      from_[k][i] = position_[near_[i].from][k] - u[k];
      to_[k][i] = position_[near_[i].to][k] - u[k];
      reach = std::max({reach, std::fabs(from_[k][i]), std::fabs(to_[k][i])});
    }
  }
  viewpoint_ = u;
  sure_area_ = kSureArea * reach * reach;
}

bool EdgeCrossings::crosses_any(std::uint32_t p, std::uint32_t q, const Double3& n) const {
  const Double3 a = position_[p] - viewpoint_, b = position_[q] - viewpoint_, across = cross(n, b - a);
  const Double4 far = sure_area_ + Double4{};
  for (std::size_t i = 0; i < near_.size(); i += kDoubleLanes) {
    const Double4 cx = load4(&from_[0][i]), cy = load4(&from_[1][i]), cz = load4(&from_[2][i]);
    const Double4 dx = load4(&to_[0][i]), dy = load4(&to_[1][i]), dz = load4(&to_[2][i]);
    // Doubled areas of (a, b, c) and (a, b, d), then of (c, d, a) and (c, d, b).
    const Double4 abc = across[0] * (cx - a[0]) + across[1] * (cy - a[1]) + across[2] * (cz - a[2]),
                  abd = across[0] * (dx - a[0]) + across[1] * (dy - a[1]) + across[2] * (dz - a[2]);
    const Double4 ex = dx - cx, ey = dy - cy, ez = dz - cz;
    const Double4 x = n[1] * ez - n[2] * ey, y = n[2] * ex - n[0] * ez, z = n[0] * ey - n[1] * ex;
    const Double4 cda = x * (a[0] - cx) + y * (a[1] - cy) + z * (a[2] - cz),
                  cdb = x * (b[0] - cx) + y * (b[1] - cy) + z * (b[2] - cz);
    const Mask4 apart = ((abc > far) & (abd > far)) | ((abc < -far) & (abd < -far)) |
                        ((cda > far) & (cdb > far)) | ((cda < -far) & (cdb < -far));
    const unsigned bits = bits_of(apart);
    for (unsigned left = ~bits & 0xfu; left != 0; left &= left - 1) {
      const std::size_t at = i + static_cast<std::size_t>(__builtin_ctz(left));
      if (at < near_.size() && crosses(p, q, n, near_[at])) return true;
    }
  }
  return false;
}

bool EdgeCrossings::crosses(std::uint32_t p, std::uint32_t q, const Double3& n, const FrontEdge& e) const {
  if (e.from == p || e.from == q || e.to == p || e.to == q) return false;
  const Double3 &a = position_[p], &b = position_[q], &c = position_[e.from], &d = position_[e.to];
  const auto side = [&](const Double3& x, const Double3& y, const Double3& z) {
    return dot(cross(y - x, z - x), n);
  };
  if (side(a, b, c) * side(a, b, d) > 0.0 || side(c, d, a) * side(c, d, b) > 0.0) return false;
  return std::fabs(dot((c + d) * 0.5 - (a + b) * 0.5, n)) <= kOtherSheet * (norm(b - a) + norm(d - c));
}

}  // namespace tessera
