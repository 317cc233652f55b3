#include "tests/helpers/exact_scan.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "kernels/scene/sample_source.h"
#include "octree/vector.h"

namespace tessera::test {
namespace {

constexpr double kSharpCosine = 0.86602540378443865;  // 30 degrees
/// Thinner faces are tilted by as little as rounding to the lattice's margins.
constexpr double kSliver = 0.03;

std::array<Double3, 3> rotation(int number) {
  if (number == 0) return {Double3{1, 0, 0}, Double3{0, 1, 0}, Double3{0, 0, 1}};
  Random random(static_cast<std::uint64_t>(number));
  const auto direction = [&] {
    return unit(Double3{random.gaussian(), random.gaussian(), random.gaussian()});
  };
  const Double3 x = direction();
  const Double3 y = unit(cross(x, direction()));
  return {x, y, cross(x, y)};
}

double distance_to_segment(const Double3& p, const Double3& a, const Double3& b) {
  const Double3 d = b - a;
  const double t = std::clamp(dot(p - a, d) / dot(d, d), 0.0, 1.0);
  return norm(p - a - d * t);
}

}  // namespace

Double3 ExactScan::to_cells(const Double3& p) const {
  Double3 q;
  for (std::size_t k = 0; k < 3; ++k) q[k] = dot(matrix[k], p) / h + origin[k];
  return q;
}

Double3 ExactScan::to_scene(const Double3& p) const {
  const Double3 q = (p - origin) * h;
  Double3 s{};
  for (std::size_t k = 0; k < 3; ++k)
    for (std::size_t c = 0; c < 3; ++c) s[c] += matrix[k][c] * q[k];
  return s;
}

ExactScan make_exact_scan(const std::string& scene, double h, int pose, const Double3& shift) {
  ExactScan scan;
  scan.scene = synth::make_scene({scene, 0, 0});
  scan.h = h;
  scan.matrix = rotation(pose);
  const synth::Box3 box = scan.scene->bounds();
  Double3 low = {1e9, 1e9, 1e9}, high = {-1e9, -1e9, -1e9};
  for (int c = 0; c < 8; ++c) {
    const Double3 p = scan.to_cells(
        {c & 1 ? box.hi[0] : box.lo[0], c & 2 ? box.hi[1] : box.lo[1], c & 4 ? box.hi[2] : box.lo[2]});
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], p[k]);
      high[k] = std::max(high[k], p[k]);
    }
  }
  for (std::size_t k = 0; k < 3; ++k) {
    scan.origin[k] = kScanOrigin + std::ceil(4.0 - low[k]) + shift[k];
    scan.cells[k] = 64 * (static_cast<int>(std::ceil(high[k] - low[k] + 10.0)) / 64 + 1);
  }
  const double spacing = h / 1.5;
  const auto source = synth::sample_surface(*scan.scene, synth::points_for_spacing(*scan.scene, spacing), 1);
  synth::SampleBatch batch;
  for (std::uint64_t unit = 0; unit < source->unit_count(); ++unit) {
    source->sample(unit, batch);
    const synth::SurfaceBatch& s = batch.surface;
    for (std::size_t i = 0; i < s.size(); ++i) {
      Sample sample;
      sample.p = scan.to_cells({s.x[i], s.y[i], s.z[i]});
      const Double3 n = {s.nx[i], s.ny[i], s.nz[i]};
      for (std::size_t k = 0; k < 3; ++k) sample.n[k] = dot(scan.matrix[k], n);
      scan.samples.push_back(sample);
    }
  }
  return scan;
}

FeatureErrors measure_features(const ExactScan& scan, const IndexedMesh& mesh) {
  FeatureErrors errors;
  const auto off_crease = [&](const Double3& p) {
    synth::SharpFeature crease;
    scan.scene->nearest_crease(scan.to_scene(p), crease);
    return crease.distance / scan.h;
  };
  for (const Double3& c : scan.scene->corners()) {
    double nearest = 1e9;
    for (const Double3& p : mesh.position) nearest = std::min(nearest, norm(p - scan.to_cells(c)));
    errors.corners.push_back(nearest);
  }
  for (std::size_t v = 0; v < mesh.position.size(); ++v) {
    const VertexClass c = mesh.vertex_class[v];
    if (c != VertexClass::kCrease && c != VertexClass::kCorner) continue;
    errors.classed.push_back(off_crease(mesh.position[v]));
    errors.classed_at.push_back(mesh.position[v]);
  }
  std::map<std::pair<std::uint32_t, std::uint32_t>, Double3> open;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> sharp;
  for (const auto& f : mesh.faces) {
    std::array<Double3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = mesh.position[f[k]];
    const Double3 n = cross(p[1] - p[0], p[2] - p[0]);
    const double longest = std::max({norm(p[1] - p[0]), norm(p[2] - p[1]), norm(p[0] - p[2])});
    if (!(norm(n) > kSliver * longest)) continue;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto key = std::minmax(f[k], f[(k + 1) % 3]);
      const auto [at, fresh] = open.try_emplace(key, unit(n));
      if (!fresh && dot(at->second, unit(n)) < kSharpCosine) sharp.push_back(key);
    }
  }
  std::vector<std::uint32_t> ends;
  for (const auto& [a, b] : sharp) ends.insert(ends.end(), {a, b});
  std::sort(ends.begin(), ends.end());
  ends.erase(std::unique(ends.begin(), ends.end()), ends.end());
  for (const std::uint32_t v : ends) {
    errors.sharp.push_back(off_crease(mesh.position[v]));
    errors.sharp_at.push_back(mesh.position[v]);
  }
  std::map<std::array<int, 3>, std::vector<std::size_t>> near;
  for (std::size_t e = 0; e < sharp.size(); ++e) {
    const Double3 middle = (mesh.position[sharp[e].first] + mesh.position[sharp[e].second]) * 0.5;
    near[{static_cast<int>(middle[0]) / 2, static_cast<int>(middle[1]) / 2, static_cast<int>(middle[2]) / 2}]
        .push_back(e);
  }
  std::size_t found = 0, all = 0;
  for (const Double3& truth : scan.scene->crease_points(0.25 * scan.h)) {
    const Double3 p = scan.to_cells(truth);
    const std::array<int, 3> at = {static_cast<int>(p[0]) / 2, static_cast<int>(p[1]) / 2,
                                   static_cast<int>(p[2]) / 2};
    double nearest = 1e9;
    for (int d = 0; d < 27; ++d) {
      const auto cell = near.find({at[0] + d % 3 - 1, at[1] + d / 3 % 3 - 1, at[2] + d / 9 - 1});
      if (cell == near.end()) continue;
      for (const std::size_t e : cell->second)
        nearest = std::min(
            nearest, distance_to_segment(p, mesh.position[sharp[e].first], mesh.position[sharp[e].second]));
    }
    ++all;
    found += nearest < 0.1;
  }
  errors.recovered = all > 0 ? static_cast<double>(found) / static_cast<double>(all) : 1.0;
  return errors;
}

}  // namespace tessera::test
