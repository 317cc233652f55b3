#include <algorithm>
#include <charconv>
#include <fstream>
#include <map>
#include <optional>

#include "kernels/closing/sign_flow.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/points/closing_store.h"
#include "stream/points/multipole_store.h"
#include "stream/points/point_overlay.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/surface/closing_stages.h"

namespace tessera {
namespace {

constexpr const char* kDecisionFile = "close/decision.json";
constexpr std::size_t kVotingBricks = 512;
constexpr std::size_t kVotesPerBrick = 16;
/// Winding number at the points themselves: 1/2 on a closed surface, 0 on a sheet, -1/2 on the walls of a room.
constexpr float kClosedVote = 0.25f;

// A visit of one brick: points with halo, dipoles, node states, one leaf's lists.
constexpr std::uint64_t kCloseBytesPerPoint = 40 + 28 + sizeof(Dipole) + 60;
constexpr std::uint64_t kVisitBytes = 4u << 20;

/// Of a node of the map of signs.
constexpr std::uint64_t kBytesPerSigns = sizeof(SignMap::value_type) + 48;

/// What the set of closing cells may take: a byte a cell, so half a billion cells under a cap of 2 GiB.
std::uint64_t set_limit(const RunOptions& run) {
  return run.memory_bytes / 4;
}

class CloseStage : public SerialStage {
 public:
  explicit CloseStage(const JobState& state)
      : state_(state), mode_(reconstruct_options(state).holes), plan_(Plan::of_work(state.work)) {
    if (!mode_.close) return;
    points_ = std::make_unique<PointStore>(PointStore::of_surface(state.work));
    multipoles_ = std::make_unique<MultipoleStore>(state.work);
    boundaries_ = std::make_unique<BrickSectionStore>(list_task_files(state.work / "rims", ".tsr"));
  }

  std::string name() const override { return "close"; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "bricks"; }
  std::vector<std::string> obsolete() const override { return {"rims/"}; }

  std::uint64_t finish_bytes() const override {
    if (!mode_.close) return 1u << 20;
    CloseCounts maximum{0, 0, multipoles_->far().bytes(), 0};
    for (const BrickSection& b : boundaries_->bricks()) maximum.boundaries += b.extra;
    std::uint64_t bytes = 0;
    for (const BrickEntry& brick : points_->bricks()) {
      const Int3 corner = corner_of(brick_of_key(brick.key));
      maximum.visit_points = points_->count_bound(corner, kEdges, MultipoleStore::kHaloCells);
      maximum.near_bytes = multipoles_->near_bytes(corner, kEdges);
      bytes = std::max(bytes, close_bytes(state_.run, maximum));
    }
    return bytes;
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    if (!mode_.close) return {{"needed", false}};
    Json entry = {{"needed", true}, {"summary_bytes", multipoles_->far().bytes()}};
    const ClosingOptions options = decide(entry, context);
    Seeds boundaries;
    for (const BrickSection& brick : boundaries_->bricks())
      for (const Int3& c : boundaries_->boundaries(brick)) boundaries[brick_of_cell(c)].push_back(c);
    SignMap signs;
    ClosingMap cells = grow(boundaries, options, signs, entry, context);
    if (flows(options) && !cells.empty()) {
      signs = let_flow(cells, std::move(signs), options, context);
      for (const Int3& c : forced_cells(signs)) boundaries[brick_of_cell(c)].push_back(c);
      cells = grow(boundaries, options, signs, entry, context);
      std::uint64_t forced = 0;
      for (const Int3& brick : bricks_of(signs))
        if (std::vector<ClosingLeaf> values = flow_values(signs, brick); !values.empty())
          forced += add_flow_values(std::move(values), cells[brick_key(brick)]);
      entry["forced_nodes"] = forced;
    }
    entry["bricks"] = cells.size();
    BrickSectionWriter writer(context.create(kClosingFile));
    for (const auto& [key, own] : cells) writer.cells(key, own);
    context.count_written(writer.finish());
    return entry;
  }

