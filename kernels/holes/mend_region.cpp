#include "kernels/holes/mend_region.h"

#include <limits>
#include <map>
#include <set>
#include <utility>

namespace tessera {
namespace {

constexpr std::size_t kMaxIsland = 200;  ///< faces within a region that are taken out with it
constexpr int kMaxWidenings = 6;

}  // namespace

MendRegion::MendRegion(const MeshBlock& block, const ContactCell& whole) : block_(block), whole_(whole) {
  start_.assign(block.key.size() + 1, 0);
  for (const Corners& f : block.faces)
    for (const std::uint32_t v : f) ++start_[v + std::size_t{1}];
  for (std::size_t v = 1; v < start_.size(); ++v) start_[v] += start_[v - 1];
  at_.resize(3 * block.faces.size());
  std::vector<std::uint32_t> next(start_.begin(), start_.end() - 1);
  for (std::uint32_t f = 0; f < block.faces.size(); ++f)
    for (const std::uint32_t v : block.faces[f]) at_[next[v]++] = f;
}

std::uint32_t MendRegion::across(std::uint32_t f, const Edge& e) const {
  for (const std::uint32_t g : faces_at(e[0]))
    if (g != f)
      for (const std::uint32_t v : corners(g))
        if (v == e[1]) return g;
  return kNoFace;
}

bool MendRegion::is_within(const Double3& p) const {
  for (std::size_t a = 0; a < 3; ++a)
    if (!(p[a] > whole_.low[a] && p[a] < whole_.high[a])) return false;
  return true;
}

bool MendRegion::is_known(const std::vector<std::uint32_t>& region) const {
  for (const std::uint32_t f : region)
    for (const std::uint32_t v : corners(f))
      if (!is_within(block_.position[v])) return false;
  return true;
}

void MendRegion::grow(std::vector<std::uint32_t>& region) const {
  std::vector<std::uint32_t> grown;
  for (const std::uint32_t f : region)
    for (const std::uint32_t v : corners(f))
      for (const std::uint32_t g : faces_at(v)) grown.push_back(g);
  sort_unique(grown);
  region = std::move(grown);
}

std::vector<std::vector<std::uint32_t>> MendRegion::parts_of(const std::vector<std::uint32_t>& region) const {
  std::vector<std::uint8_t> taken(region.size(), 0);
  const auto slot = [&](std::uint32_t f) {
    const auto at = std::lower_bound(region.begin(), region.end(), f);
    return at != region.end() && *at == f ? static_cast<std::size_t>(at - region.begin()) : region.size();
  };
  std::vector<std::vector<std::uint32_t>> parts;
  for (std::size_t first = 0; first < region.size(); ++first) {
    if (taken[first] != 0) continue;
    std::vector<std::uint32_t> part = {region[first]};
    taken[first] = 1;
    for (std::size_t i = 0; i < part.size(); ++i)
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint32_t g = across(part[i], edge(corners(part[i]), k));
        const std::size_t at = g == kNoFace ? region.size() : slot(g);
        if (at < region.size() && taken[at] == 0) taken[at] = 1, part.push_back(g);
      }
    std::sort(part.begin(), part.end());
    parts.push_back(std::move(part));
  }
  return parts;
}

/// Loops of directed edges beside which the part ends, the one with the smallest vertex first.
/// \param pinched  vertices at which several begin; there are no loops then
MendRegion::Loops MendRegion::loops_of(const std::vector<std::uint32_t>& part,
                                       std::vector<std::uint32_t>& pinched) const {
  std::map<std::uint32_t, std::uint32_t> next;
  for (const std::uint32_t f : part)
    for (std::size_t k = 0; k < 3; ++k) {
      const Edge e = edge(corners(f), k);
      const std::uint32_t g = across(f, e);
      if (g != kNoFace && std::binary_search(part.begin(), part.end(), g)) continue;
      if (!next.emplace(e[0], e[1]).second) pinched.push_back(e[0]);
    }
  Loops loops;
  if (!pinched.empty()) return loops;
  while (!next.empty()) {
    std::vector<std::uint32_t> loop;
    for (auto at = next.begin(); at != next.end(); at = next.find(loop.back())) {
      if (loop.empty()) loop.push_back(at->first);
      loop.push_back(at->second);
      next.erase(at);
    }
    if (loop.front() != loop.back()) return {};
    loop.pop_back();
    loops.push_back(std::move(loop));
  }
  return loops;
}

/// The faces beyond a loop, where they are few and nothing else hangs on them.
std::vector<std::uint32_t> MendRegion::island_beyond(const std::vector<std::uint32_t>& loop,
                                                     const std::vector<std::uint32_t>& part) const {
  std::vector<std::uint32_t> island;
  std::set<std::uint32_t> seen;
  const auto add = [&](std::uint32_t g) {
    if (g != kNoFace && !std::binary_search(part.begin(), part.end(), g) && seen.insert(g).second)
      island.push_back(g);
  };
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const Edge e = {loop[i], loop[(i + 1) % loop.size()]};
    for (const std::uint32_t f : faces_at(e[0]))
      for (const std::uint32_t v : corners(f))
        if (v == e[1]) add(f);
  }
  for (std::size_t i = 0; i < island.size(); ++i) {
    if (island.size() > kMaxIsland) return {};
    for (std::size_t k = 0; k < 3; ++k) {
      const Edge e = edge(corners(island[i]), k);
      if (!is_within(block_.position[e[0]])) return {};
      add(across(island[i], e));
    }
  }
  return island;
}

