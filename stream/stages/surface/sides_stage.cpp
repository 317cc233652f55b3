#include "stream/stages/surface/sides_stage.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <string>
#include <utility>

#include "stream/files/json.h"
#include "stream/files/packed_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/block_sides.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/first_pass.h"

namespace tessera {
namespace {

constexpr PackedKind kMovesKind = {"TSSIDMV1", "a file of vertices that went back at the sides of blocks"};

/// What one task of a round found.
struct RoundEntry {
  Section places, blocks;
};

std::string round_name(int round) {
  return "sides-" + std::to_string(round + 1);
}

std::vector<std::filesystem::path> round_files(const std::filesystem::path& work, int round) {
  return list_task_files(work / round_name(round), ".tsr");
}

void sort_places(std::vector<SafePlace>& places) {
  std::sort(places.begin(), places.end(),
            [](const SafePlace& a, const SafePlace& b) { return a.key < b.key; });
  const auto same = [](const SafePlace& a, const SafePlace& b) { return a.key == b.key; };
  places.erase(std::unique(places.begin(), places.end(), same), places.end());
}

/// Those of one round.
std::vector<SafePlace> load_round(const std::filesystem::path& work, int round) {
  std::vector<SafePlace> all;
  for (const auto& path : round_files(work, round)) {
    const PackedFile file(path, kMovesKind, sizeof(RoundEntry));
    for (const RoundEntry& e : file.table<RoundEntry>()) {
      const std::vector<SafePlace> part = file.load<SafePlace>(e.places);
      all.insert(all.end(), part.begin(), part.end());
    }
  }
  sort_places(all);
  return all;
}

const SafePlace* place_of(std::span<const SafePlace> places, std::uint64_t key) {
  const auto at = std::lower_bound(places.begin(), places.end(), key,
                                   [](const SafePlace& p, std::uint64_t k) { return p.key < k; });
  return at == places.end() || at->key != key ? nullptr : &*at;
}

/// Around all of it; half open, as cells are.
ContactCell around(const RiskyMesh& mesh) {
  ContactCell core = {mesh.position.front(), mesh.position.front()};
  for (const Double3& p : mesh.position)
    for (std::size_t a = 0; a < 3; ++a)
      core.low[a] = std::min(core.low[a], p[a]), core.high[a] = std::max(core.high[a], p[a]);
  for (double& x : core.high) x = std::nextafter(x, std::numeric_limits<double>::infinity());
  return core;
}

class SidesStage : public Stage {
 public:
  SidesStage(const JobState& state, int round)
      : round_(round), sides_(state.work), moved_(load_side_moves(state.work, round)) {
    if (round > 0) last_ = load_round(state.work, round - 1);
    MeshNames names;
    for (const SafePlace& p : moved_) bricks_.push_back(brick_key(names(p.key).brick));
    bricks_.erase(std::unique(bricks_.begin(), bricks_.end()), bricks_.end());
    needed_ = round == 0 || !(looks() ? moved_ : last_).empty();
  }

  std::string name() const override { return round_name(round_); }
  std::size_t task_count() const override { return needed_ ? sides_.file_count() : 0; }
  std::uint64_t units() const override { return needed_ ? sides_.block_count() : 0; }
  std::string unit_name() const override { return "blocks"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = sides_.first(task); b < sides_.end(task); ++b)
      maximum = std::max(maximum, sides_.bytes(b));
    return maximum + kSlack;
  }

