#include <algorithm>
#include <nlohmann/json.hpp>
#include <unordered_set>

#include "octree/error.h"
#include "octree/portable_math.h"
#include "stream/files/durable_file.h"
#include "stream/import/import_stages.h"
#include "stream/stages/resample/resample_stages.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::size_t kMostNamed = 20;  ///< blends that a warning names
constexpr int kBlendBits = 32;          ///< of a new key: vertices of one blend

json to_json(const JumpSum& s) {
  return {{"edges", s.edges}, {"mean", s.mean}, {"variance", s.variance}, {"noise", s.noise}};
}
json to_json(const NormalJumps& j) {
  return {{"along", to_json(j.along)}, {"across", to_json(j.across)}};
}
json to_json(const BlendReport& r) {
  json out = {{"changed", r.outcome == BlendOutcome::kChanged},
              {"closed", r.closed},
              {"convex", r.convex},
              {"sharp", r.sharp},
              {"straightened", r.straightened},
              {"ribs", r.ribs},
              {"rows", r.rows},
              {"length", r.length},
              {"radius", r.radius},
              {"turn_deg", r.turn * 180.0 / kPi},
              {"noise", r.rms}};
  if (r.outcome != BlendOutcome::kChanged) {
    out["left_because"] = sentence_of(r.outcome);
    if (r.outcome == BlendOutcome::kBeyondTolerance && std::isfinite(r.distance))
      out["distance"] = r.distance;
    return out;
  }
  out["new_radius"] = r.new_radius;
  out["distance"] = std::isfinite(r.distance) ? json(r.distance) : json(nullptr);
  out["faces_removed"] = r.faces_removed;
  out["faces_added"] = r.faces_added;
  out["jumps_before"] = to_json(r.before);
  out["jumps_after"] = to_json(r.after);
  return out;
}

class BlendsStage : public Stage {
 public:
  BlendsStage(const JobState& state, const ResampleOptions& options)
      : work_(state.work),
        store_(open_imported_mesh(state.work, kResampleImport)),
        scale_(MeshScale::of_work(state.work)),
        kernel_(options.kernel(scale_.tolerance, !store_.info().double_positions)),
        tracks_(load_tracks(state.work)) {}

  std::string name() const override { return "blends"; }
  std::size_t task_count() const override { return tracks_.size(); }
  std::uint64_t units() const override { return tracks_.size(); }
  std::string unit_name() const override { return "blends"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto near = store_.select(box(task));
    std::uint64_t vertices = 0, faces = 0;
    for (const std::size_t p : near)
      vertices += store_.patches()[p].vertices, faces += store_.patches()[p].faces;
    return 2 * store_.block_bytes(near) + resample_blend_bytes(vertices, faces) + (std::uint64_t{4} << 20);
  }

  json run(std::size_t task, TaskContext& context) const override {
    const FoundTrack& found = tracks_[task];
    const MeshBlock block = store_.load_box(box(task));
    context.check_stop();
    BlendOptions options = kernel_;
    options.first_key = std::uint64_t{1} << 63 | static_cast<std::uint64_t>(task) << kBlendBits;
    ResampledBlend blend = resample_blend(block, found.track, options, scale_.edge);
    if (found.by_hand && blend.report.outcome == BlendOutcome::kNoFlanks) {
      context.check_stop();
      BlendTrack other = found.track;
      other.convex = !other.convex;
      ResampledBlend again = resample_blend(block, other, options, scale_.edge);
      if (again.report.outcome != BlendOutcome::kNoFlanks) blend = std::move(again);
    }
    context.count_written(save_blend(context.create(blend_file(task)), blend));
    context.advance(1);
    json out = to_json(blend.report);
    out["name"] = found.name;
    out["at"] = found.track.centre[found.track.centre.size() / 2];
    return out;
  }

