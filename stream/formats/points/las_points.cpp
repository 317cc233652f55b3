#include "stream/formats/points/las_points.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "stream/formats/closed_file.h"
#include "stream/formats/points/las_header.h"
#include "stream/formats/points/laz_points.h"
#include "stream/formats/points/point_records.h"

namespace tessera {

namespace {

class LasPoints final : public PointFile {
 public:
  LasPoints(const ReadFile& file, LasHeader header, const ReadOptions& options)
      : input_(file), options_(options), header_(std::move(header)) {
    PointRecordLayout& layout = header_.layout;
    header_.check_bounds(header_.end - header_.begin >= layout.stride);
    const PointFileInfo& info = header_.info;
    const std::optional<PointBox> bounds =
        info.has_bounds ? std::optional(PointBox{info.declared_min, info.declared_max}) : std::nullopt;
    count_ = verified_count(file, header_.begin, header_.end, info.declared_points, layout, true, bounds);
    if (!count_.warning.empty()) header_.info.warnings.push_back(count_.warning);
    if (!options_.colours) layout.colour = {};
    header_.intensities = options_.intensities;
    if (layout.colour[0].there()) {
      layout.colour_scale = sample_colour_scale(file, header_.begin, count_.usable, layout);
    }
  }

  const PointFileInfo& info() const override { return header_.info; }

  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    return even_slices(file, 0, count_.usable, header_.layout.stride, target_bytes);
  }

  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    const std::size_t stride = header_.layout.stride;
    ChunkSink out(options_.chunk_points, sink);
    ReadCounts counts;
    const std::uint64_t end = std::min(slice.end, count_.usable);
    const std::uint64_t begin = std::min(slice.begin, end);
    const ReadFile file = input_.open();
    ByteWindow window(file, header_.begin + begin * stride, header_.begin + end * stride,
                      std::max(ByteWindow::kDefaultCapacity, stride), options_.release_cache);
    for (std::uint64_t left = end - begin; left > 0;) {
      const char* records = window.peek(stride).data();
      const std::size_t n = std::min(window.peek(stride).size() / stride, out.remaining());
      header_.append(records, n, out, counts);
      window.skip(n * stride);
      left -= n;
    }
    out.flush();
    counts.points = out.points();
    if (slice.end >= count_.usable) counts.missing = count_.missing;
    return counts;
  }

 private:
  ClosedFile input_;
  ReadOptions options_;
  LasHeader header_;
  RecordCount count_;
};

}  // namespace

std::unique_ptr<PointFile> open_las_points(const ReadFile& file, const ReadOptions& options) {
  LasHeader header(file);
  if (header.compressed) return open_laz_points(file, std::move(header), options);
  return std::make_unique<LasPoints>(file, std::move(header), options);
}

}  // namespace tessera
