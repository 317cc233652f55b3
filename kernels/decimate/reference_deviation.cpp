#include "kernels/decimate/reference_deviation.h"

#include <immintrin.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace tessera {
namespace {

constexpr float cross2(float ax, float ay, float bx, float by) {
  return ax * by - ay * bx;
}
constexpr double cross2(double ax, double ay, double bx, double by) {
  return ax * by - ay * bx;
}

/// How far a corner must be moved to turn a triangle so that this counts, as a share of how wide triangles are there.
constexpr float kNoise = 1.0f / 32.0f;

/// The bound of a face shares a word with the flags of its edges: rounded up to the bits that they leave.
constexpr std::uint32_t kFlagBits = 8;
std::uint32_t packed_above(float bound) {
  constexpr std::uint32_t kLow = (1u << kFlagBits) - 1;
  return (std::bit_cast<std::uint32_t>(bound) + kLow) & ~kLow;
}
float unpacked(std::uint32_t lines) {
  return std::bit_cast<float>(lines >> kFlagBits << kFlagBits);
}

// Without the care of fmax for what is not a number, which costs a call.
template <class T>
constexpr T larger(T a, T b) {
  return a < b ? b : a;
}
template <class T>
constexpr T smaller(T a, T b) {
  return b < a ? b : a;
}

}  // namespace

ReferenceDeviation::ReferenceDeviation(const CollapseMesh& reference, bool normals) {
  faces_.resize(reference.faces().size());
  for (std::size_t f = 0; f < faces_.size(); ++f) {
    const CollapseFace& from = reference.face(f);
    faces_[f] = {{from.vertex[0], from.vertex[1], from.vertex[2]},
                 0,
                 {from.opposite[0], from.opposite[1], from.opposite[2]},
                 (from.state & (7u * kStateBorder | 7u * kStateCrease)) | packed_above(from.bound)};
  }
  vertices_.resize(reference.vertices());
  corner_.resize(reference.vertices());
  for (std::uint32_t v = 0; v < vertices_.size(); ++v) {
    vertices_[v] = {reference.at(v), 0, 0};
    corner_[v] = reference.corner(v);
  }
  points_.reserve(1024);
  steps_.reserve(1024);
  if (!normals) return;
  width_.resize(vertices_.size(), 0.0f);
  for (const Face& f : faces_) {
    const Double3 a = vertices_[f.vertex[0]].at, b = vertices_[f.vertex[1]].at - a,
                  c = vertices_[f.vertex[2]].at - a;
    const double longest2 = larger(larger(dot(b, b), dot(c, c)), dot(c - b, c - b));
    if (!(longest2 > 0.0)) continue;
    const auto height = static_cast<float>(norm(cross(b, c)) / std::sqrt(longest2));
    for (const std::uint32_t v : f.vertex) width_[v] = larger(width_[v], height);
  }
}

