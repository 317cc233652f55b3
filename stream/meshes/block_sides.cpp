#include "stream/meshes/block_sides.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "kernels/mesh/mesh_block_ops.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kSideKind = {"TSSIDES1", "a file of the sides of blocks"};
/// Cells from a side inwards. Features and borders move vertices by at most one cell, so what reaches over a side meets nothing that
/// lies deeper; one more, so that what goes back is looked at as well.
constexpr double kSideCells = 2.0;

int block_edge(std::uint32_t bricks) {
  return bricks == 64 ? 4 : bricks == 8 ? 2 : 1;
}

/// Vertices of the faces that are left, and who needs them.
struct NearSide {
  std::vector<std::uint64_t> key;
  std::vector<Double3> position;
  std::vector<SafePlace> places;
  std::vector<std::array<std::uint32_t, 3>> faces;
};

NearSide load_side(const PackedFile& file, const SideEntry& e) {
  NearSide side;
  side.key.resize(e.vertices), side.position.resize(e.vertices);
  side.places.resize(e.places), side.faces.resize(e.faces);
  file.read(e.content,
            {buffer_of(side.key), buffer_of(side.position), buffer_of(side.places), buffer_of(side.faces)});
  return side;
}

const SafePlace* find_place(std::span<const SafePlace> places, std::uint64_t key) {
  const auto at = std::lower_bound(places.begin(), places.end(), key,
                                   [](const SafePlace& p, std::uint64_t k) { return p.key < k; });
  return at == places.end() || at->key != key ? nullptr : &*at;
}

}  // namespace

std::string side_file(std::size_t task) {
  return kSideFolder + task_file_stem(task) + ".tss";
}

SideFileWriter::SideFileWriter(const std::filesystem::path& path, const MeshFrame& frame)
    : file_(path, kSideKind, std::size_t{1} << 18) {
  for (std::size_t a = 0; a < 3; ++a)
    frame_[a] = frame.lattice.world(static_cast<int>(a), 0.0) - frame.shift[a];
  frame_[3] = frame.lattice.h;
}

void SideFileWriter::add(std::uint64_t brick, std::uint32_t bricks, const MeshBlock& block,
                         std::span<const SafePlace> safe) {
  SideEntry e;
  e.brick = brick, e.bricks = bricks;
  const Int3 at = brick_of_key(brick);
  const double h = frame_[3], edge = h * kBrickCells;
  Double3 low, high;  // what lies between is near no side
  for (std::size_t a = 0; a < 3; ++a) {
    low[a] = frame_[a] + edge * at[a] + kSideCells * h;
    high[a] = frame_[a] + edge * (at[a] + block_edge(bricks)) - kSideCells * h;
  }
  std::vector<std::uint8_t> beyond(block.key.size());  // per side
  for (std::size_t v = 0; v < beyond.size(); ++v)
    for (std::size_t a = 0; a < 3; ++a) {
      const double x = block.position[v][a];
      beyond[v] = static_cast<std::uint8_t>(beyond[v] | (x < low[a] ? 1u : x > high[a] ? 2u : 0u) << 2 * a);
    }
  std::vector<std::uint8_t> keep(block.faces.size());
  for (std::size_t f = 0; f < keep.size(); ++f) {
    const auto& corner = block.faces[f];
    const unsigned sides = static_cast<unsigned>(beyond[corner[0]] | beyond[corner[1]] | beyond[corner[2]]);
    keep[f] = sides != 0;
    for (std::size_t s = 0; s < 6; ++s) e.faces_at[s] += sides >> s & 1u;
  }
  const MeshBlock near = select_faces(block, keep);
  std::vector<SafePlace> places;
  std::size_t v = 0, n = 0;
  for (const SafePlace& place : safe) {
    while (v < block.key.size() && block.key[v] < place.key) ++v;
    while (n < near.key.size() && near.key[n] < place.key) ++n;
    const bool here = v < block.key.size() && block.key[v] == place.key;
    // One that no face of this block has is of another's.
    if (here && (n == near.key.size() || near.key[n] != place.key)) continue;
    if (!here || near.position[n] != place.at) places.push_back(place);
  }
  e.vertices = static_cast<std::uint32_t>(near.key.size());
  e.faces = static_cast<std::uint32_t>(near.faces.size());
  e.places = static_cast<std::uint32_t>(places.size());
  if (e.faces == 0 && e.places == 0) return;
  e.content =
      file_.append({bytes_of(near.key), bytes_of(near.position), bytes_of(places), bytes_of(near.faces)});
  table_.push_back(e);
}

std::uint64_t SideFileWriter::finish() {
  return file_.finish(table_, std::as_bytes(std::span(frame_)));
}

BlockSides::BlockSides(const std::filesystem::path& work) {
  first_.push_back(0);
  for (const auto& path : list_task_files(work / kSideFolder, ".tss")) {
    files_.emplace_back(path, kSideKind, sizeof(SideEntry), sizeof frame_);
    std::copy_n(files_.back().info().begin(), sizeof frame_,
                std::as_writable_bytes(std::span(frame_)).begin());
    files_.back().append_table(entries_);
    file_.resize(entries_.size(), static_cast<std::uint32_t>(files_.size() - 1));
    first_.push_back(entries_.size());
  }
  order_.resize(entries_.size());
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  std::sort(order_.begin(), order_.end(),
            [&](std::size_t a, std::size_t b) { return entries_[a].brick < entries_[b].brick; });
}

