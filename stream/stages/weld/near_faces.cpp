#include "stream/stages/weld/near_faces.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr double kSide = kBrickCells;
constexpr double kMaxSpan = 10.0;  ///< cells; no face is so wide
/// Cells: what comes so near to the side of a brick may touch what is beyond it, for there vertices lie, or do when rounded.
constexpr double kAtSide = 1e-3;

Double3 seen_from(const Double3& at, const Int3& owner, const Int3& brick) {
  Double3 p = at;
  for (std::size_t a = 0; a < 3; ++a) p[a] += kSide * (owner[a] - brick[a]);
  return p;
}

}  // namespace

bool NearFaces::may_be_risky(std::size_t patch, const Int3& brick) {
  if (round_ == 0) return positions_.may_return(patch);
  const auto back = positions_.returned(patch, round_ - 1);
  if (back.empty()) return false;
  const Int3 owner = brick_of_key(store_.patches()[patch].key);
  const Vertices& there = vertices(patch);
  return std::any_of(back.begin(), back.end(), [&](std::uint64_t v) {
    const Double3 p = seen_from(wide(there.position[v & 0xffffffffu]), owner, brick);
    return std::all_of(p.begin(), p.end(), [](double x) { return x > -kMaxSpan && x < kSide + kMaxSpan; });
  });
}

const NearFaces::Vertices& NearFaces::vertices(std::size_t patch) {
  return vertices_.get(patch, [&](Vertices& out) { load_vertices(patch, out); });
}

void NearFaces::load_vertices(std::size_t patch, Vertices& out) {
  std::vector<std::uint32_t> rgba;
  positions_.load(patch, out.position, rgba, &out.safe);
  out.risky.resize(out.position.size());
  if (round_ == 0)
    for (std::size_t v = 0; v < out.risky.size(); ++v) out.risky[v] = out.position[v] != out.safe[v];
  else
    for (const std::uint64_t v : positions_.returned(patch, round_ - 1)) out.risky[v & 0xffffffffu] = 1;
}

const NearFaces::View& NearFaces::view(std::size_t patch) {
  return views_.get(patch, [&](View& out) { load_view(patch, out); });
}

void NearFaces::load_view(std::size_t patch, View& out) {
  numbered_.load_faces(patch, read_);
  out.foreign = read_.foreign;
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  const Vertices& own = vertices(patch);
  const std::size_t count = own.position.size() + out.foreign.size();
  out.position.reserve(count), out.returns.reserve(count);
  out.risky = own.risky;
  std::vector<std::uint8_t> beyond;
  beyond.reserve(count);
  const auto add = [&](const Float3& p, const Float3& safe, const Int3& owner) {
    out.position.push_back(p);
    out.returns.push_back(p != safe);
    const Double3 here = seen_from(wide(p), owner, brick);
    beyond.push_back(
        std::any_of(here.begin(), here.end(), [](double x) { return x < kAtSide || x > kSide - kAtSide; }));
  };
  for (std::size_t v = 0; v < own.position.size(); ++v) add(own.position[v], own.safe[v], brick);
  for (const VertexSlot& slot : out.foreign) {
    const Vertices& there = vertices(slot.patch);
    add(there.position[slot.vertex], there.safe[slot.vertex], brick_of_key(store_.patches()[slot.patch].key));
    out.risky.push_back(there.risky[slot.vertex]);
  }
  out.faces.reserve(read_.faces.size());
  for (const PatchFace& f : read_.faces) {
    if (!read_.kept(f)) continue;
    const auto number = static_cast<std::uint32_t>(out.faces.size());
    if (beyond[f[0]] || beyond[f[1]] || beyond[f[2]]) out.reaching.push_back(number);
    out.faces.push_back(f);
  }
}

