/// \file hole_files.h
/// What the stages "loops" and "holes" leave in the work directory. Loops are ordered by the smallest
/// output number on them, over all files, and so are their fillings; chained loops come behind.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "kernels/holes/hole_filling.h"
#include "octree/vector.h"

namespace tessera {

/// A boundary loop of the welded mesh: positions in cells from the lattice origin.
struct NamedLoop {
  HoleLoop loop;
  std::vector<std::uint64_t> vertex;  ///< output number of each of its vertices
};

/// Bytes in memory and on disk of a loop of n edges, without its taken edges.
constexpr std::uint64_t loop_bytes(std::uint64_t n) {
  return 64 + n * (8 + 24 + 24 + 4);
}

/// Loops of so many edges every brick finds alone: half of one reaches no farther than the faces that it sees.
inline constexpr std::uint32_t kMaxShortEdges = 60;
/// How far from a brick short loops of so many edges go, in cells: half the way around, and a face.
constexpr int short_halo(std::uint32_t edges) {
  return static_cast<int>(edges * 7 / 8) + 5;
}
static_assert(short_halo(kMaxShortEdges) <= 60);  // StripReader::gather
/// Loops of up to so many edges are chained from the bricks' border edges, at the end.
inline constexpr std::uint32_t kMaxChainedEdges = 400;
/// Of rooms: longer ones go around what stands there, few are gaps, and their fillings take the most time.
inline constexpr std::uint32_t kMaxRoomEdges = 100;
/// New vertices of their fillings, at most: a hole 20 cells wide needs fewer.
inline constexpr std::uint64_t kChainedVertices = 3'000;
/// Border edges of paths that are open at once, at most: what lies between a front of bricks and the next.
inline constexpr std::uint64_t kMaxOpenEdges = 60'000;
/// Of loops around what is narrower than the support of a sample.
inline constexpr std::uint32_t kNarrowEdges = 40;
/// A batch of loops ends when it may need so many new vertices.
constexpr std::uint64_t batch_vertices(std::uint64_t max_hole) {
  return max_hole <= kMaxShortEdges ? 25'000 : 200'000;
}
/// Of the faces around a filling while its rim is rounded off.
inline constexpr std::uint64_t kRoundingBytes = std::uint64_t{8} << 20;
/// Memory of a task that fills loops of at most `max_hole` edges: the kernel, and the batch with its fillings.
/// \param chained  edges of loops that are chained, 0 = none
constexpr std::uint64_t hole_task_bytes(std::uint64_t max_hole, std::uint64_t chained = 0) {
  return std::max(hole_bytes(max_hole),
                  chained > 0 ? hole_bytes(chained, kChainedVertices) + kRoundingBytes : 0) +
         290 * (batch_vertices(max_hole) + (chained > 0 ? kChainedVertices : 0));
}

void save_loops(const std::filesystem::path& path, const std::vector<NamedLoop>& loops);
std::vector<NamedLoop> load_loops(const std::filesystem::path& path);

/// A vertex of a rim that gave way to its filling.
struct MovedRim {
  std::uint64_t number = 0;  ///< in the output
  Float3 to{};               ///< cells, relative to the brick that owns it
  std::uint32_t unused = 0;
  bool operator<(const MovedRim& other) const { return number < other.number; }
};

/// A vertex of a rim as it is written, in cells from the lattice origin.
struct RimVertex {
  std::uint64_t number = 0;  ///< in the output
  Double3 position{};
};

/// What one filling has of its batch, in order.
struct FillingSpan {
  std::uint32_t vertices = 0, faces = 0, rim = 0, unused = 0;
  Double3 low{}, high{};  ///< around it, cells from the lattice origin
};

/// The fillings of one batch.
struct HoleFillings {
  std::vector<Double3> position;    ///< new vertices, cells from the lattice origin
  std::vector<std::uint32_t> rgba;  ///< theirs, or empty
  /// Output numbers, or kNew | index of a new vertex of this batch.
  std::vector<std::array<std::uint64_t, 3>> faces;
  static constexpr std::uint64_t kNew = std::uint64_t{1} << 63;
  std::vector<MovedRim> moved;
  std::vector<FillingSpan> spans;
  std::vector<RimVertex> rim;

  void save(const std::filesystem::path& path) const;
  static HoleFillings load(const std::filesystem::path& path);
};

/// The others; borders that the ones that go had moved stay moved. \param gone  per filling
HoleFillings without_fillings(const HoleFillings& all, std::span<const std::uint8_t> gone);

/// Sizes without loading.
struct HoleFillingsHead {
  std::uint64_t vertices = 0;
  std::uint64_t faces = 0;
};
HoleFillingsHead load_fillings_head(const std::filesystem::path& path);
std::vector<MovedRim> load_rim_moves(const std::filesystem::path& path);
std::vector<FillingSpan> load_filling_spans(const std::filesystem::path& path);

/// Files in order; none when no holes were asked for.
std::vector<std::filesystem::path> list_loop_files(const std::filesystem::path& work);
/// As the stage "holes" left them; and, once "uncross-holes" is done, without the fillings that crossed others.
std::vector<std::filesystem::path> list_all_filling_files(const std::filesystem::path& work);
std::vector<std::filesystem::path> list_filling_files(const std::filesystem::path& work);
std::string loop_file_name(std::size_t task, std::size_t batch);
std::string filling_file_name(std::size_t batch);
/// What stands in for a file of fillings of which some are left out. \param name  of that file, without its folder
std::string kept_filling_file_name(const std::string& name);

}  // namespace tessera
