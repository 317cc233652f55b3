#include "stream/stages/surface/level_files.h"

#include <utility>

#include "octree/error.h"
#include "stream/files/packed_file.h"
#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kLevelKind = {"TSLEVEL1", "a file of levels"};
constexpr std::size_t kLevelBuffer = std::size_t{1} << 16;

}  // namespace

std::string split_nodes_file(std::size_t task) {
  return kLevelFolder + task_file_stem(task) + ".tsl";
}

std::uint64_t save_split_nodes(const std::filesystem::path& file, const std::vector<SplitNode>& nodes) {
  return PackedWriter(file, kLevelKind, kLevelBuffer).finish(nodes);
}

std::vector<SplitNode> load_split_nodes(const std::filesystem::path& file) {
  return PackedFile(file, kLevelKind, sizeof(SplitNode)).table<SplitNode>();
}

LevelTree make_level_tree(int levels, std::span<const SplitNode> nodes) {
  std::vector<std::vector<std::uint64_t>> split(static_cast<std::size_t>(levels));
  for (const SplitNode& n : nodes) split.at(n.level).push_back(n.key);
  return LevelTree(levels, std::move(split));
}

LevelTree level_tree_of_work(const std::filesystem::path& work, int levels) {
  const std::filesystem::path file = work / kLevelTreeFile;
  const std::vector<SplitNode> nodes = load_split_nodes(file);
  for (const SplitNode& n : nodes)
    if (n.level == 0 || n.level >= static_cast<std::uint64_t>(levels))
      throw InputError(file.string() + ": of another number of levels; run again with --force");
  return make_level_tree(levels, nodes);
}

Lattice finest_lattice(const Lattice& points, const ReconstructOptions& options) {
  Lattice finest = points;
  for (std::uint64_t level = 1; level < options.levels; ++level) {
    finest.h *= 0.5;
    for (std::int64_t& brick : finest.origin_brick) brick *= 2;
  }
  return finest;
}

}  // namespace tessera
