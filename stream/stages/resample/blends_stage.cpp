#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <set>
#include <unordered_map>

#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/import/import_stages.h"
#include "stream/stages/resample/resample_stages.h"

namespace tessera {
namespace {

constexpr std::size_t kMaxNamed = 20;  ///< blends that a warning names
constexpr int kBlendBits = 32;         ///< of a new key: vertices of one blend

Json to_json(const JumpSum& s) {
  return {{"edges", s.edges}, {"mean", s.mean}, {"variance", s.variance}, {"noise", s.noise}};
}
Json to_json(const NormalJumps& j) {
  return {{"along", to_json(j.along)}, {"across", to_json(j.across)}};
}
Json to_json(const BlendReport& r) {
  Json out = {{"changed", r.outcome == BlendOutcome::kChanged},
              {"closed", r.closed},
              {"convex", r.convex},
              {"sharp", r.sharp},
              {"straightened", r.straightened},
              {"ribs", r.ribs},
              {"rows", r.rows},
              {"length", r.length},
              {"radius", r.radius},
              {"turn_deg", r.arc_angle * 180.0 / kPi},
              {"noise", r.rms}};
  if (r.outcome != BlendOutcome::kChanged) {
    out["left_because"] = sentence_of(r.outcome);
    if (r.outcome == BlendOutcome::kBeyondTolerance && std::isfinite(r.distance))
      out["distance"] = r.distance;
    return out;
  }
  out["new_radius"] = r.new_radius;
  out["distance"] = std::isfinite(r.distance) ? Json(r.distance) : Json(nullptr);
  out["faces_removed"] = r.faces_removed;
  out["faces_added"] = r.faces_added;
  out["jumps_before"] = to_json(r.before);
  out["jumps_after"] = to_json(r.after);
  return out;
}

/// What blends that stand have changed. Two that are edited may share vertices, or border on each other, as each fills its
/// own hole: but not faces, nor an edge that both draw anew between two vertices that were there. Others share nothing, as
/// each is held against what is around it.
class TakenFaces {
 public:
  explicit TakenFaces(bool edited) : edited_(edited) {}
  /// \returns -1, or the blend that it is at odds with; then nothing of it counts
  std::int64_t take(const ResampledBlend& blend, std::size_t number) {
    std::vector<std::uint64_t> words;
    for (const auto& f : blend.removed)
      if (edited_)
        words.push_back(hash(f));
      else
        words.insert(words.end(), f.begin(), f.end());
    if (edited_) add_new_edges(blend, words);
    for (const std::uint64_t w : words)
      if (const auto at = by_.find(w); at != by_.end()) return static_cast<std::int64_t>(at->second);
    for (const std::uint64_t w : words) by_.emplace(w, number);
    return -1;
  }

 private:
  using Edge = std::pair<std::uint64_t, std::uint64_t>;
  static void add_new_edges(const ResampledBlend& blend, std::vector<std::uint64_t>& words) {
    std::set<Edge> was;
    for (const auto& f : blend.removed)
      for (const Edge& e : {Edge{f[0], f[1]}, Edge{f[1], f[2]}, Edge{f[0], f[2]}}) was.insert(e);
    for (const auto& f : blend.added.faces)
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [a, b] = std::minmax(blend.added.key[f[k]], blend.added.key[f[(k + 1) % 3]]);
        if (b >> 63 == 0 && was.count({a, b}) == 0) words.push_back(hash({a, b, b}));
      }
  }
  /// Where two that differ meet in one word a blend is left that need not be: once in 2^64 by the square of their number.
  static std::uint64_t hash(const std::array<std::uint64_t, 3>& f) {
    return random_bits(random_bits(f[0], 1, f[1]), 2, f[2]);
  }
  bool edited_;
  std::unordered_map<std::uint64_t, std::size_t> by_;
};

double distance_of(const BlendCurve& a, const BlendCurve& b) {
  double square = std::numeric_limits<double>::infinity();
  for (const Double3& p : a.centre)
    for (const Double3& q : b.centre) square = std::min(square, squared_distance(p, q));
  return std::sqrt(square);
}

class BlendsStage : public Stage {
 public:
  BlendsStage(const JobState& state, const ResampleOptions& options)
      : work_(state.work),
        store_(open_imported_mesh(state.work, kResampleImport)),
        scale_(MeshScale::of_work(state.work)),
        kernel_(options.kernel(scale_.tolerance, !store_.info().double_positions)),
        curves_(load_blend_curves(state.work)) {}

