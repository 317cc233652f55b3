#include "stream/stages/decimate/certify_stage.h"

#include <algorithm>
#include <map>
#include <optional>
#include <span>
#include <type_traits>

#include "octree/error.h"
#include "stream/check/compare_cells.h"
#include "stream/check/compared_before.h"
#include "stream/check/mesh_compare.h"
#include "stream/files/direct_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/task_files.h"
#include "stream/meshes/parts_at_once.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

constexpr double kMeasuredShare = 1e-3;  ///< of the diagonal: the scale of what is only measured
constexpr double kMaxDistance = 1.25;    ///< times the tolerance: far enough to say how much it is missed by
constexpr std::size_t kMaxProofTasks = 400;
constexpr std::size_t kFullTask = 8;   ///< cells: a task is worth a file from here
constexpr std::size_t kFewTasks = 16;  ///< as far as there are so many: else threads would go without

/// At the end: its bounds, its place among those to be searched again, and in a tree what that finds, if each is.
constexpr std::uint64_t kFinishCellBytes = sizeof(CellBounds) + 64 + sizeof(CellComparison) + 64;

static_assert(std::is_trivially_copyable_v<CellComparison>,
              "results of tasks are kept as they lie in memory");

class CertifyStage : public Stage {
 public:
  CertifyStage(const JobState& state, const CertifyRequest& request)
      : work_(state.work),
        request_(request),
        mesh_(request.mesh(state)),
        reference_(request.reference(state)) {
    CompareOptions options;
    options.tolerance = request_.tolerance > 0.0 ? request_.tolerance
                        : request_.scale > 0.0   ? request_.scale
                                                 : kMeasuredShare * reference_.diagonal();
    options.max_distance = kMaxDistance * options.tolerance;
    begun_ = begin_comparison(mesh_, reference_, options);
    cells_ = make_compare_cells(mesh_, reference_, options.max_distance, options.cell_faces);
    per_task_ = cells_per_task(cells_.size());
    if (request_.tight && !alone())
      lanes_ = parts_at_once(state.run, certify_finish_bytes(largest_cell(), cells_.size()),
                             certify_lane_bytes(largest_cell()));
    if (!request_.name_before.empty())
      before_.emplace(request.mesh_before(state), reference_, options.max_distance, options.cell_faces);
  }
  std::string name() const override { return request_.name; }
  std::size_t task_count() const override { return (cells_.size() + per_task_ - 1) / per_task_; }
  std::uint64_t units() const override { return cells_.size(); }
  std::string unit_name() const override { return "cells"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    std::uint64_t maximum = 0;
    for (std::size_t c = first(task); c < first(task + 1); ++c) maximum = std::max(maximum, cells_[c].bytes);
    return certify_task_bytes(maximum);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    DirectFile file(context.create(file_name(request_.name, task)), std::size_t{1} << 16);
    std::vector<FailedFace> failed;
    std::size_t kept = 0;
    for (std::size_t c = first(task); c < first(task + 1); ++c) {
      context.check_stop();
      CellComparison result;
      if (proven_before(cells_[c].box, result))
        ++kept;
      else
        result = compare_cell(mesh_, reference_, begun_, cells_[c].box, alone() ? 0.0 : begun_.tolerance,
                              retry() && proves() ? &failed : nullptr, [&] { context.check_stop(); });
      if (failed.size() > kMaxFailedFaces) failed.resize(kMaxFailedFaces);
      file.write(&result, sizeof result);
      context.advance(1);
    }
    context.count_written(file.finish());
    if (!failed.empty()) context.count_written(write_failed_faces(context.create(failed_name(task)), failed));
    return {{"failed_faces", failed.size()}, {"cells_kept", kept}};
  }

