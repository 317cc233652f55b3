#include "stream/points/top_store.h"

#include <cmath>

#include "stream/files/task_files.h"

namespace tessera {
namespace {

constexpr PackedKind kTopKind = {"TSTOPSF1", "a file of the top surface"};

}  // namespace

ViewAxes ViewAxes::along(const Double3& up) {
  ViewAxes axes;
  axes.up = 0;
  for (std::size_t a = 1; a < 3; ++a)
    if (std::fabs(up[a]) >= std::fabs(up[axes.up])) axes.up = a;
  axes.u = (axes.up + 1) % 3, axes.v = (axes.up + 2) % 3;
  axes.sign = up[axes.up] < 0.0 ? -1 : 1;
  return axes;
}

TopFileWriter::TopFileWriter(const std::filesystem::path& path) : file_(path, kTopKind) {}

void TopFileWriter::add(std::uint64_t key, bool is_model, std::span<const std::byte> bytes) {
  table_.push_back({key, is_model ? 1u : 0u, 0, file_.append(bytes)});
}
void TopFileWriter::model(std::uint64_t key, const std::vector<ModelColumn>& columns) {
  add(key, true, bytes_of(columns));
}
void TopFileWriter::samples(std::uint64_t key, const std::vector<PointRecord>& records) {
  add(key, false, bytes_of(records));
}

TopStore::TopStore(const std::filesystem::path& work) {
  for (const std::filesystem::path& path : list_task_files(work / kFolder, kExtension)) {
    const PackedFile& file = files_.emplace_back(path, kTopKind, sizeof(TopEntry));
    for (const TopEntry& e : file.table<TopEntry>())
      if (!(e.is_model != 0 ? models_ : samples_).emplace(e.key, Place{files_.size() - 1, e.section}).second)
        throw_out_of_order(path, e.key);
  }
  for (const auto& [key, place] : samples_) bricks_.push_back(key);
}

std::uint64_t TopStore::sample_count(std::uint64_t key) const {
  const auto found = samples_.find(key);
  return found == samples_.end() ? 0 : found->second.section.bytes / sizeof(PointRecord);
}
std::vector<PointRecord> TopStore::samples(std::uint64_t key) const {
  const auto found = samples_.find(key);
  if (found == samples_.end()) return {};
  return files_[found->second.file].load<PointRecord>(found->second.section);
}
std::vector<ModelColumn> TopStore::model(std::uint64_t key) const {
  const auto found = models_.find(key);
  if (found == models_.end()) return {};
  return files_[found->second.file].load<ModelColumn>(found->second.section);
}

}  // namespace tessera
