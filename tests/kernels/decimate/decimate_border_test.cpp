// Decimation where the surface ends, and where it was moved before: the bound of the loop against the certificate, which shares no code with it.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>

#include "kernels/certify/certificate.h"
#include "kernels/decimate/decimate.h"
#include "kernels/mesh/mesh_block_ops.h"
#include "octree/portable_math.h"
#include "octree/vector.h"
#include "tests/helpers/block_meshes.h"

namespace decimate_border_test {

namespace {

using namespace tessera;
using namespace tessera::test;

/// Proven distance of a to b.
double certified(const MeshBlock& a, const MeshBlock& b, double tolerance) {
  CertificateOptions options;
  options.tolerance = tolerance;
  options.max_distance = 100.0 * tolerance;
  options.area_unit = 1e-6;
  return certify_deviation({a.position, a.faces}, nullptr, ClosestFaces(b.position, b.faces, b.position[0]),
                           options)
      .upper;
}

/// A sheet with noise, a share of whose faces is missing: ears, slits, islands and vertices with several fans.
MeshBlock ragged_sheet(int size, double noise, double missing, std::uint64_t seed) {
  MeshBlock sheet = grid_block(size, size, [](double x, double y) { return 0.002 * x * (x - y); });
  add_noise(sheet, noise, seed);
  std::vector<std::array<std::uint32_t, 3>> faces;
  for (std::size_t f = 0; f < sheet.faces.size(); ++f)
    if (static_cast<double>(random_bits(seed, 9, f) % 1000) >= 1000.0 * missing)
      faces.push_back(sheet.faces[f]);
  // Every fan gets a vertex of its own, as the import makes them.
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> own(faces.size());
  std::vector<std::vector<std::pair<std::uint32_t, std::uint32_t>>> at(
      sheet.position.size());  // (face, corner)
  for (std::uint32_t f = 0; f < faces.size(); ++f)
    for (std::uint32_t c = 0; c < 3; ++c) at[faces[f][c]].push_back({f, c});
  for (std::uint32_t v = 0; v < at.size(); ++v) {
    std::vector<int> fan(at[v].size());
    for (std::size_t i = 0; i < fan.size(); ++i) fan[i] = static_cast<int>(i);
    for (std::size_t round = 0; round < fan.size(); ++round)
      for (std::size_t i = 0; i < fan.size(); ++i)
        for (std::size_t j = 0; j < fan.size(); ++j) {
          const auto [f, c] = at[v][i];
          const auto [g, d] = at[v][j];
          if (faces[f][(c + 1) % 3] == faces[g][(d + 2) % 3]) fan[i] = fan[j] = std::min(fan[i], fan[j]);
        }
    for (std::size_t i = 0; i < fan.size(); ++i) {
      const std::size_t first = static_cast<std::size_t>(fan[i]);
      if (first == i) position.push_back(sheet.position[v]);
      own[at[v][i].first][at[v][i].second] = first == i ? static_cast<std::uint32_t>(position.size() - 1)
                                                        : own[at[v][first].first][at[v][first].second];
    }
  }
  return make_block(position, own);
}

}  // namespace

TEST_CASE("decimate: ragged borders do not creep, ears of ears count", "[property]") {
  for (const double missing : {0.05, 0.2, 0.35})
    for (std::uint64_t seed = 1; seed <= 6; ++seed) {
      const MeshBlock reference = ragged_sheet(40, 0.1, missing, seed);
      for (const double tolerance : {0.15, 0.6, 1.5}) {
        DecimateOptions options;
        options.tolerance = tolerance;
        options.feature_angle_deg = seed % 2 == 0 ? 25.0 : 0.0;
        MeshBlock block = reference;
        for (int pass = 0; pass < 3; ++pass) decimate(block, pass == 0 ? block : reference, options);
        CAPTURE(missing, seed, tolerance, reference.faces.size(), block.faces.size());
        CHECK(block.faces.size() < reference.faces.size());
        CHECK(certified(block, reference, tolerance) <= 1.03 * tolerance);
        CHECK(certified(reference, block, tolerance) <= 1.03 * tolerance);
      }
    }
}

TEST_CASE("decimate: held vertices keep their faces", "[unit]") {
  const MeshBlock reference = grid_block(20, 20, [](double, double) { return 0.0; });
  std::vector<std::uint64_t> pinned;
  for (std::size_t v = 0; v < reference.key.size(); ++v)
    if (reference.position[v][0] >= 5.0 && reference.position[v][0] <= 8.0)
      pinned.push_back(reference.key[v]);
  DecimateOptions options;
  options.tolerance = 0.1;
  MeshBlock block = reference;
  decimate(block, block, options, pinned);
  CHECK(block.faces.size() < reference.faces.size() / 3);
  std::size_t kept = 0;
  for (const auto& f : block.faces) {
    bool inside = true;
    for (const std::uint32_t v : f)
      inside = inside && block.position[v][0] >= 5.0 && block.position[v][0] <= 8.0;
    kept += inside;
  }
  CHECK(kept == 3 * 20 * 2);
}

TEST_CASE("decimate: what was moved before stays within the tolerance of where it was, lines too",
          "[property]") {
  const double tolerance = 0.3, moved = 0.08;
  // A sheet with a crease that ends in its border, a body without any line, and its edges.
  const auto ridge = [](double x, double) { return -std::fabs(x - 15.0); };
  for (const MeshBlock& given : {grid_block(30, 30, ridge), sphere_block(4), cube_block(16)}) {
    const double scale = given.faces.size() == 1800 ? 1.0 : 1.0 / 16.0;
    MeshBlock smooth = given;
    add_noise(smooth, moved * scale, 3);
    smooth.face_bound.clear();
    for (const auto& f : smooth.faces) {
      double maximum = 0.0;
      for (const std::uint32_t v : f)
        maximum = std::max(maximum, norm(smooth.position[v] - given.position[v]));
      smooth.face_bound.push_back(static_cast<float>(maximum * (1.0 + 1e-6)));
    }
    for (const double angle : {0.0, 40.0}) {
      DecimateOptions options;
      options.tolerance = tolerance * scale;
      options.feature_angle_deg = angle;
      MeshBlock b = smooth;
      const DecimateReport first = decimate(b, b, options);
      const std::size_t left = b.faces.size();
      const DecimateReport second = decimate(b, smooth, options);  // as after a pass with other seams
      CAPTURE(given.faces.size(), angle, left, b.faces.size());
      CHECK(left < given.faces.size() / 3);
      CHECK(std::max(first.bound, second.bound) <= options.tolerance);
      CHECK(certified(b, given, options.tolerance) <= options.tolerance);
      CHECK(certified(given, b, options.tolerance) <= options.tolerance);
    }
  }
}

}  // namespace decimate_border_test