  std::uint64_t finish_bytes() const override {
    std::uint64_t most = 0;
    for (std::size_t b = 0; b < tracks_.size(); ++b) {
      std::error_code error;
      const std::uintmax_t bytes = std::filesystem::file_size(work_ / blend_file(b), error);
      if (!error) most += bytes;
    }
    // Keys of vertices in a table; reports.
    return 3 * most + tracks_.size() * 4096 + (std::uint64_t{4} << 20);
  }

  json finish(const std::vector<json>& summaries, TaskContext& context) const override {
    std::unordered_set<std::uint64_t> taken;
    json blends = json::array(), stands = json::array();
    std::uint64_t changed = 0, removed = 0, added = 0;
    double farthest = 0.0;
    std::vector<std::string> left;
    for (std::size_t b = 0; b < summaries.size(); ++b) {
      context.check_stop();
      json blend = summaries[b];
      bool stand = blend.at("changed").get<bool>();
      if (stand) {
        const ResampledBlend change = load_blend(work_ / blend_file(b));
        const auto is_taken = [&](const std::array<std::uint64_t, 3>& f) {
          return taken.count(f[0]) + taken.count(f[1]) + taken.count(f[2]) > 0;
        };
        stand = std::none_of(change.removed.begin(), change.removed.end(), is_taken);
        if (stand)
          for (const auto& f : change.removed) taken.insert(f.begin(), f.end());
        else
          blend = {{"name", blend.at("name")},
                   {"at", blend.at("at")},
                   {"changed", false},
                   {"left_because", "another blend that comes before it reaches its faces"}};
      }
      if (stand) {
        ++changed;
        removed += blend.at("faces_removed").get<std::uint64_t>();
        added += blend.at("faces_added").get<std::uint64_t>();
        if (blend.at("distance").is_number())
          farthest = std::max(farthest, blend.at("distance").get<double>());
      } else {
        left.push_back(blend.at("name").get<std::string>() + " (" +
                       blend.at("left_because").get<std::string>() + ")");
      }
      stands.push_back(stand);
      blends.push_back(std::move(blend));
    }
    write_durably(context.create(kStandsFile), stands.dump());
    json result = {{"blends", blends},         {"changed", changed},   {"left", left.size()},
                   {"faces_removed", removed}, {"faces_added", added}, {"distance", farthest}};
    if (!left.empty()) result["warnings"] = {warning(left)};
    return result;
  }

  static constexpr const char* kStandsFile = "stands.json";

 private:
  MeshBox box(std::size_t task) const {
    const BlendTrack& t = tracks_[task].track;
    MeshBox box{t.centre[0], t.centre[0]};
    for (const Double3& p : t.centre)
      for (std::size_t a = 0; a < 3; ++a)
        box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
    return grown(box, blend_reach(t, kernel_, scale_.edge));
  }

  static std::string warning(const std::vector<std::string>& left) {
    std::string text = std::to_string(left.size()) + (left.size() == 1 ? " blend stays" : " blends stay") +
                       " as in the input: ";
    for (std::size_t i = 0; i < std::min(left.size(), kMostNamed); ++i) text += (i ? "; " : "") + left[i];
    if (left.size() > kMostNamed) text += "; the others stand in the report";
    return text;
  }

  std::filesystem::path work_;
  MeshStore store_;
  MeshScale scale_;
  BlendOptions kernel_;
  std::vector<FoundTrack> tracks_;
};

}  // namespace

std::unique_ptr<Stage> make_blends_stage(const JobState& state, const ResampleOptions& options) {
  return std::make_unique<BlendsStage>(state, options);
}

std::vector<std::size_t> blends_that_stand(const std::filesystem::path& work) {
  std::vector<std::size_t> out;
  std::size_t b = 0;
  for (const json& stand : json::parse(read_text(work / BlendsStage::kStandsFile))) {
    if (stand.get<bool>()) out.push_back(b);
    ++b;
  }
  return out;
}

}  // namespace tessera