bool ReferenceDeviation::set_polygon(const LinkLoop& loop, bool inner_centre) {
  size_ = loop.size;
  if (size_ < (inner_centre ? 4u : 3u) || size_ >= kPadded) return false;
  closes_to_ = inner_centre ? 1 : 0;
  Double3 area{0, 0, 0};
  for (std::size_t i = 1; i < size_; ++i) area = area + cross(loop.at[i], loop.at[following(i)]);
  const double length2 = dot(area, area);
  if (!(length2 > 0.0)) return false;
  n_ = area * (1.0 / std::sqrt(length2));
  ex_ = any_orthogonal(n_);
  ey_ = cross(n_, ex_);
  frame_ = {static_cast<float>(ex_[0]), static_cast<float>(ey_[0]), static_cast<float>(n_[0]), 0.0f,
            static_cast<float>(ex_[1]), static_cast<float>(ey_[1]), static_cast<float>(n_[1]), 0.0f,
            static_cast<float>(ex_[2]), static_cast<float>(ey_[2]), static_cast<float>(n_[2]), 0.0f};
  std::array<double, kPadded> x, y, z;
  double radius = 0.0;
  int flips = 0;
  for (std::size_t i = 0; i < size_; ++i) {
    x[i] = dot(loop.at[i], ex_);
    y[i] = dot(loop.at[i], ey_);
    z[i] = dot(loop.at[i], n_);
    radius = larger(radius, larger(larger(std::fabs(x[i]), std::fabs(y[i])), std::fabs(z[i])));
  }
  for (std::size_t i = 0; i < size_; ++i) {
    const std::size_t j = following(i);
    x_[i] = static_cast<float>(x[i]), y_[i] = static_cast<float>(y[i]), z_[i] = static_cast<float>(z[i]);
    edge_x_[i] = static_cast<float>(x[j] - x[i]);
    edge_y_[i] = static_cast<float>(y[j] - y[i]);
    edge_c_[i] = static_cast<float>(cross2(x[j] - x[i], y[j] - y[i], x[i], y[i]));
    edge_z_[i] = static_cast<float>(z[j] - z[i]);
    // A point on the rim is outside: what only touches the polygon does not count.
    edge_c_[i] +=
        8.0f * 0x1p-24f * static_cast<float>(radius) * (std::fabs(edge_x_[i]) + std::fabs(edge_y_[i]));
    if (i == 0 && inner_centre)
      edge_x_[0] = edge_y_[0] = edge_z_[0] = edge_c_[0] = 0.0f;  // left of it is everything
    if (i == 0 || j == 0) continue;
    // z = sx x + sy y through the origin and both corners.
    const double full = cross2(x[i], y[i], x[j], y[j]);
    if (inner_centre) {
      if (!(full > 0.0)) return false;
      flips += y[i] < 0.0 && y[j] >= 0.0;
    }
    slope_x_[i] = static_cast<float>((z[i] * y[j] - z[j] * y[i]) / full);
    slope_y_[i] = static_cast<float>((z[j] * x[i] - z[i] * x[j]) / full);
    face_cosine_[i] = 1.0f / std::sqrt(1.0f + slope_x_[i] * slope_x_[i] + slope_y_[i] * slope_y_[i]);
  }
  groups_ = (size_ + kLanes - 1) / kLanes;
  all_ = (std::uint64_t{1} << size_) - 1;
  sectors_ = all_ & ~std::uint64_t{1};
  inner_spokes_ = sectors_;
  if (inner_centre && flips != 1) return false;
  if (!inner_centre) {
    sectors_ &= ~(std::uint64_t{1} << (size_ - 1));
    inner_spokes_ = sectors_ & ~std::uint64_t{2};
  }
  radius_ = static_cast<float>(radius);
  return true;
}

inline void ReferenceDeviation::classify(Point& p) const {
  const __m256 px = _mm256_set1_ps(p.x), py = _mm256_set1_ps(p.y), zero = _mm256_setzero_ps();
  p.spokes = p.links = 0;
  for (std::size_t g = 0; g < groups_; ++g) {
    const std::size_t at = g * kLanes;
    const __m256 spoke =
        _mm256_sub_ps(_mm256_mul_ps(_mm256_load_ps(&x_[at]), py), _mm256_mul_ps(_mm256_load_ps(&y_[at]), px));
    const __m256 link = _mm256_sub_ps(_mm256_sub_ps(_mm256_mul_ps(_mm256_load_ps(&edge_x_[at]), py),
                                                    _mm256_mul_ps(_mm256_load_ps(&edge_y_[at]), px)),
                                      _mm256_load_ps(&edge_c_[at]));
    p.spokes |= static_cast<std::uint64_t>(_mm256_movemask_ps(_mm256_cmp_ps(spoke, zero, _CMP_GE_OQ))) << at;
    p.links |= static_cast<std::uint64_t>(_mm256_movemask_ps(_mm256_cmp_ps(link, zero, _CMP_GE_OQ))) << at;
  }
  p.spokes &= all_;
  p.links &= all_;
  const std::uint64_t sector = sector_bits(p);
  p.inside = sector != 0;
  p.sector = p.inside ? static_cast<std::uint8_t>(std::countr_zero(sector)) : std::uint8_t{0};
}

