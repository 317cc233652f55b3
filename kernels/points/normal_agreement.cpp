#include "kernels/points/normal_agreement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace tessera {
namespace {

constexpr std::size_t kNearest = 4;  ///< neighbours that a sample is compared with
constexpr float kParallel = 0.8f;    ///< cosine between lines of one surface
constexpr double kInPlane = 0.35;    ///< offset along the normal, as a part of the distance
// A split cell: its lines are parallel, both sides have their part of it, hardly any sample lies beyond the line, and the
// two halves are one sheet.
constexpr std::size_t kMinOfCell = 8;
constexpr double kParallelMean = 0.8, kMinPart = 0.25, kMaxBeyond = 0.1, kMaxStep = 0.25;

bool is_split(std::span<const NormalSample> cell) {
  if (cell.size() < kMinOfCell) return false;
  const auto n = static_cast<double>(cell.size());
  Double3 axis{};
  for (const NormalSample& s : cell) axis = dot(s.n, cell[0].n) < 0.0f ? axis - wide(s.n) : axis + wide(s.n);
  if (norm(axis) < kParallelMean * n) return false;
  axis = unit(axis);
  const auto up = [&](const NormalSample& s) { return dot(wide(s.n), axis) > 0.0; };
  Double3 above{}, below{};
  double count = 0.0;
  for (const NormalSample& s : cell) {
    Double3& sum = up(s) ? above : below;
    sum = sum + s.p;
    if (up(s)) count += 1.0;
  }
  if (std::min(count, n - count) < kMinPart * n) return false;
  above = above / count, below = below / (n - count);
  const double step = dot(above - below, axis);
  const Double3 across = above - below - axis * step;
  const double apart = norm(across);
  if (!(std::fabs(step) <= kMaxStep * apart) || !(apart > 0.0)) return false;
  const double line = 0.5 * dot(above + below, across);
  double beyond = 0.0;
  for (const NormalSample& s : cell) beyond += (dot(s.p, across) > line) != up(s) ? 1.0 : 0.0;
  return beyond <= kMaxBeyond * n;
}

}  // namespace

NormalAgreement compare_neighbours(std::span<const NormalSample> cell) {
  struct Neighbour {
    double squared = std::numeric_limits<double>::infinity();
    std::size_t at = 0;
  };
  NormalAgreement out;
  std::uint64_t behind = 0, before = 0, mixed = 0;
  for (std::size_t i = 0; i < cell.size(); ++i) {
    const Double3 n = wide(cell[i].n);
    std::array<Neighbour, kNearest> nearest;
    for (std::size_t j = 0; j < cell.size(); ++j) {
      const Double3 d = cell[j].p - cell[i].p;
      const double squared = dot(d, d);
      if (j == i || !(squared > 0.0) || squared >= nearest.back().squared) continue;
      const double along = dot(d, n);
      if (along * along > kInPlane * kInPlane * squared || std::fabs(dot(cell[i].n, cell[j].n)) < kParallel)
        continue;
      std::size_t at = kNearest - 1;
      for (; at > 0 && nearest[at - 1].squared > squared; --at) nearest[at] = nearest[at - 1];
      nearest[at] = {squared, j};
    }
    for (const Neighbour& near : nearest) {
      if (!(near.squared < std::numeric_limits<double>::infinity())) break;
      ++out.pairs;
      const NormalSample& other = cell[near.at];
      if (dot(cell[i].n, other.n) > 0.0f) continue;
      const Double3 d = other.p - cell[i].p;
      const double there = dot(d, n), back = -dot(d, wide(other.n));
      ++(there < 0.0 && back < 0.0 ? behind : there > 0.0 && back > 0.0 ? before : mixed);
    }
  }
  out.against = mixed + 2 * std::min(behind, before);
  out.cells = 1;
  out.split = is_split(cell) ? 1 : 0;
  return out;
}

}  // namespace tessera