bool NearFaces::reaches(const View& there, std::uint32_t number, std::size_t patch, const Int3& brick) const {
  Double3 low = {1e9, 1e9, 1e9}, high = {-1e9, -1e9, -1e9};
  for (const std::uint32_t v : there.faces[number]) {
    const Int3 owner = brick_of_key(store_.patches()[there.slot(patch, v).patch].key);
    const Double3 p = seen_from(wide(there.position[v]), owner, brick);
    for (std::size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
  }
  for (std::size_t a = 0; a < 3; ++a)
    if (high[a] < -kAtSide || low[a] > kSide + kAtSide) return false;
  return true;
}

void NearFaces::gather(const Int3& brick, const std::vector<std::size_t>& around) {
  mesh_ = {};
  returns_.clear();
  std::size_t reaching = 0;
  bool torn = false;
  for (const std::size_t p : around) {
    const View& there = view(p);
    const Int3 at = brick_of_key(store_.patches()[p].key);
    const auto add_vertex = [&](std::uint32_t v) {
      const VertexSlot slot = there.slot(p, v);
      // Moved from its owner's corner in one step, whichever patch names it: each step rounds.
      const Int3 owner = brick_of_key(store_.patches()[slot.patch].key);
      mesh_.position.push_back(written_.floats
                                   ? written_.of(seen_from(wide(there.position[v]), owner, {0, 0, 0}))
                                   : seen_from(wide(there.position[v]), owner, brick));
      mesh_.name.push_back(patch_vertex(slot.patch, slot.vertex));
      mesh_.risky.push_back(there.risky[v]);
      returns_.push_back(there.returns[v]);
    };
    const auto first = static_cast<std::uint32_t>(mesh_.position.size());
    if (at == brick) {
      for (std::uint32_t v = 0; v < there.position.size(); ++v) add_vertex(v);
      for (const PatchFace& f : there.faces)
        mesh_.faces.push_back({first + f[0], first + f[1], first + f[2]});
      continue;
    }
    for (const std::uint32_t number : there.reaching) {
      if (!reaches(there, number, p, brick)) continue;
      torn = torn || reaching == kMaxReaching;
      if (torn) break;
      ++reaching;
      const auto corner = static_cast<std::uint32_t>(mesh_.position.size());
      for (const std::uint32_t v : there.faces[number]) add_vertex(v);
      mesh_.faces.push_back({corner, corner + 1, corner + 2});
    }
  }
  torn_ += torn;
}

std::uint64_t NearFaces::find_crossings(const Int3& brick, std::vector<std::uint64_t>& back) {
  const std::vector<std::size_t> around = kept_patches_around(store_, numbering_, brick);
  if (std::none_of(around.begin(), around.end(), [&](std::size_t p) { return may_be_risky(p, brick); }))
    return 0;
  gather(brick, around);
  std::uint64_t pairs = 0;
  ContactCell core = {{0, 0, 0}, {kSide, kSide, kSide}};
  if (written_.floats) {
    mesh_.cell = written_.lattice.h;
    core = {written_.of(seen_from({0, 0, 0}, brick, {0, 0, 0})),
            written_.of(seen_from(core.high, brick, {0, 0, 0}))};
  }
  risky_crossings(mesh_, core, [&](std::uint32_t i, std::uint32_t j) {
    ++pairs;
    for (const std::uint32_t f : {i, j})
      for (const std::uint32_t v : mesh_.faces[f])
        if (returns_[v] != 0) back.push_back(mesh_.name[v]);
  });
  return pairs;
}

std::uint64_t NearFaces::bytes(std::span<const PatchEntry> patches) {
  constexpr std::uint64_t kVertexBytes = sizeof(Double3) + 8 + 2, kFaceBytes = 12;
  std::uint64_t largest = 0, vertices = 0, faces = 0;
  for (const PatchEntry& e : patches) {
    largest = std::max<std::uint64_t>(largest, 120ull * e.vertices + 60ull * e.foreign + 40ull * e.faces);
    vertices = std::max<std::uint64_t>(vertices, e.vertices + std::uint64_t{e.foreign});
    faces = std::max<std::uint64_t>(faces, e.faces);
  }
  vertices += 3 * kMaxReaching, faces += kMaxReaching;
  return kVertexCacheBytes + kViewCacheBytes + 2 * largest +
         2 * (vertices * kVertexBytes + faces * kFaceBytes) + risky_crossings_bytes(faces, kBrickCells) +
         NumberedPatches::kCacheBytes;
}

}  // namespace tessera
