/// \file quantise.h
/// Coordinates to quanta, many at a time: the same bits as Lattice::quantise, and the tests that decide what
/// is a point at all. Survey and distribution both come here, so they never differ about a point.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "octree/lattice.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

inline constexpr double kQuantaPerBrick = double{kBrickCells} * kQuantaPerCell;
/// Coordinates of 2^50 quanta and more are absurd on sight: beyond, doubles no longer hold the quanta
/// exactly.
inline constexpr double kMaxQuanta = 1125899906842624.0;

enum class PointClass : std::uint8_t { kGood, kNonFinite, kTooFar };

/// Scratch of one reader: absolute quanta (origin 0) of a chunk, whole numbers in doubles.
struct ChunkQuanta {
  std::vector<double> x, y, z;
  std::vector<PointClass> disposition;

  void compute(const PointChunk& chunk, double h) {
    const std::size_t n = chunk.size();
    for (auto* v : {&x, &y, &z}) v->resize(n);
    disposition.resize(n);
    quanta(chunk.x.data(), n, h, x.data());
    quanta(chunk.y.data(), n, h, y.data());
    quanta(chunk.z.data(), n, h, z.data());
    for (std::size_t i = 0; i < n; ++i) {
      const double sum = std::fabs(chunk.x[i]) + std::fabs(chunk.y[i]) + std::fabs(chunk.z[i]);
      const bool far = !(std::fabs(x[i]) < kMaxQuanta) || !(std::fabs(y[i]) < kMaxQuanta) ||
                       !(std::fabs(z[i]) < kMaxQuanta);
      // A sum of finite doubles may overflow; such a point is far, and counted there by the next line's
      // order.
      const bool bad = !(sum - sum == 0.0) &&
                       !(std::isfinite(chunk.x[i]) && std::isfinite(chunk.y[i]) && std::isfinite(chunk.z[i]));
      disposition[i] = bad ? PointClass::kNonFinite : far ? PointClass::kTooFar : PointClass::kGood;
    }
  }

 private:
  static void quanta(const double* world, std::size_t n, double h, double* out) {
    for (std::size_t i = 0; i < n; ++i) out[i] = std::floor(world[i] / h * kQuantaPerCell + 0.5);
  }
};

/// The good points of a chunk, in quanta, and their normals; without copies where all are good.
class GoodPoints {
 public:
  /// \post  valid until the next call, or until the chunk goes
  void choose(const PointChunk& chunk, const ChunkQuanta& quanta) {
    const auto& of = quanta.disposition;
    const auto good = static_cast<std::size_t>(std::count(of.begin(), of.end(), PointClass::kGood));
    p = {quanta.x, quanta.y, quanta.z};
    n = {chunk.nx, chunk.ny, chunk.nz};
    if (good == of.size()) return;
    for (std::size_t a = 0; a < 3; ++a)
      p[a] = chosen(p[a], of, points_[a]), n[a] = chosen(n[a], of, normals_[a]);
  }
  std::size_t size() const { return p[0].size(); }

  std::array<std::span<const double>, 3> p;
  std::array<std::span<const float>, 3> n;  ///< empty where there are none

 private:
  template <typename T>
  static std::span<const T> chosen(std::span<const T> all, const std::vector<PointClass>& of,
                                   std::vector<T>& out) {
    out.clear();
    for (std::size_t i = 0; i < all.size(); ++i)
      if (of[i] == PointClass::kGood) out.push_back(all[i]);
    return out;
  }
  std::array<std::vector<double>, 3> points_;
  std::array<std::vector<float>, 3> normals_;
};

}  // namespace tessera
