#include "stream/stages/weld/patch_positions.h"

#include <algorithm>

#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kReturnedKind = {"TSRETRN1", "a file of vertices that went back"};
constexpr const char* kReturnedExtension = ".tsr";

std::string folder_of_round(int round) {
  return "uncross-" + std::to_string(round + 1);
}

/// The files of a round, one after the other.
template <class Visit>
void for_each_returned(const std::filesystem::path& work, int round, const Visit& visit) {
  for (const auto& path : list_task_files(work / folder_of_round(round), kReturnedExtension)) {
    const PackedFile file(path, kReturnedKind, sizeof(Section));
    for (const Section& section : file.table<Section>()) visit(file.load<std::uint64_t>(section));
  }
}

}  // namespace

std::string returned_file_name(int round, std::size_t task) {
  return folder_of_round(round) + "/" + task_file_stem(task) + kReturnedExtension;
}

std::uint64_t save_returned(const std::filesystem::path& path, std::vector<std::uint64_t> vertices) {
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  PackedWriter file(path, kReturnedKind, std::size_t{1} << 16);
  const std::vector<Section> table = {file.append(bytes_of(vertices))};
  return file.finish(table);
}

bool any_returned(const std::filesystem::path& work, int round) {
  bool any = false;
  for_each_returned(work, round, [&](const auto& part) { any = any || !part.empty(); });
  return any;
}

PatchPositions::PatchPositions(const std::filesystem::path& work, const PatchStore& store, int rounds)
    : store_(store), moves_(work), rounds_(static_cast<std::size_t>(std::max(0, rounds))) {
  if (rounds != kBeforeBlunt) blunt_.emplace(work, kBluntFolder);
  if (rounds == kUncrossRounds) rims_.emplace(work, kRimFolder);
  for (int round = 0; round < rounds; ++round) {
    std::vector<std::uint64_t>& all = rounds_[static_cast<std::size_t>(round)];
    for_each_returned(work, round,
                      [&](const auto& part) { all.insert(all.end(), part.begin(), part.end()); });
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
  }
}

bool PatchPositions::may_return(std::size_t patch) const {
  const PatchEntry& entry = store_.patches()[patch];
  return entry.safe > 0 || moves_.any(entry.key) || (blunt_ && blunt_->any(entry.key));
}

std::span<const std::uint64_t> PatchPositions::returned(std::size_t patch, int round) const {
  const std::vector<std::uint64_t>& all = rounds_[static_cast<std::size_t>(round)];
  const auto first = std::lower_bound(all.begin(), all.end(), patch_vertex(patch, 0));
  const auto last = std::lower_bound(first, all.end(), patch_vertex(patch + 1, 0));
  return {first, last};
}

void PatchPositions::load(std::size_t patch, std::vector<Float3>& position, std::vector<std::uint32_t>& rgba,
                          std::vector<Float3>* safe) const {
  store_.load_vertices(patch, position, rgba);
  bool back = safe != nullptr;
  for (int round = 0; round < static_cast<int>(rounds_.size()); ++round)
    back = back || !returned(patch, round).empty();
  std::vector<Float3> before;
  if (back) {
    before = position;
    for (const SafeVertex& v : store_.load_safe(patch)) before.at(v.vertex) = v.at;
  }
  moves_.apply(store_.patches()[patch].key, position);
  if (blunt_) blunt_->apply(store_.patches()[patch].key, position);
  for (int round = 0; round < static_cast<int>(rounds_.size()); ++round)
    for (const std::uint64_t v : returned(patch, round)) {
      const auto vertex = static_cast<std::uint32_t>(v);
      position.at(vertex) = before.at(vertex);
    }
  if (rims_) rims_->apply(store_.patches()[patch].key, position);
  if (safe) *safe = std::move(before);
}

}  // namespace tessera
