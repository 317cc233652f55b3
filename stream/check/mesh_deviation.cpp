#include "stream/check/mesh_deviation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <vector>

#include "stream/check/compare_cells.h"
#include "stream/import/import_mesh.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::uint64_t kCellFaces = 1u << 16;
constexpr double kEdgesPerDiagonal = 400.0;  // triangles of about two pixels
/// Without a scale: how far the reference is looked for. Meshes that are near cost a halo that is thin.
constexpr std::array<double, 3> kSearchPerDiagonal = {1.0 / 1024, 1.0 / 128, 1.0 / 16};
constexpr double kShare = 0.99;
constexpr int kBins = 4096;
constexpr std::uint64_t kTrianglesPerCheck = 256;

}  // namespace

MeshDeviation::MeshDeviation(const std::filesystem::path& mesh, const std::filesystem::path& reference,
                             bool with_sign, const std::filesystem::path& temp, std::uint64_t memory_bytes,
                             const char* who, std::function<void()> check)
    : scratch_(temp, "deviation"),
      memory_bytes_(memory_bytes),
      with_sign_(with_sign),
      who_(who),
      check_(std::move(check)) {
  RunOptions run;
  run.memory_bytes = memory_bytes;
  run.threads = core_count();
  mesh_.emplace(import_mesh(mesh, scratch_.path(), "mesh", run, throw_if_stopped));
  reference_.emplace(import_mesh(reference, scratch_.path(), "reference", run, throw_if_stopped));
  size_ = std::max(mesh_->diagonal(), 1e-300);
}

void MeshDeviation::for_each(double limit, const std::function<void(const DeviationTriangle&)>& sink) const {
  const DeviationSampling sampling{size_ / kEdgesPerDiagonal, limit, with_sign_};
  const double max_distance = limit + 2.0 * sampling.edge;
  const MemoryBudget budget(memory_bytes_, 0);
  std::uint64_t count = 0;
  const auto checked = [&](const DeviationTriangle& t) {
    if (++count % kTrianglesPerCheck == 0) {
      throw_if_stopped();
      if (check_) check_();
    }
    sink(t);
  };
  for (const CompareCell& cell : make_compare_cells(*mesh_, *reference_, max_distance, kCellFaces)) {
    throw_if_stopped();
    budget.require(cell.bytes, who_);
    const MeshBlock a = mesh_->load_box(cell.box);
    if (a.faces.empty()) continue;
    const MeshBlock b = reference_->load_box(grown(cell.box, kCompareHalo * max_distance));
    const ClosestFaces index(b.position, b.faces, cell.box.low);
    sample_deviation({a.position, a.faces}, {cell.box.low, cell.box.high}, index, sampling, checked);
  }
}

double MeshDeviation::scale() const {
  for (const double share : kSearchPerDiagonal)
    if (const std::optional<double> end = scale_within(size_ * share)) return *end;
  return round_up_2_digits(size_ * kSearchPerDiagonal.back());
}

std::optional<double> MeshDeviation::scale_within(double limit) const {
  std::vector<std::uint64_t> bins(kBins, 0);
  std::uint64_t all = 0;
  for_each(limit, [&](const DeviationTriangle& t) {
    for (const float d : t.deviation) {
      const double at = std::abs(static_cast<double>(d)) / limit;
      // The root spreads small distances.
      if (at < 1.0) ++bins[static_cast<std::size_t>(std::sqrt(at) * kBins)];
      ++all;
    }
  });
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < kBins; ++i) {
    sum += bins[i];
    if (static_cast<double>(sum) < kShare * static_cast<double>(all)) continue;
    const double root = static_cast<double>(i + 1) / kBins;
    return round_up_2_digits(limit * root * root);
  }
  return std::nullopt;
}

}  // namespace tessera
