#include "stream/points/point_inputs.h"

#include <algorithm>
#include <cassert>
#include <string>
#include <tuple>

#include "octree/error.h"
#include "octree/points.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/task_files.h"
#include "stream/formats/points/projection.h"
#include "stream/points/file_notices.h"
#include "stream/points/projected_inputs.h"
#include "stream/points/unpacked_points.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

// Half of it costs a hundredth more of the whole job, in samples of every task.
constexpr std::uint64_t kTaskBytes = std::uint64_t{16} << 20;
// Of smaller inputs there are tasks for sixteen cores, as long as samples do not hold most of what a task reads.
constexpr std::uint64_t kCores = 16;
constexpr std::uint64_t kLeastTaskBytes = std::uint64_t{4} << 20;
constexpr std::uint64_t kMostRecordBytes = 4096;  // of most files
// So few that what a pass makes of them stays in the second-level cache.
constexpr std::size_t kPointsTogether = 8192;
// Each task writes a file or two; the work directory stays below a thousand of them.
constexpr std::uint64_t kMaxTasks = 400;
// Of points to be thinned, about: they lie in memory, one of a cube.
constexpr std::uint64_t kBucketPoints = std::uint64_t{1} << 18;
constexpr std::uint64_t kMaxBuckets = 1024;

std::shared_ptr<PointInputs> open_inputs(const JobState& job, bool colours, bool unpacked) {
  ReadOptions read;
  read.colours = colours;
  read.unpacked = unpacked;
  read.chunk_points = kPointsTogether;
  const ReconstructOptions options = reconstruct_options(job);
  read.columns = options.columns;
  read.intensities = options.colour == "intensity";
  read.grid_normals = options.normals != "estimate";
  // Of octrees the box is taken where the file has its own coordinates.
  const bool projects = !options.project.empty() && options.project != "off";
  if (!projects) read.bounds = PointFilter(options).box();
  read.resolution_limit = options.resolution_limit;
  std::vector<std::unique_ptr<PointFile>> files(job.inputs.size());
  parallel_for(files.size(), [&](std::size_t i) { files[i] = open_point_file(job.inputs[i], read); });
  std::vector<std::string> notes;
  files = in_one_plane(std::move(files), {options.crs, options.project, options.columns}, !unpacked, notes);
  return std::make_shared<PointInputs>(std::move(files), options, kTaskBytes, std::move(notes));
}

}  // namespace

PointInputs::PointInputs(std::vector<std::unique_ptr<PointFile>> files, const ReconstructOptions& options,
                         std::uint64_t task_bytes, std::vector<std::string> notes)
    : files_(std::move(files)), filter_(options), notices_(std::move(notes)) {
  if (files_.empty()) throw UsageError("no input: name at least one scan, folder, glob or @list");
  require_one_crs();
  FileNotices notices;
  for (const auto& f : files_) notices.add(f->info());
  for (std::string& line : notices.lines()) notices_.push_back(std::move(line));
  if (std::none_of(files_.begin(), files_.end(), [](const auto& f) { return f->info().attributes.echo; }))
    filter_.refuse();
  if (options.resolution_limit > 0.0 &&
      std::none_of(files_.begin(), files_.end(), [](const auto& f) { return f->info().octree; }))
    throw UsageError("--resolution-limit " + number_text(options.resolution_limit) +
                     ": no input has an octree of resolutions, COPC files do");
  for (const auto& f : files_) {
    bytes_ += f->info().planned_bytes();
    sensors_.insert(sensors_.end(), f->info().sensors.begin(), f->info().sensors.end());
  }
  sensors_.insert(sensors_.end(), options.viewpoints.begin(), options.viewpoints.end());
  std::sort(sensors_.begin(), sensors_.end());
  sensors_.erase(std::unique(sensors_.begin(), sensors_.end()), sensors_.end());
  if (sensors_.size() >= kNoSensor)
    throw InputError("the inputs name " + std::to_string(sensors_.size()) + " sensor origins, at most " +
                     std::to_string(kNoSensor - 1) + " are possible; reconstruct in parts");
  for (const auto& f : files_) {
    auto& ids = file_sensors_.emplace_back();
    for (const Double3& s : f->info().sensors) ids.push_back(id_of(s));
  }
  for (const Double3& v : options.viewpoints) viewpoints_.push_back(id_of(v));

  if (options.thin > 0.0)
    thin_buckets_ =
        static_cast<std::size_t>(std::clamp<std::uint64_t>(bytes_ / 24 / kBucketPoints, 1, kMaxBuckets));
  // A record more for each, as slices end with a whole one: else what all of them leave would be a task too many.
  const std::uint64_t shared = std::max(bytes_ / kCores + kMostRecordBytes, kLeastTaskBytes);
  const std::uint64_t target = std::max(std::min(task_bytes, shared), bytes_ / kMaxTasks);
  std::uint64_t filled = 0;
  for (std::size_t i = 0; i < files_.size(); ++i) {
    for (const InputSlice& slice : files_[i]->slices(static_cast<std::uint32_t>(i), target)) {
      if (tasks_.empty() || filled + slice.bytes > target) {
        tasks_.emplace_back();
        filled = 0;
      }
      tasks_.back().push_back(slice);
      filled += slice.bytes;
    }
  }
}

