#include "stream/stages/smooth/smoothed_patch.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

#include "octree/error.h"
#include "stream/meshes/mesh_rings.h"
#include "stream/runtime/memory_budget.h"
#include "stream/stages/smooth/smooth_plan.h"

namespace tessera {
namespace {

/// Numbers in the patch.
using PatchVertices = std::vector<std::uint32_t>;

/// Cuts off half along the longest extent: what lies together has its rings together.
template <class Item, class Position>
std::vector<Item> cut_off_half(std::vector<Item>& items, const Position& position) {
  Double3 low = position(items[0]), high = low;
  for (const Item i : items)
    for (std::size_t a = 0; a < 3; ++a)
      low[a] = std::min(low[a], position(i)[a]), high[a] = std::max(high[a], position(i)[a]);
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
  const auto half = items.begin() + static_cast<std::ptrdiff_t>(items.size() / 2);
  std::nth_element(items.begin(), half, items.end(), [&](Item i, Item j) {
    return position(i)[axis] != position(j)[axis] ? position(i)[axis] < position(j)[axis] : i < j;
  });
  std::vector<Item> rest(half, items.end());
  items.erase(half, items.end());
  std::sort(items.begin(), items.end()), std::sort(rest.begin(), rest.end());
  return rest;
}

std::size_t slot_of(const MeshBlock& block, std::uint64_t key) {
  return static_cast<std::size_t>(std::lower_bound(block.key.begin(), block.key.end(), key) -
                                  block.key.begin());
}

class RingSmoother {
 public:
  using Stop = std::function<void()>;

  RingSmoother(const MeshStore& store, const SmoothRound& rule, std::uint64_t bytes, const Stop& stop)
      : store_(store), rule_(rule), patch_bytes_(store.largest_patch_bytes()), bytes_(bytes), stop_(stop) {}

  std::uint64_t read() const { return read_; }

  /// The patches that the few rings are enough for are done, and what is done of the others is told by them.
  std::vector<SmoothedPatch> few(std::span<const std::size_t> patches) {
    std::vector<SmoothedPatch> out;
    const std::optional<MeshRings> near = rings_of(patches, {}, few_rings(rule_));
    if (!near) return out;
    std::vector<std::uint8_t> wanted(near->block.key.size(), 0);
    for (const std::size_t p : patches)
      for (const std::uint64_t key : store_.load({&p, 1}).key) wanted[slot_of(near->block, key)] = 1;
    stop_();
    const SmoothedBlock smoothed = smooth_block(near->block, rule_, wanted);
    for (const std::size_t p : patches) {
      SmoothedPatch& patch = out.emplace_back();
      patch.key = store_.load({&p, 1}).key;
      for (const std::uint64_t key : patch.key) {
        const std::size_t v = slot_of(near->block, key);
        patch.from.push_back(near->block.position[v]);
        patch.position.push_back(smoothed.position[v]);
        patch.role.push_back(smoothed.role[v]);
        patch.complete.push_back(smoothed.complete[v]);
        patch.first.push_back(near->first_patch[v] == p);
      }
    }
    return out;
  }

  /// Does the vertices that are not right yet, all at once or in parts.
  void complete(std::size_t p, SmoothedPatch& to) {
    std::vector<PatchVertices> parts(1);
    for (std::uint32_t v = 0; v < to.key.size(); ++v)
      if (to.complete[v] == 0) parts[0].push_back(v);
    while (!parts.empty()) {
      PatchVertices part = std::move(parts.back());
      parts.pop_back();
      if (part.empty() || take_with(round_rings(rule_), p, part, to)) continue;
      if (part.size() == 1)
        throw ResourceError("the rings of faces that smoothing needs around one vertex take at least " +
                            format_bytes(least_) + ": take fewer --threads, or with one of them --memory " +
                            std::to_string(cap_mib_for_guess(least_)) + "M");
      parts.push_back(cut_off_half(part, [&](std::uint32_t v) { return to.from[v]; }));
      parts.push_back(std::move(part));
    }
  }

  /// A patch of which nothing is known.
  SmoothedPatch bare(std::size_t p) const {
    const MeshHaloBlock near = store_.load_near({&p, 1}, 0.0);
    SmoothedBlock nothing;
    nothing.position = near.block.position;
    nothing.role.assign(near.block.key.size(), VertexRole::kOpen);
    nothing.complete.assign(near.block.key.size(), 0);
    return SmoothedPatch::of(near, 0, p, nothing);
  }

