#include "stream/import/file_vertices.h"

#include <algorithm>
#include <utility>

#include "stream/import/import_ranges.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

constexpr std::size_t kKeptBatch = 8192;

Float3 kept_floats(const Double3& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
}

}  // namespace

MeshRanges* find_ranges(MeshReader& mesh) {
  auto* ranges = dynamic_cast<MeshRanges*>(&mesh);
  return ranges && ranges->has_ranges() ? ranges : nullptr;
}

FileVertices::FileVertices(MeshReader& mesh, std::uint64_t max_bytes, std::size_t lanes)
    : mesh_(mesh),
      file_ranges_(find_ranges(mesh)),
      lanes_(lanes),
      keep_(!mesh.header().double_positions && !mesh.header().colour && mesh.header().vertices > 0 &&
            mesh.header().vertices <= max_bytes / sizeof(Float3)) {
  if (keep_ && file_ranges_) position_.resize(mesh.header().vertices);
}

std::size_t FileVertices::ranges() const {
  return !all_ && !file_ranges_ ? 1 : (mesh_.header().vertices + kImportRange - 1) / kImportRange;
}

void FileVertices::read_all(const Sink& sink) {
  parallel_in_order(
      ranges(), lanes_, [&](std::size_t range) { read(range, sink); }, [](std::size_t) {});
}

void FileVertices::read(std::size_t range, const Sink& sink) {
  const std::uint64_t begin = range * kImportRange;
  const std::uint64_t end = std::min(begin + kImportRange, mesh_.header().vertices);
  if (all_) return read_kept(begin, end, sink);
  if (!file_ranges_) return read_in_order(sink);
  std::unique_ptr<MeshVertexPart> part = take_part();
  file_ranges_->read_vertex_range(begin, end, *part);
  if (keep_) {
    for (std::uint64_t i = begin; i < end; ++i) position_[i] = kept_floats(part->position[i - begin]);
    if (++kept_ranges_ == ranges()) all_ = true;
  }
  sink(part->position, part->rgba);
  const std::lock_guard lock(mutex_);
  parts_.push_back(std::move(part));
}

std::unique_ptr<MeshVertexPart> FileVertices::take_part() {
  const std::lock_guard lock(mutex_);
  if (parts_.empty()) return std::make_unique<MeshVertexPart>();
  std::unique_ptr<MeshVertexPart> part = std::move(parts_.back());
  parts_.pop_back();
  return part;
}

void FileVertices::read_kept(std::uint64_t begin, std::uint64_t end, const Sink& sink) const {
  std::vector<Double3> batch;
  while (begin < end) {
    batch.resize(std::min<std::uint64_t>(kKeptBatch, end - begin));
    for (Double3& to : batch) {
      const Float3& p = position_[begin++];
      to = {p[0], p[1], p[2]};
    }
    sink(batch, {});
  }
}

void FileVertices::read_in_order(const Sink& sink) {
  bool keep = std::exchange(keep_, false);
  if (keep) position_.reserve(mesh_.header().vertices);
  mesh_.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t> rgba) {
    keep = keep && position_.size() + batch.size() <= position_.capacity();
    for (std::size_t i = 0; keep && i < batch.size(); ++i) position_.push_back(kept_floats(batch[i]));
    sink(batch, rgba);
  });
  all_ = keep && position_.size() == mesh_.header().vertices;
  if (!all_) std::vector<Float3>().swap(position_);
}

}  // namespace tessera
