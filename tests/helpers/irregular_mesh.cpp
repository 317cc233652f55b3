#include "tests/helpers/irregular_mesh.h"

#include <cmath>

#include "solvers/intrinsic_delaunay.h"

namespace tessera::test {
namespace {

double random_unit(std::uint64_t& state) {
  state = state * 6364136223846793005ULL + 1442695040888963407ULL;
  return static_cast<double>(state >> 40) * 0x1p-24;
}

}  // namespace

IrregularMesh irregular_mesh(const IrregularMeshOptions& options) {
  const std::size_t n = options.side;
  IrregularMesh mesh;
  mesh.positions.reserve(n * n);
  mesh.fixed.reserve(n * n);
  constexpr double kPi = 3.14159265358979323846;
  const auto graded = [&](double t) { return t + options.grading * std::sin(2.0 * kPi * t) / (2.0 * kPi); };
  const double step = 1.0 / static_cast<double>(n - 1);
  std::uint64_t state = 7;
  for (std::size_t j = 0; j < n; ++j)
    for (std::size_t i = 0; i < n; ++i) {
      const double u = (static_cast<double>(i) + options.jitter * (2.0 * random_unit(state) - 1.0)) * step;
      const double v = (static_cast<double>(j) + options.jitter * (2.0 * random_unit(state) - 1.0)) * step;
      mesh.positions.push_back({graded(u), graded(v) / options.stretch, 0.0});
      const double r2 = (u - 0.5) * (u - 0.5) + (v - 0.5) * (v - 0.5);
      const bool border = i < 3 || j < 3 || i + 3 >= n || j + 3 >= n;
      mesh.fixed.push_back(border ? 1 : r2 < 1.0 / 256.0 ? 2 : 0);
    }
  mesh.faces.reserve(2 * (n - 1) * (n - 1));
  for (std::size_t j = 0; j + 1 < n; ++j)
    for (std::size_t i = 0; i + 1 < n; ++i) {
      const auto a = static_cast<std::uint32_t>(j * n + i), b = a + 1, c = a + static_cast<std::uint32_t>(n),
                 d = c + 1;
      if (random_unit(state) < 0.5) {
        mesh.faces.push_back({a, b, d});
        mesh.faces.push_back({a, d, c});
      } else {
        mesh.faces.push_back({a, b, c});
        mesh.faces.push_back({b, d, c});
      }
    }
  // In the plane, intrinsic flips give the Delaunay triangulation itself.
  if (options.stretch == 1.0) mesh.faces = intrinsic_delaunay({mesh.positions, mesh.faces}).faces;
  mesh.target.reserve(3 * n * n);
  for (std::size_t k = 0; k < mesh.positions.size(); ++k) {
    auto& p = mesh.positions[k];
    p[2] = options.height * std::sin(5.0 * p[0]) * std::cos(4.0 * p[1] + 1.0);
    mesh.target.insert(mesh.target.end(), {p[0], p[1], p[2] + (mesh.fixed[k] == 2 ? 0.2 : 0.0)});
    mesh.fixed[k] = mesh.fixed[k] != 0;
  }
  return mesh;
}

}  // namespace tessera::test
