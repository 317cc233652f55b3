#include "kernels/scene/surface_sampler.h"

#include <algorithm>
#include <cassert>

namespace tessera::synth {
namespace {

// The plastic number's powers: the additive sequence that keeps points of the plane furthest apart.
constexpr double kR2u = 0.75487766624669276005;
constexpr double kR2v = 0.56984029099805326591;
constexpr double kCellPoints =
    64.0;  // few enough that density is constant over a cell, many enough to be cheap
constexpr std::uint32_t kSpanCells = 1024;  // about 65,000 points: 3 MB of doubles
constexpr double kJitter = 0.35;  // of the mean spacing: breaks the lattice look, keeps points apart
constexpr int kTrimGrid = 16;     // sub-samples per axis that measure a trimmed cell

double fraction(double v) {
  return v - std::floor(v);
}

}  // namespace

void SurfaceBatch::resize(std::size_t n) {
  for (auto* v : {&x, &y, &z, &nx, &ny, &nz}) v->resize(n);
}

void SurfaceBatch::push_back(const SurfacePoint& p) {
  x.push_back(p.position[0]), y.push_back(p.position[1]), z.push_back(p.position[2]);
  nx.push_back(p.normal[0]), ny.push_back(p.normal[1]), nz.push_back(p.normal[2]);
}

SurfaceSampler::SurfaceSampler(const Scene& scene, std::uint64_t points, std::uint64_t seed)
    : patches_(scene.patches()), points_(points), seed_(seed) {
  assert(!patches_.empty() && points > 0);
  double rough_area = 0.0;
  for (const auto* patch : patches_) rough_area += patch->length_u() * patch->length_v();
  const double edge = std::sqrt(rough_area * kCellPoints / static_cast<double>(points));
  double sum = 0.0;
  for (std::uint32_t p = 0; p < patches_.size(); ++p) {
    const auto count = [edge](double extent) {
      return static_cast<std::uint32_t>(std::clamp(std::floor(extent / edge + 0.5), 1.0, 1e6));
    };
    grids_.push_back({count(patches_[p]->length_v()), count(patches_[p]->length_u())});
    for (std::uint32_t row = 0; row < grids_[p].rows; ++row) {
      for (std::uint32_t first = 0; first < grids_[p].columns; first += kSpanCells) {
        SampleSpan span;
        span.patch = p;
        span.row = row;
        span.first_cell = first;
        span.cells = std::min(kSpanCells, grids_[p].columns - first);
        span.area_before = sum;
        for (std::uint32_t c = 0; c < span.cells; ++c) sum += cell_area(p, row, first + c);
        span.area_after = sum;
        spans_.push_back(span);
      }
    }
  }
  area_ = sum;
  spacing_ = std::sqrt(area_ / static_cast<double>(points));
  for (auto& span : spans_) {
    span.first_point = points_before(span.area_before);
    span.points = points_before(span.area_after) - span.first_point;
  }
}

std::uint64_t SurfaceSampler::points_before(double area) const {
  if (area >= area_) return points_;
  return std::min(points_,
                  static_cast<std::uint64_t>(std::floor(area / area_ * static_cast<double>(points_) + 0.5)));
}

double SurfaceSampler::cell_area(std::uint32_t patch, std::uint32_t row, std::uint32_t column) const {
  const SurfacePatch& surface = *patches_[patch];
  const double du = 1.0 / grids_[patch].columns, dv = 1.0 / grids_[patch].rows;
  const double area = surface.density((column + 0.5) * du, (row + 0.5) * dv) * du * dv;
  if (!surface.trimmed()) return area;
  int in = 0;
  for (int j = 0; j < kTrimGrid; ++j) {
    for (int i = 0; i < kTrimGrid; ++i) {
      in += surface.inside((column + (i + 0.5) / kTrimGrid) * du, (row + (j + 0.5) / kTrimGrid) * dv);
    }
  }
  return area * in / (kTrimGrid * kTrimGrid);
}

void SurfaceSampler::sample(const SampleSpan& span, SurfaceBatch& out) const {
  const SurfacePatch& surface = *patches_[span.patch];
  const Grid grid = grids_[span.patch];
  const double du = 1.0 / grid.columns, dv = 1.0 / grid.rows;
  std::vector<double> u, v;
  u.reserve(span.points);
  v.reserve(span.points);
  double sum = span.area_before;
  std::uint64_t before = span.first_point;
  for (std::uint32_t c = 0; c < span.cells; ++c) {
    sum += cell_area(span.patch, span.row, span.first_cell + c);
    const std::uint64_t after = points_before(sum);
    const std::uint64_t want = after - before;
    const std::uint64_t cell = (static_cast<std::uint64_t>(span.patch) << 44) +
                               static_cast<std::uint64_t>(span.row) * grid.columns + span.first_cell + c;
    const std::uint64_t offset = random_bits(seed_, 1, cell);
    const double u0 = static_cast<double>(offset & 0xffffffffu) * 0x1p-32;
    const double v0 = static_cast<double>(offset >> 32) * 0x1p-32;
    // A point shares its cell's area evenly, so in cell units the spacing is 1/sqrt(n) in both axes.
    const double jitter = want ? kJitter / std::sqrt(static_cast<double>(want)) : 0.0;
    std::uint64_t accepted = 0;
    for (std::uint64_t k = 0; accepted < want; ++k) {
      const std::uint64_t bits = mix(offset + k);
      const double ju = (static_cast<double>(bits & 0xffffffffu) * 0x1p-32 - 0.5) * jitter;
      const double jv = (static_cast<double>(bits >> 32) * 0x1p-32 - 0.5) * jitter;
      // Jitter wraps inside the cell, as the sequence does.
      const double pu = (span.first_cell + c + fraction(u0 + static_cast<double>(k) * kR2u + ju)) * du;
      const double pv = (span.row + fraction(v0 + static_cast<double>(k) * kR2v + jv)) * dv;
      // A cell with area has at least 1/256 of it inside, so this ends; the test is what trims the patch.
      if (surface.trimmed() && !surface.inside(pu, pv)) continue;
      u.push_back(pu);
      v.push_back(pv);
      ++accepted;
    }
    before = after;
  }
  assert(before == span.first_point + span.points);
  surface.evaluate(u, v, out);
}

}  // namespace tessera::synth