  std::uint64_t finish_bytes() const override {
    const std::uint64_t lane = certify_lane_bytes(largest_cell());
    return certify_finish_bytes(largest_cell(), cells_.size()) + (lanes_ - 1) * lane;
  }

  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::vector<CellBounds> bounds;
    bounds.reserve(cells_.size());
    for_each_result([&](std::size_t, const CellComparison& cell) { bounds.emplace_back(cell); });
    std::map<std::size_t, CellComparison> tight;
    std::vector<CellComparison> ring(lanes_);
    const auto again = [&](std::span<const std::size_t> which, double enough) {
      std::vector<CellBounds> found;
      parallel_in_order(
          which.size(), lanes_,
          [&](std::size_t k) {
            ring[k % lanes_] = compare_cell(mesh_, reference_, begun_, cells_[which[k]].box, enough, nullptr,
                                            [&] { context.check_stop(); });
          },
          [&](std::size_t k) { found.emplace_back(tight[which[k]] = ring[k % lanes_]); });
      return found;
    };
    if (request_.tight) tighten_cells(bounds, begun_.tolerance, again);
    MeshComparison sum = begun_;
    for_each_result([&](std::size_t c, const CellComparison& cell) {
      const auto found = tight.find(c);
      add_cell(sum, found == tight.end() ? cell : found->second);
    });
    const std::string complaint = request_.tolerance > 0.0 ? sum.complaint(false) : "";
    const double rounding = add_rounding(sum);
    Json report = to_json(sum);
    if (rounding > 0.0) report["rounding"] = rounding;
    std::vector<FailedFace> failed = crossing_faces();
    if (!failed.empty()) report["crossing_faces"] = failed.size();
    if (!complaint.empty()) {
      const std::size_t crossing = failed.size();
      for (std::size_t task = 0; task < summaries.size() && failed.size() < kMaxFailedFaces; ++task)
        if (summaries[task].at("failed_faces").natural() > 0)
          for (const FailedFace& face : read_failed_faces(work_ / failed_name(task)))
            if (failed.size() < kMaxFailedFaces) failed.push_back(face);
      if (failed.size() == crossing) throw ValidationError("the result gets no name: " + complaint);
      report["failed_faces"] = failed.size() - crossing;
    }
    if (!failed.empty())
      context.count_written(write_failed_faces(context.create(request_.failed_file), failed));
    report.erase("seconds");  // the stage has its own
    if (before_) {
      std::size_t kept = 0;
      for (const Json& s : summaries) kept += s.at("cells_kept").get<std::size_t>();
      report["cells_kept"] = kept;
    }
    return report;
  }

  /// What is left to a round behind this one goes with the work directory.
  std::vector<std::string> obsolete() const override {
    return retry() && proves() ? std::vector<std::string>{} : std::vector<std::string>{request_.name + "/"};
  }

 private:
  std::uint64_t largest_cell() const {
    std::uint64_t maximum = 0;
    for (const CompareCell& cell : cells_) maximum = std::max(maximum, cell.bytes);
    return maximum;
  }
  /// The only cell holds the largest distance: searched to the end at once, it is not searched again.
  bool alone() const { return request_.tight && cells_.size() == 1; }
  static std::size_t cells_per_task(std::size_t cells) {
    return std::max(std::clamp<std::size_t>(cells / kFewTasks, 1, kFullTask),
                    (cells + kMaxProofTasks - 1) / kMaxProofTasks);
  }

  /// A face moves no farther than its corners do.
  double add_rounding(MeshComparison& sum) const {
    if (request_.placement.rounding == 0.0) return 0.0;
    const double rounding = float_rounding(request_.placement.origin, mesh_.box().low, mesh_.box().high);
    for (DirectedDeviation* direction : {&sum.there, &sum.back})
      for (DeviationReport* found : {&direction->surface, &direction->border})
        if (found->area > 0.0) found->upper += rounding;
    sum.tolerance += rounding;
    return rounding;
  }

  /// What the round before found in a cell that it proved and that is the same now.
  bool proven_before(const MeshBox& cell, CellComparison& result) const {
    if (!before_) return false;
    const std::int64_t then = before_->same(mesh_, cell);
    if (then < 0) return false;
    const std::size_t c = static_cast<std::size_t>(then), per_task = cells_per_task(before_->cells());
    const ReadFile file(work_ / file_name(request_.name_before, c / per_task));
    file.read_at(c % per_task * sizeof result, &result, sizeof result);
    const CellBounds bounds(result);
    return std::max(bounds.upper[0], bounds.upper[1]) <= begun_.tolerance;
  }

  void for_each_result(const std::function<void(std::size_t, const CellComparison&)>& use) const {
    for (std::size_t task = 0; task < task_count(); ++task) {
      const ReadFile file(work_ / file_name(request_.name, task));
      for (std::size_t c = first(task); c < first(task + 1); ++c) {
        CellComparison cell;
        file.read_at((c - first(task)) * sizeof cell, &cell, sizeof cell);
        use(c, cell);
      }
    }
  }
  std::size_t first(std::size_t task) const { return std::min(cells_.size(), task * per_task_); }
  static std::string file_name(const std::string& stage, std::size_t task) {
    return stage + "/" + task_file_stem(task) + ".bin";
  }

  std::string failed_name(std::size_t task) const {
    return request_.name + "/" + task_file_stem(task) + ".failed";
  }
  /// At most half of what a round takes: the others are those that are not proven.
  std::vector<FailedFace> crossing_faces() const {
    const std::filesystem::path file = work_ / request_.crossing_file;
    if (!retry() || request_.crossing_file.empty() || !std::filesystem::exists(file)) return {};
    std::vector<FailedFace> faces = read_failed_faces(file);
    faces.resize(std::min(faces.size(), kMaxFailedFaces / 2));
    return faces;
  }
  bool proves() const { return request_.tolerance > 0.0; }
  bool retry() const { return !request_.failed_file.empty(); }

  std::filesystem::path work_;
  CertifyRequest request_;
  MeshStore mesh_;
  MeshStore reference_;
  MeshComparison begun_;
  std::vector<CompareCell> cells_;
  std::size_t per_task_ = 1;
  std::size_t lanes_ = 1;  ///< cells that the end compares at once
  std::optional<ComparedBefore> before_;
};

}  // namespace

std::uint64_t certify_task_bytes(std::uint64_t cell_bytes) {
  return cell_bytes + (std::uint64_t{2} << 20) + 4 * kMaxFailedFaces * sizeof(FailedFace);
}

std::uint64_t certify_lane_bytes(std::uint64_t cell_bytes) {
  return cell_bytes + (std::uint64_t{2} << 20) + sizeof(CellComparison);
}

std::uint64_t certify_finish_bytes(std::uint64_t cell_bytes, std::uint64_t cells) {
  return certify_lane_bytes(cell_bytes) + 3 * kMaxFailedFaces * sizeof(FailedFace) + cells * kFinishCellBytes;
}

std::unique_ptr<Stage> make_certify_stage(const JobState& state, const CertifyRequest& request) {
  return std::make_unique<CertifyStage>(state, request);
}

}  // namespace tessera
