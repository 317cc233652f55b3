// Speed and density of the field kernel on one synthetic block; prints one JSON line.
// field_bench [sphere|box|terrain] [cells] [h in spacings] [radius in cells] [noise in spacings] [repeats] [noise of normals, rad]
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <string>

#include "kernels/field/field.h"
#include "tests/helpers/oriented_samples.h"
#include "tools/microbench/thread_seconds.h"

namespace {

using namespace tessera;

test::Samples make_scene(const std::string& name, int cells, double spacing, double noise, double* centre_out,
                         double* radius_out) {
  test::Random random(7);
  test::Samples samples;
  const double centre = 64.0 + 0.5 * cells, radius = 0.43 * cells;
  *centre_out = centre;
  *radius_out = radius;
  if (name == "sphere") {
    test::add_sphere({centre, centre, centre}, radius, spacing, random, samples);
  } else if (name == "box") {
    const double low = centre - 0.37 * cells, high = centre + 0.37 * cells;
    test::add_box({low, low, low}, {high, high, high}, spacing, random, samples);
  } else if (name == "terrain") {
    const int n = static_cast<int>((cells + 16) / spacing);
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) {
        const double x = 56.0 + (i + random.unit()) * spacing, y = 56.0 + (j + random.unit()) * spacing;
        const double z = centre + 6.0 * std::sin(x / 11.0) * std::cos(y / 17.0);
        const double zx = 6.0 / 11.0 * std::cos(x / 11.0) * std::cos(y / 17.0),
                     zy = -6.0 / 17.0 * std::sin(x / 11.0) * std::sin(y / 17.0);
        const double l = std::sqrt(1.0 + zx * zx + zy * zy);
        samples.push_back({{x, y, z}, {-zx / l, -zy / l, 1.0 / l}, 0});
      }
  } else {
    std::fprintf(stderr, "field_bench: unknown scene %s; know sphere, box, terrain\n", name.c_str());
    std::exit(2);
  }
  if (noise > 0.0) test::add_noise(noise * spacing, random, samples);
  return samples;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string scene = argc > 1 ? argv[1] : "sphere";
  const int cells = argc > 2 ? std::atoi(argv[2]) : 128;
  const double h = argc > 3 ? std::atof(argv[3]) : 1.5, radius = argc > 4 ? std::atof(argv[4]) : 3.0;
  const double noise = argc > 5 ? std::atof(argv[5]) : 0.0;
  const int repeats = argc > 6 ? std::atoi(argv[6]) : 20;
  const double normal_noise = argc > 7 ? std::atof(argv[7]) : 0.0;
  FieldOptions options;
  options.radius_cells = radius;
  options.noise_cells = noise / h;
  double centre = 0, sphere_radius = 0;
  auto samples = make_scene(scene, cells, 1.0 / h, noise, &centre, &sphere_radius);
  test::Random random(11);
  for (auto& s : samples) {
    double l2 = 0;
    for (double& n : s.n) {
      n += normal_noise * random.gaussian();
      l2 += n * n;
    }
    for (double& n : s.n) n /= std::sqrt(l2);
  }
  const Int3 origin = {64, 64, 64}, size = {cells, cells, cells};
  const PointBlock block = test::make_block(samples, origin, size, field_halo_cells(options));
  const std::size_t core = test::make_block(samples, origin, size, 0).size();
  double best = 1e30;
  DirectedField field;
  for (int i = 0; i < repeats; ++i) {
    const double start = thread_seconds();
    field = evaluate_field(block, options);
    best = std::min(best, thread_seconds() - start);
  }
  std::size_t nodes = 0, torn = 0;
  double error = 0, normal_error = 0;
  std::size_t roots = 0;
  for (const BandLeaf& leaf : field.leaves) {
    for (const auto word : leaf.valid()) nodes += static_cast<std::size_t>(std::popcount(word));
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (int z = 0; z < 8; ++z)
        for (int b = 0; b < 64; ++b) {
          const int i = leaf.origin[0] + (b & 7), j = leaf.origin[1] + (b >> 3), k = leaf.origin[2] + z;
          const EdgeRoot* root = field.root_at(i, j, k, static_cast<int>(axis));
          if (!root) continue;
          ++roots;
          Double3 p = {i + 0.0 + origin[0], j + 0.0 + origin[1], k + 0.0 + origin[2]};
          p[axis] += static_cast<double>(root->t);
          if (scene == "sphere") {
            const double dx = p[0] - centre, dy = p[1] - centre, dz = p[2] - centre;
            const double d = std::sqrt(dx * dx + dy * dy + dz * dz);
            error += std::abs(d - sphere_radius);
            const double c =
                (dx * static_cast<double>(root->normal[0]) + dy * static_cast<double>(root->normal[1]) +
                 dz * static_cast<double>(root->normal[2])) /
                d;
            normal_error += std::sqrt(std::max(0.0, 2.0 - 2.0 * c));
          }
          // A crossed edge whose four cells are not all complete: a border of the surface.
          bool complete = true;
          for (int c = 0; c < 4 && complete; ++c) {
            Int3 base = {i, j, k};
            base[(axis + 1) % 3] -= c & 1;
            base[(axis + 2) % 3] -= c >> 1;
            for (int corner = 0; corner < 8 && complete; ++corner) {
              const Int3 q = {base[0] + (corner & 1), base[1] + (corner >> 1 & 1), base[2] + (corner >> 2)};
              bool in = true;
              for (std::size_t a = 0; a < 3; ++a) in = in && q[a] >= -1 && q[a] <= cells;
              if (!in) continue;
              const BandLeaf* at = field.leaf_at(q[0], q[1], q[2]);
              complete = at && at->is_valid(BandLeaf::node(q[0], q[1], q[2]));
            }
          }
          torn += !complete;
        }
  }
  const auto n = static_cast<double>(core);
  std::printf(
      "{\"bench\":\"field\",\"scene\":\"%s\",\"cells\":%d,\"h\":%g,\"radius\":%g,\"noise\":%g,\"normal_"
      "noise\":%g,"
      "\"points\":%zu,\"seconds\":%.5f,\"points_per_s\":%.0f,\"us_per_point\":%.4f,\"nodes_per_point\":%.3f,"
      "\"roots_per_point\":%.3f,\"leaves\":%zu,\"torn_edges\":%zu,\"mean_error_h\":%.5f,"
      "\"mean_normal_error\":%.5f}\n",
      scene.c_str(), cells, h, radius, noise, normal_noise, core, best, n / best, best / n * 1e6,
      static_cast<double>(nodes) / n, static_cast<double>(roots) / n, field.leaves.size(), torn,
      error / static_cast<double>(std::max<std::size_t>(1, roots)),
      normal_error / static_cast<double>(std::max<std::size_t>(1, roots)));
  return 0;
}