  std::string name() const override { return "blends"; }
  std::size_t task_count() const override { return curves_.size(); }
  std::uint64_t units() const override { return curves_.size(); }
  std::string unit_name() const override { return "blends"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto near = store_.select(box(task));
    std::uint64_t vertices = 0, faces = 0;
    for (const std::size_t p : near)
      vertices += store_.patches()[p].vertices, faces += store_.patches()[p].faces;
    return blends_task_bytes(store_.block_bytes(near), vertices, faces);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const FoundCurve& found = curves_[task];
    const MeshBlock block = store_.load_box(box(task));
    context.check_stop();
    BlendOptions options = kernel_;
    options.first_key = std::uint64_t{1} << 63 | static_cast<std::uint64_t>(task) << kBlendBits;
    ResampledBlend blend = resample_blend(block, found.curve, options, scale_.edge);
    if (found.by_hand && blend.report.outcome == BlendOutcome::kNoFlanks) {
      context.check_stop();
      BlendCurve other = found.curve;
      other.convex = !other.convex;
      ResampledBlend again = resample_blend(block, other, options, scale_.edge);
      if (again.report.outcome != BlendOutcome::kNoFlanks) blend = std::move(again);
    }
    context.count_written(save_blend(context.create(blend_file(task)), blend));
    context.advance(1);
    Json out = to_json(blend.report);
    out["name"] = found.name;
    out["at"] = found.curve.centre[found.curve.centre.size() / 2];
    return out;
  }

  std::uint64_t finish_bytes() const override {
    std::uint64_t maximum = 0;
    for (std::size_t b = 0; b < curves_.size(); ++b) {
      std::error_code error;
      const std::uintmax_t bytes = std::filesystem::file_size(work_ / blend_file(b), error);
      if (!error) maximum += bytes;
    }
    // Faces in a table, edges of one blend in a set; reports.
    return 4 * maximum + curves_.size() * 4096 + (std::uint64_t{4} << 20);
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    // Longer ones first: where two need the same faces, more stays aligned.
    std::vector<std::size_t> order(summaries.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
      return summaries[a].at("length").get<double>() > summaries[b].at("length").get<double>();
    });
    std::vector<Json> blends = summaries;
    std::vector<std::uint8_t> stands(summaries.size(), 0);
    TakenFaces taken(kernel_.edit != BlendEdit::kNone);
    for (const std::size_t b : order) {
      context.check_stop();
      if (!blends[b].at("changed").get<bool>()) continue;
      const std::int64_t other = taken.take(load_blend(work_ / blend_file(b)), b);
      stands[b] = other < 0;
      if (stands[b]) continue;
      const std::size_t first = static_cast<std::size_t>(other);
      blends[b] = {{"name", blends[b].at("name")},
                   {"at", blends[b].at("at")},
                   {"changed", false},
                   {"left_because",
                    fmt::format("blend {}, {:.3g} away, is longer and takes faces that it needs",
                                curves_[first].name, distance_of(curves_[b].curve, curves_[first].curve))}};
    }
    std::uint64_t changed = 0, removed = 0, added = 0;
    double farthest = 0.0;
    std::vector<std::string> left;
    for (std::size_t b = 0; b < blends.size(); ++b) {
      const Json& blend = blends[b];
      if (!stands[b]) {
        left.push_back(blend.at("name").get<std::string>() + " (" +
                       blend.at("left_because").get<std::string>() + ")");
        continue;
      }
      ++changed;
      removed += blend.at("faces_removed").get<std::uint64_t>();
      added += blend.at("faces_added").get<std::uint64_t>();
      if (blend.at("distance").is_number()) farthest = std::max(farthest, blend.at("distance").get<double>());
    }
    write_text(context.create(kStandsFile), dump_json(Json(stands)));
    Json result = {{"blends", blends},         {"changed", changed},   {"left", left.size()},
                   {"faces_removed", removed}, {"faces_added", added}, {"distance", farthest}};
    if (!left.empty()) result["warnings"] = {warning(left)};
    return result;
  }

  static constexpr const char* kStandsFile = "stands.json";

 private:
  MeshBox box(std::size_t task) const {
    const BlendCurve& t = curves_[task].curve;
    MeshBox box{t.centre[0], t.centre[0]};
    for (const Double3& p : t.centre)
      for (std::size_t a = 0; a < 3; ++a)
        box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
    return grown(box, blend_halo(t, kernel_, scale_.edge));
  }

  static std::string warning(const std::vector<std::string>& left) {
    std::string text = std::to_string(left.size()) + (left.size() == 1 ? " blend stays" : " blends stay") +
                       " as in the input: ";
    for (std::size_t i = 0; i < std::min(left.size(), kMaxNamed); ++i) text += (i ? "; " : "") + left[i];
    if (left.size() > kMaxNamed) text += "; the others stand in the report";
    return text;
  }

  std::filesystem::path work_;
  MeshStore store_;
  MeshScale scale_;
  BlendOptions kernel_;
  std::vector<FoundCurve> curves_;
};

}  // namespace

std::uint64_t blends_task_bytes(std::uint64_t block_bytes, std::uint64_t vertices, std::uint64_t faces) {
  return 2 * block_bytes + resample_blend_bytes(vertices, faces) + (std::uint64_t{4} << 20);
}

std::unique_ptr<Stage> make_blends_stage(const JobState& state, const ResampleOptions& options) {
  return std::make_unique<BlendsStage>(state, options);
}

std::vector<std::size_t> blends_that_stand(const std::filesystem::path& work) {
  std::vector<std::size_t> out;
  std::size_t b = 0;
  for (const Json& stand : parse_json(read_text(work / BlendsStage::kStandsFile))) {
    if (stand.get<int>() != 0) out.push_back(b);
    ++b;
  }
  return out;
}

}  // namespace tessera