 private:
  using Seeds = std::map<std::uint64_t, std::vector<Int3>>;  ///< by key of the brick

  /// The closing cells that are reached from seeds.
  /// \param signs  empty: what the closing field says around the cells comes here; else they stand
  ClosingMap grow(const Seeds& seeds, const ClosingOptions& options, SignMap& signs, Json& entry,
                  TaskContext& context) const {
    const bool fixed = !signs.empty();
    Seeds pending = seeds;
    ClosingMap cells;
    std::uint64_t rounds = 0;
    std::uint64_t visits = 0;
    std::uint64_t added = 0;
    std::uint64_t leaves = 0;
    std::vector<Int3> stopped;
    while (!pending.empty()) {
      const std::vector<std::pair<std::uint64_t, std::vector<Int3>>> round(pending.begin(), pending.end());
      pending.clear();
      std::vector<GrownCells> grown(round.size());
      parallel_for(round.size(), [&](std::size_t i) {
        context.check_stop();
        const auto known = cells.find(round[i].first);
        grown[i] =
            visit(brick_of_key(round[i].first), round[i].second,
                  known == cells.end() ? std::span<const ClosingLeaf>{} : known->second, signs, options);
      });
      for (std::size_t i = 0; i < round.size(); ++i) {
        added += grown[i].added;
        stopped.insert(stopped.end(), grown[i].stopped.begin(), grown[i].stopped.end());
        if (!fixed && flows(options)) add_field_signs(grown[i].evaluated, signs);
        if (grown[i].added == 0) continue;
        std::vector<ClosingLeaf>& own = cells[round[i].first];
        leaves += grown[i].cells.size() - own.size();
        own = std::move(grown[i].cells);
        for (const Int3& c : grown[i].leaving) pending[brick_of_cell(c)].push_back(c);
      }
      require_memory(3 * leaves * sizeof(ClosingLeaf) + signs.size() * kBytesPerSigns);
      visits += round.size();
      ++rounds;
    }
    const std::uint64_t taken = take_back_unfinished(cells, stopped);
    std::erase_if(cells, [](const auto& brick) { return brick.second.empty(); });
    entry["rounds"] = rounds;
    entry["visits"] = visits;
    entry["cells"] = added - taken;
    entry["unfinished_cells"] = taken;
    return cells;
  }

  /// Exact scans do not contradict each other. With a limit, holes stay open, and around these inside and outside meet
  /// anywhere.
  bool flows(const ClosingOptions& options) const {
    return options.limit == 0.0f && plan_.noise_cells > double{ClosingField::kExactNoise};
  }

  static std::vector<Int3> bricks_of(const SignMap& map) {
    std::vector<Int3> bricks;
    for (const auto& [key, leaf] : map) {
      const std::uint64_t brick = key >> 3 * (kBrickBits - kLeafBits);
      if (bricks.empty() || brick_key(bricks.back()) != brick) bricks.push_back(brick_of_key(brick));
    }
    return bricks;
  }

  /// Signs after their flow, in the leaves around the closing cells.
  SignMap let_flow(const ClosingMap& cells, SignMap field, const ClosingOptions& options,
                   TaskContext& context) const {
    SignMap region = flow_region(cells);
    require_memory((2 * region.size() + field.size()) * kBytesPerSigns);
    const std::vector<Int3> bricks = bricks_of(region);
    for (const Int3& brick : bricks) enter_local_signs(boundaries_->signs_around(brick), region);
    enter_field_signs(field, region);
    field.clear();
    const auto step = [&](const auto& change) {
      std::vector<SignChange> changes(bricks.size());
      parallel_for(bricks.size(), [&](std::size_t i) {
        context.check_stop();
        changes[i] = change(bricks[i]);
      });
      for (const SignChange& c : changes)
        for (const auto& [key, leaf] : c) region[key] = leaf;
    };
    step([&](const Int3& brick) {
      SignChange leaves = prepare_flow(region, cells, brick);
      const std::vector<Int3> loose = loose_nodes(leaves);
      if (loose.empty()) return leaves;
      const MultipoleTree near =
          multipoles_->near(points_->load(corner_of(brick), kEdges, MultipoleStore::kHaloCells));
      std::vector<float> winding(loose.size());
      WindingField(multipoles_->far(), near).evaluate(loose, winding);
      fix_local(winding, options.level, leaves);
      return leaves;
    });
    for (int round = 0; round < kFlowRounds; ++round)
      step([&](const Int3& brick) { return flow_signs(region, brick); });
    return region;
  }

