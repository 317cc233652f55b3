#include "stream/meshes/mesh_blocking.h"

#include <algorithm>
#include <numeric>

#include "kernels/mesh/mesh_block_ops.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMaxTasks = 400;

struct CodedPatch {
  std::uint64_t code;  ///< Morton code of the shifted brick
  std::size_t patch;
};

class Cutter {
 public:
  Cutter(const MeshStore& store, const MeshBlocking& blocking, std::span<const std::uint64_t> weight)
      : patches_(store.patches()), blocking_(blocking), weight_(weight) {}

  /// \param coded  bricks below one node  \param bits  width of the codes below it
  void cut(std::span<const CodedPatch> coded, int bits) {
    if (coded.empty()) return;
    MeshBlockCut block;
    for (const CodedPatch& p : coded) {
      block.faces += patches_[p.patch].faces;
      if (!weight_.empty()) block.weight += weight_[p.patch];
    }
    if (bits == 0 || (block.faces <= blocking_.max_faces && block.weight <= blocking_.max_weight)) {
      for (const CodedPatch& p : coded) block.patches.push_back(p.patch);
      std::sort(block.patches.begin(), block.patches.end());
      const Int3 corner = brick_of_key(coded.front().code >> bits << bits);
      for (std::size_t a = 0; a < 3; ++a) {
        block.first_brick[a] = corner[a] - blocking_.shift[a];
        // The lowest bit of a code is of x.
        block.last_brick[a] = block.first_brick[a] + (1 << (bits + 2 - static_cast<int>(a)) / 3) - 1;
      }
      blocks.push_back(std::move(block));
      return;
    }
    bits -= blocking_.halves ? 1 : 3;
    while (!coded.empty()) {
      const std::uint64_t node = coded.front().code >> bits;
      const auto end = std::find_if(coded.begin(), coded.end(),
                                    [&](const CodedPatch& p) { return p.code >> bits != node; });
      const auto count = static_cast<std::size_t>(end - coded.begin());
      cut(coded.first(count), bits);
      coded = coded.subspan(count);
    }
  }

  std::vector<MeshBlockCut> blocks;

 private:
  std::span<const MeshPatchEntry> patches_;
  const MeshBlocking& blocking_;
  std::span<const std::uint64_t> weight_;
};

}  // namespace

std::uint64_t MeshBlockCut::brick_of(const Lattice& lattice, const Double3& a, const Double3& b,
                                     const Double3& c) const {
  Int3 brick = brick_of_key(brick_of_face(lattice, a, b, c));
  for (std::size_t i = 0; i < 3; ++i)
    brick[i] = std::clamp(brick[i], std::max(0, first_brick[i]), last_brick[i]);
  return brick_key(brick);
}

std::vector<MeshBlockCut> make_blocks(const MeshStore& store, const MeshBlocking& blocking,
                                      std::span<const std::uint64_t> weight) {
  std::vector<CodedPatch> coded;
  for (std::size_t p = 0; p < store.patches().size(); ++p) {
    const Int3 b = brick_of_key(store.patches()[p].key);
    coded.push_back(
        {brick_key({b[0] + blocking.shift[0], b[1] + blocking.shift[1], b[2] + blocking.shift[2]}), p});
  }
  std::sort(coded.begin(), coded.end(),
            [](const CodedPatch& a, const CodedPatch& b) { return a.code < b.code; });
  Cutter cutter(store, blocking, weight);
  constexpr int kRootBits = 3 * (kMaxCellBits - 1);  // holds every brick with any shift
  cutter.cut(coded, kRootBits);
  return std::move(cutter.blocks);
}

void write_block(const MeshBlockCut& cut, const Lattice& lattice, const MeshBlock& block,
                 MeshFileWriter& writer) {
  std::vector<std::uint64_t> brick;
  brick.reserve(block.faces.size());
  for (const auto& f : block.faces)
    brick.push_back(cut.brick_of(lattice, block.position[f[0]], block.position[f[1]], block.position[f[2]]));
  split_faces(block, brick, [&](std::uint64_t key, MeshBlock&& patch) { writer.add(key, patch); });
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

std::vector<std::size_t> tasks_by_faces(std::span<const std::uint64_t> faces, std::uint64_t task_faces) {
  const std::uint64_t target =
      std::max(task_faces, std::accumulate(faces.begin(), faces.end(), std::uint64_t{0}) / kMaxTasks);
  std::vector<std::size_t> first;
  std::uint64_t sum = target;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (sum >= target) {
      first.push_back(i);
      sum = 0;
    }
    sum += faces[i];
  }
  first.push_back(faces.size());
  return first;
}

std::vector<std::size_t> tasks_by_faces(std::span<const MeshBlockCut> blocks, std::uint64_t task_faces) {
  std::vector<std::uint64_t> faces;
  for (const MeshBlockCut& block : blocks) faces.push_back(block.faces + block.weight);
  return tasks_by_faces(faces, task_faces);
}

std::vector<std::size_t> tasks_by_faces(std::span<const MeshPatchEntry> patches, std::uint64_t task_faces) {
  std::vector<std::uint64_t> faces;
  for (const MeshPatchEntry& patch : patches) faces.push_back(patch.faces);
  return tasks_by_faces(faces, task_faces);
}

}  // namespace tessera