/// \return false above the limit
inline bool ReferenceDeviation::place(std::uint32_t vertex, std::uint32_t& slot) {
  Vertex& v = vertices_[vertex];
  if (v.stamp == stamp_) {
    slot = v.slot;
    return true;
  }
  v.stamp = stamp_;
  slot = v.slot = static_cast<std::uint32_t>(points_.size());
  // The fourth lane holds the stamp: cleared, or its bits would count as a subnormal number.
  const __m256d r = _mm256_sub_pd(_mm256_blend_pd(_mm256_load_pd(&v.at[0]), _mm256_setzero_pd(), 8),
                                  _mm256_set_pd(0.0, origin_[2], origin_[1], origin_[0]));
  const __m128 f = _mm256_cvtpd_ps(r);
  const __m128 x = _mm_mul_ps(_mm_shuffle_ps(f, f, 0x00), _mm_load_ps(&frame_[0]));
  const __m128 y = _mm_mul_ps(_mm_shuffle_ps(f, f, 0x55), _mm_load_ps(&frame_[4]));
  const __m128 z = _mm_mul_ps(_mm_shuffle_ps(f, f, 0xaa), _mm_load_ps(&frame_[8]));
  alignas(16) float at[4];
  _mm_store_ps(at, _mm_add_ps(_mm_add_ps(x, y), z));
  points_.emplace_back();
  Point& p = points_.back();
  p.x = at[0], p.y = at[1], p.z = at[2];
  classify(p);
  if (p.inside) {
    const std::size_t i = p.sector;
    p.deviation = std::fabs(p.z - slope_x_[i] * p.x - slope_y_[i] * p.y);
    deviation_ = larger(deviation_, p.deviation);
  } else if ((lines_ & ~p.links) != 0) {
    p.inside = beyond_line(p);
  }
  return deviation_ <= limit_;
}

/// Whether p lies beyond a line of the rim, beside it: then its distance to the line counts.
bool ReferenceDeviation::beyond_line(Point& p) {
  bool beyond = false;
  float nearest = 0.0f;
  for (std::uint64_t cut = lines_ & ~p.links; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    const float dx = p.x - x_[j], dy = p.y - y_[j], size2 = edge_x_[j] * edge_x_[j] + edge_y_[j] * edge_y_[j];
    const float t = (dx * edge_x_[j] + dy * edge_y_[j]) / size2;
    if (!(t >= 0.0f && t <= 1.0f)) continue;
    const float across = cross2(edge_x_[j], edge_y_[j], dx, dy), up = p.z - z_[j] - t * edge_z_[j];
    const float distance = std::sqrt(across * across / size2 + up * up);
    nearest = beyond ? smaller(nearest, distance) : distance;
    beyond = true;
  }
  if (beyond) {
    p.deviation = nearest;
    deviation_ = larger(deviation_, nearest);
  }
  return beyond;
}

/// A vertex of a line of the reference: its distance to the nearest line of the rim counts.
/// \param own  bound of the triangle at the line
bool ReferenceDeviation::near_line(const Point& p, float own) {
  float nearest2 = limit_ * limit_ * 4.0f + 1.0f;
  for (std::uint64_t bits = lines_; bits != 0; bits &= bits - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(bits));
    const float dx = p.x - x_[j], dy = p.y - y_[j], size2 = edge_x_[j] * edge_x_[j] + edge_y_[j] * edge_y_[j];
    float t = (dx * edge_x_[j] + dy * edge_y_[j]) / size2;
    t = t > 0.0f ? (t < 1.0f ? t : 1.0f) : 0.0f;
    const float ux = dx - t * edge_x_[j], uy = dy - t * edge_y_[j], uz = p.z - z_[j] - t * edge_z_[j];
    nearest2 = smaller(nearest2, ux * ux + uy * uy + uz * uz);
  }
  for (std::uint64_t bits = ends_; bits != 0; bits &= bits - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(bits));
    const float ux = p.x - x_[j], uy = p.y - y_[j], uz = p.z - z_[j];
    nearest2 = smaller(nearest2, ux * ux + uy * uy + uz * uz);
  }
  deviation_ = larger(deviation_, std::sqrt(nearest2) + own);
  return deviation_ <= limit_;
}

