// A mesh in memory shrinks within a tolerance, and how far it is from what it was is proven.
#include <tessera/kernels.h>
#include <tessera/octree.h>
#include <tessera/version.h>

#include <cmath>
#include <iostream>

int main() {
  std::vector<tessera::Double3> vertices;
  std::vector<std::array<std::uint32_t, 3>> faces;
  constexpr std::uint32_t kSide = 100;
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x) {
      const tessera::Double3 at = {0.01 * x, 0.01 * y, 0.0};
      vertices.push_back(at + tessera::Double3{0.0, 0.0, 0.1} * std::sin(6.0 * at[0]));
      if (x + 1 == kSide || y + 1 == kSide) continue;
      const std::uint32_t v = y * kSide + x;
      faces.push_back({v, v + 1, v + kSide + 1});
      faces.push_back({v, v + kSide + 1, v + kSide});
    }
  tessera::MeshBlock block = tessera::make_block(vertices, faces);
  const tessera::MeshBlock reference = block;
  const auto report = tessera::decimate(block, reference, {.tolerance = 0.001});
  const tessera::ClosestFaces closest(reference.position, reference.faces, {0.5, 0.5, 0.0});
  const auto proof =
      tessera::certify_deviation({block.position, block.faces}, nullptr, closest,
                                 {.tolerance = 0.001, .max_distance = 0.01, .area_unit = 1e-9});
  std::cout << "Tessera " TESSERA_VERSION_STRING ": " << report.faces_in << " faces became "
            << report.faces_out << ", at most " << proof.upper << " away\n";
  return proof.upper <= 0.001 && report.faces_out < report.faces_in / 10 ? 0 : 1;
}
