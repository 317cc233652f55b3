#include "kernels/field/field.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "kernels/field/band.h"
#include "kernels/field/bodies.h"
#include "kernels/field/border.h"
#include "kernels/field/coarse_normals.h"
#include "kernels/field/edge_roots.h"
#include "kernels/field/node_fit.h"
#include "kernels/field/point_leaves.h"
#include "kernels/field/root_colour.h"
#include "kernels/field/unseen_cells.h"
#include "octree/portable_math.h"

namespace tessera {
namespace {

/// Support radius as the kernel uses it: a multiple of the quantum, so that comparing with it is exact.
float support_radius(const FieldOptions& options) {
  const double quanta = std::floor(std::clamp(options.radius_cells, 1.0, 4.0) * kQuantaPerCell + 0.5);
  return static_cast<float>(quanta / kQuantaPerCell);
}

float cosine_to_90(double degrees) {
  return static_cast<float>(cosine_of_degrees(std::clamp(degrees, 0.0, 90.0)));
}

/// Box of the samples that reach a leaf's band nodes.
SampleBox support_box(const std::array<std::uint64_t, 8>& nodes, float radius) {
  std::uint64_t plane = 0;
  int low_z = 7, high_z = 0;
  for (int z = 0; z < 8; ++z) {
    if (!nodes[static_cast<std::size_t>(z)]) continue;
    plane |= nodes[static_cast<std::size_t>(z)];
    low_z = std::min(low_z, z);
    high_z = std::max(high_z, z);
  }
  const int low_y = std::countr_zero(plane) / 8, high_y = (63 - std::countl_zero(plane)) / 8;
  std::uint64_t row = plane | plane >> 32;
  row |= row >> 16;
  row |= row >> 8;
  const auto bits = static_cast<std::uint32_t>(row & 0xff);
  const int low_x = std::countr_zero(bits), high_x = 31 - std::countl_zero(bits);
  return {{static_cast<float>(low_x) - radius, static_cast<float>(low_y) - radius,
           static_cast<float>(low_z) - radius},
          {static_cast<float>(high_x) + radius, static_cast<float>(high_y) + radius,
           static_cast<float>(high_z) + radius}};
}

/// Closes gaps of a leaf where its samples are sparse or uneven.
void bridge_leaf(const PointBlock& points, const PointLeaves& leaves, const PointBlock& coarse_points,
                 const PointLeaves& coarse_leaves, const Int3& leaf, const NodeFitOptions& options,
                 NodeFitScratch& scratch, LeafFit& fit) {
  std::array<std::uint64_t, 8> nodes{};
  std::uint64_t any = 0;
  for (std::size_t z = 0; z < 8; ++z) any |= nodes[z] = fit.few[z] | fit.beyond[z];
  if (!any) return;
  SampleList& samples = scratch.wide_samples;
  gather_samples(coarse_points, coarse_leaves, leaf[0], leaf[1], leaf[2], support_box(nodes, kMaxRadius),
                 samples);
  if (!choose_gaps(samples, options, scratch, fit)) return;
  for (std::size_t z = 0; z < 8; ++z) nodes[z] = fit.gap[0][z] | fit.gap[1][z] | fit.gap[2][z];
  gather_samples(points, leaves, leaf[0], leaf[1], leaf[2], support_box(nodes, kMaxRadius), samples);
  bridge_gaps(samples, options, scratch, fit);
}

/// Smooths a leaf where the normals of its noisy samples contradict each other.
void smooth_leaf(const PointBlock& points, const PointLeaves& leaves, const Int3& leaf,
                 const NodeFitOptions& options, NodeFitScratch& scratch, LeafFit& fit) {
  std::uint64_t any = 0;
  for (const std::uint64_t word : scratch.rough) any |= word;
  if (!any) return;
  gather_samples(points, leaves, leaf[0], leaf[1], leaf[2], support_box(scratch.rough, rough_radius(options)),
                 scratch.wide_samples);
  smooth_rough(scratch.wide_samples, options, scratch, fit);
}

}  // namespace

int field_halo_cells(const FieldOptions& options) {
  return std::max(kBandHalo + 1,
                  static_cast<int>(std::ceil(std::max(support_radius(options), kMaxRadius))) + 2);
}

namespace {

BandFits fit_band(const PointBlock& points, const PointLeaves& leaves, const FieldOptions& options,
                  const NodeFilter& wanted, const CoarserFits* coarser) {
  const PointBlock coarse_points = average_normals(points);
  const PointLeaves coarse_leaves = index_leaves(coarse_points, false);
  std::vector<BandNodes> band = choose_band(leaves, wanted);
  const PointBlock volumetric = options.bodies ? volumetric_points(points) : PointBlock();
  PointLeaves volumetric_leaves;
  if (volumetric.size() > 0) {
    volumetric_leaves = index_leaves(volumetric, false);
    add_body_leaves(volumetric_leaves, band);
  }
  if (coarser) add_coarser_leaves(*coarser, points.origin, points.cells, band);
  BodyScratch body_scratch;
  BandFits out;
  out.origin = points.origin;
  out.cells = points.cells;
  out.leaf_index.assign(leaves.range.size(), -1);
  out.leaf.reserve(band.size());
  out.fits.reserve(band.size());

  NodeFitOptions fit_options;
  fit_options.radius = support_radius(options);
  fit_options.sheets.feature_angle = static_cast<float>(options.feature_angle_deg * (kPi / 180.0));
  fit_options.sheets.cos_feature = cosine_to_90(options.feature_angle_deg);
  fit_options.sheets.cos_seed = cosine_to_90(0.8 * options.feature_angle_deg);
  fit_options.sheets.noise = static_cast<float>(options.noise_cells);
  fit_options.firm_boundary = options.firm_boundary;
  fit_options.noisy = options.noise_cells > kExactNoise;
  NodeFitScratch scratch;
  SampleList samples, coarse;
  for (BandNodes& nodes : band) {
    if (options.pause) options.pause();
    const auto index = static_cast<int>(nodes.leaf);
    const int i = index % leaves.dims[0] - 1, j = index / leaves.dims[0] % leaves.dims[1] - 1,
              k = index / (leaves.dims[0] * leaves.dims[1]) - 1;
    LeafWords inside = nodes_in_block({i, j, k}, points.cells);
    if (wanted) {
      const LeafWords chosen = nodes.nodes == BandNodes().nodes ? wanted({i, j, k}) : nodes.requested;
      for (std::size_t z = 0; z < 8; ++z) nodes.nodes[z] &= inside[z] &= chosen[z];
      if (inside == LeafWords{}) continue;
    }
    LeafFit& fit = out.fits.emplace_back();
    if (nodes.nodes != BandNodes().nodes) {
      const SampleBox support = support_box(nodes.nodes, fit_options.radius);
      gather_samples(points, leaves, i, j, k, support, samples);
      gather_samples(coarse_points, coarse_leaves, i, j, k, support, coarse);
    }
    fit_nodes(samples, coarse, nodes.nodes, fit_options, scratch, fit, out.sheets);
    smooth_leaf(points, leaves, {i, j, k}, fit_options, scratch, fit);
    // Where the surface will be closed, gaps are the closing field's.
    if (!options.firm_boundary)
      bridge_leaf(points, leaves, coarse_points, coarse_leaves, {i, j, k}, fit_options, scratch, fit);
    if (volumetric.size() > 0)
      join_bodies({volumetric, volumetric_leaves, coarse_points, coarse_leaves}, {i, j, k}, inside,
                  body_scratch, fit, scratch.boundary, out.sheets);
    if (coarser)
      fill_from_coarser(*coarser, points.origin, {i, j, k}, inside, fit, scratch.boundary, out.sheets);
    keep_boundaries(scratch.boundary, fit, out.boundaries);
    std::uint64_t any = 0;
    for (const std::uint64_t word : fit.valid) any |= word;
    if (!any) {
      out.fits.pop_back();
      continue;
    }
    out.leaf_index[nodes.leaf] = static_cast<std::int32_t>(out.leaf.size());
    out.leaf.push_back({i, j, k});
  }
  return out;
}

}  // namespace

BandFits fit_field(const PointBlock& points, const FieldOptions& options, const NodeFilter& wanted,
                   const CoarserFits* coarser) {
  return fit_band(points, index_leaves(points, true), options, wanted, coarser);
}

DirectedField evaluate_field(const PointBlock& points, const FieldOptions& options, const NodeFilter& wanted,
                             const CoarserFits* coarser) {
  const PointLeaves leaves = index_leaves(points, true);
  BandFits band = fit_band(points, leaves, options, wanted, coarser);
  DirectedField field;
  field.origin = band.origin;
  field.cells = band.cells;
  field.leaf_index = std::move(band.leaf_index);
  field.leaves.reserve(band.fits.size());
  for (std::size_t f = 0; f < band.fits.size(); ++f) {
    const LeafFit& fit = band.fits[f];
    BandLeaf& leaf = field.leaves.emplace_back(
        field.origin,
        Int3{band.leaf[f][0] * kLeafCells, band.leaf[f][1] * kLeafCells, band.leaf[f][2] * kLeafCells});
    leaf.set_valid(fit.valid);
    for (std::size_t z = 0; z < 8; ++z)
      for (std::uint64_t left = fit.valid[z]; left; left &= left - 1) {
        const std::size_t n = static_cast<std::size_t>(std::countr_zero(left)) + 64 * z;
        leaf.value(n) = fit.value[n];
        if (fit.value[n] < 0.0f) leaf.inside[z] |= left & (~left + 1);
      }
  }
  find_roots(band.fits, band.sheets, options.noise_cells > kExactNoise, field);
  find_border(band.fits, band.boundaries, field);
  mark_unseen_cells(points, leaves, field);
  if (!points.rgba.empty())
    colour_roots(points, leaves, support_radius(options), options.bodies, coarser != nullptr, field);
  return field;
}

}  // namespace tessera
