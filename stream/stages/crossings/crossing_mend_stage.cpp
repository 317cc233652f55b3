#include <algorithm>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <utility>

#include "kernels/holes/crossing_mend.h"
#include "kernels/mesh/block_contacts.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/meshes/failed_regions.h"
#include "stream/runtime/numbers.h"
#include "stream/runtime/serial_stage.h"
#include "stream/stages/crossings/crossing_pairs.h"
#include "stream/stages/crossings/crossing_parts.h"
#include "stream/stages/crossings/mended_mesh.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxGroupFaces =
    1000;  ///< in pairs that hang together: more of them are no small bad place
constexpr std::size_t kMaxAroundFaces = 30'000;   ///< looked at around a group
constexpr int kMaxHalvings = 3;                   ///< of a box with more
constexpr std::uint64_t kMendedPairBytes = 8192;  ///< what is held for a pair: itself, what it is replaced by
constexpr std::size_t kListedPlaces = 20;
constexpr std::uint64_t kFacesForPair = 100;  ///< a result that crosses itself more often is none
/// How far around a group faces are looked at, in its own extents, one after the other until that does.
constexpr std::array<double, 3> kAround = {1.0, 3.0, 8.0};

/// Pairs whose faces have vertices in common.
struct PairGroup {
  std::vector<std::size_t> pairs;  ///< ascending
  std::vector<FaceKeys> faces;     ///< ascending
  MeshBox box;
};

class KeyForest {
 public:
  std::uint64_t root(std::uint64_t key) {
    std::uint64_t top = key;
    for (auto at = parent_.emplace(key, key).first; at->second != top; at = parent_.find(top))
      top = at->second;
    while (key != top) key = std::exchange(parent_[key], top);
    return top;
  }
  void join(std::uint64_t a, std::uint64_t b) {
    a = root(a), b = root(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::map<std::uint64_t, std::uint64_t> parent_;
};

std::vector<PairGroup> group_pairs(const std::vector<CrossingPair>& pairs) {
  KeyForest forest;
  for (const CrossingPair& pair : pairs)
    for (const FaceKeys& face : pair.face)
      for (const std::uint64_t key : face) forest.join(pair.face[0][0], key);
  std::map<std::uint64_t, PairGroup> groups;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    PairGroup& group = groups[forest.root(pairs[i].face[0][0])];
    const MeshBox box = pairs[i].box();
    if (group.pairs.empty()) group.box = box;
    for (std::size_t a = 0; a < 3; ++a) {
      group.box.low[a] = std::min(group.box.low[a], box.low[a]);
      group.box.high[a] = std::max(group.box.high[a], box.high[a]);
    }
    group.pairs.push_back(i);
    group.faces.insert(group.faces.end(), pairs[i].face.begin(), pairs[i].face.end());
  }
  std::vector<PairGroup> out;
  for (auto& [key, group] : groups) {
    std::sort(group.faces.begin(), group.faces.end());
    group.faces.erase(std::unique(group.faces.begin(), group.faces.end()), group.faces.end());
    out.push_back(std::move(group));
  }
  return out;
}

class CrossingMendStage : public SerialStage {
 public:
  CrossingMendStage(const JobState& state, const CrossingPlan& plan)
      : name_(crossing_mend_name(plan)), plan_(plan), mesh_(open_to_mend(state, plan)) {
    files_ = list_task_files(state.work / crossing_search_name(plan), ".pairs");
    for (const auto& file : files_) pairs_ += std::filesystem::file_size(file) / sizeof(CrossingPair);
    if (pairs_ > 0 && plan.given) given_ = plan.given(state);
    if (pairs_ > 0 && plan.given_margin) given_margin_ = plan.given_margin(state);
    options_.may_cut = plan.may_cut;
    options_.gentle = plan.gentle;
    options_.float_positions = !mesh_.info().double_positions;
    options_.max_loop = kMaxLoop;
    if (plan.placed) options_.written = written_position(plan.placed(state));
  }

