#include "stream/stages/surface/uncross_holes_stage.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"
#include "stream/points/plan.h"
#include "stream/runtime/report.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/surface/hole_files.h"
#include "stream/stages/surface/hole_limit.h"
#include "stream/stages/surface/holes_stage.h"
#include "stream/stages/surface/loops_stage.h"
#include "stream/stages/weld/mesh_around.h"
#include "stream/stages/weld/weld_stage.h"

namespace tessera {
namespace {

/// Fillings of batches that are read at a time, and the faces of one check.
constexpr std::uint64_t kUncrossHolesBytes = std::uint64_t{28} << 20;
constexpr std::size_t kOpenBatches = 4;
/// Faces at the border that another filling moved lie no farther from it, in cells.
constexpr double kMovedMargin = 3.0;

/// A filling of the job; ascending by batch, then by its place there.
struct PlacedFilling {
  std::uint32_t batch = 0, index = 0;
  Double3 low{}, high{};
};

bool overlaps(const PlacedFilling& a, const PlacedFilling& b) {
  bool apart = false;
  for (std::size_t k = 0; k < 3; ++k)
    apart = apart || a.low[k] - kMovedMargin > b.high[k] || b.low[k] - kMovedMargin > a.high[k];
  return !apart;
}

/// Which fillings lie near each other: by their low corners along the first axis.
class FillingIndex {
 public:
  void add(const PlacedFilling& filling) {
    widest_ = std::max(widest_, filling.high[0] - filling.low[0]);
    all_.push_back(filling);
  }
  void sort() {
    std::sort(all_.begin(), all_.end(),
              [](const PlacedFilling& a, const PlacedFilling& b) { return a.low[0] < b.low[0]; });
  }
  /// The others near it, in the order of the job.
  std::vector<PlacedFilling> near(const PlacedFilling& filling) const {
    std::vector<PlacedFilling> out;
    const double first = filling.low[0] - widest_ - 2 * kMovedMargin;
    auto at = std::lower_bound(all_.begin(), all_.end(), first,
                               [](const PlacedFilling& f, double x) { return f.low[0] < x; });
    for (; at != all_.end() && at->low[0] <= filling.high[0] + kMovedMargin; ++at)
      if (!(at->batch == filling.batch && at->index == filling.index) && overlaps(*at, filling))
        out.push_back(*at);
    std::sort(out.begin(), out.end(), [](const PlacedFilling& a, const PlacedFilling& b) {
      return a.batch != b.batch ? a.batch < b.batch : a.index < b.index;
    });
    return out;
  }
  std::uint64_t bytes() const { return all_.size() * sizeof(PlacedFilling); }

 private:
  std::vector<PlacedFilling> all_;
  double widest_ = 0.0;
};

/// The fillings of a batch, and where faces and rim of each begin.
struct OpenBatch {
  HoleFillings fillings;
  std::vector<std::size_t> face, rim;

  explicit OpenBatch(const std::filesystem::path& path) : fillings(HoleFillings::load(path)) {
    std::size_t f = 0, r = 0;
    for (const FillingSpan& s : fillings.spans) {
      face.push_back(f), rim.push_back(r);
      f += s.faces, r += s.rim;
    }
  }

  /// Its faces, in cells from `origin`; new vertices are named by batch and number.
  void add_faces(std::uint32_t batch, std::uint32_t index, const Double3& origin,
                 std::vector<ContactFace>& out) const {
    const FillingSpan& span = fillings.spans[index];
    std::map<std::uint64_t, Double3> at;
    for (std::size_t r = rim[index]; r < rim[index] + span.rim; ++r)
      at[fillings.rim[r].number] = fillings.rim[r].position;
    for (std::size_t f = face[index]; f < face[index] + span.faces; ++f) {
      ContactFace made;
      for (std::size_t k = 0; k < 3; ++k) {
        const std::uint64_t v = fillings.faces[f][k];
        const bool fresh = (v & HoleFillings::kNew) != 0;
        const Double3& p = fresh ? fillings.position[v & ~HoleFillings::kNew] : at.at(v);
        made.corner[k] = p - origin;
        made.vertex[k] = fresh ? v | std::uint64_t{batch} << 32 : v;
      }
      if (!collinear(made.corner[0], made.corner[1], made.corner[2])) out.push_back(made);
    }
  }
};

class UncrossHolesStage : public Stage {
 public:
  explicit UncrossHolesStage(const JobState& state)
      : work_(state.work),
        needed_(hole_limit(state, Plan::of_work(state.work)).membranes),
        files_(needed_ ? list_all_filling_files(state.work) : std::vector<std::filesystem::path>{}),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)) {
    for (std::uint32_t b = 0; b < files_.size(); ++b) {
      std::uint32_t index = 0;
      for (const FillingSpan& s : load_filling_spans(files_[b])) index_.add({b, index++, s.low, s.high});
    }
    index_.sort();
  }

