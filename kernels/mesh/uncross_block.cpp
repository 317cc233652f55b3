#include "kernels/mesh/uncross_block.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/mesh/risky_crossings.h"

namespace tessera {
namespace {

constexpr int kBlockRounds = 3;
constexpr std::uint32_t kNoPlace = 0xffffffffu;

/// Per vertex of the block: where in `safe` its place stands.
std::vector<std::uint32_t> places(const MeshBlock& block, std::span<const SafePlace> safe) {
  std::vector<std::uint32_t> place(block.key.size(), kNoPlace);
  std::size_t v = 0;
  for (std::size_t s = 0; s < safe.size(); ++s) {
    while (v < block.key.size() && block.key[v] < safe[s].key) ++v;
    if (v < block.key.size() && block.key[v] == safe[s].key && block.position[v] != safe[s].at)
      place[v] = static_cast<std::uint32_t>(s);
  }
  return place;
}

/// All of the block; half open, as cells are.
ContactCell core_of(const MeshBlock& block) {
  ContactCell core = {block.position[0], block.position[0]};
  for (const Double3& p : block.position)
    for (std::size_t a = 0; a < 3; ++a)
      core.low[a] = std::min(core.low[a], p[a]), core.high[a] = std::max(core.high[a], p[a]);
  for (double& x : core.high) x = std::nextafter(x, std::numeric_limits<double>::infinity());
  return core;
}

}  // namespace

void take_back(MeshBlock& block, std::span<const SafePlace> places) {
  std::size_t v = 0;
  for (const SafePlace& place : places) {
    while (v < block.key.size() && block.key[v] < place.key) ++v;
    if (v == block.key.size()) return;
    if (block.key[v] == place.key) block.position[v] = place.at;
  }
}

Uncrossed uncross_block(MeshBlock& block, std::span<const SafePlace> safe,
                        std::span<const std::uint8_t> complete, double cell) {
  Uncrossed result;
  if (safe.empty() || block.faces.empty()) return result;
  const std::vector<std::uint32_t> place = places(block, safe);
  RiskyMesh mesh;
  mesh.cell = cell;
  mesh.position = block.position;
  mesh.name = block.key;
  mesh.faces = block.faces;
  mesh.risky.resize(place.size());
  for (std::size_t v = 0; v < place.size(); ++v) mesh.risky[v] = place[v] != kNoPlace;
  const ContactCell core = core_of(block);
  std::vector<std::uint8_t> back(place.size());
  for (int round = 0; round < kBlockRounds; ++round) {
    bool any = false;
    std::vector<std::uint8_t> now(place.size());
    risky_crossings(mesh, core, [&](std::uint32_t i, std::uint32_t j) {
      result.pairs += round == 0;
      for (const std::uint32_t f : {i, j})
        for (const std::uint32_t v : mesh.faces[f])
          if (place[v] != kNoPlace && back[v] == 0 && complete[v] != 0) now[v] = 1, any = true;
    });
    if (!any) break;
    // Faces that did not change meet as they did.
    for (std::size_t v = 0; v < now.size(); ++v) {
      mesh.risky[v] = now[v];
      if (now[v] == 0) continue;
      back[v] = 1;
      mesh.position[v] = safe[place[v]].at;
    }
  }
  for (std::size_t v = 0; v < back.size(); ++v)
    if (back[v] != 0) result.returned.push_back(safe[place[v]]);
  block.position = std::move(mesh.position);
  return result;
}

}  // namespace tessera