  std::string name() const override { return name_; }
  std::uint64_t units() const override { return pairs_; }
  std::string unit_name() const override { return "pairs"; }
  std::uint64_t finish_bytes() const override {
    std::uint64_t largest = mesh_.largest_patch_bytes();
    for (const MeshStore& store : given_) largest = std::max(largest, store.largest_patch_bytes());
    return crossing_mend_stage_bytes(std::min(pairs_, kMaxCrossingPairs), largest);
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    Counts counts;
    if (pairs_ > kMaxCrossingPairs) {
      counts.left_pairs = pairs_;
      hand_on({pairs_, mesh_.box().low}, context);
      counts.all_looked_at = false;
      return told(counts);
    }
    const std::vector<CrossingPair> pairs = load_crossing_pairs(files_);
    LeftPairs left;
    std::vector<FailedFace> left_faces;
    MendedMesh mended(mesh_);
    std::vector<std::uint8_t> inherited(pairs.size(), 0);
    for (const PairGroup& group : group_pairs(pairs)) {
      context.check_stop();
      if (is_inherited(group, pairs, context)) {
        ++counts.inherited_groups;
        if (counts.inherited_at.is_null()) counts.inherited_at = place_json(pairs[group.pairs.front()]);
        for (const std::size_t p : group.pairs) inherited[p] = 1;
      } else if (!mend(group, mended, counts, context)) {
        ++counts.left_groups;
        if (counts.places.size() < kListedPlaces)
          counts.places.push_back(place_json(pairs[group.pairs.front()]));
      }
      context.advance(group.pairs.size());
    }
    for (std::size_t p = 0; p < pairs.size(); ++p) {
      const bool stays = !mended.is_gone(pairs[p].face[0]) && !mended.is_gone(pairs[p].face[1]);
      if (stays && inherited[p] == 0) {
        if (left.pairs++ == 0) left.place = place_of(pairs[p]);
        if (left_faces.size() + 1 < kMaxFailedFaces)
          left_faces.insert(left_faces.end(), pairs[p].corners.begin(), pairs[p].corners.end());
      }
      counts.inherited_pairs += stays && inherited[p] != 0;
    }
    counts.left_pairs = left.pairs;
    hand_on(left, context);
    if (plan_.hands_on && !left_faces.empty())
      context.count_written(write_failed_faces(context.create(name_ + "/" + kLeftFacesFile), left_faces));
    if (!mended.empty()) context.count_written(mended.write(context.create(name_ + "/mended.tmm")));
    return told(counts);
  }

 private:
  static constexpr std::uint32_t kMaxLoop = 120;

  struct Counts {
    std::uint64_t inherited_groups = 0, inherited_pairs = 0, mended_groups = 0, left_groups = 0,
                  left_pairs = 0;
    std::uint64_t removed = 0, added = 0, new_vertices = 0;
    Json places = Json::array(), inherited_at;
    bool all_looked_at = true;
  };

  static Double3 place_of(const CrossingPair& pair) {
    const MeshBox box = pair.shared_box();
    return box.low * 0.5 + box.high * 0.5;
  }
  static Json place_json(const CrossingPair& pair) {
    const Double3 p = place_of(pair);
    return Json{p[0], p[1], p[2]};
  }
  void hand_on(const LeftPairs& left, TaskContext& context) const {
    if (!plan_.asked_for || left.pairs == 0) return;
    DirectFile file(context.create(name_ + "/" + kLeftPairsFile), 4096);
    file.write(&left, sizeof left);
    context.count_written(file.finish());
  }

  Json told(const Counts& c) const {
    Json out = {{"inherited_groups", c.inherited_groups},
                {"inherited_pairs", c.inherited_pairs},
                {"mended_groups", c.mended_groups},
                {"left_groups", c.left_groups},
                {"left_pairs", c.left_pairs},
                {"faces_removed", c.removed},
                {"faces_added", c.added},
                {"new_vertices", c.new_vertices},
                {"left", c.places}};
    // No round takes away what is in the input too.
    if (plan_.strict && c.left_pairs == 0 && c.inherited_pairs > 0) throw ValidationError(as_given(c));
    if (plan_.final && c.left_pairs > 0 && (c.all_looked_at || plan_.strict)) {
      const std::string sentence = of_its_own(c);
      // What crossed as given is told from what came by places alone.
      if (plan_.strict || (c.inherited_pairs == 0 && c.left_pairs > mesh_.face_count() / kFacesForPair))
        throw ValidationError(sentence);
      out["warnings"].push_back(sentence);
    }
    return out;
  }

  static std::string first_at(const Json& place) {
    std::string where;
    for (const Json& x : place)
      where += (where.empty() ? ", the first at " : " ") + number_text(x.get<double>());
    return where;
  }
  /// The input was repaired, so only its writing can have made it meet.
  static std::string as_given(const Counts& c) {
    return std::to_string(c.inherited_pairs) +
           " pairs of faces still cross, overlap or touch as they would be written" +
           first_at(c.inherited_at) +
           ", and those of the input do so too in such numbers: its sheets are nearer to each other than a "
           "format of floats tells apart; write one of doubles (-o OUT.ply), or move the mesh to the origin "
           "first";
  }
  std::string of_its_own(const Counts& c) const {
    const std::string where = c.places.empty() ? std::string() : first_at(c.places[0]);
    return std::to_string(c.left_pairs) + " pairs among the " + std::to_string(mesh_.face_count()) +
           " faces came to cross, overlap or touch that did not as given" + where +
           ", and could not be mended: sheets lie closer to each other there than faces of this size can "
           "keep "
           "apart; ask for more faces, or shorter edges";
  }

  /// Whether what the mesh was made of has a pair where one of the group's is, or cannot be looked at.
  bool is_inherited(const PairGroup& group, const std::vector<CrossingPair>& pairs,
                    TaskContext& context) const {
    const auto any_meet = [&](const MeshBox& box) {
      return std::any_of(given_.begin(), given_.end(),
                         [&](const MeshStore& store) { return meets_in(store, box, 0, context); });
    };
    // Nearly always: nothing meets anywhere around.
    if (!any_meet(grown(group.box, given_margin_))) return false;
    return std::any_of(group.pairs.begin(), group.pairs.end(),
                       [&](std::size_t p) { return any_meet(grown(pairs[p].shared_box(), given_margin_)); });
  }

