/// What the stages of a merge share.
#include <algorithm>

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/files/task_files.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/patch_runs.h"
#include "stream/stages/merge/merge_stages.h"

namespace tessera {
namespace {

constexpr std::uint64_t kTaskFaces = 100'000;

MeshBox box_of_segment(const JointEdge& e) {
  MeshBox box;
  for (std::size_t a = 0; a < 3; ++a)
    box.low[a] = std::min(e.a[a], e.b[a]), box.high[a] = std::max(e.a[a], e.b[a]);
  return box;
}

}  // namespace

void MergePlan::save(const std::filesystem::path& path) const {
  write_text(path, dump_json(fields_to_json(*this)));
}

MergePlan MergePlan::of_work(const std::filesystem::path& work) {
  auto plan = fields_from_json<MergePlan>(parse_json(read_text(work / kFile)));
  plan.info.lattice = plan.lattice;
  return plan;
}

std::string merge_import(std::size_t input) {
  return "mesh-" + std::to_string(input);
}

MergeMeshes::MergeMeshes(const std::filesystem::path& work, bool joints) : plan_(MergePlan::of_work(work)) {
  for (const std::size_t input : plan_.order)
    stores_.push_back(open_imported_mesh(work, merge_import(input)));
  if (joints) joints_ = load_merge_list<JointEdge>(work / kJointsFile, kJointsKind);
}

std::vector<MergeTask> MergeMeshes::tasks() const {
  std::vector<MergeTask> out;
  for (std::size_t r = 0; r < stores_.size(); ++r)
    for (const PatchRun& run : patch_runs(stores_[r], kTaskFaces)) out.push_back({r, run.first, run.end});
  return out;
}

std::uint64_t MergeMeshes::face_count() const {
  std::uint64_t sum = 0;
  for (const MeshStore& store : stores_) sum += store.face_count();
  return sum;
}

bool MergeMeshes::is_alone(std::size_t rank, const MeshBox& box) const {
  const MeshBox near = grown(box, plan_.range.apart + plan_.range.beyond);
  for (std::size_t r = 0; r < stores_.size(); ++r)
    if (r != rank && overlap(stores_[r].box(), near) && !stores_[r].select(near).empty()) return false;
  return true;
}

std::vector<const MergeSheet*> MergeMeshes::Near::pointers() const {
  std::vector<const MergeSheet*> out;
  for (const auto& s : sheets) out.push_back(s.get());
  return out;
}

MergeMeshes::Near MergeMeshes::load(const MeshBox& box, double margin, std::size_t own,
                                    const MeshBlock* block) const {
  Near near;
  near.sheets.resize(stores_.size());
  near.rgba.resize(stores_.size());
  const MeshBox wide = grown(box, margin);
  for (std::size_t r = 0; r < stores_.size(); ++r) {
    MeshBlock loaded;
    const bool given = r == own && block;
    if (!given) {
      if (!overlap(stores_[r].box(), wide)) continue;
      loaded = stores_[r].load_box(wide);
      if (loaded.faces.empty()) continue;
    }
    const MeshBlock& mesh = given ? *block : loaded;
    near.rgba[r] = mesh.rgba;
    std::vector<Double3> position;
    std::vector<std::array<std::uint32_t, 3>> segments;
    const MeshBox range = grown(wide, plan_.fade[r]);
    for (const JointEdge& e : joints_) {
      if (e.rank != r || !overlap(box_of_segment(e), range)) continue;
      const auto a = static_cast<std::uint32_t>(position.size());
      position.push_back(e.a);
      position.push_back(e.b);
      segments.push_back({a, a + 1, a + 1});
    }
    ClosestFaces joints;
    if (!segments.empty()) joints = ClosestFaces(position, segments, plan_.origin);
    near.sheets[r] =
        std::make_unique<MergeSheet>(SignedDistance(mesh, plan_.origin), std::move(joints), plan_.fade[r]);
  }
  return near;
}

std::uint64_t MergeMeshes::near_bytes(const MeshBox& box, double margin) const {
  std::uint64_t bytes = 0;
  for (const MeshStore& store : stores_) {
    const std::vector<std::size_t> patches = store.select(grown(box, margin));
    std::uint64_t vertices = 0, faces = 0;
    for (const std::size_t p : patches)
      vertices += store.patches()[p].vertices, faces += store.patches()[p].faces;
    bytes += store.block_bytes(patches) + SignedDistance::bytes(vertices, faces);  // as merge_near_bytes()
  }
  return bytes;
}

std::uint64_t merge_near_bytes(const MeshSize& near) {
  return MeshStore::block_bytes(near.vertices, near.faces) + SignedDistance::bytes(near.vertices, near.faces);
}

MeshStore open_merge_store(const std::filesystem::path& work, const std::string& folder) {
  return MeshStore(list_task_files(work / folder, ".tmm"));
}

MeshStore open_merged_mesh(const std::filesystem::path& work) {
  std::vector<std::filesystem::path> files = list_task_files(work / "kept", ".tmm");
  for (const auto& file : list_task_files(work / "zipped", ".tmm")) files.push_back(file);
  return MeshStore(files, list_task_files(work / "cut", ".tmm"));
}

}  // namespace tessera
