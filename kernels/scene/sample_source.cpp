#include "kernels/scene/sample_source.h"

#include <algorithm>

#include "kernels/scene/surface_sampler.h"

namespace tessera::synth {
namespace {

class PatchSource final : public SampleSource {
 public:
  PatchSource(const Scene& scene, std::uint64_t points, std::uint64_t seed) : sampler_(scene, points, seed) {
    scans_.push_back({{}, 0, 0, 0, sampler_.spans().size()});
  }
  std::uint64_t unit_count() const override { return sampler_.spans().size(); }
  void sample(std::uint64_t unit, SampleBatch& out) const override {
    const SampleSpan& span = sampler_.spans()[unit];
    sampler_.sample(span, out.surface);
    out.dx.clear(), out.dy.clear(), out.dz.clear();
    out.flying = 0;
    out.key.resize(out.surface.size());
    for (std::size_t i = 0; i < out.key.size(); ++i) out.key[i] = span.first_point + i;
  }
  const std::vector<ScanInfo>& scans() const override { return scans_; }
  double area() const override { return sampler_.area(); }
  double spacing() const override { return sampler_.spacing(); }

 private:
  SurfaceSampler sampler_;
  std::vector<ScanInfo> scans_;
};

/// Three families of axis-parallel rays on jittered square grids. A hit belongs to the family whose axis is
/// nearest to its normal, so every piece of surface is seen by exactly one, at an incidence below 55 degrees.
class AxisSource final : public SampleSource {
 public:
  AxisSource(const Scene& scene, std::uint64_t points, std::uint64_t seed) : scene_(scene), seed_(seed) {
    const Double3 extent = scene.bounds().hi - scene.bounds().lo;
    const double widest = std::max(extent[0], std::max(extent[1], extent[2]));
    // A coarse run counts what a grid of that step gives, and measures the area.
    set_step(widest / 96.0);
    std::uint64_t hits = 0;
    SampleBatch batch;
    for (std::uint64_t unit = 0; unit < unit_count(); ++unit) {
      sample(unit, batch);
      hits += batch.surface.size();
      for (std::size_t i = 0; i < batch.surface.size(); ++i) {
        const double n = std::max(std::fabs(batch.surface.nx[i]),
                                  std::max(std::fabs(batch.surface.ny[i]), std::fabs(batch.surface.nz[i])));
        area_ += step_ * step_ / n;
      }
    }
    set_step(step_ *
             std::sqrt(static_cast<double>(std::max<std::uint64_t>(hits, 1)) / static_cast<double>(points)));
    spacing_ = std::sqrt(area_ / static_cast<double>(points));
  }
  std::uint64_t unit_count() const override { return rows_[0] + rows_[1] + rows_[2]; }
  void sample(std::uint64_t unit, SampleBatch& out) const override {
    int axis = 0;
    std::uint64_t row = unit;
    while (row >= rows_[axis]) row -= rows_[axis++];
    const Box3 box = scene_.bounds();
    const double lo[3] = {box.lo[0], box.lo[1], box.lo[2]}, hi[3] = {box.hi[0], box.hi[1], box.hi[2]};
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    const auto columns = static_cast<std::uint64_t>(std::floor((hi[u] - lo[u]) / step_)) + 1;
    out.surface.resize(0);
    out.dx.clear(), out.dy.clear(), out.dz.clear();
    out.key.clear();
    out.flying = 0;
    std::vector<SurfacePoint> found;
    for (std::uint64_t column = 0; column < columns; ++column) {
      const std::uint64_t name = mix(unit << 32 | column);
      const std::uint64_t bits = random_bits(seed_, 17, name);
      double o[3], d[3] = {0, 0, 0};
      o[axis] = lo[axis] - 0.01 * (hi[axis] - lo[axis]);
      o[u] = lo[u] + (static_cast<double>(column) + 0.3 + 0.4 * to_unit(bits)) * step_;
      o[v] = lo[v] + (static_cast<double>(row) + 0.3 + 0.4 * to_unit(mix(bits))) * step_;
      if (o[u] > hi[u] || o[v] > hi[v]) continue;
      d[axis] = 1.0;
      scene_.crossings({{o[0], o[1], o[2]}, {d[0], d[1], d[2]}}, 1.02 * (hi[axis] - lo[axis]), found);
      for (std::size_t k = 0; k < found.size(); ++k) {
        const SurfacePoint& p = found[k];
        const double n[3] = {std::fabs(p.normal[0]), std::fabs(p.normal[1]), std::fabs(p.normal[2])};
        // Ties (a slope of exactly 45 degrees) go to the earlier axis.
        const int dominant = n[0] >= n[1] && n[0] >= n[2] ? 0 : n[1] >= n[2] ? 1 : 2;
        if (dominant != axis) continue;
        out.surface.push_back(p);
        out.key.push_back(name + k);
      }
    }
  }
  const std::vector<ScanInfo>& scans() const override { return scans_; }
  double area() const override { return area_; }
  double spacing() const override { return spacing_; }

 private:
  void set_step(double step) {
    step_ = step;
    const Double3 extent = scene_.bounds().hi - scene_.bounds().lo;
    const double e[3] = {extent[0], extent[1], extent[2]};
    for (int axis = 0; axis < 3; ++axis) {
      rows_[axis] = static_cast<std::uint64_t>(std::floor(e[(axis + 2) % 3] / step)) + 1;
    }
    scans_.assign(1, {{}, 0, 0, 0, unit_count()});
  }

  const Scene& scene_;
  std::uint64_t seed_;
  double step_ = 0.0, area_ = 0.0, spacing_ = 0.0;
  std::uint64_t rows_[3] = {0, 0, 0};
  std::vector<ScanInfo> scans_;
};

}  // namespace

std::unique_ptr<SampleSource> sample_surface(const Scene& scene, std::uint64_t points, std::uint64_t seed) {
  if (scene.patches().empty()) return std::make_unique<AxisSource>(scene, points, seed);
  return std::make_unique<PatchSource>(scene, points, seed);
}

std::uint64_t points_for_spacing(const Scene& scene, double spacing) {
  const double area = sample_surface(scene, 1u << 18, 1)->area();
  return static_cast<std::uint64_t>(std::floor(area / (spacing * spacing) + 0.5));
}

}  // namespace tessera::synth
