#include "stream/stages/tiles/tile_levels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

#include "kernels/certify/certificate.h"
#include "kernels/decimate/block_clustering.h"
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
#include "stream/stages/tiles/cluster_stage.h"
#include "stream/stages/tiles/colour_stage.h"

namespace tessera {
namespace {

constexpr const char* kChoice = "tolerance.json";
constexpr std::array<const char*, 3> kMethodNames = {"decimation", "decimation without creases",
                                                     "clustering"};
constexpr std::uint64_t kSampleFaces = 1u << 14;
constexpr std::size_t kSamples = 8;
/// What samples must shrink to. Their locked seams, a twentieth of their vertices, are not there in the whole.
constexpr double kShare = 0.29;
// In mean edges. Where decimation would need more, its creases are noise; where it still would, clustering needs no more.
constexpr double kLargestWithCreases = 1.0;
constexpr double kLargestTolerance = 2.0;
constexpr double kFirstCell = 2.0;  ///< in mean edges: cells that leave about a quarter of an even mesh

constexpr std::uint64_t kChoiceBytes = std::uint64_t{1} << 20;

/// The sample, the copy that is decimated or clustered, what that takes.
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
      least_method_ = level_method(work, level - 1);
      if (least_method_ != LevelMethod::kClustering) before_ = level_tolerance(work, level - 1);
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
    Choice choice;
    if (!samples_.empty()) choice = choose(context);
    Json result = {{"level", level_}, {"tolerance", choice.tolerance}, {"faces_below", below_.face_count()}};
    if (choice.tolerance > 0.0) result["method"] = kMethodNames[static_cast<std::size_t>(choice.method)];
    write_text(context.create(kChoice), dump_json(result));
    return result;
  }

 private:
  struct Choice {
    double tolerance = 0.0;  ///< or the cell of clustering
    LevelMethod method = LevelMethod::kDecimation;
  };

  Choice choose(TaskContext& context) const {
    std::vector<MeshBlock> blocks;
    for (const MeshBlockCut& cut : samples_) blocks.push_back(below_.load(cut.patches));
    const double edge = mean_edge(blocks);
    for (const LevelMethod method : {LevelMethod::kDecimation, LevelMethod::kDecimationWithoutCreases}) {
      if (method < least_method_) continue;
      const double tolerance = decimation_tolerance(blocks, edge, method, context);
      if (tolerance > 0.0) return {tolerance, method};
    }
    return {clustering_cell(blocks, edge, context), LevelMethod::kClustering};
  }

  /// Share of the faces of all samples that stay, each left to `faces_left`.
  template <class FacesLeft>
  double share_left(const std::vector<MeshBlock>& blocks, TaskContext& context,
                    const FacesLeft& faces_left) const {
    std::vector<std::size_t> left(blocks.size(), 0);
    parallel_for(blocks.size(), [&](std::size_t b) {
      context.check_stop();
      left[b] = faces_left(blocks[b]);
    });
    std::size_t sum = 0, faces = 0;
    for (std::size_t b = 0; b < blocks.size(); ++b) {
      sum += left[b];
      faces += blocks[b].faces.size();
    }
    return static_cast<double>(sum) / static_cast<double>(faces);
  }