  Json run(std::size_t task, TaskContext& context) const override {
    std::vector<SafePlace> back;
    std::vector<MovedBlock> blocks;
    std::uint64_t pairs = 0;
    for (std::size_t b = sides_.first(task); b < sides_.end(task); ++b) {
      context.check_stop();
      context.advance(1);
      if (round_ > 0 && !moved_around(b)) continue;
      SideMesh near = sides_.load(b, moved_);
      if (looks() && std::any_of(near.mesh.name.begin(),
                                 near.mesh.name.begin() + static_cast<std::ptrdiff_t>(near.own_vertices),
                                 [&](std::uint64_t key) { return place_of(moved_, key) != nullptr; }))
        blocks.push_back({task, sides_[b].brick, sides_[b].bricks});
      pairs += find(near, back);
    }
    if (looks()) back.clear();
    sort_places(back);
    PackedWriter file(context.create(round_name(round_) + "/" + task_file_stem(task) + ".tsr"), kMovesKind,
                      std::size_t{1} << 16);
    const std::vector<RoundEntry> table = {{file.append(bytes_of(back)), file.append(bytes_of(blocks))}};
    context.count_written(file.finish(table));
    return {{"crossing_pairs", pairs}, {"blocks", blocks.size()}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"crossing_pairs", 0}, {"blocks", 0}});
  }

 private:
  static constexpr std::uint64_t kSlack = std::uint64_t{2} << 20;

  bool looks() const { return round_ + 1 == kSideRounds; }

  bool moved_around(std::size_t block) const {
    const std::vector<std::uint64_t> codes = sides_.bricks_around(block);
    return std::any_of(codes.begin(), codes.end(), [&](std::uint64_t code) {
      return std::binary_search(bricks_.begin(), bricks_.end(), code);
    });
  }

  /// Pairs that cross at the sides, one of their faces the block's. \param back  gets what may go back of them
  std::uint64_t find(SideMesh& near, std::vector<SafePlace>& back) const {
    const std::vector<SafePlace>& risky = round_ == 0 ? near.safe : last_;
    bool any = false;
    for (std::size_t v = 0; v < near.mesh.name.size(); ++v)
      if (place_of(risky, near.mesh.name[v]) != nullptr) near.mesh.risky[v] = 1, any = true;
    if (!any) return 0;
    std::uint64_t pairs = 0;
    risky_crossings(near.mesh, around(near.mesh), [&](std::uint32_t i, std::uint32_t j) {
      if (i >= near.own_faces && j >= near.own_faces) return;
      ++pairs;
      for (const std::uint32_t f : {i, j})
        for (const std::uint32_t v : near.mesh.faces[f])
          if (const SafePlace* place = place_of(near.safe, near.mesh.name[v])) back.push_back(*place);
    });
    return pairs;
  }

  int round_;
  BlockSides sides_;
  std::vector<SafePlace> moved_, last_;  ///< in all rounds before; in the one before
  std::vector<std::uint64_t> bricks_;    ///< of the moved ones, ascending
  bool needed_ = false;
};

constexpr double kSidesTime = 0.05;     ///< microseconds a face
constexpr double kSideBytes = 3.0;      ///< a face of the scan
constexpr std::uint64_t kMinShare = 4;  ///< of its faces a block has fewer at its sides, and others around it

StageForecast forecast_sides(const PlannedScan& scan, int round) {
  const std::uint64_t faces = FirstPass::max_block_faces(scan.largest_patch.faces) / kMinShare;
  StageForecast told = {.tasks = scan.groups.size(),
                        .task_bytes = BlockSides::bytes(faces, faces),
                        .sure_bytes = BlockSides::bytes(0, 0),
                        .files = scan.groups.size()};
  if (round > 0) return told;
  told.processor_us = scan.faces * kSidesTime;
  told.disk_bytes = static_cast<std::uint64_t>(scan.faces * kSideBytes);
  told.moved_bytes = 3.0 * scan.faces * kSideBytes;
  return told;
}

}  // namespace

std::vector<StageEntry> side_stages() {
  std::vector<StageEntry> stages;
  for (int round = 0; round < kSideRounds; ++round)
    stages.push_back({round_name(round),
                      [round](const JobState& state) { return std::make_unique<SidesStage>(state, round); },
                      [round](const PlannedScan& scan) { return forecast_sides(scan, round); }});
  return stages;
}

std::vector<SafePlace> load_side_moves(const std::filesystem::path& work, int rounds) {
  std::vector<SafePlace> all;
  for (int round = 0; round < rounds; ++round) {
    const std::vector<SafePlace> part = load_round(work, round);
    all.insert(all.end(), part.begin(), part.end());
  }
  sort_places(all);
  return all;
}

std::vector<MovedBlock> load_moved_blocks(const std::filesystem::path& work) {
  std::vector<MovedBlock> all;
  for (const auto& path : round_files(work, kSideRounds - 1)) {
    const PackedFile file(path, kMovesKind, sizeof(RoundEntry));
    for (const RoundEntry& e : file.table<RoundEntry>()) {
      const std::vector<MovedBlock> part = file.load<MovedBlock>(e.blocks);
      all.insert(all.end(), part.begin(), part.end());
    }
  }
  return all;
}

std::vector<std::string> side_folders() {
  std::vector<std::string> folders = {kSideFolder};
  for (int round = 0; round < kSideRounds; ++round) folders.push_back(round_name(round) + "/");
  return folders;
}

}  // namespace tessera
