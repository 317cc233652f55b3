#include "stream/stages/tiles/tile_levels.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "kernels/certify/certificate.h"
#include "kernels/decimate/decimate.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/mesh_blocking.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/decimate/simplify_needs.h"
#include "stream/stages/decimate/simplify_options.h"
#include "stream/stages/decimate/simplify_stage.h"

namespace tessera {
namespace {

constexpr const char* kChoice = "tolerance.json";
constexpr std::uint64_t kSampleFaces = 1u << 14;
constexpr std::size_t kSamples = 8;
/// What samples must shrink to. Their locked seams, a twentieth of their vertices, are not there in the whole.
constexpr double kShare = 0.29;
/// A level that keeps more than this is not worth its bytes: the one below is the last.
constexpr double kStalledShare = 0.75;
constexpr double kLargestTolerance = 1.0 / 16.0;  ///< of the diagonal

constexpr std::uint64_t kChoiceBytes = std::uint64_t{1} << 20;

/// The sample, the copy that is decimated, what that takes.
std::uint64_t sample_bytes(std::uint64_t block_bytes, std::uint64_t faces) {
  return 2 * block_bytes + decimate_bytes(faces, 0);
}

/// 2^(half_steps / 2), the same on every machine.
double tolerance_of(int half_steps) {
  const int whole = half_steps >> 1;
  return std::ldexp((half_steps & 1) != 0 ? 0x1.6a09e667f3bcdp+0 : 1.0, whole);
}
/// Least half steps with a tolerance above `value` > 0, up to one too many.
int half_steps_above(double value) {
  int exponent = 0;
  std::frexp(value, &exponent);
  return 2 * exponent;
}

double mean_edge(const std::vector<MeshBlock>& samples) {
  double sum = 0.0;
  std::uint64_t count = 0;
  for (const MeshBlock& block : samples)
    for (const auto& f : block.faces)
      for (std::size_t c = 0; c < 3; ++c, ++count)
        sum += norm(block.position[f[c]] - block.position[f[(c + 1) % 3]]);
  return count > 0 ? sum / static_cast<double>(count) : 0.0;
}

class LevelToleranceStage : public SerialStage {
 public:
  LevelToleranceStage(const std::filesystem::path& work, int level, std::uint64_t tile_faces)
      : level_(level), below_(open_level(work, level - 1)) {
    if (below_.face_count() <= tile_faces) return;
    if (level > 1) {
      before_ = level_tolerance(work, level - 1);
      const std::uint64_t faces = open_level(work, level - 2).face_count();
      if (static_cast<double>(below_.face_count()) > kStalledShare * static_cast<double>(faces)) return;
    }
    const std::vector<MeshBlockCut> blocks = make_blocks(below_, {kSampleFaces});
    const std::size_t count = std::min(kSamples, blocks.size());
    for (std::size_t i = 0; i < count; ++i)
      samples_.push_back(blocks[(2 * i + 1) * blocks.size() / (2 * count)]);
  }

  std::string name() const override { return "tolerance"; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "faces"; }

  std::uint64_t finish_bytes() const override {
    std::uint64_t bytes = kChoiceBytes;
    for (const MeshBlockCut& cut : samples_)
      bytes += sample_bytes(below_.block_bytes(cut.patches), cut.faces);
    return bytes;
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const double tolerance = samples_.empty() ? 0.0 : choose(context);
    Json result = {{"level", level_}, {"tolerance", tolerance}, {"faces_below", below_.face_count()}};
    write_durably(context.create(kChoice), dump_json(result));
    return result;
  }

 private:
  double choose(TaskContext& context) const {
    std::vector<MeshBlock> blocks;
    std::uint64_t faces = 0;
    for (const MeshBlockCut& cut : samples_) {
      blocks.push_back(below_.load(cut.patches));
      faces += cut.faces;
    }
    double widest = 0.0;
    for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, below_.box().high[k] - below_.box().low[k]);
    const int minimum = half_steps_above(
        std::max({4.0 * certificate_rounding(widest), 0x1p-30 * below_.diagonal(), before_}));
    const int maximum = std::max(minimum, half_steps_above(kLargestTolerance * below_.diagonal()));

    std::map<int, double> known;
    const auto share = [&](int half_steps) {
      if (const auto at = known.find(half_steps); at != known.end()) return at->second;
      SimplifyOptions options;
      options.tolerance = tolerance_of(half_steps);
      const DecimateOptions kernel = options.kernel(!below_.info().double_positions);
      std::vector<std::size_t> left(blocks.size(), 0);
      parallel_for(blocks.size(), [&](std::size_t b) {
        context.check_stop();
        MeshBlock block = blocks[b];
        left[b] = decimate(block, block, kernel).faces_out;
      });
      std::size_t sum = 0;
      for (const std::size_t n : left) sum += n;
      return known[half_steps] = static_cast<double>(sum) / static_cast<double>(faces);
    };
    const int guess =
        before_ > 0.0 ? half_steps_above(before_) + 3 : half_steps_above(mean_edge(blocks) / 32.0);
    // [low, high]: low is not enough, high is; both may lie one beyond what is allowed.
    int at = std::clamp(guess, minimum, maximum), low = minimum - 1, high = maximum + 1;
    for (int stride = 1; high - low > 1; stride *= 2) {
      (share(at) <= kShare ? high : low) = at;
      if (low < minimum && high > minimum)
        at = std::max(minimum, high - stride);
      else if (high > maximum && low < maximum)
        at = std::min(maximum, low + stride);
      else
        at = low + (high - low) / 2;
    }
    if (high <= maximum) return tolerance_of(high);
    return share(maximum) <= kStalledShare ? tolerance_of(maximum) : 0.0;
  }

  int level_;
  MeshStore below_;
  double before_ = 0.0;
  std::vector<MeshBlockCut> samples_;  ///< empty: there is no further level
};

}  // namespace

std::string level_folder(int level) {
  return "level-" + std::to_string(level);
}

MeshStore open_level(const std::filesystem::path& work, int level) {
  if (level == 0) return open_imported_mesh(work, kTilesImport);
  const SimplifyPass last{kLevelPasses - 1, 0, false};
  return MeshStore(list_task_files(work / level_folder(level) / last.folder(), ".tmm"));
}

double level_tolerance(const std::filesystem::path& work, int level) {
  const std::filesystem::path file = work / level_folder(level) / kChoice;
  if (!std::filesystem::exists(file)) return 0.0;
  return parse_json(read_text(file)).at("tolerance").get<double>();
}

int levels_above(const std::filesystem::path& work) {
  int level = 0;
  while (level < kMaxLevels && level_tolerance(work, level + 1) > 0.0) ++level;
  return level;
}

double level_step_bound(const std::filesystem::path& work, int level) {
  if (level == 0) return 0.0;
  return parse_json(read_text(work / level_folder(level) / kLevelCertificate))
      .at("certified_max")
      .get<double>();
}

std::uint64_t level_tolerance_bytes(std::uint64_t faces) {
  const std::uint64_t each = std::min(faces, kSampleFaces);
  const std::uint64_t samples = std::clamp<std::uint64_t>(faces / kSampleFaces, 1, kSamples);
  return kChoiceBytes + samples * sample_bytes(surface_block_bytes(each), each);
}

std::unique_ptr<Stage> make_level_tolerance_stage(const JobState& state, int level,
                                                  std::uint64_t tile_faces) {
  return std::make_unique<LevelToleranceStage>(state.work.parent_path(), level, tile_faces);
}

}  // namespace tessera