 private:
  std::optional<MeshRings> rings_of(std::span<const std::size_t> patches, std::span<const std::uint64_t> keys,
                                    int rings) {
    stop_();
    std::optional<MeshRings> near =
        load_rings(store_, patches, keys, rings, [&](std::uint64_t vertices, std::uint64_t faces) {
          const std::uint64_t need = smooth_by_rings_bytes(rule_, vertices, faces, patch_bytes_);
          if (need > bytes_) least_ = std::min(least_, need);
          return need <= bytes_;
        });
    if (near) read_ += near->block.faces.size();
    return near;
  }

  /// \returns false where so many rings of the vertices do not fit
  bool take_with(int rings, std::size_t p, const PatchVertices& vertices, SmoothedPatch& to) {
    std::vector<std::uint64_t> keys;
    for (const std::uint32_t v : vertices) keys.push_back(to.key[v]);
    const std::optional<MeshRings> near = rings_of({&p, 1}, keys, rings);
    if (!near) return false;
    std::vector<std::uint8_t> wanted(near->block.key.size(), 0);
    for (const std::uint64_t key : keys) wanted[slot_of(near->block, key)] = 1;
    stop_();
    const SmoothedBlock smoothed = smooth_block(near->block, rule_, wanted);
    for (const std::uint32_t v : vertices) {
      const std::size_t at = slot_of(near->block, to.key[v]);
      if (smoothed.complete[at] == 0)
        throw std::logic_error("smooth: vertex " + std::to_string(to.key[v]) +
                               " misses rings that are all there");
      to.position[v] = smoothed.position[at];
      to.role[v] = smoothed.role[at];
      to.complete[v] = 1;
    }
    return true;
  }

  const MeshStore& store_;
  const SmoothRound& rule_;
  std::uint64_t patch_bytes_, bytes_;
  const Stop& stop_;
  std::uint64_t read_ = 0, least_ = std::numeric_limits<std::uint64_t>::max();  ///< that did not fit
};

}  // namespace

SmoothedPatch SmoothedPatch::of(const MeshHaloBlock& near, std::size_t k, std::size_t patch,
                                const SmoothedBlock& smoothed) {
  SmoothedPatch out;
  for (const std::uint32_t v : near.core_vertices[k]) {
    out.key.push_back(near.block.key[v]);
    out.from.push_back(near.block.position[v]);
    out.first.push_back(near.first_patch[v] == patch);
    out.position.push_back(smoothed.position[v]);
    out.role.push_back(smoothed.role[v]);
    out.complete.push_back(smoothed.complete[v]);
    if (!smoothed.laplacian.empty()) out.laplacian.push_back(smoothed.laplacian[v]);
  }
  return out;
}

bool SmoothedPatch::whole() const {
  return std::find(complete.begin(), complete.end(), std::uint8_t{0}) == complete.end();
}

std::uint64_t smooth_by_rings(const MeshStore& store, const SmoothRound& rule,
                              std::span<const std::size_t> patches, std::uint64_t bytes,
                              const std::function<void()>& stop,
                              const std::function<void(std::size_t patch, const SmoothedPatch&)>& use) {
  RingSmoother smoother(store, rule, bytes, stop);
  const auto middle = [&](std::size_t p) {
    const MeshBox& box = store.patches()[p].box;
    return (box.low + box.high) * 0.5;
  };
  std::vector<std::vector<std::size_t>> groups = {{patches.begin(), patches.end()}};
  while (!groups.empty()) {
    std::vector<std::size_t> group = std::move(groups.back());
    groups.pop_back();
    std::vector<SmoothedPatch> smoothed = smoother.few(group);
    if (smoothed.empty() && group.size() > 1) {
      groups.push_back(cut_off_half(group, middle));
      groups.push_back(std::move(group));
      continue;
    }
    if (smoothed.empty()) smoothed.push_back(smoother.bare(group[0]));
    for (std::size_t k = 0; k < group.size(); ++k) {
      smoother.complete(group[k], smoothed[k]);
      use(group[k], smoothed[k]);
      smoothed[k] = {};
    }
  }
  return smoother.read();
}

int few_rings(const SmoothRound& rule) {
  const double edges = round_edges(rule);
  return edges > 0.0 ? std::min(round_rings(rule), static_cast<int>(std::ceil(edges))) : round_rings(rule);
}

std::uint64_t smooth_by_rings_bytes(const SmoothRound& rule, std::uint64_t vertices, std::uint64_t faces,
                                    std::uint64_t patch_bytes) {
  // What is done of a group of patches stays while its last vertices are.
  constexpr std::uint64_t kDoneVertexBytes = 8 + 24 + 24 + 1 + 1 + 1;
  return std::max(mesh_rings_bytes(vertices, faces, patch_bytes),
                  smooth_tile_bytes(rule, vertices, faces, patch_bytes)) +
         kDoneVertexBytes * vertices;
}

}  // namespace tessera
