#include "kernels/extract/patch_builder.h"

#include <algorithm>
#include <cassert>

namespace tessera {
namespace {

constexpr std::uint32_t kUnranked = 0xffffffffu;

VertexKey key_on_finest(Int3 node, int level, int type) {
  for (int& c : node) {
    c *= 1 << level;
    assert(c >= 0 && c < 1 << kMaxCellBits);
  }
  return make_vertex_key(static_cast<std::uint32_t>(node[0]), static_cast<std::uint32_t>(node[1]),
                         static_cast<std::uint32_t>(node[2]), static_cast<std::uint32_t>(type));
}

}  // namespace

PatchBuilder::PatchBuilder(const Int3& corner, int level, bool names, bool finer)
    : corner_(corner), names_(names), finer_(finer) {
  patch_.level = level;
  for (std::size_t a = 0; a < 3; ++a) patch_.brick[a] = corner[a] >> kBrickBits;
}

VertexKey PatchBuilder::key(const Int3& at, int type) const {
  return key_on_finest({corner_[0] + at[0], corner_[1] + at[1], corner_[2] + at[2]}, patch_.level, type);
}

VertexKey PatchBuilder::finer_key(const Int3& node, int type) const {
  return key_on_finest(node, patch_.level - 1, type);
}

void PatchBuilder::start(std::size_t own, std::size_t foreign) {
  first_own_ = own;
  patch_.position.resize(own);
  patch_.rgba.resize(own);
  patch_.vertex_class.resize(own);
  if (names_) patch_.name.resize(own);
  patch_.faces.reserve(2 * own);
  foreign_.resize(foreign);
}

std::uint32_t PatchBuilder::add_own(const BrickVertex& vertex) {
  patch_.position.push_back(vertex.position);
  patch_.rgba.push_back(vertex.rgba);
  patch_.vertex_class.push_back(vertex.kind);
  if (names_) patch_.name.push_back(vertex.key);
  return static_cast<std::uint32_t>(patch_.position.size() - 1);
}

std::uint32_t PatchBuilder::add_foreign(const BrickVertex& vertex) {
  foreign_.push_back(vertex);
  return static_cast<std::uint32_t>(foreign_.size() - 1) | kForeignVertex;
}

std::uint32_t PatchBuilder::add_finer(const BrickVertex& vertex) {
  const auto [found, is_new] = finer_slot_.emplace(vertex.key, 0);
  if (is_new) found->second = add_foreign(vertex);
  return found->second;
}

std::uint32_t PatchBuilder::add_centre(const Int3& cell, int number, const Float3& position,
                                       std::uint32_t rgba, VertexClass kind) {
  const BrickVertex centre{key(cell, 6 + number), in_owner(cell) + position, rgba, kind};
  return inside_brick(cell) ? add_own(centre) : add_foreign(centre);
}

Patch PatchBuilder::finish() {
  if (!patch_.synthetic.empty()) patch_.synthetic.resize(patch_.faces.size(), 0);
  if (!patch_.border.empty()) patch_.border.resize(patch_.faces.size(), 0);
  resolve_foreign();
  std::sort(patch_.exported.begin(), patch_.exported.end());
  std::sort(patch_.safe.begin(), patch_.safe.end(),
            [](const SafeVertex& a, const SafeVertex& b) { return a.vertex < b.vertex; });
  const auto own = patch_.rgba.begin();
  if (std::none_of(own, own + static_cast<std::ptrdiff_t>(first_own_),
                   [](std::uint32_t rgba) { return (rgba >> 24) != 0; }))
    patch_.rgba.clear();
  return std::move(patch_);
}

void PatchBuilder::resolve_foreign() {
  std::vector<std::uint32_t> faces;
  std::vector<std::pair<VertexKey, std::uint32_t>> named;
  std::vector<std::uint32_t> rank(foreign_.size(), kUnranked);
  for (std::size_t f = 0; f < patch_.faces.size(); ++f) {
    const PatchFace& face = patch_.faces[f];
    if (!((face[0] | face[1] | face[2]) & kForeignVertex)) continue;
    faces.push_back(static_cast<std::uint32_t>(f));
    for (const std::uint32_t v : face) {
      if (!(v & kForeignVertex)) continue;
      const std::uint32_t slot = v & ~kForeignVertex;
      assert(slot < rank.size());
      if (rank[slot] != kUnranked) continue;
      rank[slot] = 0;
      named.emplace_back(foreign_[slot].key, slot);
    }
  }
  std::sort(named.begin(), named.end());
  auto next = static_cast<std::uint32_t>(patch_.position.size());
  for (const auto& [key, slot] : named) {
    const BrickVertex& vertex = foreign_[slot];
    patch_.foreign.push_back(key);
    if (finer_) patch_.foreign_finer.push_back(vertex.finer);
    if (names_) {
      patch_.foreign_position.push_back(vertex.position);
      patch_.foreign_rgba.push_back(vertex.rgba);
      patch_.foreign_class.push_back(vertex.kind);
    }
    rank[slot] = next++;
  }
  for (const std::uint32_t f : faces)
    for (std::uint32_t& v : patch_.faces[f])
      if (v & kForeignVertex) v = rank[v & ~kForeignVertex];
}

}  // namespace tessera
