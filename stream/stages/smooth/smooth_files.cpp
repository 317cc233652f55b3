
#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/stages/smooth/coarse_files.h"
#include "stream/stages/smooth/smooth_stage.h"

namespace tessera {

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
  write_durably(path, dump_json(Json{{"largest_move", move}}));
}

double longest_move(const std::filesystem::path& work, std::size_t rounds) {
  return parse_json(read_text(work / moved_file(rounds))).at("largest_move").get<double>();
}

}  // namespace tessera