  /// 0 where even the largest one leaves too many faces.
  double decimation_tolerance(const std::vector<MeshBlock>& blocks, double edge, LevelMethod method,
                              TaskContext& context) const {
    double widest = 0.0;
    for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, below_.box().high[k] - below_.box().low[k]);
    const int minimum = half_steps_above(
        std::max({4.0 * certificate_rounding(widest), 0x1p-30 * below_.diagonal(), before_}));
    const int maximum = std::max(
        minimum, half_steps_above(
                     (method == LevelMethod::kDecimation ? kLargestWithCreases : kLargestTolerance) * edge));
    const int guess = before_ > 0.0 ? half_steps_above(before_) + 3 : half_steps_above(edge / 32.0);
    const auto enough = [&](int half_steps) {
      SimplifyOptions options = level_options(method);
      options.tolerance = tolerance_of(half_steps);
      const DecimateOptions kernel = options.kernel(!below_.info().double_positions);
      return share_left(blocks, context,
                        [&](MeshBlock block) { return decimate(block, block, kernel).faces_out; }) <= kShare;
    };
    const int found = least_half_steps(std::clamp(guess, minimum, maximum), minimum, maximum, enough);
    return found <= maximum ? tolerance_of(found) : 0.0;
  }

  /// The least cell that leaves few enough faces: there always is one, the whole mesh at the most.
  double clustering_cell(const std::vector<MeshBlock>& blocks, double edge, TaskContext& context) const {
    double widest = 0.0;
    for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, below_.box().high[k] - below_.box().low[k]);
    const int minimum = half_steps_above(widest / static_cast<double>((1u << kClusterBits) - 1));
    const int maximum = std::max(minimum, half_steps_above(widest));
    const auto enough = [&](int half_steps) {
      const ClusterGrid grid{below_.box().low, tolerance_of(half_steps), level_};
      return share_left(blocks, context, [&](const MeshBlock& block) {
               const std::vector<std::uint8_t> core(block.faces.size(), 1);
               return cluster_block(block, core, grid, false).block.faces.size();
             }) <= kShare;
    };
    const int guess = std::clamp(half_steps_above(kFirstCell * edge), minimum, maximum);
    return tolerance_of(std::min(maximum, least_half_steps(guess, minimum, maximum, enough)));
  }

  /// Least half steps within [minimum, maximum] that are enough, from a guess outwards; maximum + 1 where none are.
  template <class Enough>
  static int least_half_steps(int guess, int minimum, int maximum, const Enough& enough) {
    // [low, high]: low is not enough, high is; both may lie one beyond what is allowed.
    int at = guess, low = minimum - 1, high = maximum + 1;
    for (int stride = 1; high - low > 1; stride *= 2) {
      (enough(at) ? high : low) = at;
      if (low < minimum && high > minimum)
        at = std::max(minimum, high - stride);
      else if (high > maximum && low < maximum)
        at = std::min(maximum, low + stride);
      else
        at = low + (high - low) / 2;
    }
    return high;
  }

  int level_;
  MeshStore below_;
  double before_ = 0.0;  ///< tolerance of the level below
  /// Of the level below: what it gave up is not taken up again, and what was clustered is no surface to decimate.
  LevelMethod least_method_ = LevelMethod::kDecimation;
  std::vector<MeshBlockCut> samples_;  ///< empty: there is no further level
};

}  // namespace

std::string level_folder(int level) {
  return "level-" + std::to_string(level);
}

MeshStore open_level(const std::filesystem::path& work, int level) {
  if (level == 0) return open_imported_mesh(work, kTilesImport);
  if (level_is_clustered(work, level))
    return MeshStore(list_task_files(work / level_folder(level) / kClusterFolder, ".tmm"));
  const std::vector<std::filesystem::path> coloured =
      list_task_files(work / level_folder(level) / kColourFolder, ".tmm");
  return coloured.empty() ? open_decimated_level(work, level) : MeshStore(coloured);
}

MeshStore open_decimated_level(const std::filesystem::path& work, int level) {
  const SimplifyPass last{kLevelPasses - 1, 0, false};
  return MeshStore(list_task_files(work / level_folder(level) / last.folder(), ".tmm"));
}

double level_tolerance(const std::filesystem::path& work, int level) {
  const std::filesystem::path file = work / level_folder(level) / kChoice;
  if (!std::filesystem::exists(file)) return 0.0;
  return parse_json(read_text(file)).at("tolerance").get<double>();
}

LevelMethod level_method(const std::filesystem::path& work, int level) {
  const Json choice = parse_json(read_text(work / level_folder(level) / kChoice));
  const auto at = std::find(kMethodNames.begin(), kMethodNames.end(), choice.at("method").get<std::string>());
  return static_cast<LevelMethod>(at - kMethodNames.begin());
}

std::string level_method_name(const std::filesystem::path& work, int level) {
  return level == 0 ? "input" : kMethodNames[static_cast<std::size_t>(level_method(work, level))];
}

bool level_is_clustered(const std::filesystem::path& work, int level) {
  return level_tolerance(work, level) > 0.0 && level_method(work, level) == LevelMethod::kClustering;
}

SimplifyOptions level_options(LevelMethod method) {
  SimplifyOptions options;
  options.colour_tolerance = 0.0;  // a level shows the mean of what it stands for
  if (method != LevelMethod::kDecimation) options.feature_angle_deg = 0.0;
  return options;
}

int levels_above(const std::filesystem::path& work) {
  int level = 0;
  while (level < kMaxLevels && level_tolerance(work, level + 1) > 0.0) ++level;
  return level;
}

double level_step_bound(const std::filesystem::path& work, int level) {
  if (level == 0) return 0.0;
  const std::filesystem::path folder = work / level_folder(level);
  const double bound = parse_json(read_text(folder / kLevelCertificate)).at("certified_max").get<double>();
  if (!std::filesystem::exists(folder / kClusterCertificate)) return bound;
  const Json measured = parse_json(read_text(folder / kClusterCertificate)).at("certified_max");
  return measured.is_number() ? std::min(bound, measured.get<double>()) : bound;
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
