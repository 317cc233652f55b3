#include "stream/meshes/store_write_stage.h"

#include <algorithm>
#include <utility>

#include <nlohmann/json.hpp>

#include "stream/files/path_text.h"
#include "stream/meshes/mesh_store_output.h"
#include "stream/runtime/serial_stage.h"

namespace tessera {
namespace {

using json = nlohmann::json;

class StoreWriteStage : public SerialStage {
 public:
  StoreWriteStage(std::string name, const JobState& state, std::filesystem::path path, MeshStore store,
                  std::string comment, std::uint64_t sort_bytes)
      : name_(std::move(name)),
        work_(state.work),
        path_(std::move(path)),
        store_(std::move(store)),
        comment_(std::move(comment)),
        sort_bytes_(sort_bytes) {}

  std::string name() const override { return name_; }
  std::uint64_t units() const override { return store_.face_count(); }
  std::string unit_name() const override { return "faces"; }
  std::uint64_t finish_bytes() const override {
    return write_mesh_store_bytes(store_.largest_patch_bytes(), store_.patches().size(), sort_bytes_);
  }

  json finish(const std::vector<json>&, TaskContext& context) const override {
    MeshStoreOutput output;
    output.path = path_;
    output.comments = {comment_};
    output.temp = work_;
    output.memory_bytes = sort_bytes_;
    output.check_stop = [&] { context.check_stop(); };
    output.advance = [&](std::uint64_t faces) { context.advance(faces); };
    const MeshStoreOutputReport report = write_mesh_store(store_, output);
    context.count_written(report.bytes);
    return {{"path", json_text(path_)},    {"vertices", report.vertices},
            {"faces", report.faces},       {"synthetic_faces", report.synthetic_faces},
            {"bytes", report.bytes},       {"double_positions", store_.info().double_positions},
            {"shift", store_.info().shift}};
  }

 private:
  std::string name_;
  std::filesystem::path work_;
  std::filesystem::path path_;
  MeshStore store_;
  std::string comment_;
  std::uint64_t sort_bytes_;
};

}  // namespace

std::unique_ptr<Stage> make_store_write_stage(const JobState& state, MeshStore store, std::string comment,
                                              std::uint64_t sort_bytes) {
  return std::make_unique<StoreWriteStage>("write", state, state.output, std::move(store), std::move(comment),
                                           sort_bytes);
}

std::uint64_t sort_bytes(const RunOptions& run) {
  return std::min<std::uint64_t>(std::uint64_t{64} << 20, run.memory_bytes / 8);
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
