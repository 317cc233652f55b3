#include "kernels/field/node_fit.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include "kernels/field/crease_evidence.h"
#include "kernels/field/node_sums.h"
#include "kernels/field/rim_rule.h"
#include "octree/lanes.h"
#include "octree/vector.h"

namespace tessera {
namespace {

/// Where two scans of one side disagree, a narrow kernel sees either near it and, from two thirds of the radius on,
/// three surfaces: both, and an inverted one between. A wide one sees their mean up to 0.8 radii.
/// Deviation of the samples' tangent planes, in radii, from which a node looks again with the wide kernel, and from
/// which it takes that.
constexpr float kLayeredHint = 0.05f;
constexpr float kLayered = 0.2f;
/// Least squared length of the mean normal: layers are parallel, what bends is not.
constexpr float kLayeredNormal = 0.85f;

/// Nodes whose samples' tangent planes deviate by more than `minimum` cells, with normals that agree.
std::uint32_t layered_nodes(const NodeSums& s, float minimum, float min_normal) {
  const __m256 w2 = _mm256_mul_ps(s.w, s.w);
  const __m256 variance = _mm256_fmsub_ps(s.w, s.pn2, _mm256_mul_ps(s.pn, s.pn));  // times w^2
  const __m256 apart =
      _mm256_cmp_ps(variance, _mm256_mul_ps(w2, _mm256_set1_ps(minimum * minimum)), _CMP_GT_OQ);
  const __m256 parallel = _mm256_cmp_ps(fused_dot(s.nx, s.ny, s.nz, s.nx, s.ny, s.nz),
                                        _mm256_mul_ps(w2, _mm256_set1_ps(min_normal)), _CMP_GE_OQ);
  return static_cast<std::uint32_t>(_mm256_movemask_ps(_mm256_and_ps(apart, parallel)));
}

/// Fewest samples that carry a node, and the least weight: a lone sample at half the radius has 0.32.
constexpr int kMinHits = 4;
constexpr float kMinWeight = 0.02f;
/// Rim test: largest distance of the foot point from the samples' centroid, as a multiple of their spread.
/// At the straight border of an evenly sampled half plane it is 0.7; 1.0 lets the surface reach the last
/// samples.
constexpr float kBoundaryRatio = 1.0f;
/// Where chance leaves two or three samples with nearly all the weight, their spread says nothing: a foot
/// point this close to the centroid, in radii, is among them. At the border of the half plane it is 0.23;
/// beyond, the surface reaches on by up to half a cell.
constexpr float kBoundaryFloor = 0.36f;
/// Distance from the plane of the averaged samples beyond which a node is not looked at again, cells.
constexpr float kGapPlane = 2.5f;
/// Blocks of samples within which the radius that follows the spacing ends: an even plane has 10 within 3 cells.
constexpr int kGapBlocks = 8;
/// What suffices at the largest radius.
constexpr int kMinBlocks = 6;
/// Distance to the nearest sample from a foot point that samples surround, in grown radii and in radii: gaps are
/// bridged up to twice that.
constexpr float kGapShare = 0.5f;
constexpr float kMaxGap = 0.9f;
/// How far off the surface a sample may lie that counts as part of it, in radii.
constexpr float kThickness = 0.3f;
/// Nodes less deep than this may be in a gap; those that turn out to be surrounded are at least so deep.
constexpr float kSurroundedDepth = 0.9f;
static_assert(kSurroundedDepth <= kBoundaryDepth, "the depth of a node that may be in a gap is stored");
/// How fast the distance of foot point and centroid grows towards a straight border, per distance.
constexpr float kBoundarySlope = 0.6f;
/// Both where closing takes over at the rim: it stays well among the samples, so that no flap reaches on.
constexpr float kFirmBoundaryRatio = 0.6f;
constexpr float kFirmBoundaryFloor = 0.18f;

/// Nodes whose samples' mean plane is near enough for a surface within their cells.
__m256 near_plane(const NodeSums& s) {
  const __m256 farthest = _mm256_set1_ps(kGapPlane * kGapPlane);
  const __m256 n2 = fused_dot(s.nx, s.ny, s.nz, s.nx, s.ny, s.nz);
  return _mm256_and_ps(_mm256_cmp_ps(_mm256_mul_ps(s.pn, s.pn), _mm256_mul_ps(n2, farthest), _CMP_LE_OQ),
                       _mm256_cmp_ps(n2, _mm256_setzero_ps(), _CMP_GT_OQ));
}

/// The algebraic spheres of one row, as the crease test needs them.
struct Spheres {
  __m256 u0, ux, uy, uz, twice_u4;
  __m256 residual;      ///< mean squared, of the normals
  __m256 normal_noise;  ///< deviation of the normals per direction, were all of the residual noise
  __m256 sound;
};

/// A bit per node of a row.
struct RowFlags {
  std::uint32_t valid = 0;
  std::uint32_t misfit = 0;  ///< normals that a sphere does not explain
  std::uint32_t few = 0;     ///< too few samples, but some, and their plane is near
  std::uint32_t beyond = 0;  ///< the samples end before it, unless they surround it
  std::uint32_t near = 0;    ///< valid, and near the end of the surface
};

/// Turns the sums into values, gradients and flags of one row.
void finish_row(const NodeSums& s, std::uint32_t active, const NodeFitOptions& options, std::size_t at,
                LeafFit& out, LeafBoundary& out_boundary, RowFlags* flags, Spheres* spheres) {
  const __m256 one = _mm256_set1_ps(1.0f), zero = _mm256_setzero_ps(), two = _mm256_set1_ps(2.0f);
  const __m256 enough =
      _mm256_and_ps(_mm256_cmp_ps(s.w, _mm256_set1_ps(kMinWeight), _CMP_GE_OQ),
                    _mm256_castsi256_ps(_mm256_cmpgt_epi32(s.hits, _mm256_set1_epi32(kMinHits - 1))));
  const __m256 inverse_w = _mm256_div_ps(one, _mm256_blendv_ps(one, s.w, enough));
  const __m256 cx = _mm256_mul_ps(s.px, inverse_w), cy = _mm256_mul_ps(s.py, inverse_w),
               cz = _mm256_mul_ps(s.pz, inverse_w);
  const __m256 spread_w = _mm256_sub_ps(s.pp, fused_dot(s.px, s.py, s.pz, cx, cy, cz));    // sum w |p - c|^2
  const __m256 covariance = _mm256_sub_ps(s.pn, fused_dot(s.nx, s.ny, s.nz, cx, cy, cz));  // sum w (p - c).n
  // Below this spread (samples at one spot) the sphere degenerates: take the plane.
  const __m256 wide = _mm256_cmp_ps(spread_w, _mm256_mul_ps(s.w, _mm256_set1_ps(1e-4f)), _CMP_GT_OQ);
  const __m256 u4 = _mm256_and_ps(
      wide, _mm256_div_ps(covariance, _mm256_mul_ps(two, _mm256_blendv_ps(one, spread_w, wide))));
  const __m256 twice = _mm256_mul_ps(two, u4);
  const __m256 ux = _mm256_mul_ps(_mm256_fnmadd_ps(twice, s.px, s.nx), inverse_w);
  const __m256 uy = _mm256_mul_ps(_mm256_fnmadd_ps(twice, s.py, s.ny), inverse_w);
  const __m256 uz = _mm256_mul_ps(_mm256_fnmadd_ps(twice, s.pz, s.nz), inverse_w);
  const __m256 u_p = fused_dot(ux, uy, uz, s.px, s.py, s.pz);
  const __m256 u0 = _mm256_sub_ps(zero, _mm256_mul_ps(_mm256_fmadd_ps(u4, s.pp, u_p), inverse_w));
  const __m256 u2 = fused_dot(ux, uy, uz, ux, uy, uz);
  const __m256 disc = _mm256_fnmadd_ps(_mm256_mul_ps(_mm256_set1_ps(4.0f), u4), u0, u2);
  // Opposite sheets cancel the normals: then the sphere says nothing.
  const __m256 sound = _mm256_and_ps(_mm256_cmp_ps(u2, _mm256_set1_ps(1e-4f), _CMP_GT_OQ),
                                     _mm256_cmp_ps(disc, zero, _CMP_GT_OQ));
  const __m256 length = _mm256_sqrt_ps(_mm256_blendv_ps(one, u2, sound));
  const __m256 root = _mm256_sqrt_ps(_mm256_blendv_ps(one, disc, sound));
  const __m256 value = _mm256_div_ps(_mm256_mul_ps(two, u0), _mm256_add_ps(length, root));
  const __m256 inverse_length = _mm256_div_ps(one, length);
  const __m256 gx = _mm256_mul_ps(ux, inverse_length), gy = _mm256_mul_ps(uy, inverse_length),
               gz = _mm256_mul_ps(uz, inverse_length);
  // Foot point relative to the node: -value * gradient.
  const __m256 fx = _mm256_fmadd_ps(value, gx, cx), fy = _mm256_fmadd_ps(value, gy, cy),
               fz = _mm256_fmadd_ps(value, gz, cz);
  const __m256 off2 = fused_dot(fx, fy, fz, fx, fy, fz);
  const float boundary = options.firm_boundary ? kFirmBoundaryRatio : kBoundaryRatio;
  const float floor = options.firm_boundary ? kFirmBoundaryFloor : kBoundaryFloor;
  const __m256 limit2 =
      _mm256_max_ps(_mm256_mul_ps(_mm256_mul_ps(spread_w, inverse_w), _mm256_set1_ps(boundary * boundary)),
                    _mm256_set1_ps(floor * floor * options.radius * options.radius));
  const __m256 among = _mm256_cmp_ps(off2, limit2, _CMP_LE_OQ);
  const __m256 magnitude = _mm256_andnot_ps(_mm256_set1_ps(-0.0f), value);
  const __m256 close = _mm256_cmp_ps(magnitude, _mm256_set1_ps(kLargestValue), _CMP_LE_OQ);
  const __m256 fitted = _mm256_and_ps(_mm256_and_ps(enough, sound), close);
  // Mean squared residual of the normals against the sphere's gradient u + 2 u4 p.
  const __m256 u_n = _mm256_fmadd_ps(twice, s.pn, fused_dot(ux, uy, uz, s.nx, s.ny, s.nz));
  const __m256 g2 =
      _mm256_fmadd_ps(s.w, u2, _mm256_mul_ps(twice, _mm256_fmadd_ps(twice, s.pp, _mm256_mul_ps(two, u_p))));
  const __m256 residual = _mm256_mul_ps(_mm256_add_ps(_mm256_fnmadd_ps(two, u_n, s.w), g2), inverse_w);
  const __m256 misfit =
      _mm256_and_ps(enough, _mm256_cmp_ps(residual, _mm256_set1_ps(options.max_residual), _CMP_GT_OQ));
  _mm256_store_ps(out.value.data() + at, value);
  _mm256_store_ps(out.gradient[0].data() + at, gx);
  _mm256_store_ps(out.gradient[1].data() + at, gy);
  _mm256_store_ps(out.gradient[2].data() + at, gz);
  const auto bits = [&](__m256 lanes) {
    return static_cast<std::uint32_t>(_mm256_movemask_ps(lanes)) & active;
  };
  *flags = {.valid = bits(_mm256_and_ps(fitted, among)),
            .misfit = bits(misfit),
            .few = bits(_mm256_andnot_ps(enough, near_plane(s))),
            .beyond = bits(_mm256_andnot_ps(among, fitted))};
  const __m256 half_residual = _mm256_mul_ps(_mm256_max_ps(residual, zero), _mm256_set1_ps(0.5f));
  *spheres = {u0, ux, uy, uz, twice, residual, _mm256_sqrt_ps(half_residual), sound};
  if (options.firm_boundary) return;
  // Most nodes are deep within the least limit: no root for them.
  const float deep = std::max(0.0f, floor * options.radius - kBoundarySlope * kBoundaryDepth);
  flags->beyond = bits(_mm256_and_ps(fitted, _mm256_cmp_ps(off2, _mm256_set1_ps(deep * deep), _CMP_GT_OQ)));
  if (!flags->beyond) return;
  const __m256 depth = _mm256_div_ps(_mm256_sub_ps(_mm256_sqrt_ps(limit2), _mm256_sqrt_ps(off2)),
                                     _mm256_set1_ps(kBoundarySlope));
  flags->beyond =
      bits(_mm256_and_ps(fitted, _mm256_cmp_ps(depth, _mm256_set1_ps(kSurroundedDepth), _CMP_LT_OQ)));
  flags->near = bits(_mm256_and_ps(fitted, _mm256_cmp_ps(depth, _mm256_set1_ps(kBoundaryDepth), _CMP_LT_OQ)));
  if (!flags->near) return;
  flags->near &= bits(_mm256_cmp_ps(depth, _mm256_set1_ps(-kBoundaryMargin), _CMP_GE_OQ));
  flags->valid |= flags->near;
  _mm256_store_ps(out_boundary.depth.data() + at, depth);
  _mm256_store_ps(out_boundary.inward[0].data() + at, fx);
  _mm256_store_ps(out_boundary.inward[1].data() + at, fy);
  _mm256_store_ps(out_boundary.inward[2].data() + at, fz);
}

/// How far a mean normal may turn from the sphere before it hints at a crease, as a share of the feature
/// angle; and how many deviations of such a mean are granted to noise.
constexpr float kHintShare = 0.1f;
constexpr float kNoisyHintShare = 0.3f;
constexpr float kHintDeviations = 2.0f;

/// Most that is granted where samples are exact: the three faces of a corner turn no farther from a sphere through them
/// than such noise would.
constexpr float kMaxGranted = 0.15f;
constexpr float kLargestChord = 2.0f;  ///< between unit normals: grants all

/// Nodes of the row in whose reach a mean normal turns from the node's sphere by more than noise explains.
/// Nodes whose sphere says nothing are among them.
std::uint32_t crease_hints(const RowSamples& coarse, const Spheres& s, float r2, float min_angle,
                           bool noisy) {
  const __m256 node_x = _mm256_setr_ps(0, 1, 2, 3, 4, 5, 6, 7), reach2 = _mm256_set1_ps(r2);
  const __m256 minimum = _mm256_set1_ps(min_angle);
  const __m256 granted = _mm256_min_ps(_mm256_mul_ps(s.normal_noise, _mm256_set1_ps(kHintDeviations)),
                                       _mm256_set1_ps(noisy ? kLargestChord : kMaxGranted));
  const __m256 two = _mm256_set1_ps(2.0f);
  __m256 hint = _mm256_andnot_ps(s.sound, _mm256_castsi256_ps(_mm256_set1_epi32(-1)));
  for (std::size_t i = 0; i < coarse.size; ++i) {
    const __m256 y = _mm256_broadcast_ss(&coarse.y[i]), z = _mm256_broadcast_ss(&coarse.z[i]);
    const __m256 nx = _mm256_broadcast_ss(&coarse.nx[i]), ny = _mm256_broadcast_ss(&coarse.ny[i]),
                 nz = _mm256_broadcast_ss(&coarse.nz[i]);
    const __m256 dx = _mm256_sub_ps(_mm256_broadcast_ss(&coarse.x[i]), node_x);
    const __m256 near =
        _mm256_cmp_ps(_mm256_fmadd_ps(dx, dx, _mm256_broadcast_ss(&coarse.yz2[i])), reach2, _CMP_LT_OQ);
    const __m256 gx = _mm256_fmadd_ps(s.twice_u4, dx, s.ux), gy = _mm256_fmadd_ps(s.twice_u4, y, s.uy),
                 gz = _mm256_fmadd_ps(s.twice_u4, z, s.uz);
    const __m256 n2 = fused_dot(nx, ny, nz, nx, ny, nz);
    const __m256 lengths = _mm256_sqrt_ps(_mm256_mul_ps(fused_dot(gx, gy, gz, gx, gy, gz), n2));
    const __m256 limit = _mm256_fmadd_ps(granted, _mm256_sqrt_ps(n2), minimum);
    // Squared chord 2 - 2 cos > limit^2, without dividing by the lengths.
    const __m256 chord2 = _mm256_mul_ps(two, _mm256_sub_ps(lengths, fused_dot(gx, gy, gz, nx, ny, nz)));
    const __m256 deviates =
        _mm256_cmp_ps(chord2, _mm256_mul_ps(_mm256_mul_ps(limit, limit), lengths), _CMP_GT_OQ);
    hint = _mm256_or_ps(hint, _mm256_and_ps(near, deviates));
  }
  return static_cast<std::uint32_t>(_mm256_movemask_ps(hint));
}

/// Farthest foot point of a creased node, cells.
constexpr float kLargestFoot = 2.5f;
/// Rim test beside creases, where the foot point lies on the joined sheets: at the corner of a cube it
/// is 1.1.
constexpr float kCreaseBoundaryRatio = 1.6f;
/// Cells: far off a corner only its tip is in reach, with little spread.
constexpr float kCreaseBoundarySlack = 0.6f;

/// Distance from a crease, cells, within which its sheets end at each other, not at a border.
constexpr float kAtCrease = 0.5f;

/// Value, gradient and depth of a creased node; false where the surface does not reach.
bool value_of_sheets(const Sheets& sheets, std::size_t at, const NodeFitOptions& options, LeafFit& out,
                     LeafBoundary& out_boundary) {
  const SurfaceValue here = sheets.at({0, 0, 0});
  out.value[at] = here.value;
  for (std::size_t c = 0; c < 3; ++c) out.gradient[c][at] = here.normal[c];
  // Foot point by alternating projections onto the active sheets.
  Float3 foot = {0, 0, 0};
  SurfaceValue s = here;
  for (int step = 0; step < 3; ++step) {
    for (std::size_t c = 0; c < 3; ++c) foot[c] -= s.value * s.normal[c];
    if (step < 2) s = sheets.at(foot);
  }
  Float3 off;
  float foot2 = 0.0f;
  for (std::size_t c = 0; c < 3; ++c) {
    off[c] = sheets.centroid[c] - foot[c];
    foot2 += foot[c] * foot[c];
  }
  const float spread = std::sqrt(std::max(0.0f, sheets.spread2));
  const bool supported = norm(off) <= kCreaseBoundaryRatio * spread + kCreaseBoundarySlack &&
                         foot2 <= kLargestFoot * kLargestFoot;
  if (options.firm_boundary) return supported;
  // At a crease the centroid lies under the foot point: along the surface, a crease is no border.
  off = sheets.along(off - s.normal * tessera::dot(off, s.normal), foot, kAtCrease);
  for (std::size_t c = 0; c < 3; ++c) out_boundary.inward[c][at] = off[c];
  out_boundary.depth[at] =
      (std::max(kBoundaryRatio * spread, kBoundaryFloor * options.radius) - norm(off)) / kBoundarySlope;
  return supported && out_boundary.depth[at] >= -kBoundaryMargin;
}

}  // namespace

namespace {

/// The samples within the radius of node `x` of the row, to scratch.local.
void gather_local(std::uint32_t x, const RowSupport& support, bool row_is_whole, NodeFitScratch& scratch) {
  scratch.local.clear();
  if (row_is_whole) {
    append_local(scratch.row, static_cast<float>(x), support.r2, scratch.local);
  } else {
    for (std::size_t next = 0; next < scratch.slab.size;) {
      fill_row(scratch.slab, support, &next, scratch.row);
      append_local(scratch.row, static_cast<float>(x), support.r2, scratch.local);
    }
  }
}

/// The sphere of node `x` of a row, empty if it has none.
std::optional<SmoothFit> smooth_fit(const Spheres& row, std::uint32_t x) {
  if ((_mm256_movemask_ps(row.sound) >> x & 1) == 0) return std::nullopt;
  const auto lane = [x](__m256 v) {
    alignas(32) std::array<float, kLanes> lanes;
    _mm256_store_ps(lanes.data(), v);
    return lanes[x];
  };
  return SmoothFit{lane(row.u0), {lane(row.ux), lane(row.uy), lane(row.uz)}, lane(row.twice_u4)};
}

/// Tries sheets at the bent nodes of a row; updates their values and flags. \param split  nodes that have sheets
/// \param coarse_is_whole  scratch.coarse_row holds all that the row reaches, as scratch.row does if row_is_whole
void fit_creases(std::uint32_t misfit, const Spheres& spheres, const SampleList& coarse, std::size_t at,
                 const NodeFitOptions& options, NodeFitScratch& scratch, const RowSupport& support,
                 bool row_is_whole, bool coarse_is_whole, LeafFit& out, std::vector<Sheets>& sheets,
                 RowFlags* flags, std::uint32_t* split, std::uint32_t* creased) {
  for (std::uint32_t left = misfit; left; left &= left - 1) {
    const auto x = static_cast<std::uint32_t>(std::countr_zero(left));
    NormalSeeds seeds;
    if (options.noisy) {
      scratch.coarse_local.clear();
      for (std::size_t next = coarse_is_whole ? coarse.size : 0; next < coarse.size;) {
        fill_row(coarse, support, &next, scratch.coarse_row);
        append_local(scratch.coarse_row, static_cast<float>(x), support.r2, scratch.coarse_local);
      }
      if (coarse_is_whole)
        append_local(scratch.coarse_row, static_cast<float>(x), support.r2, scratch.coarse_local);
      scratch.coarse_local.pad();
      make_unit(scratch.coarse_local);
      seeds = seed_normals(scratch.coarse_local, options.sheets.cos_seed);
      if (seeds.count < 2) continue;
    }
    gather_local(x, support, row_is_whole, scratch);
    scratch.local.pad();
    if (!options.noisy) seeds = seed_normals(scratch.local, options.sheets.cos_feature);
    const std::optional<SmoothFit> smooth = smooth_fit(spheres, x);
    const Sheets found = options.noisy ? confirmed_sheets(seeds, options.sheets, smooth ? &*smooth : nullptr,
                                                          scratch.local, scratch.requested)
                                       : fit_sheets(scratch.local, seeds, options.sheets);
    if (found.count == 0) continue;
    const std::uint32_t bit = 1u << x;
    *split |= bit;
    flags->valid &= ~bit;
    flags->near &= ~bit;
    if (!value_of_sheets(found, at + x, options, out, scratch.boundary)) continue;
    flags->valid |= bit;
    if (!options.firm_boundary && scratch.boundary.depth[at + x] < kBoundaryDepth) flags->near |= bit;
    if (found.count == 1) continue;  // a smooth sheet without its neighbours: value and gradient say all
    *creased |= bit;
    sheets.push_back(found);
  }
}

/// Fits those of the nodes anew whose samples lie in layers; updates their values and valid bits.
void join_layers(std::uint32_t hints, std::size_t at, const NodeFitOptions& options, NodeFitScratch& scratch,
                 const RowSupport& support, bool row_is_whole, LeafFit& out, RowFlags* flags) {
  NodeSums sums;
  clear(sums);
  if (row_is_whole) {
    accumulate<true>(scratch.row, support.r2, 1.0f / support.r2, sums);
  } else {
    for (std::size_t next = 0; next < scratch.slab.size;) {
      fill_row(scratch.slab, support, &next, scratch.row);
      accumulate<true>(scratch.row, support.r2, 1.0f / support.r2, sums);
    }
  }
  const std::uint32_t layered = layered_nodes(sums, kLayered * options.radius, kLayeredNormal) & hints;
  if (!layered) return;
  LeafFit& wide = scratch.wide;
  RowFlags found;
  Spheres spheres;
  finish_row(sums, layered, options, at, wide, scratch.wide_boundary, &found, &spheres);
  for (std::uint32_t left = layered; left; left &= left - 1) {
    const auto i = at + static_cast<std::size_t>(std::countr_zero(left));
    out.value[i] = wide.value[i];
    for (std::size_t c = 0; c < 3; ++c) out.gradient[c][i] = wide.gradient[c][i];
    scratch.boundary.depth[i] = scratch.wide_boundary.depth[i];
    for (std::size_t c = 0; c < 3; ++c) scratch.boundary.inward[c][i] = scratch.wide_boundary.inward[c][i];
  }
  flags->valid = (flags->valid & ~layered) | found.valid;
  flags->near = (flags->near & ~layered) | found.near;
  flags->beyond = (flags->beyond & ~layered) | found.beyond;
}

/// Mean squared residual of the normals from which on a noisy node leans on a wider fit (18 degrees), and from which on
/// it is that (37 degrees); and the radius of that fit, in radii.
constexpr float kRough = 0.1f;
constexpr float kRoughest = 0.4f;
constexpr float kRoughGrowth = 1.5f;

std::uint32_t rough_nodes(const Spheres& spheres) {
  return static_cast<std::uint32_t>(
      _mm256_movemask_ps(_mm256_cmp_ps(spheres.residual, _mm256_set1_ps(kRough), _CMP_GT_OQ)));
}

/// A row of nodes with the radius that they have at a level of growth: 1, 1.5, 2 radii.
RowSupport support_of_row(std::uint32_t nodes, std::size_t y, std::size_t z, float r) {
  return {.y0 = static_cast<float>(y),
          .z0 = static_cast<float>(z),
          .low_x = static_cast<float>(std::countr_zero(nodes)) - r,
          .high_x = static_cast<float>(31 - std::countl_zero(nodes)) + r,
          .r2 = r * r};
}
/// Sums of the samples that a row of nodes reaches. \return how often `row` was filled: 1 if it holds them all
int sum_row(const SampleList& samples, const RowSupport& support, RowSamples& row, NodeSums& sums) {
  clear(sums);
  int fills = 0;
  for (std::size_t next = 0; next < samples.size; ++fills) {
    fill_row(samples, support, &next, row);
    accumulate<false>(row, support.r2, 1.0f / support.r2, sums);
  }
  return fills;
}
float grown_radius(std::size_t level, const NodeFitOptions& options) {
  return (1.0f + 0.5f * static_cast<float>(level)) * options.radius;
}

}  // namespace

void fit_nodes(const SampleList& samples, const SampleList& coarse, const std::array<std::uint64_t, 8>& nodes,
               const NodeFitOptions& options, NodeFitScratch& scratch, LeafFit& out,
               std::vector<Sheets>& sheets) {
  const float r = options.radius;
  scratch.boundary.nodes = {};
  scratch.rough = {};
  for (std::size_t z = 0; z < 8; ++z) {
    out.first_sheets[z] = static_cast<std::uint32_t>(sheets.size());
    if (!nodes[z]) continue;
    fill_slab(samples, static_cast<float>(z), r, scratch.slab);
    for (std::size_t y = 0; y < 8; ++y) {
      const auto active = static_cast<std::uint32_t>(nodes[z] >> (8 * y) & 0xff);
      if (!active) continue;
      const RowSupport support = support_of_row(active, y, z, r);
      NodeSums sums;
      const int fills = sum_row(scratch.slab, support, scratch.row, sums);
      std::uint32_t split = 0, creased = 0;
      RowFlags flags;
      Spheres spheres;
      const std::size_t at = 8 * y + 64 * z;
      finish_row(sums, active, options, at, out, scratch.boundary, &flags, &spheres);
      if (flags.misfit) {
        std::uint32_t hints = 0;
        int coarse_fills = 0;
        for (std::size_t next = 0; next < coarse.size; ++coarse_fills) {
          fill_row(coarse, support, &next, scratch.coarse_row);
          hints |= crease_hints(scratch.coarse_row, spheres, support.r2,
                                (options.noisy ? kNoisyHintShare : kHintShare) * options.sheets.feature_angle,
                                options.noisy);
        }
        fit_creases(flags.misfit & hints, spheres, coarse, at, options, scratch, support, fills == 1,
                    coarse_fills == 1, out, sheets, &flags, &split, &creased);
      }
      const std::uint32_t hints =
          layered_nodes(sums, kLayeredHint * r, 0.5f * kLayeredNormal) & active & ~split;
      if (hints) join_layers(hints, at, options, scratch, support, fills == 1, out, &flags);
      if (options.noisy) {
        _mm256_store_ps(scratch.roughness.data() + at, spheres.residual);
        const std::uint32_t rough = rough_nodes(spheres) & flags.valid & ~split;
        scratch.rough[z] |= static_cast<std::uint64_t>(rough) << (8 * y);
      }
      out.valid[z] |= static_cast<std::uint64_t>(flags.valid) << (8 * y);
      scratch.boundary.nodes[z] |= static_cast<std::uint64_t>(flags.near) << (8 * y);
      out.creased[z] |= static_cast<std::uint64_t>(creased) << (8 * y);
      out.few[z] |= static_cast<std::uint64_t>(flags.few & ~split) << (8 * y);
      out.beyond[z] |= static_cast<std::uint64_t>(flags.beyond & ~split) << (8 * y);
    }
  }
}

float rough_radius(const NodeFitOptions& options) {
  return std::min(kRoughGrowth * options.radius, kMaxRadius);
}

void smooth_rough(const SampleList& samples, const NodeFitOptions& options, NodeFitScratch& scratch,
                  LeafFit& fit) {
  NodeFitOptions grown = options;
  const float r = grown.radius = rough_radius(options);
  for (std::size_t z = 0; z < 8; ++z) {
    if (!scratch.rough[z]) continue;
    fill_slab(samples, static_cast<float>(z), r, scratch.slab);
    for (std::size_t y = 0; y < 8; ++y) {
      const auto nodes = static_cast<std::uint32_t>(scratch.rough[z] >> (8 * y) & 0xff);
      if (!nodes) continue;
      NodeSums sums;
      sum_row(scratch.slab, support_of_row(nodes, y, z, r), scratch.row, sums);
      RowFlags flags;
      Spheres spheres;
      LeafFit& wide = scratch.wide;
      finish_row(sums, nodes, grown, 8 * y + 64 * z, wide, scratch.wide_boundary, &flags, &spheres);
      for (std::uint32_t left = flags.valid | flags.beyond; left; left &= left - 1) {
        const std::size_t i = 8 * y + 64 * z + static_cast<std::size_t>(std::countr_zero(left));
        const float t = std::min((scratch.roughness[i] - kRough) / (kRoughest - kRough), 1.0f);
        Float3 g;
        for (std::size_t c = 0; c < 3; ++c) g[c] = (1.0f - t) * fit.gradient[c][i] + t * wide.gradient[c][i];
        const float length = norm(g);
        if (!(length > 0.0f)) continue;
        fit.value[i] = (1.0f - t) * fit.value[i] + t * wide.value[i];
        for (std::size_t c = 0; c < 3; ++c) fit.gradient[c][i] = g[c] / length;
      }
    }
  }
}

bool choose_gaps(const SampleList& coarse, const NodeFitOptions& options, NodeFitScratch& scratch,
                 LeafFit& fit) {
  std::uint64_t any = 0;
  for (std::size_t z = 0; z < 8; ++z)
    for (std::size_t y = 0; y < 8; ++y) {
      const auto beyond = static_cast<std::uint32_t>(fit.beyond[z] >> (8 * y) & 0xff);
      auto left = beyond | static_cast<std::uint32_t>(fit.few[z] >> (8 * y) & 0xff);
      for (std::size_t level = 0; level < fit.gap.size() && left; ++level) {
        const std::uint32_t nodes = level == 0 ? beyond : left;  // few samples stay few
        const float r = grown_radius(level, options);
        if (!nodes) continue;
        if (r > kMaxRadius) break;
        const RowSupport support = support_of_row(nodes, y, z, r);
        NodeSums s;
        sum_row(coarse, support, scratch.coarse_row, s);
        const auto near = static_cast<std::uint32_t>(_mm256_movemask_ps(near_plane(s)));
        const bool last = level + 1 == fit.gap.size() || grown_radius(level + 1, options) > kMaxRadius;
        const __m256i minimum = _mm256_set1_epi32((last ? kMinBlocks : kGapBlocks) - 1);
        const auto enough = static_cast<std::uint32_t>(_mm256_movemask_ps(
                                _mm256_castsi256_ps(_mm256_cmpgt_epi32(s.hits, minimum)))) &
                            nodes;
        left &= ~enough;
        fit.gap[level][z] |= static_cast<std::uint64_t>(enough & near) << (8 * y);
        any |= enough & near;
      }
    }
  return any != 0;
}

void bridge_gaps(const SampleList& samples, const NodeFitOptions& options, NodeFitScratch& scratch,
                 LeafFit& fit) {
  NodeFitOptions grown = options;
  for (std::size_t level = 0; level < fit.gap.size(); ++level) {
    const float r = grown.radius = grown_radius(level, options);
    const float within = std::min(kGapShare * r, kMaxGap * options.radius);
    for (std::size_t z = 0; z < 8; ++z) {
      if (!fit.gap[level][z]) continue;
      fill_slab(samples, static_cast<float>(z), r, scratch.slab);
      for (std::size_t y = 0; y < 8; ++y) {
        const auto nodes = static_cast<std::uint32_t>(fit.gap[level][z] >> (8 * y) & 0xff);
        if (!nodes) continue;
        const RowSupport support = support_of_row(nodes, y, z, r);
        NodeSums sums;
        const int fills = sum_row(scratch.slab, support, scratch.row, sums);
        RowFlags flags;
        Spheres spheres;
        const std::size_t at = 8 * y + 64 * z;
        LeafFit& wide = scratch.wide;
        finish_row(sums, nodes, grown, at, wide, scratch.wide_boundary, &flags, &spheres);
        for (std::uint32_t left = flags.valid | flags.beyond; left; left &= left - 1) {
          const auto x = static_cast<std::uint32_t>(std::countr_zero(left));
          const std::size_t i = at + x;
          gather_local(x, support, fills == 1, scratch);
          const Float3 gradient = {wide.gradient[0][i], wide.gradient[1][i], wide.gradient[2][i]};
          if (!is_surrounded(scratch.local, wide.value[i], gradient, kThickness * options.radius, within))
            continue;
          const std::uint64_t bit = std::uint64_t{1} << (8 * y + x);
          const bool beyond = (scratch.boundary.nodes[z] & bit) != 0 && scratch.boundary.depth[i] < 0.0f;
          if (!(fit.valid[z] & bit) || beyond) {
            fit.value[i] = wide.value[i];
            for (std::size_t c = 0; c < 3; ++c) fit.gradient[c][i] = gradient[c];
          }
          fit.valid[z] |= bit;
          scratch.boundary.nodes[z] &= ~bit;
          if (!(flags.near >> x & 1)) continue;
          scratch.boundary.nodes[z] |= bit;
          scratch.boundary.depth[i] = std::max(scratch.wide_boundary.depth[i], kSurroundedDepth);
          for (std::size_t c = 0; c < 3; ++c)
            scratch.boundary.inward[c][i] = scratch.wide_boundary.inward[c][i];
        }
      }
    }
  }
}

}  // namespace tessera
