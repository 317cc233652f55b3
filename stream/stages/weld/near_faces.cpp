#include "stream/stages/weld/near_faces.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr std::uint64_t kVertexCacheBytes = std::uint64_t{20} << 20;
constexpr std::uint64_t kViewCacheBytes = std::uint64_t{20} << 20;
constexpr double kSide = kBrickCells;

Double3 seen_from(const Double3& at, const Int3& owner, const Int3& brick) {
  Double3 p = at;
  for (std::size_t a = 0; a < 3; ++a) p[a] += kSide * (owner[a] - brick[a]);
  return p;
}

/// Drops the smallest bricks, which came first, until the cache is small.
template <class Cache>
void shrink(Cache& cache, std::uint64_t& bytes, std::uint64_t most) {
  while (bytes > most && !cache.empty()) {
    bytes -= cache.begin()->second.bytes();
    cache.erase(cache.begin());
  }
}

}  // namespace

bool NearFaces::any_risky(std::size_t patch) const {
  return round_ == 0 ? positions_.may_return(patch) : !positions_.returned(patch, round_ - 1).empty();
}

const NearFaces::Vertices& NearFaces::vertices(std::size_t patch) {
  const auto found = vertices_.find(patch);
  if (found != vertices_.end()) return found->second;
  shrink(vertices_, vertex_bytes_, kVertexCacheBytes);
  Vertices& out = vertices_[patch];
  std::vector<std::uint32_t> rgba;
  positions_.load(patch, out.position, rgba, &out.safe);
  out.risky.resize(out.position.size());
  if (round_ == 0)
    for (std::size_t v = 0; v < out.risky.size(); ++v) out.risky[v] = out.position[v] != out.safe[v];
  else
    for (const std::uint64_t v : positions_.returned(patch, round_ - 1)) out.risky[v & 0xffffffffu] = 1;
  vertex_bytes_ += out.bytes();
  return out;
}

const NearFaces::View& NearFaces::view(std::size_t patch) {
  const auto found = views_.find(patch);
  if (found != views_.end()) return found->second;
  shrink(views_, view_bytes_, kViewCacheBytes);
  View& out = views_[patch];
  numbered_.load_faces(patch, read_);
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  std::vector<std::uint8_t> beyond;
  const auto add = [&](const Vertices& there, const Int3& owner, const VertexSlot& slot) {
    const Double3 p = seen_from(wide(there.position[slot.vertex]), owner, brick);
    out.position.push_back(p);
    out.name.push_back(patch_vertex(slot.patch, slot.vertex));
    out.returns.push_back(there.position[slot.vertex] != there.safe[slot.vertex]);
    out.risky.push_back(there.risky[slot.vertex]);
    beyond.push_back(std::any_of(p.begin(), p.end(), [](double x) { return x < 0.0 || x > kSide; }));
  };
  const Vertices& own = vertices(patch);
  const auto count = static_cast<std::uint32_t>(own.position.size());
  for (std::uint32_t v = 0; v < count; ++v) add(own, brick, {static_cast<std::uint32_t>(patch), v});
  for (const VertexSlot& slot : read_.foreign)
    add(vertices(slot.patch), brick_of_key(store_.patches()[slot.patch].key), slot);
  out.faces.reserve(read_.faces.size());
  for (const PatchFace& f : read_.faces) {
    if (!read_.kept(f)) continue;
    if (beyond[f[0]] || beyond[f[1]] || beyond[f[2]])
      out.reaching.push_back(static_cast<std::uint32_t>(out.faces.size()));
    out.faces.push_back(f);
  }
  view_bytes_ += out.bytes();
  return out;
}

std::uint64_t NearFaces::find_crossings(const Int3& brick, std::vector<std::uint64_t>& back) {
  const std::vector<std::size_t> around = kept_patches_around(store_, numbering_, brick);
  if (std::none_of(around.begin(), around.end(), [this](std::size_t p) { return any_risky(p); })) return 0;
  std::vector<ContactFace> faces;
  std::vector<std::uint8_t> risky, returns;  // bit i of `returns`: corner i may go back
  for (const std::size_t p : around) {
    const View& there = view(p);
    const Int3 at = brick_of_key(store_.patches()[p].key);
    const auto add = [&](const PatchFace& f) {
      if (faces.size() == kMaxFaces) return;
      ContactFace& face = faces.emplace_back();
      std::uint8_t is_risky = 0, back_bits = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        face.corner[i] = seen_from(there.position[f[i]], at, brick);
        face.vertex[i] = there.name[f[i]];
        is_risky |= there.risky[f[i]];
        back_bits = static_cast<std::uint8_t>(back_bits | there.returns[f[i]] << i);
      }
      risky.push_back(is_risky);
      returns.push_back(back_bits);
    };
    // Faces lie in the bricks of their patches, but for those with vertices that were moved.
    if (at == brick)
      for (const PatchFace& f : there.faces) add(f);
    else
      for (const std::uint32_t f : there.reaching) add(there.faces[f]);
  }
  std::uint64_t pairs = 0;
  risky_crossings(faces, risky, {{0, 0, 0}, {kSide, kSide, kSide}}, [&](std::uint32_t i, std::uint32_t j) {
    ++pairs;
    for (const std::uint32_t f : {i, j})
      for (std::size_t k = 0; k < 3; ++k)
        if (returns[f] >> k & 1) back.push_back(faces[f].vertex[k]);
  });
  return pairs;
}

std::uint64_t NearFaces::bytes(std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0, faces = 0;
  for (const PatchEntry& e : patches) {
    largest = std::max<std::uint64_t>(largest, 120ull * e.vertices + 60ull * e.foreign + 40ull * e.faces);
    faces = std::max<std::uint64_t>(faces, e.faces);
  }
  const std::uint64_t compared = std::min<std::uint64_t>(kMaxFaces, 2 * faces + 10'000);
  return kVertexCacheBytes + kViewCacheBytes + 2 * largest + compared * (2 * sizeof(ContactFace) + 4) +
         risky_crossings_bytes(compared, 65 * 65 * 65) + NumberedPatches::kCacheBytes;
}

}  // namespace tessera