  /// Whether faces meet that both lie in a part of the box, or whether there are more than can be looked at.
  bool meets_in(const MeshStore& store, const MeshBox& box, int halvings, TaskContext& context) const {
    context.check_stop();
    if (const auto block = load_faces(store, box, kMaxAroundFaces)) return meets(*block, nullptr);
    if (halvings == kMaxHalvings) return true;
    const Double3 middle = box.low * 0.5 + box.high * 0.5;
    for (unsigned part = 0; part < 8; ++part) {
      MeshBox octant = box;
      for (std::size_t a = 0; a < 3; ++a) ((part >> a & 1u) != 0 ? octant.low : octant.high)[a] = middle[a];
      if (meets_in(store, octant, halvings + 1, context)) return true;
    }
    return false;
  }

  bool mend(const PairGroup& group, MendedMesh& mended, Counts& counts, TaskContext& context) const {
    if (plan_.tells_only || group.faces.size() > kMaxGroupFaces) return false;
    std::optional<MeshBox> widest;
    for (const double around : kAround) {
      context.check_stop();
      const MeshBox box = around_group(group, around);
      const auto block = mended.load(box, kMaxAroundFaces);
      if (!block) break;
      widest = box;
      const auto done = mend_in(*block, box, false, group, mended, counts);
      if (done) return *done;
    }
    // Ways that need less than what more rings do.
    if (!widest) return false;
    return mend_in(*mended.load(*widest, kMaxAroundFaces), *widest, true, group, mended, counts)
        .value_or(false);
  }

  static MeshBox around_group(const PairGroup& group, double around) {
    double extent = 0.0;
    for (std::size_t a = 0; a < 3; ++a) extent = std::max(extent, group.box.high[a] - group.box.low[a]);
    return grown(group.box, around * extent);
  }

  /// None where a wider block may do.
  std::optional<bool> mend_in(const MeshBlock& block, const MeshBox& box, bool last, const PairGroup& group,
                              MendedMesh& mended, Counts& counts) const {
    std::vector<std::uint32_t> crossing;
    for (std::uint32_t f = 0; f < block.faces.size(); ++f)
      if (std::binary_search(group.faces.begin(), group.faces.end(), face_keys(block, f)))
        crossing.push_back(f);
    // A group before it has taken some of its faces away: the others meet nothing more, or are looked at as they are.
    if (crossing.size() < group.faces.size() && !meets(block, &crossing)) return true;
    CrossingMendOptions options = options_;
    options.last_block = last;
    options.first_key =
        ~std::uint64_t{0} << 52 | static_cast<std::uint64_t>(plan_.generation) << 32 | counts.new_vertices;
    CrossingMend found = mend_crossing(block, crossing, {box.low, box.high}, options);
    if (!found.mended) return found.torn ? std::nullopt : std::optional<bool>(false);
    ++counts.mended_groups;
    counts.removed += found.removed.size();
    counts.added += found.added.faces.size();
    counts.new_vertices += found.new_vertices;
    mended.apply(block, std::move(found));
    return true;
  }

  /// Whether any faces meet in the bytes that are written, one of these among them unless null.
  bool meets(const MeshBlock& block, const std::vector<std::uint32_t>* some) const {
    MeshBlock placed = block;
    if (options_.written)
      for (Double3& p : placed.position) p = options_.written(p);
    std::vector<std::uint32_t> number;
    const std::vector<ContactFace> faces = contact_faces(placed, &number);
    bool any = false;
    block_contacts(faces, kAllSpace, [&](std::uint32_t i, std::uint32_t j, FaceContact) {
      const auto asked = [&](std::uint32_t f) {
        return some == nullptr || std::binary_search(some->begin(), some->end(), number[f]);
      };
      any = any || ((asked(i) || asked(j)) && !meet_in_copies(faces[i], faces[j]));
    });
    return any;
  }

  std::string name_;
  CrossingPlan plan_;
  MeshStore mesh_;
  std::vector<std::filesystem::path> files_;
  std::uint64_t pairs_ = 0;
  std::vector<MeshStore> given_;
  double given_margin_ = 0.0;
  CrossingMendOptions options_;
};

}  // namespace

std::uint64_t crossing_mend_stage_bytes(std::uint64_t pairs, std::uint64_t largest_patch_bytes) {
  constexpr std::uint64_t kSlack = std::uint64_t{2} << 20;
  if (pairs == 0) return kSlack;
  CrossingMendOptions options;
  options.max_loop = 120;
  return kSlack + pairs * kMendedPairBytes + 3 * largest_patch_bytes +
         3 * MeshStore::block_bytes(kMaxAroundFaces / 2, kMaxAroundFaces) +
         crossing_mend_bytes(kMaxAroundFaces, options);
}

std::unique_ptr<Stage> make_crossing_mend_stage(const JobState& state, const CrossingPlan& plan) {
  return std::make_unique<CrossingMendStage>(state, plan);
}

}  // namespace tessera
