/// Stage "joints" of a merge: where a mesh ends and another one goes on.
#include <algorithm>

#include "stream/files/direct_file.h"
#include "stream/files/external_sort.h"
#include "stream/files/json.h"
#include "stream/files/record_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

constexpr std::size_t kJointPage = 1u << 12;

std::string part(std::size_t task) {
  return "joints/" + task_file_stem(task) + ".edg";
}

std::uint64_t joints_finish_bytes(const RunOptions& run) {
  return sort_bytes(run) + 5 * kJointPage * sizeof(JointEdge) + DirectFile::kDefaultBuffer +
         (std::uint64_t{4} << 20);
}

class JointsStage : public MergeFacesStage {
 public:
  explicit JointsStage(const JobState& state) : MergeFacesStage(state, false) {}

  std::string name() const override { return "joints"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const MergeTask& t = tasks_[task];
    const MeshStore& store = meshes_.store(t.rank);
    std::uint64_t maximum = 0;
    for (std::size_t p = t.first; p < t.end; ++p) {
      const MeshPatchEntry& e = store.patches()[p];
      std::uint64_t bytes = MeshStore::block_bytes(e.vertices, e.faces);
      if (!meshes_.is_alone(t.rank, e.box)) bytes += meshes_.near_bytes(e.box, margin());
      maximum = std::max(maximum, bytes);
    }
    return maximum + DirectFile::kDefaultBuffer + (std::uint64_t{1} << 20);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const MergeTask& t = tasks_[task];
    const MeshStore& store = meshes_.store(t.rank);
    DirectFile out(context.create(part(task)));
    std::uint64_t borders = 0, joints = 0;
    for (std::size_t p = t.first; p < t.end; ++p) {
      context.check_stop();
      const MeshPatchEntry& e = store.patches()[p];
      context.advance(e.faces);
      const bool alone = meshes_.is_alone(t.rank, e.box);
      const MeshBlock block = store.load({&p, 1});
      std::vector<std::array<Double3, 3>> edges;  // with the third corner
      for (std::size_t f = 0; f < block.faces.size(); ++f)
        for (std::size_t k = 0; k < 3; ++k)
          if (block.face_flags[f] >> k & 1)
            edges.push_back({block.position[block.faces[f][k]], block.position[block.faces[f][(k + 1) % 3]],
                             block.position[block.faces[f][(k + 2) % 3]]});
      borders += edges.size();
      if (alone || edges.empty()) continue;
      MeshBox box{edges[0][0], edges[0][0]};
      for (const auto& edge : edges)
        for (std::size_t c = 0; c < 2; ++c)
          for (std::size_t a = 0; a < 3; ++a) {
            box.low[a] = std::min(box.low[a], edge[c][a]);
            box.high[a] = std::max(box.high[a], edge[c][a]);
          }
      const MergeMeshes::Near near = meshes_.load(box, margin());
      std::vector<JointEdge> found;
      for (const auto& [a, b, c] : edges) {
        if (!passed(t.rank, a, b, c, near)) continue;
        found.push_back({t.rank, a, b});
      }
      joints += found.size();
      out.write(found.data(), found.size() * sizeof(JointEdge));
    }
    context.count_written(out.finish());
    return {{"rank", t.rank}, {"borders", borders}, {"joints", joints}};
  }

  std::uint64_t finish_bytes() const override { return joints_finish_bytes(state_.run); }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    ExternalSort<JointEdge> sort(state_.work, sort_bytes(state_.run));
    std::uint64_t borders = 0, joints = 0;
    for (std::size_t t = 0; t < tasks_.size(); ++t) {
      borders += summaries[t].at("borders").get<std::uint64_t>();
      joints += summaries[t].at("joints").get<std::uint64_t>();
      for_each_page<JointEdge>(state_.work / part(t), kJointPage, [&](auto page) {
        for (const JointEdge& edge : page) sort.add(edge);
      });
    }
    PackedWriter out(context.create(kJointsFile), kJointsKind);
    std::vector<Section> sections;
    sort.drain(
        [&](std::span<const JointEdge> batch) { sections.push_back(out.append(std::as_bytes(batch))); });
    context.count_written(out.finish(sections));
    return {{"border_edges", borders}, {"joint_edges", joints}};
  }

  std::vector<std::string> obsolete() const override { return {"joints/"}; }

 private:
  double margin() const { return meshes_.plan().range.apart + meshes_.plan().range.beyond; }

  bool passed(std::size_t rank, const Double3& a, const Double3& b, const Double3& c,
              const MergeMeshes::Near& near) const {
    const MergePlan& plan = meshes_.plan();
    const Double3 normal = unit_or_zero(triangle_normal(a, b, c));
    const Double3 out = unit_or_zero(cross(b - a, normal));
    if (normal == Double3{0, 0, 0} || out == Double3{0, 0, 0}) return false;
    const Double3 p = (a + b) * 0.5 + out * plan.range.beyond - plan.origin;
    for (std::size_t r = 0; r < near.sheets.size(); ++r)
      if (r != rank && near.sheets[r] && near.sheets[r]->passes(p, plan.range, normal)) return true;
    return false;
  }
};

}  // namespace

std::uint64_t merge_joints_bytes(const RunOptions& run, std::uint64_t patch_bytes, std::uint64_t near_bytes) {
  return std::max(patch_bytes + near_bytes + DirectFile::kDefaultBuffer + (std::uint64_t{1} << 20),
                  joints_finish_bytes(run));
}

std::unique_ptr<Stage> make_merge_joints_stage(const JobState& state) {
  return std::make_unique<JointsStage>(state);
}

}  // namespace tessera
