// Error, cost and memory of the winding number on the lattice; prints one JSON line.
// winding_bench [points] [queries] [brute force 0|1]
// A torus sampled at h = 1.5 spacings; two queries of three within 12 cells of a sample, the others anywhere
// in its box.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "octree/portable_math.h"
#include "octree/winding_number.h"
#include "tests/helpers/oriented_samples.h"
#include "tools/microbench/thread_seconds.h"

namespace {

using namespace tessera;

Int3 quantised(const Double3& p) {
  Int3 q;
  for (std::size_t c = 0; c < 3; ++c) q[c] = static_cast<int>(std::floor(p[c] * kQuantaPerCell + 0.5));
  return q;
}

/// Sums in double over all dipoles, 64 queries at a time.
std::vector<double> brute_force(const std::vector<Dipole>& dipoles, const std::vector<Int3>& queries) {
  constexpr std::size_t kBatch = 64;
  std::vector<double> out(queries.size());
  for (std::size_t at = 0; at < queries.size(); at += kBatch) {
    std::array<double, kBatch> x{}, y{}, z{}, sum{};
    const std::size_t count = std::min(kBatch, queries.size() - at);
    for (std::size_t i = 0; i < count; ++i)
      x[i] = queries[at + i][0], y[i] = queries[at + i][1], z[i] = queries[at + i][2];
    constexpr double kCore = static_cast<double>(kDipoleCore);
    for (const Dipole& d : dipoles) {
      const double px = d.q[0], py = d.q[1], pz = d.q[2];
      const double mx = static_cast<double>(d.moment[0]), my = static_cast<double>(d.moment[1]),
                   mz = static_cast<double>(d.moment[2]);
      for (std::size_t i = 0; i < kBatch; ++i) {
        const double dx = (px - x[i]) / kQuantaPerCell, dy = (py - y[i]) / kQuantaPerCell,
                     dz = (pz - z[i]) / kQuantaPerCell;
        const double r2 = std::max(dx * dx + dy * dy + dz * dz, kCore * kCore);
        sum[i] += (mx * dx + my * dy + mz * dz) / (r2 * std::sqrt(r2));
      }
    }
    for (std::size_t i = 0; i < count; ++i) out[at + i] = sum[i] / (4 * kPi);
  }
  return out;
}

}  // namespace

int main(int argc, char** argv) {
  const double points = argc > 1 ? std::atof(argv[1]) : 100000;
  const auto count = static_cast<std::size_t>(argc > 2 ? std::atof(argv[2]) : 100000);
  const bool brute = argc <= 3 || std::atoi(argv[3]) != 0;

  // Ring R, tube R / 2.5: area 4 pi^2 R^2 / 2.5.
  const double spacing = 1 / 1.5;
  const double ring = std::sqrt(points * spacing * spacing * 2.5 / (4 * kPi * kPi)), tube = ring / 2.5;
  const double half = ring + tube;
  const Double3 centre = {half + 200.3, half + 190.7, half + 210.1};
  test::Random random(3);
  std::vector<Dipole> dipoles;
  {
    test::Samples samples;
    test::add_torus(centre, ring, tube, spacing, random, samples);
    const double area = 4 * kPi * kPi * ring * tube / static_cast<double>(samples.size());
    for (const test::Sample& s : samples) {
      Dipole d;
      d.q = quantised(s.p);
      for (std::size_t c = 0; c < 3; ++c) d.moment[c] = static_cast<float>(s.n[c] * area);
      dipoles.push_back(d);
    }
  }
  const auto before = [](const Int3& a, const Int3& b) {
    return cell_key(a, -kQuantumBits) < cell_key(b, -kQuantumBits);
  };
  std::sort(dipoles.begin(), dipoles.end(),
            [&](const Dipole& a, const Dipole& b) { return before(a.q, b.q); });
  std::vector<Int3> queries(count);
  for (std::size_t i = 0; i < count; ++i) {
    Double3 p;
    const Int3& near =
        dipoles[static_cast<std::size_t>(random.unit() * static_cast<double>(dipoles.size()))].q;
    for (std::size_t c = 0; c < 3; ++c)
      p[c] = i % 3 == 0 ? centre[c] + 1.2 * half * (2 * random.unit() - 1)
                        : static_cast<double>(near[c]) / kQuantaPerCell + 12 * (2 * random.unit() - 1);
    queries[i] = quantised(p);
  }
  std::sort(queries.begin(), queries.end(), before);

  double start = thread_seconds();
  const MultipoleTree tree(dipoles, kLeafBits);
  const double build = thread_seconds() - start;
  std::uint64_t summary = 0;
  for (int bits = kBrickBits; bits <= tree.top_bits(); ++bits) summary += tree.level(bits).cells.size();
  std::vector<float> value(count);
  std::vector<Float3> gradient(count);
  const WindingField field(tree);
  start = thread_seconds();
  field.evaluate(queries, value);
  const double seconds = thread_seconds() - start;
  start = thread_seconds();
  field.evaluate(queries, value, gradient);
  const double with_gradient = thread_seconds() - start;
  // Nodes of the lattice, leaf by leaf, as closing asks for them.
  std::vector<Int3> nodes;
  std::vector<float> at_nodes;
  const auto& leaves = tree.level(kLeafBits).cells;
  for (std::size_t l = 0; l < leaves.size() && nodes.size() < count; l += 1 + leaves.size() / 200) {
    const auto at = morton_decode(leaves[l].key);
    for (int n = 0; n < 512; ++n)
      nodes.push_back({(static_cast<int>(at[0]) * 8 + (n & 7)) << 10,
                       (static_cast<int>(at[1]) * 8 + (n >> 3 & 7)) << 10,
                       (static_cast<int>(at[2]) * 8 + (n >> 6)) << 10});
  }
  at_nodes.resize(nodes.size());
  start = thread_seconds();
  field.evaluate(nodes, at_nodes);
  const double by_leaf = thread_seconds() - start;

  double rms = -1, worst = -1, brute_seconds = 0;
  if (brute) {
    start = thread_seconds();
    const std::vector<double> exact = brute_force(dipoles, queries);
    brute_seconds = thread_seconds() - start;
    double sum2 = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const double e = std::abs(static_cast<double>(value[i]) - exact[i]);
      sum2 += e * e;
      worst = std::max(worst, e);
    }
    rms = std::sqrt(sum2 / static_cast<double>(count));
  }
  const double n = static_cast<double>(count);
  std::printf(
      "{\"bench\":\"winding\",\"points\":%zu,\"queries\":%zu,\"rms\":%.3g,\"max\":%.3g,\"us_per_query\":%.3g,"
      "\"us_with_gradient\":%.3g,\"us_per_node_by_leaf\":%.3g,\"brute_us\":%.4g,\"build_s\":%.3g,"
      "\"summary_cells\":%zu,\"summary_bytes\":%zu,\"leaves\":%zu}\n",
      dipoles.size(), count, rms, worst, 1e6 * seconds / n, 1e6 * with_gradient / n,
      1e6 * by_leaf / static_cast<double>(nodes.size()), 1e6 * brute_seconds / n, build,
      static_cast<std::size_t>(summary), static_cast<std::size_t>(summary * sizeof(Multipole)),
      leaves.size());
  return 0;
}