void PointInputs::require_one_crs() {
  const PointFile* named = nullptr;
  for (const auto& f : files_) {
    const Crs& crs = f->info().crs;
    if (!crs.known()) continue;
    if (named == nullptr) named = f.get();
    if (!is_same_crs(named->info().crs, crs))
      throw InputError(
          f->info().path.string() + ": is in the coordinate system " + crs.name + ", but " +
          named->info().path.string() + " is in " + named->info().crs.name +
          ": bring them into one with --project EPSG:n, name the one that they are in with --crs EPSG:n, "
          "or reconstruct them apart");
    // Of several texts for one system the least, so that the order of the files does not matter; codes alone come last.
    const auto order = [](const Crs& c) { return std::tuple(c.wkt.empty(), c.wkt, c.name); };
    if (!crs_.known() || order(crs) < order(crs_)) crs_ = crs;
  }
}

Json to_json(const Crs& crs) {
  if (!crs.known()) return nullptr;
  Json j = {{"name", json_text(crs.name)}};
  if (!crs.wkt.empty()) j["wkt"] = json_text(crs.wkt);
  if (crs.horizontal != 0) j["epsg"] = crs.horizontal;
  if (crs.vertical != 0) j["epsg_vertical"] = crs.vertical;
  return j;
}

std::uint16_t PointInputs::id_of(const Double3& origin) const {
  const auto at = std::lower_bound(sensors_.begin(), sensors_.end(), origin);
  assert(at != sensors_.end() && *at == origin);
  return static_cast<std::uint16_t>(at - sensors_.begin());
}

std::uint64_t PointInputs::declared_points() const {
  std::uint64_t sum = 0;
  for (const auto& f : files_) sum += f->info().declared_points;
  return sum;
}

std::uint64_t PointInputs::expected_points() const {
  if (filter_.chooses() || thin_buckets_ > 0) return 0;
  std::uint64_t sum = 0;
  for (const auto& f : files_)
    if (!f->info().placeholders) sum += f->info().credible_points();
  return sum;
}

bool PointInputs::has_colour() const {
  return std::any_of(files_.begin(), files_.end(), [](const auto& f) { return f->info().attributes.colour; });
}

bool PointInputs::has_grid_normals() const {
  return std::any_of(files_.begin(), files_.end(),
                     [](const auto& f) { return f->info().attributes.grid_normals; });
}

std::uint64_t PointInputs::task_input_bytes(std::size_t k) const {
  std::uint64_t sum = 0;
  for (const InputSlice& s : tasks_[k]) sum += s.bytes;
  return sum;
}

bool PointInputs::has_packed() const {
  return thin_buckets_ > 0 ||
         std::any_of(files_.begin(), files_.end(), [](const auto& f) { return f->info().packed; });
}

bool PointInputs::is_packed(std::size_t k) const {
  return thin_buckets_ > 0 || std::any_of(tasks_[k].begin(), tasks_[k].end(),
                                          [&](const InputSlice& s) { return files_[s.file]->info().packed; });
}

void PointInputs::read_unpacked_of(const std::filesystem::path& work, bool colours) {
  unpacked_of_ = work;
  unpacked_colours_ = colours;
  if (thin_buckets_ == 0) return;
  tasks_.clear();
  bytes_ = 0;
  for (std::size_t b = 0; b < thin_buckets_; ++b) {
    std::error_code gone;  // passes that read it are done
    const std::uint64_t bytes = std::filesystem::file_size(work / thinned_file(b), gone);
    tasks_.push_back({InputSlice{0, 0, 0, gone ? 0 : bytes}});
    bytes_ += tasks_.back().front().bytes;
  }
}

std::uint64_t PointInputs::unpacked_bytes(std::size_t k) const {
  if (unpacked_of_.empty() || !is_packed(k)) return 0;
  return std::filesystem::file_size(unpacked_of_ / (thin_buckets_ > 0 ? thinned_file(k) : unpacked_file(k)));
}

std::string PointInputs::unpacked_file(std::size_t k) {
  return "unpacked/" + task_file_stem(k) + ".points";
}