  static constexpr Int3 kEdges = {kBrickCells, kBrickCells, kBrickCells};

  static Int3 corner_of(const Int3& brick) {
    return {brick[0] * kBrickCells, brick[1] * kBrickCells, brick[2] * kBrickCells};
  }
  static std::uint64_t brick_of_cell(const Int3& c) {
    return brick_key({c[0] >> kBrickBits, c[1] >> kBrickBits, c[2] >> kBrickBits});
  }
  void require_memory(std::uint64_t bytes) const {
    if (bytes <= set_limit(state_.run)) return;
    throw ResourceError("stage close: the surface that closes the holes takes " + format_bytes(bytes) +
                        " to list and a quarter of --memory " + format_bytes(state_.run.memory_bytes) +
                        " is for it; raise --memory to " + format_bytes(8 * bytes) +
                        ", or limit the distance with --holes fill-to:D");
  }

  /// Level, bounds and limit; all functions of the data.
  ClosingOptions decide(Json& entry, TaskContext& context) const {
    ClosingOptions options;
    for (std::size_t a = 0; a < 3; ++a) {
      options.low[a] = (plan_.brick_min[a] - 1) * kBrickCells;
      options.high[a] = (plan_.brick_max[a] + 2) * kBrickCells;
    }
    const std::size_t bricks = points_->bricks().size();
    const std::size_t step = bricks / kVotingBricks + 1;
    std::vector<std::array<std::uint64_t, 3>> votes(bricks / step + 1);
    parallel_for(votes.size(), [&](std::size_t i) {
      context.check_stop();
      if (i * step < bricks) votes[i] = vote(brick_of_key(points_->bricks()[i * step].key));
    });
    std::array<std::uint64_t, 3> sum{};  // room, sheet, solid
    for (const auto& v : votes)
      for (std::size_t k = 0; k < 3; ++k) sum[k] += v[k];
    const bool sheet = sum[1] >= sum[0] && sum[1] > sum[2];
    options.level = sheet ? 0.0f : sum[2] >= sum[0] ? 0.5f : -0.5f;
    const double given = mode_.limit / plan_.lattice.h;
    const double limit = given > 0.0 ? given : sheet ? kDefaultSheetLimit : 0.0;
    if (limit > double{kMaxClosingLimit})
      throw UsageError(
          "--holes " + reconstruct_options(state_).holes + ": at most " +
          dump_json(Json(double{kMaxClosingLimit} * plan_.lattice.h)) +
          " (56 lattice spacings) can be bridged; a closed object needs no limit: --holes close");
    options.limit = static_cast<float>(limit);
    const Json decision = {{"level", options.level},
                           {"limit_cells", options.limit},
                           {"low", options.low},
                           {"high", options.high}};
    std::ofstream file(context.create(kDecisionFile));
    file << dump_json(decision) << '\n';
    if (!file.flush())
      throw ResourceError("cannot write " + std::string(kDecisionFile) + "; is the disk full?");
    entry["kind"] = sheet ? "sheet" : options.level > 0.0f ? "solid" : "room";
    entry["level"] = options.level;
    entry["limit"] = limit * plan_.lattice.h;
    entry["votes"] = {{"room", sum[0]}, {"sheet", sum[1]}, {"solid", sum[2]}};
    return options;
  }