std::vector<std::uint64_t> BlockSides::bricks_around(std::size_t block) const {
  const Int3 first = brick_of_key(entries_[block].brick);
  const int edge = block_edge(entries_[block].bricks);
  std::vector<std::uint64_t> codes;
  for (int z = first[2] - 1; z <= first[2] + edge; ++z)
    for (int y = first[1] - 1; y <= first[1] + edge; ++y)
      for (int x = first[0] - 1; x <= first[0] + edge; ++x)
        if (x >= 0 && y >= 0 && z >= 0) codes.push_back(brick_key({x, y, z}));
  return codes;
}

std::vector<std::size_t> BlockSides::blocks_around(std::size_t block) const {
  std::vector<std::size_t> blocks;
  for (const std::uint64_t code : bricks_around(block)) {
    const auto next = std::upper_bound(order_.begin(), order_.end(), code,
                                       [&](std::uint64_t c, std::size_t b) { return c < entries_[b].brick; });
    if (next == order_.begin()) continue;
    const std::size_t there = *std::prev(next);
    if (there != block && code - entries_[there].brick < entries_[there].bricks) blocks.push_back(there);
  }
  std::sort(blocks.begin(), blocks.end());
  blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
  return blocks;
}

BlockSides::Box BlockSides::cube(const SideEntry& e) const {
  const Int3 at = brick_of_key(e.brick);
  const double edge = frame_[3] * kBrickCells, margin = frame_[3] * kSideCells;
  Box box;
  for (std::size_t a = 0; a < 3; ++a) {
    box.low[a] = frame_[a] + edge * at[a] - margin;
    box.high[a] = frame_[a] + edge * (at[a] + block_edge(e.bricks)) + margin;
  }
  return box;
}

SideMesh BlockSides::load(std::size_t block, std::span<const SafePlace> moved) const {
  const SideEntry& own = entries_[block];
  SideMesh out;
  out.mesh.cell = frame_[3];
  const auto add_vertex = [&](const NearSide& side, std::uint32_t v) {
    const SafePlace* back = find_place(moved, side.key[v]);
    out.mesh.position.push_back(back != nullptr ? back->at : side.position[v]);
    out.mesh.name.push_back(side.key[v]);
  };
  std::vector<SafePlace> places;
  {
    NearSide side = load_side(files_[file_[block]], own);
    for (std::uint32_t v = 0; v < side.key.size(); ++v) add_vertex(side, v);
    out.own_vertices = side.key.size();
    out.own_faces = side.faces.size();
    out.mesh.faces = std::move(side.faces);
    places = std::move(side.places);
  }
  const Box box = cube(own);
  std::vector<std::uint32_t> number;
  for (const std::size_t there : blocks_around(block)) {
    const SideEntry& e = entries_[there];
    const NearSide side = load_side(files_[file_[there]], e);
    places.insert(places.end(), side.places.begin(), side.places.end());
    if (e.brick < own.brick) continue;
    number.assign(side.key.size(), ~0u);
    for (const auto& f : side.faces) {
      bool meets = true;
      for (std::size_t a = 0; a < 3; ++a) {
        const auto [low, high] =
            std::minmax({side.position[f[0]][a], side.position[f[1]][a], side.position[f[2]][a]});
        meets = meets && high >= box.low[a] && low <= box.high[a];
      }
      if (!meets) continue;
      auto& face = out.mesh.faces.emplace_back();
      for (std::size_t k = 0; k < 3; ++k) {
        if (number[f[k]] == ~0u) {
          number[f[k]] = static_cast<std::uint32_t>(out.mesh.position.size());
          add_vertex(side, f[k]);
        }
        face[k] = number[f[k]];
      }
    }
  }
  out.mesh.risky.resize(out.mesh.position.size());
  std::sort(places.begin(), places.end(),
            [](const SafePlace& a, const SafePlace& b) { return a.key < b.key; });
  for (const SafePlace& p : places)
    if (find_place(moved, p.key) == nullptr) out.safe.push_back(p);
  return out;
}

std::uint64_t BlockSides::bytes(std::size_t block) const {
  // Of another block what is at the sides that face this one comes into question.
  const SideEntry& own = entries_[block];
  const Int3 first = brick_of_key(own.brick);
  const int edge = block_edge(own.bricks);
  std::uint64_t near = 0, places = own.places, largest = 0;
  for (const std::size_t there : blocks_around(block)) {
    const SideEntry& e = entries_[there];
    const Int3 at = brick_of_key(e.brick);
    std::uint32_t faces = e.faces;
    for (std::size_t a = 0; a < 3; ++a) {
      if (at[a] >= first[a] + edge) faces = std::min(faces, e.faces_at[2 * a]);
      if (at[a] + block_edge(e.bricks) <= first[a]) faces = std::min(faces, e.faces_at[2 * a + 1]);
    }
    places += e.places;
    largest = std::max(largest, e.content.bytes + 4 * std::uint64_t{e.vertices});
    if (e.brick > own.brick) near += faces;
  }
  return bytes(own.faces, near) + largest + 2 * sizeof(SafePlace) * places + own.content.bytes;
}

std::uint64_t BlockSides::bytes(std::uint64_t own_faces, std::uint64_t near_faces) {
  // Of a face that is loaded alone all corners are its own.
  constexpr std::uint64_t kVertexBytes = 2 * (sizeof(Double3) + 8 + 1) + 1, kFaceBytes = 2 * 12;
  const std::uint64_t faces = own_faces + near_faces;
  return 3 * faces * kVertexBytes + faces * kFaceBytes + risky_crossings_bytes(faces, kMaxRiskCells) +
         (std::uint64_t{2} << 20);
}

}  // namespace tessera
