#include "stream/stages/scan/thin_stage.h"

#include <algorithm>
#include <bit>
#include <tuple>
#include <unordered_map>
#include <utility>

#include "octree/points.h"
#include "stream/files/json.h"
#include "stream/points/cubes.h"
#include "stream/points/unpacked_points.h"
#include "stream/runtime/task_counts.h"

namespace tessera {
namespace {

/// A point with all that any format says of it; what its file does not say is zero.
struct KeptPoint {
  double distance = 0.0;  ///< squared, to the middle of its cube, in edges
  Double3 p{};
  std::array<std::uint32_t, 3> normal{};  ///< bits of its floats
  std::uint32_t rgba = 0, file = 0;
  std::uint16_t intensity = 0, sensor = 0;
  Echo echo = {};
};

struct CubeHash {
  std::size_t operator()(const Cube& c) const { return static_cast<std::size_t>(cube_hash(c)); }
};

KeptPoint point_of(const PointChunk& c, std::size_t i, std::uint32_t file) {
  KeptPoint k;
  k.p = {c.x[i], c.y[i], c.z[i]};
  if (!c.nx.empty())
    k.normal = {std::bit_cast<std::uint32_t>(c.nx[i]), std::bit_cast<std::uint32_t>(c.ny[i]),
                std::bit_cast<std::uint32_t>(c.nz[i])};
  if (!c.rgba.empty()) k.rgba = c.rgba[i];
  if (!c.intensity.empty()) k.intensity = c.intensity[i];
  if (!c.sensor.empty()) k.sensor = c.sensor[i];
  if (!c.echo.empty()) k.echo = c.echo[i];
  k.file = file;
  return k;
}

/// \param like  a chunk of the same file: which arrays it has
void append(const KeptPoint& k, const PointChunk& like, PointChunk& to) {
  to.x.push_back(k.p[0]), to.y.push_back(k.p[1]), to.z.push_back(k.p[2]);
  if (!like.nx.empty()) {
    to.nx.push_back(std::bit_cast<float>(k.normal[0]));
    to.ny.push_back(std::bit_cast<float>(k.normal[1]));
    to.nz.push_back(std::bit_cast<float>(k.normal[2]));
  }
  if (!like.rgba.empty()) to.rgba.push_back(k.rgba);
  if (!like.intensity.empty()) to.intensity.push_back(k.intensity);
  if (!like.sensor.empty()) to.sensor.push_back(k.sensor);
  if (!like.echo.empty()) to.echo.push_back(k.echo);
}

class ThinStage : public Stage {
 public:
  ThinStage(const JobState& job, std::shared_ptr<const PointInputs> inputs)
      : job_(job), edge_(reconstruct_options(job).thin), inputs_(std::move(inputs)) {
    if (inputs_->thin_buckets() == 0) return;
    points_.resize(inputs_->thin_buckets());
    for (std::size_t k = 0; k < inputs_->task_count(); ++k) {
      const UnpackedFile file(job_.work / PointInputs::unpacked_file(k));
      for (const UnpackedBlock& b : file.blocks()) points_[b.bucket] += b.points;
    }
  }
  std::string name() const override { return "thin"; }
  std::size_t task_count() const override { return points_.size(); }
  std::uint64_t units() const override {
    std::uint64_t sum = 0;
    for (const std::uint64_t n : points_) sum += n;
    return sum;
  }
  std::string unit_name() const override { return "points"; }
  std::uint64_t task_bytes(std::size_t bucket) const override {
    return points_[bucket] * kPointBytes + PointInputs::kReadBytes + 2 * UnpackedWriter::kBytes;
  }
  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  std::vector<std::string> obsolete() const override {
    return points_.empty() ? std::vector<std::string>{} : std::vector<std::string>{"unpacked/"};
  }