  std::array<std::uint64_t, 3> vote(const Int3& brick) const {
    const PointBlock points = points_->load(corner_of(brick), kEdges, MultipoleStore::kHaloCells);
    const MultipoleTree near = multipoles_->near(points);
    std::vector<Int3> own;
    for (const Dipole& d : near.dipoles())
      if (Int3{d.q[0] >> 16, d.q[1] >> 16, d.q[2] >> 16} == brick) own.push_back(d.q);
    std::vector<Int3> queries;
    const std::size_t step = own.size() / kVotesPerBrick + 1;
    for (std::size_t i = 0; i < own.size(); i += step) queries.push_back(own[i]);
    std::vector<float> value(queries.size());
    WindingField(multipoles_->far(), near).evaluate(queries, value);
    std::array<std::uint64_t, 3> votes{};
    for (const float v : value) ++votes[v >= kClosedVote ? 2 : v > -kClosedVote ? 1 : 0];
    return votes;
  }

  GrownCells visit(const Int3& brick, std::span<const Int3> seeds, std::span<const ClosingLeaf> known,
                   const SignMap& signs, const ClosingOptions& options) const {
    const Int3 corner = corner_of(brick);
    // Where all signs are settled no points are read.
    std::optional<MultipoleTree> near;
    std::optional<ClosingField> field;
    const auto load = [&] {
      near = multipoles_->near(points_->load(corner, kEdges, MultipoleStore::kHaloCells));
      field.emplace(multipoles_->far(), *near, static_cast<float>(plan_.radius_cells),
                    static_cast<float>(plan_.noise_cells));
    };
    std::vector<Int3> data;
    if (options.limit > 0.0f) {
      load();
      for (const Dipole& d : near->dipoles()) data.push_back(d.q);
      for (const Multipole& m : near->level(kLeafBits).cells) data.push_back(m.centre);
    }
    const auto evaluate = [&](std::span<const Int3> queries, std::span<float> value) {
      if (!field) load();
      field->evaluate(queries, options.level, value);
    };
    return grow_closing(corner, boundaries_->signs_around(brick), known, seeds, evaluate, data, options,
                        fixed_around(signs, brick));
  }

  JobState state_;
  HolesMode mode_;
  Plan plan_;
  std::unique_ptr<PointStore> points_;
  std::unique_ptr<MultipoleStore> multipoles_;
  std::unique_ptr<BrickSectionStore> boundaries_;
};

}  // namespace

std::uint64_t close_bytes(const RunOptions& run, const CloseCounts& counts) {
  return static_cast<std::uint64_t>(run.threads) *
             (counts.visit_points * kCloseBytesPerPoint + counts.near_bytes + kVisitBytes) +
         counts.boundaries * 3 * sizeof(Int3) + counts.far_bytes + set_limit(run) + (8u << 20);
}

HolesMode::HolesMode(const std::string& text) {
  if (text == "keep") return;
  close = true;
  if (text == "close") return;
  const std::string word = "fill-to";
  const char* end = text.data() + text.size();
  if (text.rfind(word, 0) == 0 && text.size() > word.size() + 1) {
    const auto read = std::from_chars(text.data() + word.size() + 1, end, limit);
    if (read.ec == std::errc() && read.ptr == end && limit > 0.0 && limit < 1e30) return;
  }
  throw UsageError("--holes " + text +
                   ": write keep, close, or fill-to:D with a distance D > 0 in scan units");
}

ClosingOptions load_closing_options(const std::filesystem::path& work) {
  const std::filesystem::path path = work / kDecisionFile;
  const Json decision = try_parse_json(read_text(path));
  if (decision.is_discarded() || !decision.contains("high"))
    throw InputError(path.string() + ": not what the close stage wrote; run again with --force");
  ClosingOptions options;
  options.level = decision.at("level").get<float>();
  options.limit = decision.at("limit_cells").get<float>();
  options.low = decision.at("low").get<Int3>();
  options.high = decision.at("high").get<Int3>();
  return options;
}

std::unique_ptr<Stage> make_close_stage(const JobState& state) {
  return std::make_unique<CloseStage>(state);
}

}  // namespace tessera
