#include "stream/stages/merge/merge_job.h"

#include <algorithm>
#include <charconv>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/import/crs_sidecar.h"
#include "stream/import/import_needs.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/store_write_stage.h"
#include "stream/page/report_page.h"
#include "stream/runtime/report.h"
#include "stream/stages/crossings/crossing_stages.h"
#include "stream/stages/merge/merge_needs.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

void summarise(Json& report) {
  const Json scale = result_of(report, "scale");
  if (scale.is_object())
    report["resolution"] = {{"h", scale.at("h")}, {"reason", scale.at("resolution_reason")}};
  Json merge = Json::object();
  for (const char* stage : {"scale", "joints", "cover", "strip", "zip"})
    if (const Json result = result_of(report, stage); result.is_object()) merge[stage] = result;
  report["merge"] = merge;
  if (const Json mended = mending_of(report); mended.is_object()) report["crossings"] = {{"result", mended}};
  if (const Json written = result_of(report, "write"); written.is_object()) report["mesh"] = written;
}

/// Pairs that one of the meshes has stay: they are not of the merge.
CrossingPlan merge_mend(std::size_t meshes) {
  CrossingPlan plan;
  plan.mesh = [](const JobState& s) {
    StoreFiles mesh = {list_task_files(s.work / "kept", ".tmm"), list_task_files(s.work / "cut", ".tmm")};
    for (const auto& file : list_task_files(s.work / "zipped", ".tmm")) mesh.files.push_back(file);
    return mesh;
  };
  plan.given = [=](const JobState& s) {
    std::vector<MeshStore> given;
    for (std::size_t i = 0; i < meshes; ++i) given.push_back(open_imported_mesh(s.work, merge_import(i)));
    return given;
  };
  plan.may_cut = true;
  return plan;
}

}  // namespace

OptionTable option_table(MergeOptions& o) {
  OptionTable t("What it computes");
  t.add("priority", &o.priority,
        "names or numbers of meshes, best first, with commas: where meshes overlap the best one stays; "
        "others follow, the more confident one first where all of them have confidences (PLY: the mean of "
        "property `confidence`), else the finer one");
  t.add("blend", &o.blend,
        "units of the meshes: how far from its border, where another mesh passes it, a mesh passes over into "
        "that one; "
        "0 = 4 of its edges")
      .at_least(0);
  t.add("distance", &o.distance,
        "units of the meshes: surfaces so near that look the same way are one; 0 = 3 edges of the coarsest "
        "mesh")
      .at_least(0);
  t.add("resolution,voxel", &o.resolution,
        "lattice spacing h along the joints, units of the meshes; 0 = the mean edge of the finest mesh")
      .at_least(0);
  t.add("crossings", &o.crossings,
        "refuse: where faces of the result come to cross, overlap or touch others beyond what they share, "
        "and no "
        "mesh did as given, they are cut out and the holes closed anew; keep: that is not looked at")
      .one_of({"refuse", "keep"});
  t.add("meshes", &o.meshes, "how many meshes there are").hidden();
  return t;
}

std::vector<std::size_t> read_priority(const std::string& priority,
                                       const std::vector<std::filesystem::path>& inputs) {
  std::vector<std::size_t> out;
  for (std::size_t at = 0; at < priority.size();) {
    const std::size_t comma = std::min(priority.find(',', at), priority.size());
    const std::string word = priority.substr(at, comma - at);
    at = comma + 1;
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < inputs.size(); ++i)
      if (inputs[i] == word || inputs[i].filename() == word || inputs[i].stem() == word) found.push_back(i);
    std::size_t number = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
    if (found.empty() && error == std::errc() && end == word.data() + word.size() && number >= 1 &&
        number <= inputs.size())
      found.push_back(number - 1);
    if (found.size() != 1)
      throw UsageError("--priority: '" + word + "' is " +
                       (found.empty() ? "none of the meshes" : "more than one of the meshes") +
                       ": write their names, or their numbers from 1 to " + std::to_string(inputs.size()));
    if (std::find(out.begin(), out.end(), found[0]) != out.end())
      throw UsageError("--priority: '" + word + "' comes twice");
    out.push_back(found[0]);
  }
  return out;
}

JobDescription merge_job(const MergeOptions& options) {
  std::vector<StageEntry> stages;
  for (std::size_t i = 0; i < options.meshes; ++i)
    for (StageEntry& entry : import_stages({i, merge_import(i)})) stages.push_back(std::move(entry));
  stages.push_back({"scale", [options](const JobState& s) { return make_merge_scale_stage(s, options); }});
  stages.push_back({"joints", make_merge_joints_stage});
  stages.push_back({"cover", make_merge_cover_stage});
  stages.push_back({"strip", make_merge_strip_stage});
  stages.push_back({"zip", make_merge_zip_stage});
  const CrossingPlan mend = merge_mend(options.meshes);
  if (options.crossings != "keep")
    for (StageEntry& entry : crossing_stages(mend)) stages.push_back(std::move(entry));
  stages.push_back({"write", [=](const JobState& s) {
                      return make_store_write_stage(s, open_mended(s, mend), "made by tessera merge",
                                                    sort_bytes(s.run));
                    }});
  JobDescription job{"merge", std::move(stages), 0, summarise, {carried_crs(), known_origin()}, job_page()};
  job.needs = [meshes = options.meshes, mends = options.crossings != "keep", mend](const JobState& state) {
    std::vector<StageNeed> needs = import_needs(state, meshes, merge_import);
    MeshSize all{0, 0};
    for (std::size_t i = 0; i < meshes; ++i) {
      const MeshSize mesh = claimed_mesh_size(state.inputs.at(i));
      all.vertices += mesh.vertices, all.faces += mesh.faces;
    }
    if (mends)
      for (const StageNeed& need : crossing_needs(mend, all, ImportPlan::kBrickVertices))
        needs.push_back(need);
    for (const StageNeed& need : merge_needs(state.run, all)) needs.push_back(need);
    const std::uint64_t vertices = std::min(all.vertices, ImportPlan::kBrickVertices);
    needs.push_back(store_write_need(state.run, MeshStore::block_bytes(vertices, 2 * vertices),
                                     all.vertices / ImportPlan::kBrickVertices, sort_bytes(state.run)));
    return needs;
  };
  return job;
}

}  // namespace tessera
