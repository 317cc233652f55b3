#include "stream/stages/weld/near_faces.h"

#include <algorithm>
#include <array>

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

/// \param step  of a brick along an axis from that of the patch: -1, 0 or 1
unsigned reach_bit(std::size_t axis, int step) {
  return 1u << (3 * static_cast<int>(axis) + step + 1);
}

/// Into or to the sides of which bricks around a face comes, as far as its box tells.
std::uint16_t reach_of(const std::array<Float3, 3>& position, const std::array<Int3, 3>& owner,
                       const Int3& brick) {
  unsigned reach = 0;
  for (std::size_t a = 0; a < 3; ++a)
    for (int step = -1; step <= 1; ++step) {
      double low = 1e9, high = -1e9;
      for (std::size_t k = 0; k < 3; ++k) {
        const double x = double{position[k][a]} + kSide * (owner[k][a] - (brick[a] + step));
        low = std::min(low, x), high = std::max(high, x);
      }
      if (high >= -kAtSide && low <= kSide + kAtSide) reach |= reach_bit(a, step);
    }
  return static_cast<std::uint16_t>(reach);
}

}  // namespace

std::shared_ptr<const PatchView> PatchRims::get(std::size_t patch, const std::function<PatchView()>& load) {
  {
    const std::scoped_lock lock(mutex_);
    if (const Rim* kept = rims_.find(patch)) return kept->view;
  }
  auto made = std::make_shared<const PatchView>(load());
  const std::scoped_lock lock(mutex_);
  return rims_.get(patch, [&](Rim& out) { out.view = std::move(made); }).view;
}

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

const PatchView& NearFaces::view(std::size_t patch) {
  return views_.get(patch, [&](PatchView& out) { load_view(patch, out); });
}

void NearFaces::load_view(std::size_t patch, PatchView& out) {
  numbered_.load_faces(patch, read_);
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  const Vertices& own = vertices(patch);
  out.vertices.reserve(own.position.size() + read_.foreign.size());
  const auto add = [&](const Vertices& there, const Int3& owner, const VertexSlot& slot) {
    const Float3& p = there.position[slot.vertex];
    out.vertices.push_back({p, owner, patch_vertex(slot.patch, slot.vertex),
                            static_cast<std::uint8_t>(p != there.safe[slot.vertex]),
                            there.risky[slot.vertex]});
  };
  for (std::uint32_t v = 0; v < own.position.size(); ++v)
    add(own, brick, {static_cast<std::uint32_t>(patch), v});
  for (const VertexSlot& slot : read_.foreign)
    add(vertices(slot.patch), brick_of_key(store_.patches()[slot.patch].key), slot);
  out.faces.reserve(numbering_.patches[patch].kept_faces);
  for (const PatchFace& f : read_.faces)
    if (read_.kept(f)) out.faces.push_back(f);
}

PatchView NearFaces::make_rim(std::size_t patch) {
  constexpr std::uint32_t kNone = 0xffffffffu;
  const PatchView& whole = view(patch);
  PatchView out;
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  std::vector<std::uint8_t> beyond;
  beyond.reserve(whole.vertices.size());
  for (const PatchView::Vertex& v : whole.vertices) {
    const Double3 here = seen_from(wide(v.position), v.owner, brick);
    beyond.push_back(
        std::any_of(here.begin(), here.end(), [](double x) { return x < kAtSide || x > kSide - kAtSide; }));
  }
  std::vector<std::uint32_t> number(whole.vertices.size(), kNone);
  for (const PatchFace& f : whole.faces) {
    if ((beyond[f[0]] | beyond[f[1]] | beyond[f[2]]) == 0) continue;
    PatchFace face;
    std::array<Float3, 3> position;
    std::array<Int3, 3> owner;
    for (std::size_t k = 0; k < 3; ++k) {
      position[k] = whole.vertices[f[k]].position;
      owner[k] = whole.vertices[f[k]].owner;
      if (number[f[k]] == kNone) {
        number[f[k]] = static_cast<std::uint32_t>(out.vertices.size());
        out.vertices.push_back(whole.vertices[f[k]]);
      }
      face[k] = number[f[k]];
    }
    out.faces.push_back(face);
    out.reach.push_back(reach_of(position, owner, brick));
  }
  return out;
}

void NearFaces::add_vertex(const PatchView::Vertex& v, const Int3& brick) {
  // Moved from its owner's corner in one step, whichever patch names it: each step rounds.
  mesh_.position.push_back(written_.floats ? written_.of(seen_from(wide(v.position), v.owner, {0, 0, 0}))
                                           : seen_from(wide(v.position), v.owner, brick));
  mesh_.name.push_back(v.name);
  mesh_.risky.push_back(v.risky);
  returns_.push_back(v.returns);
}

void NearFaces::gather(const Int3& brick, const std::vector<std::size_t>& around) {
  mesh_.position.clear(), mesh_.name.clear(), mesh_.risky.clear(), mesh_.faces.clear();
  returns_.clear();
  std::size_t reaching = 0;
  bool torn = false;
  for (const std::size_t p : around) {
    const Int3 at = brick_of_key(store_.patches()[p].key);
    if (at == brick) {
      const PatchView& there = view(p);
      const auto first = static_cast<std::uint32_t>(mesh_.position.size());
      for (const PatchView::Vertex& v : there.vertices) add_vertex(v, brick);
      for (const PatchFace& f : there.faces)
        mesh_.faces.push_back({first + f[0], first + f[1], first + f[2]});
      continue;
    }
    const auto rim = rims_.get(p, [&] { return make_rim(p); });
    const PatchView& there = *rim;
    unsigned needed = 0;
    for (std::size_t a = 0; a < 3; ++a) needed |= reach_bit(a, brick[a] - at[a]);
    for (std::size_t f = 0; f < there.faces.size(); ++f) {
      if ((there.reach[f] & needed) != needed) continue;
      torn = torn || reaching == kMaxReaching;
      if (torn) break;
      ++reaching;
      const auto corner = static_cast<std::uint32_t>(mesh_.position.size());
      for (const std::uint32_t v : there.faces[f]) add_vertex(there.vertices[v], brick);
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
  return kVertexCacheBytes + kViewCacheBytes + PatchRims::kMaxBytes + 2 * largest +
         2 * (vertices * kVertexBytes + faces * kFaceBytes) + risky_crossings_bytes(faces, kBrickCells) +
         NumberedPatches::kCacheBytes;
}

}  // namespace tessera