/// Whether the triangle turns too far against one of the new faces that it lies over.
bool ReferenceDeviation::normal_deviates(const Face& face, const Point* const* corner) const {
  const Point p[3] = {*corner[0], *corner[1], *corner[2]};
  const float ax = p[1].x - p[0].x, ay = p[1].y - p[0].y, az = p[1].z - p[0].z;
  const float bx = p[2].x - p[0].x, by = p[2].y - p[0].y, bz = p[2].z - p[0].z;
  const float nx = ay * bz - az * by, ny = az * bx - ax * bz, nz = ax * by - ay * bx;
  const float size = std::sqrt(nx * nx + ny * ny + nz * nz);
  const float cx2 = bx - ax, cy2 = by - ay, cz2 = bz - az;
  const float longest = std::sqrt(larger(larger(ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz),
                                         cx2 * cx2 + cy2 * cy2 + cz2 * cz2));
  if (!(size > 0.0f)) return false;
  // A thin triangle among wide ones turns far where one of its corners moves a little: that says nothing of the
  // surface.
  const float width = larger(larger(width_[face.vertex[0]], width_[face.vertex[1]]), width_[face.vertex[2]]);
  const float noise = smaller(kNoise * width, 0.5f * limit_) * longest;
  // Drawn in a little, so that a face that only touches does not count.
  const float cx = (p[0].x + p[1].x + p[2].x) / 3.0f, cy = (p[0].y + p[1].y + p[2].y) / 3.0f;
  Point q[3];
  for (int i = 0; i < 3; ++i) {
    q[i].x = cx + 0.998f * (p[i].x - cx), q[i].y = cy + 0.998f * (p[i].y - cy);
    classify(q[i]);
  }
  std::uint64_t faces = 0;
  for (int i = 0; i < 3; ++i) {
    faces |= sector_bits(q[i]);
    const Point &a = q[i], &b = q[i == 2 ? 0 : i + 1];
    for (std::uint64_t cut = (a.spokes ^ b.spokes) & inner_spokes_; cut != 0; cut &= cut - 1) {
      const auto j = static_cast<std::size_t>(std::countr_zero(cut));
      const float dx = b.x - a.x, dy = b.y - a.y, area2 = cross2(dx, dy, x_[j], y_[j]);
      const float s = cross2(-a.x, -a.y, dx, dy) / area2;
      if (s > 0.0f && s < 1.0f)  // spoke j parts faces j - 1 and j
        faces |= std::uint64_t{1} << j | std::uint64_t{1} << (j == closes_to_ ? size_ - 1 : j - 1);
    }
  }
  for (faces &= sectors_; faces != 0; faces &= faces - 1) {
    const auto i = static_cast<std::size_t>(std::countr_zero(faces));
    const float along = (nz - slope_x_[i] * nx - slope_y_[i] * ny) * face_cosine_[i];
    if (along >= min_cosine_ * size) continue;
    if (along > 0.0f && size * size - along * along <= noise * noise) continue;
    return true;
  }
  return false;
}

/// Whether the segment, with both ends outside, meets the inside of the polygon.
bool ReferenceDeviation::meets_polygon(const Point& a, const Point& b) const {
  for (std::uint64_t cut = a.links ^ b.links; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    const std::size_t k = following(j);
    const float sj = cross2(b.x - a.x, b.y - a.y, x_[j] - a.x, y_[j] - a.y);
    const float sk = cross2(b.x - a.x, b.y - a.y, x_[k] - a.x, y_[k] - a.y);
    if ((sj > 0.0f && sk < 0.0f) || (sj < 0.0f && sk > 0.0f)) return true;
  }
  // From one corner of the polygon to another.
  Point middle{0.5f * (a.x + b.x), 0.5f * (a.y + b.y), 0.0f, 0.0f, false, 0, 0, 0};
  classify(middle);
  return middle.inside;
}

