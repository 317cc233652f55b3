#include "stream/stages/weld/near_faces.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr std::uint64_t kVertexCacheBytes = std::uint64_t{20} << 20;
constexpr std::uint64_t kViewCacheBytes = std::uint64_t{20} << 20;
constexpr double kSide = kBrickCells;
constexpr double kMaxSpan = 10.0;  ///< cells; no face is so wide

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

/// Cells of a brick and around it that a risky face meets, or that lie beside one that does.
class RiskCells {
 public:
  void mark(const std::array<Double3, 3>& corner) {
    Int3 low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [from, to] = std::minmax({corner[0][a], corner[1][a], corner[2][a]});
      low[a] = cell(from - 1.0), high[a] = cell(to + 1.0);
    }
    for (int k = low[2]; k <= high[2]; ++k)
      for (int j = low[1]; j <= high[1]; ++j)
        for (int i = low[0]; i <= high[0]; ++i) marked_[slot({i, j, k})] = 1;
  }
  bool holds(const Double3& p) const { return marked_[slot({cell(p[0]), cell(p[1]), cell(p[2])})] != 0; }

 private:
  static constexpr int kCells = kBrickCells + 2;
  /// What lies farther out than a cell is in the outermost ones.
  static int cell(double x) { return static_cast<int>(std::clamp(x + 1.0, 0.0, double{kCells - 1})); }
  static std::size_t slot(const Int3& c) {
    return static_cast<std::size_t>((c[2] * kCells + c[1]) * kCells + c[0]);
  }
  std::vector<std::uint8_t> marked_ = std::vector<std::uint8_t>(std::size_t{kCells} * kCells * kCells);
};

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
  out.foreign = read_.foreign;
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  const Vertices& own = vertices(patch);
  const std::size_t count = own.position.size() + out.foreign.size();
  out.position.reserve(count), out.returns.reserve(count);
  out.risky.reserve(count);
  out.risky = own.risky;
  for (std::size_t v = 0; v < own.position.size(); ++v) {
    out.position.push_back(wide(own.position[v]));
    out.returns.push_back(own.position[v] != own.safe[v]);
  }
  for (const VertexSlot& slot : out.foreign) {
    const Vertices& there = vertices(slot.patch);
    const Int3 owner = brick_of_key(store_.patches()[slot.patch].key);
    out.position.push_back(seen_from(wide(there.position[slot.vertex]), owner, brick));
    out.returns.push_back(there.position[slot.vertex] != there.safe[slot.vertex]);
    out.risky.push_back(there.risky[slot.vertex]);
  }
  std::vector<std::uint8_t> beyond(count);
  for (std::size_t v = 0; v < count; ++v) {
    const Double3& p = out.position[v];
    beyond[v] = std::any_of(p.begin(), p.end(), [](double x) { return x < 0.0 || x > kSide; });
  }
  out.faces.reserve(read_.faces.size());
  for (const PatchFace& f : read_.faces) {
    if (!read_.kept(f)) continue;
    const auto number = static_cast<std::uint32_t>(out.faces.size());
    if (out.is_risky(f)) out.risky_faces.push_back(number);
    if (beyond[f[0]] || beyond[f[1]] || beyond[f[2]]) out.reaching.push_back(number);
    out.faces.push_back(f);
  }
  view_bytes_ += out.bytes();
  return out;
}

std::uint64_t NearFaces::find_crossings(const Int3& brick, std::vector<std::uint64_t>& back) {
  const std::vector<std::size_t> around = kept_patches_around(store_, numbering_, brick);
  if (std::none_of(around.begin(), around.end(), [&](std::size_t p) { return may_be_risky(p, brick); }))
    return 0;
  // Faces lie in the bricks of their patches, but for those with vertices that were moved, and in a cell each, but for
  // risky ones.
  RiskCells cells;
  bool any = false;
  const auto corners = [&](const View& there, const Int3& at, const PatchFace& f) {
    return std::array<Double3, 3>{seen_from(there.position[f[0]], at, brick),
                                  seen_from(there.position[f[1]], at, brick),
                                  seen_from(there.position[f[2]], at, brick)};
  };
  for (const std::size_t p : around) {
    const View& there = view(p);
    const Int3 at = brick_of_key(store_.patches()[p].key);
    const auto mark = [&](const PatchFace& f) { cells.mark(corners(there, at, f)), any = true; };
    if (at == brick)
      for (const std::uint32_t f : there.risky_faces) mark(there.faces[f]);
    else
      for (const std::uint32_t f : there.reaching)
        if (there.is_risky(there.faces[f])) mark(there.faces[f]);
  }
  if (!any) return 0;
  std::vector<ContactFace> faces;
  std::vector<std::uint8_t> risky, returns;  // bit i of `returns`: corner i may go back
  for (const std::size_t p : around) {
    const View& there = view(p);
    const Int3 at = brick_of_key(store_.patches()[p].key);
    const auto add = [&](const PatchFace& f) {
      if (faces.size() == kMaxFaces) return;
      ContactFace& face = faces.emplace_back();
      face.corner = corners(there, at, f);
      std::uint8_t back_bits = 0;
      for (std::size_t i = 0; i < 3; ++i) {
        const VertexSlot slot = there.slot(p, f[i]);
        face.vertex[i] = patch_vertex(slot.patch, slot.vertex);
        back_bits = static_cast<std::uint8_t>(back_bits | there.returns[f[i]] << i);
      }
      risky.push_back(there.is_risky(f));
      returns.push_back(back_bits);
    };
    if (at != brick) {
      for (const std::uint32_t f : there.reaching) add(there.faces[f]);
      continue;
    }
    std::vector<std::uint8_t> near(there.position.size());
    for (std::size_t v = 0; v < near.size(); ++v) near[v] = cells.holds(there.position[v]);
    for (const PatchFace& f : there.faces)
      if ((near[f[0]] | near[f[1]] | near[f[2]]) != 0) add(f);
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
