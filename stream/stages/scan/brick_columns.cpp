#include "stream/stages/scan/brick_columns.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "octree/lattice.h"
#include "stream/files/task_files.h"
#include "stream/points/point_overlay.h"
#include "stream/points/reconstruct_options.h"

namespace tessera {
namespace {

/// Of a brick's block.
constexpr std::uint64_t kBlockPointBytes = 42;

}  // namespace

BrickColumns::BrickColumns(const JobState& state)
    : axes_(ViewAxes::along(reconstruct_options(state).up.value_or(Double3{0, 0, 1}))) {
  auto overlay = PointOverlay::open(state.work);
  if (!overlay || overlay->volumetric() != VolumetricUse::kTop) return;
  store_ =
      std::make_unique<PointStore>(list_task_files(state.work / kScanPointFolder, kPointExtension), overlay);
  for (std::size_t b = 0; b < store_->bricks().size(); ++b) {
    const Int3 at = brick_of_key(store_->bricks()[b].key);
    columns_[{at[axes_.u], at[axes_.v]}].push_back(b);
  }
}

BrickColumns::Fullest BrickColumns::fullest(int u0, int u1, int v0, int v1) const {
  Fullest out;
  for (int u = u0; u < u1; ++u)
    for (int v = v0; v < v1; ++v) {
      const auto found = columns_.find({u, v});
      if (found == columns_.end()) continue;
      std::uint64_t points = 0;
      for (const std::size_t b : found->second) {
        points += store_->bricks()[b].points;
        out.brick = std::max(out.brick, store_->bricks()[b].points);
      }
      out.column = std::max(out.column, points);
    }
  return out;
}

std::vector<ColumnPoint> BrickColumns::load(int u, int v, TaskContext& context) const {
  std::vector<ColumnPoint> points;
  const auto found = columns_.find({u, v});
  if (found == columns_.end()) return points;
  std::size_t count = 0;
  for (const std::size_t b : found->second) count += store_->bricks()[b].points;
  points.reserve(count);
  for (const std::size_t b : found->second) {
    const Int3 at = brick_of_key(store_->bricks()[b].key);
    const PointBlock block = store_->load({at[0] * kBrickCells, at[1] * kBrickCells, at[2] * kBrickCells},
                                          {kBrickCells, kBrickCells, kBrickCells}, 0, {.flags = true});
    const std::array<const std::vector<float>*, 3> position = {&block.x, &block.y, &block.z};
    const std::array<const std::vector<float>*, 3> normal = {&block.nx, &block.ny, &block.nz};
    const std::vector<float>&pu = *position[axes_.u], &pv = *position[axes_.v], &pt = *position[axes_.up];
    const std::int32_t base = at[axes_.up] * kBrickCells * kQuantaPerCell;
    for (std::size_t i = 0; i < block.size(); ++i) {
      ColumnPoint p;
      p.column = static_cast<std::uint16_t>(static_cast<int>(pv[i]) * kBrickCells + static_cast<int>(pu[i]));
      p.volumetric = (block.flags[i] & kPointVolumetric) != 0;
      const auto across = [&](std::size_t axis) {
        return static_cast<std::int8_t>((*normal[axis])[i] * 127.0f);
      };
      p.normal_u = across(axes_.u), p.normal_v = across(axes_.v);
      p.steep = !p.volumetric && std::fabs((*normal[axes_.up])[i]) < kSteepCosine;
      p.height = axes_.sign * (base + static_cast<std::int32_t>(pt[i] * kQuantaPerCell));
      p.rgba = block.rgba.empty() ? 0 : block.rgba[i];
      points.push_back(p);
    }
    context.count_read(block.size() * sizeof(PointRecord));
    context.check_stop();
  }
  return points;
}

std::uint64_t BrickColumns::load_bytes(std::uint64_t points) {
  return points * kBlockPointBytes;
}

std::uint64_t BrickColumns::key(int u, int v) const {
  Int3 at = {0, 0, 0};
  at[axes_.u] = u, at[axes_.v] = v;
  return brick_key(at);
}

}  // namespace tessera
