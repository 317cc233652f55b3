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
#include "stream/formats/points/point_records.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

/// Decoded at a time.
constexpr std::size_t kBatchBytes = std::size_t{1} << 16;
/// With a chunk of more, the file is one slice: readers may keep what a slice gives.
constexpr std::uint64_t kMaxSlicePoints = std::uint64_t{1} << 20;

/// Records of consecutive chunks, in order.
class RecordStream {
 public:
  RecordStream(const ReadFile& file, const laz::Schema& schema, const LazChunks& chunks,
               const ReadOptions& options)
      : file_(file),
        schema_(schema),
        chunks_(chunks),
        layers_(options.intensities ? laz::Layers::kAll
                : options.colours   ? laz::Layers::kNeeded
                                    : laz::Layers::kNoColours),
        release_(options.release_cache) {}

  /// Goes on with the first record of a chunk.
  void seek(std::size_t chunk) {
    next_ = chunk;
    left_ = 0;
    ended_ = false;
  }
  /// That the last records came from.
  std::size_t chunk() const { return next_ - 1; }
  /// Up to `count` records, fewer where a chunk ends; none only where a file that was cut off ends.
  /// \pre  there are records left  \throws InputError naming the chunk when it is damaged
  std::size_t read(char* records, std::size_t count) {
    if (ended_) return 0;
    std::uint64_t before = 0;
    try {
      while (left_ == 0) open_next();
      if (unit_left_ == 0) begin_unit();
      const auto n = static_cast<std::size_t>(std::min<std::uint64_t>({count, left_, unit_left_}));
      before = decoder_->decoded();
      decoder_->decode(records, n);
      left_ -= n;
      unit_left_ -= n;
      if (left_ == 0 && !chunks_.in_order) decoder_->require_used_up();
      return n;
    } catch (const laz::EndOfBytes& e) {
      if (!chunks_.cut_off || next_ != chunks_.size()) fail(e);
      ended_ = true;
      return decoder_ ? static_cast<std::size_t>(decoder_->decoded() - before) : 0;
    } catch (const laz::Damage& e) {
      fail(e);
    }
  }

 private:
  void open_next() {
    const std::size_t chunk = next_++;
    left_ = chunks_.points_of(chunk);
    unit_left_ = 0;
    decoder_.reset();
    begin_ = chunks_.edges[chunk].begin;
    end_ = chunks_.end_of(chunk);
    if (!schema_.layered()) feed_ = std::make_unique<FileFeed>(file_, begin_, end_, release_);
  }
  /// What one set of models codes: a chunk, or a run of chunks one after the other.
  void begin_unit() {
    decoder_.reset();
    if (schema_.layered()) {
      const laz::OpenBytes open = [&](std::uint64_t from, std::uint64_t to) {
        const std::uint64_t maximum = end_ - begin_;
        return std::make_unique<FileFeed>(file_, begin_ + std::min(from, maximum),
                                          begin_ + std::min(to, maximum), release_);
      };
      if (laz::read_layered_head(schema_, open).points != left_)
        throw laz::Damage("it counts other points than the chunk table gives it");
      decoder_ = laz::decode_layered(schema_, open, layers_);
    } else {
      decoder_ = laz::decode_pointwise(schema_, *feed_);
    }
    unit_left_ = chunks_.in_order && schema_.chunked() ? schema_.chunk_points : left_;
  }
  [[noreturn]] void fail(const laz::Damage& e) const {
    throw InputError(file_.path().string() + ": byte " + std::to_string(begin_) + ": chunk " +
                     std::to_string(next_) + " of " + std::to_string(chunks_.size()) + " is damaged: " +
                     e.what() + "; get the file anew, or compress it anew from the original");
  }

  const ReadFile& file_;
  const laz::Schema& schema_;
  const LazChunks& chunks_;
  laz::Layers layers_;
  bool release_;
  std::size_t next_ = 0;  ///< chunk after the one being read
  std::uint64_t left_ = 0, unit_left_ = 0;
  bool ended_ = false;  ///< where the file was cut off
  std::uint64_t begin_ = 0, end_ = 0;
  std::unique_ptr<FileFeed> feed_;
  std::unique_ptr<laz::ChunkDecoder> decoder_;
};

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
    RecordStream stream(file, schema_, chunks_, options_);
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
    RecordStream stream(file, schema_, chunks_, options_);
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