  std::string name() const override { return "uncross-holes"; }
  std::size_t task_count() const override { return files_.size(); }
  std::uint64_t units() const override { return files_.size(); }
  std::string unit_name() const override { return "batches"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return kUncrossHolesBytes + index_.bytes() + MeshAround::bytes(store_.patches());
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const auto batch = static_cast<std::uint32_t>(task);
    std::map<std::uint32_t, OpenBatch> open;
    MeshAround around(work_, store_, numbering_);
    const OpenBatch own(files_[task]);
    std::vector<std::uint8_t> gone(own.fillings.spans.size(), 0);
    std::uint64_t vertices = 0, faces = 0, count = 0;
    for (std::uint32_t i = 0; i < gone.size(); ++i) {
      context.check_stop();
      const FillingSpan& span = own.fillings.spans[i];
      const std::vector<PlacedFilling> near = index_.near({batch, i, span.low, span.high});
      if (near.empty() || !crosses(own, {batch, i, span.low, span.high}, near, open, around)) continue;
      gone[i] = 1;
      ++count, vertices += span.vertices, faces += span.faces;
    }
    if (count > 0)
      without_fillings(own.fillings, gone)
          .save(context.create(kept_filling_file_name(files_[task].filename().string())));
    context.advance(1);
    return {{"fillings", count}, {"vertices", vertices}, {"faces", faces}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"fillings", 0}, {"vertices", 0}, {"faces", 0}});
  }

 private:
  /// Whether faces of a filling meet those of an earlier one, or the mesh as it is now.
  bool crosses(const OpenBatch& own, const PlacedFilling& filling, const std::vector<PlacedFilling>& near,
               std::map<std::uint32_t, OpenBatch>& open, MeshAround& around) const {
    Double3 origin = filling.low;
    for (double& c : origin) c = std::floor(c);
    std::vector<ContactFace> faces;
    own.add_faces(filling.batch, filling.index, origin, faces);
    const std::size_t count = faces.size();
    std::vector<ContactFace> mesh;
    around.gather_near(origin, faces, 0.0, mesh);
    for (const PlacedFilling& other : near) {
      if (other.batch > filling.batch || (other.batch == filling.batch && other.index > filling.index)) break;
      if (other.batch == filling.batch) {
        own.add_faces(other.batch, other.index, origin, faces);
        continue;
      }
      if (open.size() > kOpenBatches) open.erase(open.begin());
      const auto there = open.try_emplace(other.batch, files_[other.batch]).first;
      there->second.add_faces(other.batch, other.index, origin, faces);
    }
    faces.insert(faces.end(), mesh.begin(), mesh.end());
    bool found = false;
    block_contacts(faces, kAllSpace,
                   [&](std::uint32_t a, std::uint32_t, FaceContact) { found = found || a < count; });
    return found;
  }

  std::filesystem::path work_;
  bool needed_;
  std::vector<std::filesystem::path> files_;
  PatchStore store_;
  Numbering numbering_;
  FillingIndex index_;
};

constexpr double kUncrossHolesTime = 0.05;  ///< microseconds a face

}  // namespace

std::unique_ptr<Stage> make_uncross_holes_stage(const JobState& state) {
  return std::make_unique<UncrossHolesStage>(state);
}

StageForecast forecast_uncross_holes(const PlannedScan& scan) {
  if (scan.max_chained_edges == 0) return idle_forecast();
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(MeshAround::bytes) + kUncrossHolesBytes,
          .sure_bytes = MeshAround::bytes({}) + kUncrossHolesBytes,
          .files = scan.groups.size(),
          .processor_us = scan.faces * kUncrossHolesTime};
}

std::vector<StageEntry> hole_stages() {
  return {{"loops", make_loops_stage, forecast_loops},
          {"holes", make_holes_stage, forecast_holes},
          {"uncross-holes", make_uncross_holes_stage, forecast_uncross_holes}};
}

Json holes_of(const Json& report) {
  Json holes = result_of(report, "holes");
  const Json gone = result_of(report, "uncross-holes");
  if (!holes.is_object() || !gone.is_object()) return holes;
  const auto less = [&](const char* key, const char* by) {
    holes[key] = holes.at(key).get<std::uint64_t>() - gone.at(by).get<std::uint64_t>();
  };
  less("filled", "fillings"), less("vertices", "vertices"), less("faces", "faces");
  holes["left_crossing"] =
      holes.at("left_crossing").get<std::uint64_t>() + gone.at("fillings").get<std::uint64_t>();
  return holes;
}

}  // namespace tessera
