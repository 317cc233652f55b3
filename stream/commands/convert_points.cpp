#include "stream/commands/convert_points.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/planned_writes.h"
#include "stream/files/task_files.h"
#include "stream/formats/points/point_writer.h"
#include "stream/formats/points/projection.h"
#include "stream/points/file_notices.h"
#include "stream/points/point_filter.h"
#include "stream/points/point_inputs.h"
#include "stream/points/point_summary.h"
#include "stream/points/unpacked_points.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {

namespace {

constexpr std::uint64_t kSliceBytes = std::uint64_t{4} << 20;

bool is_las(const std::string& extension) {
  return extension == ".las" || extension == ".laz";
}

/// What all inputs together hold.
struct Survey : SummedBounds {
  PointAttributes attributes;
  bool exact_in_float = true;
  std::uint64_t read = 0;
  std::vector<PositionGrid> grids;  ///< of every input
  std::vector<Crs> systems;         ///< of every input
};

Survey survey(const std::vector<std::filesystem::path>& inputs, const ReadOptions& read,
              ConvertReport& report) {
  Survey all;
  FileNotices notices;
  for (const auto& path : inputs) {
    const PointSummary s = summarize_points(path, read);
    all.add(s);
    all.read += s.counts.points;
    all.grids.push_back(s.info.grid);
    all.systems.push_back(s.info.crs);
    all.attributes.normals = all.attributes.normals || s.info.attributes.normals;
    all.attributes.colour = all.attributes.colour || s.info.attributes.colour;
    all.attributes.intensity = all.attributes.intensity || s.info.attributes.intensity;
    all.attributes.intensity_16 = all.attributes.intensity_16 || s.info.attributes.intensity_16;
    all.attributes.echo = all.attributes.echo || s.info.attributes.echo;
    all.attributes.sensor = all.attributes.sensor || s.info.attributes.sensor;
    all.exact_in_float = all.exact_in_float && s.exact_in_float;
    report.not_finite += s.not_finite;
    report.withheld += s.counts.withheld;
    report.empty += s.counts.empty;
    report.missing += s.missing;
    for (const std::string& w : s.warnings) notices.add(path, w);
    if (!s.info.left_out.empty()) notices.add(path, left_out_sentence(s.info));
  }
  for (std::string& line : notices.lines()) report.notes.push_back(std::move(line));
  return all;
}

/// What COPC is told of the coordinate system: that of all inputs, where they agree.
std::string wkt_of(const Survey& all, ConvertReport& report) {
  const auto leave_out = [&](const std::string& why) {
    report.notes.push_back("the coordinate system is left out: " + why);
    return std::string();
  };
  Crs known;
  for (const Crs& crs : all.systems) {
    if (known.known() && crs.known() && !is_same_crs(known, crs))
      return leave_out("the inputs are in different ones, " + known.name + " and " + crs.name);
    if (!known.known() || (known.wkt.empty() && !crs.wkt.empty())) known = crs;
  }
  if (!known.known()) return {};
  std::string wkt = known.wkt;
  if (wkt.empty() && known.horizontal > 0)
    wkt = user_crs("EPSG:" + std::to_string(known.horizontal), "the coordinate system of the inputs").wkt;
  constexpr std::size_t kLongest = 65'000;  // of a record between header and points
  if (wkt.empty() || wkt.size() > kLongest)
    return leave_out(known.name + " has no text that COPC could hold");
  return wkt;
}

PointFileHeader header_for(const std::filesystem::path& output, const ConvertOptions& options,
                           const Survey& all, ConvertReport& report) {
  PointFileHeader header;
  header.attributes = all.attributes;
  header.double_positions = options.force_double || !all.exact_in_float;
  if (is_las(lower_extension(output))) {
    header.las_scale = options.las_scale > 0 ? options.las_scale : fitting_las_scale(all.min, all.max);
    for (std::size_t a = 0; a < 3; ++a) header.las_offset[a] = std::floor(all.min[a]);
    if (header.attributes.normals) report.notes.push_back("normals are left out: LAS cannot hold them");
    header.attributes.normals = false;
  }
  if (is_copc_name(output)) header.wkt = wkt_of(all, report);
  const bool holds = lower_extension(output) == ".ply" || is_las(lower_extension(output));
  if (all.attributes.intensity && !(holds && all.attributes.intensity_16))
    report.notes.push_back("intensity is left out");
  if (all.attributes.echo && !holds) report.notes.push_back("classes and returns are left out");
  header.attributes.intensity_16 = holds && all.attributes.intensity_16;
  header.attributes.echo = holds && all.attributes.echo;
  if (all.attributes.sensor) report.notes.push_back("sensor positions are left out");
  header.attributes.intensity = false;
  header.attributes.sensor = false;
  return header;
}

std::uint64_t left_out(const ReadCounts& counts) {
  return counts.other_class + counts.other_return + counts.outside + counts.thinned;
}

/// Writes points of all inputs, in their order, one after the other.
class Output {
 public:
  Output(const std::filesystem::path& path, const PointFileHeader& header, std::size_t window)
      : kept_(header.attributes),
        encoder_(make_point_encoder(path, header)),
        writer_(create_point_file(path, header)),
        window_(window) {}

