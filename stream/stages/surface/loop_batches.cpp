#include "stream/stages/surface/loop_batches.h"

#include <algorithm>

namespace tessera {
namespace {

/// The triangulation of a loop costs the cube of its edges: a batch ends at about a second of work.
constexpr std::uint64_t kBatchCost = 1'000'000'000;

}  // namespace

void LoopBatches::add(HoleBoundary&& boundary) {
  const std::uint64_t n = boundary.vertex.size();
  batch_.push_back(std::move(boundary));
  ++loops_;
  edges_ += n;
  vertices_ += max_hole_vertices(n);
  cost_ += n * n * n / 6;
  if (edges_ >= max_edges_ || cost_ >= kBatchCost || vertices_ >= max_vertices_) flush();
}

void LoopBatches::flush() {
  if (batch_.empty()) return;
  save_loops(context_.create(loop_file_name(task_, batches_++)), gather());
  batch_.clear();
  edges_ = cost_ = vertices_ = 0;
}

/// Positions of the batch's loops and of the faces beyond, patch by patch.
std::vector<NamedLoop> LoopBatches::gather() {
  std::vector<std::uint64_t> need;
  for (const HoleBoundary& boundary : batch_) {
    need.insert(need.end(), boundary.vertex.begin(), boundary.vertex.end());
    need.insert(need.end(), boundary.third.begin(), boundary.third.end());
  }
  std::sort(need.begin(), need.end());
  need.erase(std::unique(need.begin(), need.end()), need.end());
  std::vector<Double3> position(need.size());
  std::vector<std::uint32_t> rgba(mesh_.has_colour ? need.size() : 0);
  load_positions(need, position, rgba);
  const auto slot = [&](std::uint64_t v) {
    return static_cast<std::size_t>(std::lower_bound(need.begin(), need.end(), v) - need.begin());
  };
  std::vector<NamedLoop> out(batch_.size());
  for (std::size_t l = 0; l < batch_.size(); ++l) {
    NamedLoop& named = out[l];
    named.vertex = batch_[l].vertex;
    named.loop.taken = batch_[l].taken;
    for (const std::uint64_t v : batch_[l].vertex) {
      named.loop.position.push_back(position[slot(v)]);
      if (!rgba.empty()) named.loop.rgba.push_back(rgba[slot(v)]);
    }
    for (const std::uint64_t v : batch_[l].third) named.loop.opposite.push_back(position[slot(v)]);
  }
  return out;
}

void LoopBatches::load_positions(const std::vector<std::uint64_t>& need, std::vector<Double3>& position,
                                 std::vector<std::uint32_t>& colour) {
  std::vector<Float3> local;
  std::vector<std::uint32_t> rgba;
  const auto& patches = mesh_.numbering.patches;
  for (std::size_t i = 0; i < need.size();) {
    context_.check_stop();
    // The last patch that begins at or before the vertex; those without vertices begin where the next does.
    const auto after =
        std::upper_bound(patches.begin(), patches.end(), need[i],
                         [](std::uint64_t v, const PatchSpan& p) { return v < p.first_vertex; });
    const auto p = static_cast<std::size_t>(after - patches.begin()) - 1;
    numbered_.load_kept_vertices(p, local, rgba);
    const Int3 brick = brick_of_key(mesh_.store.patches()[p].key);
    for (; i < need.size() && need[i] < patches[p].first_vertex + patches[p].kept_vertices; ++i) {
      const std::size_t v = need[i] - patches[p].first_vertex;
      for (std::size_t a = 0; a < 3; ++a)
        position[i][a] = brick[a] * double{kBrickCells} + double{local[v][a]};
      if (!colour.empty()) colour[i] = rgba.empty() ? 0 : rgba[v];
    }
  }
}

}  // namespace tessera
