/// Semantic blocks: maximal nodes of a shifted octree of bricks.
#include <algorithm>

#include "stream/mesh_store.h"

namespace tessera {
namespace {

struct Place {
  std::uint64_t code;  ///< Morton code of the shifted brick
  std::size_t patch;
};

/// Bricks [first, last) are those below one node; `bits` is the width of the node's own code range.
void cut(std::span<const Place> places, std::span<const MeshPatchEntry> patches, int bits,
         std::uint64_t limit, std::vector<MeshBlockPatches>& out) {
  if (places.empty()) return;
  std::uint64_t faces = 0;
  for (const Place& p : places) faces += patches[p.patch].faces;
  if (faces <= limit || bits == 0) {
    MeshBlockPatches block;
    for (const Place& p : places) block.push_back(p.patch);
    std::sort(block.begin(), block.end());
    out.push_back(std::move(block));
    return;
  }
  bits -= 3;
  while (!places.empty()) {
    const std::uint64_t node = places.front().code >> bits;
    const auto end =
        std::find_if(places.begin(), places.end(), [&](const Place& p) { return p.code >> bits != node; });
    const auto count = static_cast<std::size_t>(end - places.begin());
    cut(places.first(count), patches, bits, limit, out);
    places = places.subspan(count);
  }
}

}  // namespace

std::vector<MeshBlockPatches> make_blocks(const MeshStore& store, const MeshBlocking& blocking) {
  std::vector<Place> places;
  for (std::size_t p = 0; p < store.patches().size(); ++p) {
    const Int3 b = brick_of_key(store.patches()[p].key);
    places.push_back(
        {brick_key({b[0] + blocking.shift[0], b[1] + blocking.shift[1], b[2] + blocking.shift[2]}), p});
  }
  std::sort(places.begin(), places.end(), [](const Place& a, const Place& b) { return a.code < b.code; });
  std::vector<MeshBlockPatches> blocks;
  cut(places, store.patches(), 63, blocking.max_faces, blocks);
  return blocks;
}

Int3 pass_shift(int pass) {
  // A third and two thirds of a node, at every level of the octree at once: 0101... and 1010... in binary.
  constexpr std::int32_t kThird = 0x15555;
  constexpr std::int32_t kTwoThirds = 0x2aaaa;
  switch (pass % 3) {
    case 0:
      return {0, 0, 0};
    case 1:
      return {kThird, kThird, kThird};
    default:
      return {kTwoThirds, kTwoThirds, kTwoThirds};
  }
}

}  // namespace tessera