/// Crossings of the segment with spokes and rim edges. \return false above the limit
/// \param own  bound of the triangles beside it
bool ReferenceDeviation::cross_edges(const Point& a, const Point& b, float own) {
  const float dx = b.x - a.x, dy = b.y - a.y, dz = b.z - a.z;
  const auto cross = [&](float px, float py, float pz, float ux, float uy, float uz) {
    // a + t d = p + s u
    const float area2 = cross2(dx, dy, ux, uy);
    const float t = cross2(px - a.x, py - a.y, ux, uy) / area2,
                s = cross2(px - a.x, py - a.y, dx, dy) / area2;
    if (s >= 0.0f && s <= 1.0f && t >= 0.0f && t <= 1.0f)
      deviation_ = larger(deviation_, std::fabs(a.z + t * dz - pz - s * uz) + own);
  };
  for (std::uint64_t cut = (a.spokes ^ b.spokes) & inner_spokes_; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    cross(0.0f, 0.0f, 0.0f, x_[j], y_[j], z_[j]);
  }
  for (std::uint64_t cut = a.links ^ b.links; cut != 0; cut &= cut - 1) {
    const auto j = static_cast<std::size_t>(std::countr_zero(cut));
    cross(x_[j], y_[j], z_[j], edge_x_[j], edge_y_[j], edge_z_[j]);
  }
  return deviation_ <= limit_;
}

/// Measures the corners of the star that lie above the triangle. \return false above the limit
bool ReferenceDeviation::corners_above(const Point* const* corner) {
  const Point p[3] = {*corner[0], *corner[1], *corner[2]};
  const float ax = p[1].x - p[0].x, ay = p[1].y - p[0].y, bx = p[2].x - p[0].x, by = p[2].y - p[0].y;
  const float full = cross2(ax, ay, bx, by), margin = -1e-5f * std::fabs(full);
  if (!(full > 0.0f)) return true;
  for (std::size_t j = 0; j < size_; ++j) {
    const float dx = x_[j] - p[0].x, dy = y_[j] - p[0].y;
    const float s = cross2(dx, dy, bx, by), t = cross2(ax, ay, dx, dy);
    if (s < margin || t < margin || s + t > full - margin) continue;
    covered_ |= std::uint64_t{1} << j;
    deviation_ = larger(deviation_,
                        std::fabs(p[0].z + (s * (p[1].z - p[0].z) + t * (p[2].z - p[0].z)) / full - z_[j]));
  }
  return deviation_ <= limit_;
}

/// The triangles at the seed: all, or with a flat edge those of the side, that is of the fan between two
/// lines that lies more to the left of the flat edge.
bool ReferenceDeviation::seed_faces(std::uint32_t seed, std::size_t flat_edge) {
  const std::uint32_t first = corner_[seed];
  std::uint32_t c = first;
  std::size_t best_from = 0, best_to = 0, from = 0;
  float best = 0.0f, side = 0.0f, weight = 0.0f;
  fan_.clear();
  bool open = false;
  // Turn to a line first, so that no side is cut in two.
  if (flat_edge != kNoFlatEdge)
    for (; !is_line(prev_corner(c));) {
      const std::uint32_t o = faces_[c >> 2].opposite[next_corner(c) & 3u];
      if (o == kNoCorner) return false;
      c = next_corner(o);
      if (c == first) return false;
    }
  const std::uint32_t start = c;
  const auto end_side = [&](std::size_t to) {
    if (to > from && weight > 0.0f && (best_to == best_from || side / weight > best))
      best = side / weight, best_from = from, best_to = to;
    from = to, side = weight = 0.0f;
  };
  for (;;) {
    fan_.push_back(c);
    if (flat_edge != kNoFlatEdge) {
      for (const std::uint32_t k : {next_corner(c), prev_corner(c)}) {
        const Double3 r = vertices_[faces_[c >> 2].vertex[k & 3u]].at - origin_;
        side +=
            cross2(edge_x_[flat_edge], edge_y_[flat_edge], static_cast<float>(dot(r, ex_)) - x_[flat_edge],
                   static_cast<float>(dot(r, ey_)) - y_[flat_edge]);
        weight += 1.0f;
      }
      if (is_line(next_corner(c))) end_side(fan_.size());
    }
    const std::uint32_t o = faces_[c >> 2].opposite[next_corner(c) & 3u];
    if (o == kNoCorner) {
      open = true;
      break;
    }
    c = next_corner(o);
    if (c == start) break;
  }
  if (flat_edge == kNoFlatEdge) {
    if (open) return false;
    best_to = fan_.size();
  } else if (open && start != first) {
    return false;  // a crease that ends in a border
  }
  for (std::size_t i = best_from; i < best_to; ++i) {
    faces_[fan_[i] >> 2].stamp = stamp_;
    steps_.push_back({fan_[i], kNoCorner, kNoCorner});
  }
  return best_to > best_from;
}