std::string PointInputs::thinned_file(std::size_t k) {
  return "thinned/" + task_file_stem(k) + ".points";
}

void PointInputs::sensor_ids(std::uint32_t file, const PointChunk& chunk,
                             std::vector<std::uint16_t>& ids) const {
  ids.assign(chunk.size(), static_cast<std::uint16_t>(kNoSensor));
  const bool per_file = viewpoints_.size() == files_.size();
  if (viewpoints_.size() == 1 || (per_file && !viewpoints_.empty())) {
    ids.assign(chunk.size(), per_file ? viewpoints_[file] : viewpoints_[0]);
  } else if (!viewpoints_.empty()) {
    for (std::size_t i = 0; i < chunk.size(); ++i) {
      double best = -1.0;
      for (const std::uint16_t v : viewpoints_) {
        const Double3& s = sensors_[v];
        const double dx = chunk.x[i] - s[0];
        const double dy = chunk.y[i] - s[1];
        const double dz = chunk.z[i] - s[2];
        const double d = dx * dx + dy * dy + dz * dz;
        if (best < 0.0 || d < best || (d == best && v < ids[i])) {
          best = d;
          ids[i] = v;
        }
      }
    }
  }
  const auto& own = file_sensors_[file];
  for (std::size_t i = 0; i < chunk.sensor.size(); ++i)
    if (chunk.sensor[i] < own.size()) ids[i] = own[chunk.sensor[i]];
}

ReadCounts PointInputs::read(std::size_t k, TaskContext& context, bool in_bytes,
                             const std::function<void(std::uint32_t, const PointChunk&)>& sink) const {
  if (!unpacked_of_.empty() && is_packed(k)) return read_unpacked_task(k, context, in_bytes, sink);
  ReadCounts sum;
  PointChunk scratch;
  for (const InputSlice& slice : tasks_[k]) {
    // Within a slice progress is an estimate from the header's count; it ends exactly.
    const PointFileInfo& info = files_[slice.file]->info();
    const double bytes_per_point = info.declared_points == 0 ? 24.0
                                                             : static_cast<double>(info.planned_bytes()) /
                                                                   static_cast<double>(info.declared_points);
    std::uint64_t notes = 0;
    const ReadCounts counts = files_[slice.file]->read(slice, [&](const PointChunk& chunk) {
      context.check_stop();
      const PointChunk& wanted = filter_.apply(chunk, scratch, sum);
      if (wanted.size() > 0) sink(slice.file, wanted);
      const auto step = static_cast<std::uint64_t>(static_cast<double>(chunk.size()) * bytes_per_point);
      const std::uint64_t part = std::min(step, slice.bytes - notes);
      notes += part;
      context.advance(in_bytes ? part : chunk.size());
    });
    if (in_bytes) context.advance(slice.bytes - notes);
    context.count_read(slice.bytes);
    sum.points += counts.points;
    sum.withheld += counts.withheld;
    sum.empty += counts.empty;
    sum.missing += counts.missing;
    sum.surplus += counts.surplus;
    sum.warnings.insert(sum.warnings.end(), counts.warnings.begin(), counts.warnings.end());
  }
  return sum;
}

ReadCounts PointInputs::read_unpacked_task(
    std::size_t k, TaskContext& context, bool in_bytes,
    const std::function<void(std::uint32_t, const PointChunk&)>& sink) const {
  const std::filesystem::path path = unpacked_of_ / (thin_buckets_ > 0 ? thinned_file(k) : unpacked_file(k));
  const std::uint64_t bytes = task_input_bytes(k);
  std::uint64_t handed = 0;
  std::uint64_t notes = 0;
  ReadCounts counts = read_unpacked(
      path, unpacked_colours_, [&](std::uint32_t file) { return files_[file]->info().grid; },
      [&](std::uint32_t file, const PointChunk& chunk) {
        context.check_stop();
        sink(file, chunk);
        handed += chunk.size();
        // Of a record of LAS, about; it ends exactly.
        const std::uint64_t part = std::min<std::uint64_t>(chunk.size() * 28, bytes - notes);
        notes += part;
        context.advance(in_bytes ? part : chunk.size());
      });
  context.advance(in_bytes ? bytes - notes : counts.points - handed);
  context.count_read(std::filesystem::file_size(path));
  return counts;
}

std::shared_ptr<const PointInputs> open_point_inputs(const JobState& job, bool colours) {
  auto inputs = open_inputs(job, colours, true);
  inputs->read_unpacked_of(job.work, colours || reconstruct_options(job).colour == "intensity");
  return inputs;
}

std::shared_ptr<const PointInputs> open_packed_inputs(const JobState& job, bool unpacked) {
  return open_inputs(job, true, unpacked);
}

}  // namespace tessera