  /// \param filter  null: all points stay
  void add_file(const std::filesystem::path& path, const ReadOptions& read, const PointFilter* filter) {
    const auto file = open_point_file(path, read);
    const std::vector<InputSlice> slices = file->slices(0, kSliceBytes);
    const auto read_slice = [&](std::size_t slice, Read& done,
                                const std::function<void(EncodedPoints&)>& sink) {
      EncodedPoints encoded;
      PointChunk scratch;
      file->read(slices[slice], [&](const PointChunk& chunk) {
        throw_if_stopped();
        done.points += chunk.size();
        encode(filter ? filter->apply(chunk, scratch, done.counts) : chunk, encoded);
        sink(encoded);
      });
    };
    if (slices.size() == 1) {  // may be of any size: nothing of it waits in memory
      Read done;
      read_slice(0, done, [&](const EncodedPoints& encoded) { append(encoded); });
      take(done);
      return;
    }
    std::vector<std::vector<EncodedPoints>> ring(window_);
    std::vector<Read> done(slices.size());
    parallel_in_order(
        slices.size(), window_,
        [&](std::size_t slice) {
          auto& pieces = ring[slice % window_];
          pieces.clear();
          read_slice(slice, done[slice],
                     [&](EncodedPoints& encoded) { pieces.push_back(std::move(encoded)); });
        },
        [&](std::size_t slice) {
          for (const EncodedPoints& piece : ring[slice % window_]) append(piece);
          take(done[slice]);
        });
  }

  /// What stage "thin" has left, bucket by bucket.
  void add_thinned(const std::filesystem::path& work, const std::vector<PositionGrid>& grids) {
    const std::filesystem::path folder = (work / PointInputs::thinned_file(0)).parent_path();
    for (const std::filesystem::path& path : list_task_files(folder, ".points")) {
      EncodedPoints encoded;
      Read done;
      done.counts = read_unpacked(
          path, true, [&](std::uint32_t file) { return grids.at(file); },
          [&](std::uint32_t, const PointChunk& chunk) {
            throw_if_stopped();
            encode(chunk, encoded);
            append(encoded);
          });
      done.points = done.counts.points;
      take(done);
    }
  }

  std::uint64_t written() const { return written_; }
  std::uint64_t read() const { return read_; }
  std::uint64_t unwanted() const { return unwanted_; }
  std::uint64_t finish() { return writer_->finish(); }

 private:
  struct Read {
    std::uint64_t points = 0;
    ReadCounts counts;
  };
  void encode(const PointChunk& chunk, EncodedPoints& encoded) const {
    PointChunk full = chunk;
    fill_missing(full, kept_);
    encoder_->encode(full, {}, encoded);
  }
  void append(const EncodedPoints& encoded) {
    writer_->append(encoded);
    written_ += encoded.points;
  }
  void take(const Read& done) {
    read_ += done.points;
    unwanted_ += left_out(done.counts);
  }

  PointAttributes kept_;
  std::unique_ptr<PointEncoder> encoder_;
  std::unique_ptr<PointWriter> writer_;
  std::size_t window_;
  std::uint64_t written_ = 0, read_ = 0, unwanted_ = 0;
};

bool filters(const ReconstructOptions& o) {
  return !o.classes.empty() || o.returns != "all" || !o.bounds.empty() || !o.clip_rings.empty();
}

}  // namespace

ReconstructOptions wanted_points(ReconstructOptions options) {
  if (options.classes.empty())
    for (int kind = 0; kind < 256; ++kind) options.classes.push_back(std::to_string(kind));
  return options;
}

ConvertReport convert_points(const std::vector<std::filesystem::path>& inputs,
                             const std::filesystem::path& output, const ConvertOptions& options) {
  check_writes(inputs, std::array{PlannedWrite{output, "-o", PlannedWrite::Existing::kReplace}});
  const std::string extension = lower_extension(output);
  if (extension != ".ply" && !is_las(extension) && extension != ".xyz" && extension != ".txt") {
    throw UsageError(output.string() + ": unknown extension '" + extension +
                     "' for points; use .ply, .las, .laz, .copc.laz or .xyz");
  }
  const bool filtered = filters(options.wanted);
  const PointFilter filter(wanted_points(options.wanted));
  const ReadOptions read{.columns = options.columns,
                         .chunk_points = 16384,
                         .intensities = true,
                         .bounds = filter.box(),
                         .resolution_limit = options.wanted.resolution_limit};
  ConvertReport report;
  WorkerPool pool(options.threads);
  pool.run_here([&] {
    const Survey all = survey(inputs, read, report);
    if (filtered && !all.attributes.echo) PointFilter(options.wanted).refuse();
    if (all.finite == 0)
      throw EmptyError("the inputs hold no point with finite coordinates; nothing is written");
    const PointFileHeader header = header_for(output, options, all, report);
    Output out(output, header, static_cast<std::size_t>(pool.threads()) + 1);
    if (options.thinned.empty())
      for (const auto& path : inputs) out.add_file(path, read, filtered ? &filter : nullptr);
    else
      out.add_thinned(options.thinned, all.grids);
    report.points = out.written();
    report.unwanted = out.unwanted();
    if (out.read() != all.read || (!filtered && options.thinned.empty() && report.points != all.finite))
      throw InputError("an input changed while it was read; run the command again");
    PointFilter(options.wanted).require_wanted(out.read(), out.unwanted());
    if (report.points == 0)
      throw EmptyError("none of the points that are wanted has finite coordinates; nothing is written");
    report.bytes = out.finish();
  });
  return report;
}

}  // namespace tessera