/// The other end of a line at `at` than that to `from`, or where from is kNoCorner the first one.
/// \return false where not exactly two lines meet
bool ReferenceDeviation::next_on_line(std::uint32_t at, std::uint32_t from, std::uint32_t& next) const {
  std::size_t lines = 0;
  bool came = from == kNoCorner;
  const auto visit = [&](std::uint32_t w) {
    ++lines;
    if (w == from)
      came = true;
    else if (lines == 1 || from != kNoCorner)
      next = w;
  };
  const std::uint32_t first = corner_[at];
  for (std::uint32_t c = first;;) {
    if (is_line(prev_corner(c))) visit(faces_[c >> 2].vertex[next_corner(c) & 3u]);
    const std::uint32_t o = faces_[c >> 2].opposite[next_corner(c) & 3u];
    if (o == kNoCorner) {
      if (is_line(next_corner(c))) visit(faces_[c >> 2].vertex[prev_corner(c) & 3u]);
      break;
    }
    c = next_corner(o);
    if (c == first) break;
  }
  return lines == 2 && came;
}

bool ReferenceDeviation::measure_line(std::uint32_t u, std::uint32_t v, std::uint32_t q, double limit,
                                      double& deviation) const {
  constexpr int kMaxSteps = 100000;
  const Double3 start = vertices_[v].at, edge = vertices_[q].at - start;
  const double size2 = dot(edge, edge);
  double worst2 = 0.0;
  const auto add = [&](std::uint32_t w) {
    const Double3 r = vertices_[w].at - start;
    const Double3 off = r - edge * (size2 > 0.0 ? std::clamp(dot(r, edge) / size2, 0.0, 1.0) : 0.0);
    worst2 = larger(worst2, dot(off, off));
    return worst2 <= limit * limit;
  };
  if (!add(u)) return false;
  std::uint32_t one = kNoCorner, other = kNoCorner, end[2];
  if (!next_on_line(u, kNoCorner, one) || !next_on_line(u, one, other)) return false;
  for (std::size_t side = 0; side < 2; ++side) {
    std::uint32_t before = u, at = side == 0 ? one : other;
    for (int step = 0; at != v && at != q; ++step) {
      std::uint32_t next = kNoCorner;
      if (step == kMaxSteps || at == u || !add(at) || !next_on_line(at, before, next)) return false;
      before = at;
      at = next;
    }
    end[side] = at;
  }
  deviation = std::sqrt(worst2) * (1.0 + 0x1p-40);
  return end[0] != end[1];
}

