#include "stream/points/run_file.h"

#include <algorithm>
#include <tuple>
#include <utility>

namespace tessera {
namespace {

constexpr PackedKind kRunKind = {"TSRUNS02", "a run file"};
constexpr PackedKind kExtentsKind = {"TSEXTNT2", "a table of extents"};

}  // namespace

RunWriter::RunWriter(const std::filesystem::path& path, std::uint32_t file, std::size_t buckets,
                     std::size_t run_points)
    : out_(path, kRunKind), file_(file), run_points_(run_points), first_(buckets) {
  points_.reserve(run_points);  // reserved, not touched: a small task takes little
  grouped_.reserve(run_points);
  buckets_.reserve(run_points);
}

void RunWriter::flush() {
  const std::size_t n = points_.size();
  if (n == 0) return;
  std::fill(first_.begin(), first_.end(), 0);
  for (std::size_t i = 0; i < n; ++i) ++first_[buckets_[i]];
  std::uint64_t sum = 0;
  for (std::uint64_t& first : first_) first = std::exchange(sum, sum + first);
  grouped_.resize(n);
  for (std::size_t i = 0; i < n; ++i) grouped_[first_[buckets_[i]]++] = points_[i];
  const PointRecord* from = grouped_.data();
  for (std::size_t b = 0; b < first_.size(); ++b) {
    const std::span<const PointRecord> points(from, grouped_.data() + first_[b]);
    from += points.size();
    if (!points.empty())
      extents_.push_back({static_cast<std::uint32_t>(b), file_, out_.append(std::as_bytes(points))});
  }
  points_.clear();
  buckets_.clear();
}

std::uint64_t RunWriter::finish() {
  flush();
  return out_.finish(extents_);
}

PackedFile open_run_file(const std::filesystem::path& path) {
  return {path, kRunKind, sizeof(Extent)};
}

void save_extents(const std::filesystem::path& path, std::vector<Extent> extents) {
  std::sort(extents.begin(), extents.end(), [](const Extent& a, const Extent& b) {
    return std::tie(a.bucket, a.file, a.records.offset) < std::tie(b.bucket, b.file, b.records.offset);
  });
  PackedWriter(path, kExtentsKind, std::size_t{1} << 20).finish(extents);
}

std::vector<Extent> load_extents(const std::filesystem::path& path) {
  return PackedFile(path, kExtentsKind, sizeof(Extent)).table<Extent>();
}

std::vector<Extent> load_extents(const std::filesystem::path& path, std::uint64_t first,
                                 std::uint64_t count) {
  return PackedFile(path, kExtentsKind, sizeof(Extent)).entries<Extent>(first, count);
}

}  // namespace tessera
