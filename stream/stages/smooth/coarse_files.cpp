#include "stream/stages/smooth/coarse_files.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr PackedKind kSumsKind = {"TSCSUMS2", "a file of sums"};
constexpr PackedKind kSolutionKind = {"TSCSOLV2", "a coarse solution"};
constexpr PackedKind kLaplacianKind = {"TSCBEND2", "a file of bends"};

}  // namespace

std::string coarse_sums_folder(std::size_t round) {
  return "sums-" + std::to_string(round);
}
std::string coarse_folder(std::size_t round) {
  return "coarse-" + std::to_string(round);
}
std::string coarse_solution_file(std::size_t round) {
  return coarse_folder(round) + "/solution.bin";
}

std::string laplacian_folder(std::size_t round) {
  return "bend-" + std::to_string(round);
}

PatchSumsWriter::PatchSumsWriter(const std::filesystem::path& path) : file_(path, kSumsKind) {}

void PatchSumsWriter::add(const PatchSums& sums) {
  table_.push_back({sums.patch, file_.append(bytes_of(sums.unknowns)), file_.append(bytes_of(sums.entries)),
                    file_.append(bytes_of(sums.loads))});
}

PatchSumsCount count_patch_sums(const std::vector<std::filesystem::path>& files) {
  PatchSumsCount count;
  for (const auto& path : files) {
    const PackedFile file(path, kSumsKind, sizeof(PatchSumsWriter::Entry));
    for (const auto& e : file.table<PatchSumsWriter::Entry>()) {
      count.unknowns += e.unknowns.bytes / sizeof(CoarseUnknown);
      count.entries += e.entries.bytes / sizeof(CoarseEntry);
      count.loads += e.loads.bytes / sizeof(CoarseLoad);
      count.largest_patch_bytes =
          std::max(count.largest_patch_bytes, e.unknowns.bytes + e.entries.bytes + e.loads.bytes);
    }
  }
  return count;
}

void read_patch_sums(const std::vector<std::filesystem::path>& files,
                     const std::function<void(const PatchSums&)>& sink) {
  for (const auto& path : files) {
    const PackedFile file(path, kSumsKind, sizeof(PatchSumsWriter::Entry));
    for (const auto& e : file.table<PatchSumsWriter::Entry>())
      sink({e.patch, file.load<CoarseUnknown>(e.unknowns), file.load<CoarseEntry>(e.entries),
            file.load<CoarseLoad>(e.loads)});
  }
}

void save_coarse_solution(const std::filesystem::path& path, std::span<const CoarseUnknown> unknowns,
                          std::span<const CoarseValue> values) {
  std::vector<std::uint64_t> names;
  for (const CoarseUnknown& u : unknowns) names.push_back(u.name);
  PackedWriter file(path, kSolutionKind);
  const std::vector<Section> sections = {file.append(bytes_of(names)), file.append(std::as_bytes(values))};
  file.finish(sections);
}

CoarseSolution load_coarse_solution(const std::filesystem::path& path) {
  const PackedFile file(path, kSolutionKind, sizeof(Section));
  const auto sections = file.table<Section>();
  return {file.load<std::uint64_t>(sections.at(0)), file.load<CoarseValue>(sections.at(1))};
}

std::uint64_t coarse_solution_bytes(const std::filesystem::path& path) {
  return ReadFile(path).size();
}

PatchLaplacianWriter::PatchLaplacianWriter(const std::filesystem::path& path) : file_(path, kLaplacianKind) {}

void PatchLaplacianWriter::add(std::uint64_t patch, std::span<const Float3> laplacian) {
  table_.push_back({patch, file_.append(std::as_bytes(laplacian))});
}

PatchLaplacians::PatchLaplacians(const std::vector<std::filesystem::path>& files) {
  for (const auto& path : files) {
    const PackedFile& file = files_.emplace_back(path, kLaplacianKind, sizeof(PatchLaplacianWriter::Entry));
    for (const auto& e : file.table<PatchLaplacianWriter::Entry>())
      slots_[e.patch] = {files_.size() - 1, e.laplacian};
  }
}

std::vector<Float3> PatchLaplacians::load(std::uint64_t patch) const {
  const PatchSlot& slot = slots_.at(patch);
  return files_[slot.file].load<Float3>(slot.laplacian);
}

TileState tile_state(const MeshStore& loaded, const MeshStore& store, const PatchLaplacians& laplacians,
                     const MeshHaloBlock& near, const SmoothTile& tile) {
  const std::vector<std::uint64_t>& key = near.block.key;
  TileState out;
  out.now = near.block.position;
  if (!laplacians.empty()) out.laplacian.resize(key.size());
  for (const std::size_t p : loaded.select(grown(loaded.box_of(tile.patches), tile.margin))) {
    const MeshBlock patch = store.load({&p, 1});
    const std::vector<Float3> laplacian = laplacians.empty() ? std::vector<Float3>() : laplacians.load(p);
    auto at = key.begin();
    for (std::size_t v = 0; v < patch.key.size(); ++v) {
      at = std::lower_bound(at, key.end(), patch.key[v]);
      if (at == key.end()) break;
      if (*at != patch.key[v]) continue;
      const auto i = static_cast<std::size_t>(at - key.begin());
      out.now[i] = patch.position[v];
      if (!laplacian.empty()) out.laplacian[i] = laplacian[v];
    }
  }
  return out;
}

}  // namespace tessera
