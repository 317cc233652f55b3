#include "stream/stages/decimate/round_before.h"

#include <algorithm>
#include <utility>

#include "octree/lattice.h"

namespace tessera {
namespace {

std::array<std::int32_t, 6> cube(const MeshBlockCut& b) {
  return {b.first_brick[0], b.first_brick[1], b.first_brick[2],
          b.last_brick[0],  b.last_brick[1],  b.last_brick[2]};
}

}  // namespace

RoundBefore::RoundBefore(MeshStore in, MeshStore out, std::vector<MeshBlockCut> blocks)
    : in_(std::move(in)), out_(std::move(out)), blocks_(std::move(blocks)) {
  for (std::size_t b = 0; b < blocks_.size(); ++b) by_cube_.emplace(cube(blocks_[b]), b);
}

const MeshBlockCut* RoundBefore::same(const MeshStore& now, const MeshBlockCut& cut,
                                      const FailedRegions& failed) const {
  const auto at = by_cube_.find(cube(cut));
  if (at == by_cube_.end()) return nullptr;
  const MeshBlockCut& old = blocks_[at->second];
  const auto equal = [&](std::size_t a, std::size_t b) {
    const MeshPatchEntry &x = now.patches()[a], &y = in_.patches()[b];
    return x.key == y.key && x.vertex_hash == y.vertex_hash && x.face_hash == y.face_hash;
  };
  if (!std::equal(cut.patches.begin(), cut.patches.end(), old.patches.begin(), old.patches.end(), equal) ||
      failed.meet(now.box_of(cut.patches)))
    return nullptr;
  return &old;
}

std::vector<std::size_t> RoundBefore::patches_left(const MeshBlockCut& cut) const {
  std::vector<std::size_t> patches;
  for (std::size_t p = 0; p < out_.patches().size(); ++p) {
    const Int3 brick = brick_of_key(out_.patches()[p].key);
    bool inside = true;
    for (std::size_t a = 0; a < 3; ++a)
      inside = inside && brick[a] >= cut.first_brick[a] && brick[a] <= cut.last_brick[a];
    if (inside) patches.push_back(p);
  }
  return patches;
}

std::uint64_t RoundBefore::copy(const MeshBlockCut& cut, MeshFileWriter& writer) const {
  std::uint64_t faces = 0;
  for (const std::size_t p : patches_left(cut)) {
    writer.add(out_.patches()[p].key, out_.load({&p, 1}));
    faces += out_.patches()[p].faces;
  }
  return faces;
}

}  // namespace tessera
