#include "kernels/edit/displacement_volumes.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr int kRings = 6;  ///< over which heights make up for volumes

std::vector<Double3> listed(std::span<const Double3> p) {
  return {p.begin(), p.end()};
}

/// One of the surfaces that the layer is solved for.
struct Level {
  std::vector<Double3> rest_base, rest, base, vectors, widening;
  std::vector<Rotation> rotation;
  PrismFaces faces;
  std::span<const std::uint8_t> free;
};

Level coarser(const Level& fine, const CoarseLayer& c) {
  Level out{
      c.at(fine.rest_base), c.at(fine.rest), c.at(fine.base), c.at(fine.vectors), {}, {}, c.faces, c.free};
  if (!fine.widening.empty()) out.widening = c.at(fine.widening);
  // A mean of turns that are nearly the same is nearly a turn. Only those of free vertices are known.
  out.rotation.assign(c.on.size(), kIdentityRotation);
  for (std::size_t v = 0; v < c.on.size(); ++v) {
    double all = 0.0;
    Rotation sum{};
    for (std::size_t k = 0; k < 3; ++k) {
      if (!fine.free[c.on[v][k]]) continue;
      all += c.weight[v][k];
      for (std::size_t i = 0; i < 9; ++i) sum[i] += c.weight[v][k] * fine.rotation[c.on[v][k]][i];
    }
    if (!(all > 0.0)) continue;
    for (std::size_t i = 0; i < 9; ++i) out.rotation[v][i] = sum[i] / all;
  }
  return out;
}

/// A finer surface moves as the coarse one that it is encoded over.
std::vector<Double3> carried(const LayerLevel& level, const Level& coarse, std::span<const Double3> to,
                             const Level& fine) {
  const BaseState before(coarse.rest, coarse.faces), after(to, coarse.faces);
  std::vector<Double3> out = fine.vectors;
  auto tangent = level.finer.rest.begin();
  for (std::size_t v = 0; v < out.size(); ++v) {
    if (!fine.free[v]) continue;
    const NormalDisplacement& d = level.finer.of[v];
    const TangentRest* const residual = (d.face & kHasTangent) != 0 ? &*tangent++ : nullptr;
    out[v] = fine.rest[v] + (after.decode(d, residual) - before.decode(d, residual));
  }
  return out;
}

}  // namespace

double prism_volume(const std::array<Double3, 3>& base, const std::array<Double3, 3>& top) {
  const Double3 e = base[1] - base[0], f = base[2] - base[0];
  const Double3 d0 = top[0] - base[0], d1 = top[1] - base[1], d2 = top[2] - base[2];
  const Double3 g = d1 - d0, k = d2 - d0;
  return dot((d0 + d1 + d2) * (1.0 / 3.0),
             cross(e, f) * 0.5 + (cross(e, k) + cross(g, f)) * 0.25 + cross(g, k) * (1.0 / 6.0));
}

std::vector<Double3> displacement_volumes(const PosedLayer& layer, std::span<const LayerLevel> levels,
                                          const DisplacementVolumeOptions& options,
                                          DisplacementVolumeReport& report) {
  std::vector<Level> all;
  all.reserve(levels.size() + 1);
  all.push_back({listed(layer.rest.base), listed(layer.rest.surface), listed(layer.posed.base),
                 listed(layer.posed.surface), listed(layer.widening),
                 std::vector<Rotation>(layer.rotation.begin(), layer.rotation.end()), layer.faces,
                 layer.free});
  for (const LayerLevel& level : levels) all.push_back(coarser(all.back(), level.coarse));

  std::vector<Double3> found;
  for (std::size_t k = all.size(); k-- > 0;) {
    const Level& l = all[k];
    LayerRelaxation relaxation({l.rest_base, l.rest}, {l.base, l.vectors}, l.faces, l.free, l.rotation,
                               l.widening);
    const auto relax = [&](int rounds) {
      for (int round = 0; round < rounds; ++round) {
        relaxation.project(1.0);
        relaxation.relax_edges();
        relaxation.relax_heights();
      }
    };
    const bool grows = k + 1 == all.size();
    if (!grows || k == 0) relaxation.aim(1.0);
    if (k == 0) {
      report.prisms = relaxation.prisms();
      relaxation.measure(report.off_before, report.volume_before);
    }
    if (grows) {
      for (int scale = 1; scale <= options.scales; ++scale) {
        const double share = static_cast<double>(scale) / options.scales;
        relaxation.scale(scale == 1 ? share : static_cast<double>(scale) / (scale - 1), share);
        relaxation.aim(share);
        relaxation.scale_heights(kRings);
        relax(options.coarse_rounds);
      }
    } else {
      relaxation.set(carried(levels[k], all[k + 1], found, l));
    }
    if (!grows || k == 0) {
      relaxation.scale_heights(kRings);
      relax(options.rounds);
    }
    if (k == 0) {
      relaxation.scale_heights(kRings);
      for (int sweep = 0; sweep < options.last_sweeps; ++sweep) relaxation.project(1.0);
      relaxation.measure(report.off_after, report.volume_after);
    }
    found = relaxation.surface();
  }
  report.levels = all.size();
  return found;
}

std::uint64_t displacement_volume_bytes(std::uint64_t faces) {
  return 900 * (faces + 20000);
}

}  // namespace tessera
