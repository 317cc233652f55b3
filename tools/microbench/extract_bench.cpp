// extract_bench: speed of the extraction kernel alone, one JSON line.
// The surface is a stack of rippled sheets with sharp ridges: about the mix of a technical scan.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>

#include "kernels/extract/extended_marching_cubes.h"
#include "tests/helpers/analytic_field.h"

namespace {

using namespace tessera;

/// Sheets z = 16 m + ripple, each a thin plate with grooves; distances are good enough for roots.
test::Shape make_scene() {
  return [](const Double3& x) {
    const double period = 16.0;
    const double wave_x = 1.5 * std::sin(x[0] * 0.11) + 1.1 * std::sin(x[1] * 0.07);
    const double groove =
        std::fabs(x[0] - 24.0 * std::floor(x[0] / 24.0) - 12.0) - 9.0;  // ridges every 24 cells
    const double lift = groove > 0.0 ? groove : 0.0;
    const double z = x[2] - wave_x - lift;
    const double local = z - period * std::floor(z / period) - 0.5 * period;
    const double side = x[0] - 24.0 * std::floor(x[0] / 24.0) < 12.0 ? -1.0 : 1.0;
    const double dx = -(1.5 * 0.11 * std::cos(x[0] * 0.11)) - (groove > 0.0 ? side : 0.0);
    const double dy = -(1.1 * 0.07 * std::cos(x[1] * 0.07));
    const double sign = local > 0.0 ? 1.0 : -1.0;
    const double length = std::sqrt(1.0 + dx * dx + dy * dy);
    return test::ShapeSample{(std::fabs(local) - 3.0) / length, {sign * dx, sign * dy, sign}};
  };
}

struct Run {
  double seconds = 1e9;
  std::size_t triangles = 0;
  ExtractReport report;
};

Run measure(const DirectedField& field, ExtractMethod method, int repeats) {
  Run run;
  ExtractOptions options;
  options.method = method;
  for (int r = 0; r < repeats; ++r) {
    std::size_t triangles = 0;
    const std::clock_t start =
        std::clock();  // CPU time: the kernel is single-threaded, the machine may be busy
    run.report = extract_surface(field, options, [&](Patch&& p) { triangles += p.faces.size(); });
    const double took = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
    if (took < run.seconds) run.seconds = took;
    run.triangles = triangles;
  }
  return run;
}

}  // namespace

int main(int argc, char** argv) {
  const int bricks = argc > 1 ? std::atoi(argv[1]) : 2;
  const int repeats = argc > 2 ? std::atoi(argv[2]) : 7;
  if (bricks < 1 || bricks > 8 || repeats < 1) {
    std::fprintf(stderr, "usage: extract_bench [bricks per axis, 1..8] [repeats]\n");
    return 2;
  }
  const int cells = 64 * bricks;
  const DirectedField field = test::make_field(make_scene(), {64, 64, 64}, {cells, cells, cells});
  const Run plain = measure(field, ExtractMethod::kMarchingCubes, repeats);
  const Run extended = measure(field, ExtractMethod::kExtendedMarchingCubes, repeats);
  const auto rate = [](const Run& r) { return static_cast<double>(r.triangles) / r.seconds; };
  std::printf(
      "{\"bench\":\"extract\",\"cells\":%d,\"mc_triangles\":%zu,\"mc_triangles_per_s\":%.0f,"
      "\"mc_us_per_triangle\":%.4f,\"emc_triangles\":%zu,\"emc_triangles_per_s\":%.0f,"
      "\"emc_us_per_triangle\":%.4f,\"emc_time_over_mc\":%.3f,\"features\":%llu,\"flips\":%llu}\n",
      cells, plain.triangles, rate(plain), 1e6 / rate(plain), extended.triangles, rate(extended),
      1e6 / rate(extended), extended.seconds / plain.seconds,
      static_cast<unsigned long long>(extended.report.crease_samples + extended.report.corner_samples),
      static_cast<unsigned long long>(extended.report.flips));
  return 0;
}