/// The surface ends all along it.
bool MendRegion::is_border(const std::vector<std::uint32_t>& loop) const {
  for (std::size_t i = 0; i < loop.size(); ++i) {
    const std::uint32_t to = loop[(i + 1) % loop.size()];
    int faces = 0;
    for (const std::uint32_t f : faces_at(loop[i]))
      faces += std::find(corners(f).begin(), corners(f).end(), to) != corners(f).end();
    if (faces != 1) return false;
  }
  return true;
}

/// Its outline, the outer loop first and holes of the mesh behind it. \param more  what has to be taken out with it: ask again then
bool MendRegion::part_to_loops(const std::vector<std::uint32_t>& part, Loops& loops,
                               std::vector<std::uint32_t>& more) const {
  std::vector<std::uint32_t> pinched;
  loops = loops_of(part, pinched);
  for (const std::uint32_t v : pinched)
    for (const std::uint32_t f : faces_at(v))
      if (!std::binary_search(part.begin(), part.end(), f)) more.push_back(f);
  if (!pinched.empty()) return !more.empty();
  if (loops.size() < 2) return !loops.empty();
  std::vector<std::vector<std::uint32_t>> island;
  std::vector<std::size_t> open;
  std::size_t outer = 0;
  for (std::size_t i = 0; i < loops.size(); ++i) {
    island.push_back(island_beyond(loops[i], part));
    if (island.back().empty() && !is_border(loops[i])) open.push_back(i);
    if (loops[i].size() > loops[outer].size()) outer = i;
  }
  if (open.size() > 1) return false;
  if (!open.empty()) outer = open[0];
  for (std::size_t i = 0; i < loops.size(); ++i)
    if (i != outer) more.insert(more.end(), island[i].begin(), island[i].end());
  // Of a small component more stays than goes: else it would be the component that is made anew.
  if (open.empty() && !island[outer].empty() && island[outer].size() <= part.size() + more.size())
    return false;
  std::swap(loops[0], loops[outer]);
  return true;
}

/// By Euler's number: a plane with holes.
bool MendRegion::is_planar(const std::vector<std::uint32_t>& part, const Loops& loops) const {
  std::vector<std::uint32_t> vertices;
  for (const std::uint32_t f : part)
    for (const std::uint32_t v : corners(f)) vertices.push_back(v);
  sort_unique(vertices);
  std::size_t edges = 0;
  for (const auto& loop : loops) edges += loop.size();
  return 2 * (vertices.size() + part.size() + loops.size()) == 3 * part.size() + edges + 4;
}

/// Joins the loops to the first one, each by the shortest bridge that is no edge of another face.
bool MendRegion::bridge(Loops& loops, const std::vector<std::uint32_t>& part) const {
  const auto is_free = [&](std::uint32_t a, std::uint32_t b) {
    for (const std::uint32_t f : faces_at(a))
      if (!std::binary_search(part.begin(), part.end(), f) &&
          std::find(corners(f).begin(), corners(f).end(), b) != corners(f).end())
        return false;
    return true;
  };
  std::vector<std::uint32_t>& outer = loops[0];
  for (std::size_t hole = 1; hole < loops.size(); ++hole) {
    const std::vector<std::uint32_t>& inner = loops[hole];
    double nearest = std::numeric_limits<double>::infinity();
    std::size_t from = 0, to = 0;
    for (std::size_t i = 0; i < outer.size(); ++i)
      for (std::size_t j = 0; j < inner.size(); ++j) {
        const double d = squared_distance(block_.position[outer[i]], block_.position[inner[j]]);
        if (d < nearest && is_free(outer[i], inner[j])) nearest = d, from = i, to = j;
      }
    if (!(nearest > 0.0) || nearest == std::numeric_limits<double>::infinity()) return false;
    std::vector<std::uint32_t> joined(outer.begin(), outer.begin() + static_cast<std::ptrdiff_t>(from) + 1);
    for (std::size_t j = 0; j <= inner.size(); ++j) joined.push_back(inner[(to + j) % inner.size()]);
    joined.insert(joined.end(), outer.begin() + static_cast<std::ptrdiff_t>(from), outer.end());
    outer = std::move(joined);
  }
  return true;
}

std::optional<std::vector<MendDisk>> MendRegion::disks_of(std::vector<std::uint32_t>& region,
                                                          std::size_t max_faces, std::size_t max_loop) const {
  for (int again = 0; again < kMaxWidenings; ++again) {
    std::vector<MendDisk> disks;
    std::vector<std::uint32_t> wider;
    for (std::vector<std::uint32_t>& part : parts_of(region)) {
      Loops loops;
      std::vector<std::uint32_t> more;
      if (!part_to_loops(part, loops, more)) return std::nullopt;
      wider.insert(wider.end(), more.begin(), more.end());
      if (!more.empty()) continue;
      if (!is_planar(part, loops) || !bridge(loops, part) || loops[0].size() > max_loop) return std::nullopt;
      std::vector<std::uint32_t> loop = std::move(loops[0]);
      std::rotate(loop.begin(), std::min_element(loop.begin(), loop.end()), loop.end());
      disks.push_back({std::move(part), std::move(loop)});
    }
    if (wider.empty()) return disks;
    region.insert(region.end(), wider.begin(), wider.end());
    sort_unique(region);
    if (region.size() > max_faces || !is_known(region)) return std::nullopt;
  }
  return std::nullopt;
}

}  // namespace tessera
