#include "stream/stages/smooth/smooth_plan.h"

#include <algorithm>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/stages/smooth/contact_regions.h"

namespace tessera {
namespace {

// Key, position, class, colour, first patch, number in a patch, wanted; corners, flags, bound and core flag.
constexpr std::uint64_t kLoadedVertexBytes = 8 + 24 + 1 + 4 + 4 + 5 + 1;
constexpr std::uint64_t kLoadedFaceBytes = 12 + 1 + 4 + 1;

}  // namespace

std::size_t base_round(const SmoothPlan& plan, std::size_t round) {
  const int cycle = plan.rounds[round - 1].cycle;
  return round - 1 - static_cast<std::size_t>(cycle > 0 ? cycle : 0);
}

CoarseOptions coarse_options(const JobState& state, const SmoothPlan& plan, std::size_t round) {
  const std::size_t base = base_round(plan, round);
  const std::uint64_t faces = open_smoothed(state, plan, base).face_count();
  const FilterOptions& filter = plan.rounds[round - 1].filter;
  const CoarseOptions options =
      coarse_options(filter.lambda, filter.order, load_range(state.work, base).edge(faces), faces);
  if (!(options.cell > 0.0)) throw InputError("no edge has a length: there is nothing to smooth");
  return options;
}

MeshStore open_smoothed(const JobState& state, const SmoothPlan& plan, std::size_t round) {
  if (round == 0) return plan.mesh(state);
  return MeshStore(list_task_files(state.work / smooth_folder(round), ".tmm"));
}

PatchLaplacians laplacians_of(const std::filesystem::path& work, const SmoothPlan& plan, std::size_t round) {
  const SmoothRound& rule = plan.rounds[round - 1];
  if (rule.cycle <= 0 || rule.filter.order == 1) return PatchLaplacians({});
  return PatchLaplacians(list_task_files(work / laplacian_folder(round - 1), ".bin"));
}

std::string smooth_folder(std::size_t round) {
  return "smooth-" + std::to_string(round);
}

std::string moved_file(std::size_t round) {
  return smooth_folder(round) + "/moved.json";
}

void save_longest_move(const std::filesystem::path& path, double move) {
  write_text(path, dump_json(Json{{"largest_move", move}}));
}

double longest_move(const std::filesystem::path& work, std::size_t rounds) {
  return parse_json(read_text(work / moved_file(rounds))).at("largest_move").get<double>();
}

std::string range_file(std::size_t round) {
  return (round == 0 ? "reach" : smooth_folder(round)) + "/reach.bin";
}

PatchRange load_range(const std::filesystem::path& work, std::size_t round) {
  return PatchRange::load(work / range_file(round));
}

std::uint64_t tile_loading_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return MeshStore::block_bytes(vertices, faces);
}

std::uint64_t tile_loaded_bytes(std::uint64_t vertices, std::uint64_t faces) {
  return vertices * kLoadedVertexBytes + faces * kLoadedFaceBytes;
}

std::uint64_t smooth_tile_bytes(const SmoothRound& rule, std::uint64_t vertices, std::uint64_t faces,
                                std::uint64_t patch_bytes) {
  const std::uint64_t now = rule.cycle >= 0 ? TileState::bytes(vertices) : 0;
  const std::uint64_t loaded = tile_loaded_bytes(vertices, faces) + now;
  return std::max(tile_loading_bytes(vertices, faces),
                  loaded + std::max(smooth_bytes(vertices, faces, rule) + 4 * vertices,
                                    24 * vertices + search_tile_bytes(faces))) +
         3 * patch_bytes + kTileSlackBytes;
}

}  // namespace tessera