  Json run(std::size_t bucket, TaskContext& context) const override {
    std::unordered_map<Cube, KeptPoint, CubeHash> kept;
    UnpackedWriter out(context.create(PointInputs::thinned_file(bucket)));
    std::vector<PointChunk> like(inputs_->file_count());  // one point of each file
    ReadCounts counts;
    std::uint64_t without = 0;  // a cube
    PointChunk chunk, odd;
    for (std::size_t k = 0; k < inputs_->task_count(); ++k) {
      const UnpackedFile file(job_.work / PointInputs::unpacked_file(k));
      for (const UnpackedBlock& block : file.blocks()) {
        if (block.bucket != bucket) continue;
        context.check_stop();
        file.read(block, true, grid(block.file), chunk);
        if (like[block.file].size() == 0) like[block.file].append(chunk, 0);
        odd.clear();
        for (std::size_t i = 0; i < chunk.size(); ++i) {
          KeptPoint point = point_of(chunk, i, block.file);
          Cube cube;
          if (!cube_of(point.p, edge_, cube)) {
            odd.append(chunk, i);
            continue;
          }
          point.distance = squared_distance_to_middle(point.p, edge_, cube);
          const auto [at, is_new] = kept.try_emplace(cube, point);
          if (!is_new && comes_before(point, at->second)) at->second = point;
        }
        if (odd.size() > 0) out.add(block.file, grid(block.file), odd);
        without += odd.size();
        counts.points += chunk.size();
        context.advance(chunk.size());
      }
      if (bucket == 0) add_dispositions(file.counts(), counts);
    }
    counts.thinned = counts_of_bucket(bucket) - kept.size() - without;
    write(kept, like, out);
    context.count_written(out.finish(counts));
    return {{"points", counts_of_bucket(bucket)}, {"kept", kept.size() + without}};
  }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    if (summaries.empty()) return {{"skipped", "all points stay"}};
    return sum_counts(summaries);
  }

 private:
  /// A cube's entry in the table, and in the sorted list.
  static constexpr std::uint64_t kPointBytes = 2 * (sizeof(Cube) + sizeof(KeptPoint)) + 32;
  static constexpr std::size_t kChunk = 65536;

  PositionGrid grid(std::uint32_t file) const { return inputs_->file(file).info().grid; }
  std::uint64_t counts_of_bucket(std::size_t bucket) const { return points_[bucket]; }

  /// What was left out before the points were dealt is told with bucket 0.
  static void add_dispositions(const ReadCounts& from, ReadCounts& to) {
    to.points += from.other_class + from.other_return + from.outside;
    to.withheld += from.withheld;
    to.empty += from.empty;
    to.missing += from.missing;
    to.surplus += from.surplus;
    to.other_class += from.other_class;
    to.other_return += from.other_return;
    to.outside += from.outside;
    to.warnings.insert(to.warnings.end(), from.warnings.begin(), from.warnings.end());
  }

  bool comes_before(const KeptPoint& a, const KeptPoint& b) const {
    const auto key = [](const KeptPoint& k) {
      return std::tuple(k.distance, k.p, k.normal, k.rgba, k.intensity, k.echo.kind, k.echo.number,
                        k.echo.of);
    };
    if (key(a) != key(b)) return key(a) < key(b);
    const auto sensor = [&](const KeptPoint& k) {
      const PointFileInfo& info = inputs_->file(k.file).info();
      return k.sensor < info.sensors.size() ? info.sensors[k.sensor] : Double3{};
    };
    if (sensor(a) != sensor(b)) return sensor(a) < sensor(b);
    return inputs_->file(a.file).info().path < inputs_->file(b.file).info().path;
  }

  void write(const std::unordered_map<Cube, KeptPoint, CubeHash>& kept, const std::vector<PointChunk>& like,
             UnpackedWriter& out) const {
    std::vector<std::pair<Cube, const KeptPoint*>> order;
    order.reserve(kept.size());
    for (const auto& [cube, point] : kept) order.emplace_back(cube, &point);
    std::sort(order.begin(), order.end(), [](const auto& a, const auto& b) {
      return std::tie(a.second->file, a.first) < std::tie(b.second->file, b.first);
    });
    PointChunk chunk;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const std::uint32_t file = order[i].second->file;
      append(*order[i].second, like[file], chunk);
      if (chunk.size() < kChunk && i + 1 < order.size() && order[i + 1].second->file == file) continue;
      out.add(file, grid(file), chunk);
      chunk.clear();
    }
  }

  JobState job_;
  double edge_;
  std::shared_ptr<const PointInputs> inputs_;
  std::vector<std::uint64_t> points_;  ///< by bucket
};

}  // namespace

std::unique_ptr<Stage> make_thin_stage(const JobState& job, std::shared_ptr<const PointInputs> inputs) {
  return std::make_unique<ThinStage>(job, std::move(inputs));
}
std::unique_ptr<Stage> make_thin_stage(const JobState& job) {
  return make_thin_stage(job, open_packed_inputs(job, true));
}

}  // namespace tessera
