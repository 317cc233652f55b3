#include "stream/formats/points/laz_points.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "stream/formats/closed_file.h"
#include "stream/formats/laz/chunk_decoder.h"
#include "stream/formats/points/copc_index.h"
#include "stream/formats/points/laz_chunks.h"
#include "stream/formats/points/laz_records.h"
#include "stream/formats/points/point_records.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

/// Decoded at a time.
constexpr std::size_t kBatchBytes = std::size_t{1} << 16;
/// With a chunk of more, the file is one slice: readers may keep what a slice gives.
constexpr std::uint64_t kMaxSlicePoints = std::uint64_t{1} << 20;

laz::Layers wanted_layers(const ReadOptions& options) {
  return options.intensities ? laz::Layers::kAll
         : options.colours   ? laz::Layers::kNeeded
                             : laz::Layers::kNoColours;
}

class LazPoints final : public PointFile {
 public:
  LazPoints(const ReadFile& file, LasHeader header, const ReadOptions& options)
      : input_(file),
        options_(options),
        header_(std::move(header)),
        schema_(find_laz_schema(file, header_)),
        chunks_(find_laz_chunks(file, header_, schema_)) {
    PointFileInfo& info = header_.info;
    info.warnings.insert(info.warnings.end(), chunks_.warnings.begin(), chunks_.warnings.end());
    info.packed = true;
    header_.check_bounds(chunks_.points() > 0);
    if (!options.colours) header_.layout.colour = {};
    header_.intensities = options.intensities;
    if (header_.layout.colour[0].there() && !options.unpacked) sample_colours(file);
    pick_nodes(file);
    for (std::size_t i = 0; i < chunks_.size(); ++i)
      one_slice_ = one_slice_ || chunks_.points_of(i) > kMaxSlicePoints;
  }

  const PointFileInfo& info() const override { return header_.info; }

  std::vector<InputSlice> slices(std::uint32_t file, std::uint64_t target_bytes) const override {
    std::vector<InputSlice> slices(1, InputSlice{file, 0, 0, 0});
    for (std::size_t i = 0; i < chunks_.size(); ++i) {
      const std::uint64_t bytes = chunks_.points_of(i) * header_.layout.stride;
      if (!one_slice_ && slices.back().bytes > 0 && slices.back().bytes + bytes > target_bytes)
        slices.push_back({file, i, i, 0});
      slices.back().end = i + 1;
      slices.back().bytes += bytes;
    }
    return slices;
  }

  ReadCounts read(const InputSlice& slice,
                  const std::function<void(const PointChunk&)>& sink) const override {
    ChunkSink out(options_.chunk_points, sink);
    ReadCounts counts;
    const std::size_t end = std::min<std::size_t>(slice.end, chunks_.size());
    const std::size_t begin = std::min<std::size_t>(slice.begin, end);
    std::uint64_t left = chunks_.edges[end].first_point - chunks_.edges[begin].first_point;
    const ReadFile file = input_.open();
    LazRecords stream(file, schema_, chunks_, wanted_layers(options_), options_.release_cache);
    stream.seek(begin);
    const std::size_t maximum = std::max<std::size_t>(1, kBatchBytes / header_.layout.stride);
    std::vector<char> records(maximum * header_.layout.stride);
    while (left > 0) {
      const std::size_t n =
          stream.read(records.data(),
                      static_cast<std::size_t>(std::min<std::uint64_t>({maximum, left, out.remaining()})));
      if (n == 0) break;
      if (!cubes_.empty()) require_in_cube(file, records.data(), n, stream.chunk());
      header_.append(records.data(), n, out, counts);
      left -= n;
    }
    out.flush();
    file.require_unchanged();
    counts.points = out.points();
    counts.missing = left;
    if (end == chunks_.size()) counts.missing += chunks_.missing;
    return counts;
  }

 private:
  /// Of a file with an octree, what is wanted alone.
  void pick_nodes(const ReadFile& file) {
    PointFileInfo& info = header_.info;
    const std::optional<CopcInfo> copc = find_copc(file, header_);
    info.octree = copc.has_value();
    if (copc && (options_.bounds || options_.resolution_limit > 0.0)) {
      const Double3& step = header_.layout.scale;
      const double slack = std::max({std::fabs(step[0]), std::fabs(step[1]), std::fabs(step[2])});
      std::vector<std::size_t> picked;
      for (const CopcChunk& c :
           copc_chunks(file, *copc, chunks_, options_.bounds, options_.resolution_limit, slack)) {
        picked.push_back(c.chunk);
        cubes_.push_back(c);
      }
      chunks_ = chunks_.picked(picked);
      info.declared_points = chunks_.points();
    }
    info.unpacked_bytes = chunks_.points() * header_.layout.stride;
  }
  /// Else a hierarchy that lies would lose points without a word.
  void require_in_cube(const ReadFile& file, const char* records, std::size_t count,
                       std::size_t chunk) const {
    const CopcChunk& cube = cubes_[chunk];
    const PointRecordLayout& layout = header_.layout;
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t a = 0; a < 3; ++a) {
        const double p = load_scalar<std::int32_t>(records + i * layout.stride + 4 * a) * layout.scale[a] +
                         layout.shift[a];
        if (p < cube.min[a] || p > cube.max[a])
          throw InputError(file.path().string() + ": byte " + std::to_string(chunks_.edges[chunk].begin) +
                           ": a point of node " + cube.name +
                           " lies outside its cube, the octree of COPC is wrong; get the file anew, or read "
                           "it without its octree: tessera convert IN -o OUT.las");
      }
    }
  }
  /// From the records that those of the uncompressed file would be told by.
  void sample_colours(const ReadFile& file) {
    const std::size_t stride = header_.layout.stride;
    LazRecords stream(file, schema_, chunks_, wanted_layers(options_), options_.release_cache);
    std::vector<char> records;
    std::uint64_t at = 0;  // of the next record
    std::size_t chunk = 0;
    stream.seek(0);
    header_.layout.colour_scale =
        sample_colour_scale(chunks_.points(), header_.layout, [&](std::uint64_t first, std::size_t count) {
          const auto after = std::upper_bound(
              chunks_.edges.begin(), chunks_.edges.end(), first,
              [](std::uint64_t point, const LazChunk& edge) { return point < edge.first_point; });
          const auto wanted = static_cast<std::size_t>(after - chunks_.edges.begin()) - 1;
          if (wanted > chunk) {
            stream.seek(chunk = wanted);
            at = chunks_.edges[chunk].first_point;
          }
          records.resize(count * stride);
          std::size_t kept = 0;
          while (at < first + count) {
            const std::uint64_t wish =
                at < first ? std::min<std::uint64_t>(first - at, count) : first + count - at;
            const std::size_t n = stream.read(records.data() + kept * stride, static_cast<std::size_t>(wish));
            if (n == 0) break;
            if (at >= first) kept += n;
            at += n;
          }
          return std::string_view(records.data(), kept * stride);
        });
  }

  ClosedFile input_;
  ReadOptions options_;
  LasHeader header_;
  laz::Schema schema_;
  LazChunks chunks_;
  std::vector<CopcChunk> cubes_;  ///< of the chunks, where only some are read
  bool one_slice_ = false;
};

}  // namespace

std::unique_ptr<PointFile> open_laz_points(const ReadFile& file, LasHeader header,
                                           const ReadOptions& options) {
  return std::make_unique<LazPoints>(file, std::move(header), options);
}

}  // namespace tessera
