#include "stream/check/vertex_deviation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/certify/deviation_samples.h"
#include "stream/check/compare_cells.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::uint64_t kCellFaces = 1u << 16;
constexpr double kSearchPerDiagonal = 1.0 / 16;  // as render --deviation without a scale

bool inside(const MeshBox& box, const Double3& p) {
  bool in = true;
  for (std::size_t k = 0; k < 3; ++k) in = in && p[k] >= box.low[k] && p[k] <= box.high[k];
  return in;
}

double percentile99(const std::vector<float>& distance) {
  std::vector<float> size;
  for (const float d : distance)
    if (std::isfinite(d)) size.push_back(std::abs(d));
  if (size.empty()) return 0.0;
  const auto at = size.begin() + static_cast<std::ptrdiff_t>(99 * (size.size() - 1) / 100);
  std::nth_element(size.begin(), at, size.end());
  return *at > 0.0f ? round_up_2_digits(static_cast<double>(*at)) : 0.0;
}

}  // namespace

VertexDeviation vertex_deviation(const std::filesystem::path& mesh, std::span<const Double3> position,
                                 const std::filesystem::path& reference, bool with_sign,
                                 const std::filesystem::path& temp, std::uint64_t memory_bytes) {
  const ScratchFolder scratch(temp, "deviation");
  RunOptions run;
  run.memory_bytes = memory_bytes;
  run.threads = core_count();
  const MeshStore of = import_mesh(mesh, scratch.path(), "mesh", run, throw_if_stopped);
  const MeshStore to = import_mesh(reference, scratch.path(), "reference", run, throw_if_stopped);
  const double limit = std::max(of.diagonal(), 1e-300) * kSearchPerDiagonal;
  const MemoryBudget budget(memory_bytes, resident_bytes());

  VertexDeviation out;
  out.distance.assign(position.size(), std::numeric_limits<float>::quiet_NaN());
  std::vector<Double3> point;
  std::vector<std::size_t> number;
  std::vector<float> distance;
  for (const CompareCell& cell : make_compare_cells(of, to, limit, kCellFaces)) {
    throw_if_stopped();
    point.clear(), number.clear();
    for (std::size_t v = 0; v < position.size(); ++v) {
      if (!std::isnan(out.distance[v]) || !inside(cell.box, position[v])) continue;
      point.push_back(position[v]);
      number.push_back(v);
    }
    if (point.empty()) continue;
    budget.require(cell.bytes, "view --deviation");
    const MeshBlock near = to.load_box(grown(cell.box, kCompareHalo * limit));
    const ClosestFaces index(near.position, near.faces, cell.box.low);
    distance.resize(point.size());
    measure_deviation(point, index, {0.0, limit, with_sign}, distance);
    for (std::size_t i = 0; i < point.size(); ++i) out.distance[number[i]] = distance[i];
  }
  // What no face uses lies where no mesh is.
  for (float& d : out.distance)
    if (std::isnan(d)) d = std::numeric_limits<float>::infinity();
  out.percentile99 = percentile99(out.distance);
  return out;
}

}  // namespace tessera
