#include "stream/meshes/store_write_stage.h"

#include <algorithm>
#include <utility>

#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/meshes/mesh_store_output.h"
#include "stream/meshes/parts_at_once.h"
#include "stream/runtime/serial_stage.h"

namespace tessera {
namespace {

class StoreWriteStage : public SerialStage {
 public:
  StoreWriteStage(std::string name, const JobState& state, std::filesystem::path path, MeshStore store,
                  std::string comment, std::uint64_t sort_bytes,
                  const std::optional<MeshPlacement>& placement = {})
      : name_(std::move(name)),
        run_(state.run),
        work_(state.work),
        path_(std::move(path)),
        store_(std::move(store)),
        comment_(std::move(comment)),
        sort_bytes_(sort_bytes),
        origin_((placement ? *placement : store_placement(path_, store_, 0.0)).origin) {}

  std::string name() const override { return name_; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override {
    return one_bytes() + (at_once() - 1) * store_.largest_patch_bytes();
  }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    MeshStoreOutput output;
    output.path = path_;
    output.comments = {comment_};
    output.origin = origin_;
    output.temp = work_;
    output.memory_bytes = sort_bytes_;
    output.patches_at_once = at_once();
    output.check_stop = [&] { context.check_stop(); };
    output.advance = [&](std::uint64_t faces) { context.advance(faces); };
    const MeshStoreOutputReport report = write_mesh_store(store_, output);
    context.count_written(report.bytes);
    Json result = {{"path", json_text(path_)},    {"vertices", report.vertices},
                   {"faces", report.faces},       {"synthetic_faces", report.synthetic_faces},
                   {"bytes", report.bytes},       {"double_positions", store_.info().double_positions},
                   {"shift", store_.info().shift}};
    tell_rounding(result, path_, origin_, report.rounding);
    if (report.flat_faces > 0)
      result["warnings"].push_back(
          std::to_string(report.flat_faces) +
          " of the faces written have no area, so tessera check --strict refuses the mesh: they are "
          "those of the input, or come of splitting its needles, and no flip takes them away; tessera "
          "decimate drops lines");
    return result;
  }

 private:
  /// With one patch at once.
  std::uint64_t one_bytes() const {
    return write_mesh_store_bytes(store_.largest_patch_bytes(), store_.patches().size(), sort_bytes_) +
           rounding_check_bytes(path_, store_.info().double_positions, 3 * store_.face_count());
  }
  std::size_t at_once() const { return parts_at_once(run_, one_bytes(), store_.largest_patch_bytes()); }

  std::string name_;
  RunOptions run_;
  std::filesystem::path work_;
  std::filesystem::path path_;
  MeshStore store_;
  std::string comment_;
  std::uint64_t sort_bytes_;
  Double3 origin_;
};

}  // namespace

std::unique_ptr<Stage> make_store_write_stage(const JobState& state, MeshStore store, std::string comment,
                                              std::uint64_t sort_bytes,
                                              const std::optional<MeshPlacement>& placement) {
  return std::make_unique<StoreWriteStage>("write", state, state.output, std::move(store), std::move(comment),
                                           sort_bytes, placement);
}

MeshPlacement store_placement(const std::filesystem::path& output, const MeshStore& store, double tolerance) {
  const MeshBox box = grown(store.box(), tolerance);
  return place_mesh(output, store.info().double_positions, box.low, box.high,
                    fine_rounding(store.face_count(), box.low, box.high, tolerance));
}

void tell_rounding(Json& result, const std::filesystem::path& output, const Double3& origin,
                   const MeshRounding& rounding) {
  Json warnings = result.value("warnings", Json::array());
  if (origin != Double3{0, 0, 0}) {
    result["origin"] = origin;
    if (!stl_shift_path(output).empty()) warnings.push_back(stl_shift_notice(output, origin));
  }
  for (const std::string& notice : threemf_notices(output, origin, 0.0)) warnings.push_back(notice);
  if (rounding.largest > 0.0) result["rounding"] = rounding.largest;
  for (const std::string& notice : rounding_notices(rounding)) warnings.push_back(notice);
  if (rounding.merged_vertices > 0) result["merged_by_rounding"] = rounding.merged_vertices;
  if (rounding.flattened_faces > 0) result["flattened_by_rounding"] = rounding.flattened_faces;
  if (rounding.joined_vertices > 0) result["joined_by_format"] = rounding.joined_vertices;
  if (rounding.open) result["open"] = true;
  if (!warnings.empty()) result["warnings"] = std::move(warnings);
}

std::string origin_text(const Json& result) {
  if (!result.is_object() || !result.contains("origin")) return "";
  if (stl_shift_path(bytes_of_json_text(result.at("path").get<std::string>())).empty()) return "";
  return stl_shift_text(result.at("origin").get<Double3>());
}

SidecarOutput known_origin() {
  return {stl_shift_path, "the origin beside -o", false,
          [](const Json& report) { return origin_text(report.value("mesh", Json::object())); }};
}

std::uint64_t sort_bytes(const RunOptions& run) {
  return std::min<std::uint64_t>(std::uint64_t{64} << 20, run.memory_bytes / 8);
}

StageNeed store_write_need(const RunOptions& run, std::uint64_t patch_bytes, std::uint64_t patches,
                           std::uint64_t sort_bytes) {
  const std::uint64_t write = write_mesh_store_bytes(patch_bytes, patches, sort_bytes);
  return {"write", write, max_bytes_at_once(run, write, patch_bytes)};
}

std::unique_ptr<Stage> make_keep_raw_stage(const JobState& state, MeshStore store, std::string comment,
                                           std::uint64_t sort_bytes) {
  return std::make_unique<StoreWriteStage>("keep-raw", state, raw_output_path(state.output), std::move(store),
                                           std::move(comment), sort_bytes);
}

std::filesystem::path raw_output_path(const std::filesystem::path& output) {
  std::filesystem::path path = output;
  return path.replace_extension(".raw" + output.extension().string());
}

}  // namespace tessera