ReferenceDeviation::Answer ReferenceDeviation::measure(const LinkLoop& loop, const Query& query,
                                                       double& deviation) {
  if (!set_polygon(loop, query.inner_centre)) return Answer::kBeyond;
  origin_ = query.origin;
  const float slack = 16.0f * 0x1p-24f * radius_;
  deviation_ = 0.0f;
  limit_ = static_cast<float>(query.limit) * (1.0f - 0x1p-22f) - slack;
  min_cosine_ = static_cast<float>(query.min_cosine);
  lines_ = loop.borders | (query.cross_creases ? 0u : loop.creases);
  ends_ = loop.ends;
  covered_ = loop.ends;  // vertices of lines do not move
  const unsigned walls = query.cross_creases ? unsigned{kStateBorder} : kStateBorder | kStateCrease;
  points_.clear();
  steps_.clear();
  failed_at_ = kNoCorner;
  if (query.witness != kNoCorner && lines_ == 0) {
    // What was too far from one star is often too far from the next: it costs one vertex to know.
    std::uint32_t slot;
    stamp_ += 2;
    if (!place(query.witness, slot)) {
      failed_at_ = query.witness;
      return Answer::kBeyond;
    }
    deviation_ = 0.0f;
    points_.clear();
  }
  // Stamps: even on the stack, odd done.
  stamp_ += 2;
  if (!seed_faces(query.seed, query.flat_edge)) return Answer::kBeyond;
  if (query.free_corners && query.flat_edge == kNoFlatEdge) {
    std::uint32_t slot;
    if (!place(query.seed, slot) || !points_[slot].inside) return Answer::kBeyond;
  }
  // First in, first out: what a triangle touches is on its way from memory when its turn comes.
  for (std::size_t area2 = 0; area2 < steps_.size(); ++area2) {
    const Step step = steps_[area2];
    Face& f = faces_[step.corner >> 2];
    f.stamp = stamp_ + 1;
    ++walked_;
    // Corners from that of the step on; the edge opposite the first is the one across which the walk came.
    const std::uint32_t corner[3] = {step.corner, next_corner(step.corner), prev_corner(step.corner)};
    std::uint32_t slot[3] = {0, step.next, step.prev};
    const bool seed = step.next == kNoCorner;
    for (std::size_t i = 0; i < (seed ? 3 : 1); ++i)
      if (!place(f.vertex[corner[i] & 3u], slot[i])) {
        failed_at_ = f.vertex[corner[i] & 3u];
        return Answer::kBeyond;
      }
    const Point* const p[3] = {&points_[slot[0]], &points_[slot[1]], &points_[slot[2]]};
    const float ax = p[1]->x - p[0]->x, ay = p[1]->y - p[0]->y, bx = p[2]->x - p[0]->x,
                by = p[2]->y - p[0]->y;
    if (cross2(ax, ay, bx, by) < -slack * (std::fabs(ax) + std::fabs(ay) + std::fabs(bx) + std::fabs(by)))
      return Answer::kFolded;
    const float own = unpacked(f.lines);
    if (own > 0.0f) {
      deviation_ =
          larger(deviation_, own + larger(p[0]->deviation, larger(p[1]->deviation, p[2]->deviation)));
      if (deviation_ > limit_) return Answer::kBeyond;
    }
    if (query.free_corners && !corners_above(p)) return Answer::kBeyond;
    if (min_cosine_ > -1.0f && normal_deviates(f, p)) return Answer::kNormalDeviates;
    for (std::size_t i = seed ? 0 : 1; i < 3; ++i) {
      const std::uint32_t o = f.opposite[corner[i] & 3u];
      if (o != kNoCorner && faces_[o >> 2].stamp == stamp_ + 1) continue;  // seen from there
      const std::size_t next = i == 2 ? 0 : i + 1, prev = i == 0 ? 2 : i - 1;
      const Point *from = p[next], *to = p[prev];
      if (from->sector != to->sector || from->sector == 0) {
        if (to->x < from->x) std::swap(from, to);  // the same bits from either side
        if (!from->inside && !to->inside && !meets_polygon(*from, *to)) continue;
        const float beside = o == kNoCorner ? own : larger(own, unpacked(faces_[o >> 2].lines));
        if (!cross_edges(*from, *to, beside)) return Answer::kBeyond;
      }
      if (f.lines >> (corner[i] & 3u) & walls) {
        const Point &a = *from, &b = *to;
        // Where the line leaves the polygon, its crossing of the rim has been measured.
        const bool through = !a.inside && !b.inside;
        if ((a.inside || through) && !near_line(a, own)) return Answer::kBeyond;
        if ((b.inside || through) && !near_line(b, own)) return Answer::kBeyond;
        continue;
      }
      if (o == kNoCorner) return Answer::kBeyond;
      Face& across = faces_[o >> 2];
      if (across.stamp == stamp_) continue;
      across.stamp = stamp_;
      steps_.push_back({o, slot[prev], slot[next]});
      _mm_prefetch(&vertices_[across.vertex[o & 3u]], _MM_HINT_T0);
      for (const std::uint32_t ahead :
           {across.opposite[next_corner(o) & 3u], across.opposite[prev_corner(o) & 3u]})
        if (ahead != kNoCorner) _mm_prefetch(&faces_[ahead >> 2], _MM_HINT_T0);
    }
  }
  if (query.free_corners && covered_ != all_) return Answer::kBeyond;
  deviation = static_cast<double>(deviation_) * (1.0 + 0x1p-22) + static_cast<double>(slack);
  return Answer::kWithin;
}

}  // namespace tessera
