/// Stages "read" and "vertices" of an import: vertices to buckets, buckets to welded vertices in a canonical
/// order.
#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include <nlohmann/json.hpp>

#include "octree/error.h"
#include "stream/bucket_file.h"
#include "stream/durable_file.h"
#include "stream/stages/import_stages.h"

namespace tessera {
namespace {

using json = nlohmann::json;

constexpr std::uint64_t kDealBytes = std::uint64_t{32} << 20;  ///< open chunks while dealing out

/// A vertex on its way to its bucket.
template <class Real>
struct DealtVertex {
  std::array<Real, 3> position;
  std::uint32_t rgba;
  std::uint32_t in_file;
};

class ImportReadStage : public Stage {
 public:
  ImportReadStage(const JobState& state, ImportSource source)
      : path_(source.path(state)), source_(std::move(source)), names_(source_.folder) {}

  std::string name() const override { return source_.folder + "-read"; }
  std::size_t task_count() const override { return 0; }
  std::uint64_t task_bytes(std::size_t) const override { return 0; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "vertices"; }
  json run(std::size_t, TaskContext&) const override { return {}; }
  std::uint64_t finish_bytes() const override {
    return kDealBytes + ImportPlan::kSurveyBytes + DirectFile::kDefaultBuffer + (std::uint64_t{8} << 20);
  }

  json finish(const std::vector<json>&, TaskContext& context) const override {
    const auto mesh = open_mesh_file(path_);
    const ImportPlan plan = ImportPlan::measure(*mesh, [&] { context.check_stop(); });
    if (plan.file_vertices >= 0xffffffffu)
      throw ResourceError(path_.string() + ": has " + std::to_string(plan.file_vertices) +
                          " vertices and at most 4294967294 can be worked on: cut the mesh in parts");
    write_durably(context.create(names_.plan()), plan.to_json().dump());
    const std::uint64_t bytes =
        plan.info.double_positions ? deal<double>(*mesh, plan, context) : deal<float>(*mesh, plan, context);
    context.count_written(bytes);
    return {{"format", mesh->format()},
            {"vertices", plan.file_vertices},
            {"nonfinite_vertices", plan.nonfinite_vertices},
            {"h", plan.info.lattice.h},
            {"buckets", plan.buckets()}};
  }

 private:
  template <class Real>
  std::uint64_t deal(MeshReader& mesh, const ImportPlan& plan, TaskContext& context) const {
    BucketFileWriter out(context.create(names_.dealt_vertices()), sizeof(DealtVertex<Real>), plan.buckets(),
                         kDealBytes);
    std::uint32_t next = 0;
    std::uint64_t last_brick = ~std::uint64_t{0};
    std::size_t bucket = 0;
    mesh.read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
      context.check_stop();
      context.count_read(positions.size() * sizeof(std::array<Real, 3>));
      for (std::size_t i = 0; i < positions.size(); ++i, ++next) {
        const Double3& p = positions[i];
        if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) continue;
        const std::uint64_t brick = plan.brick_of(p);
        if (brick != last_brick) {
          bucket = plan.bucket_of_brick(brick);
          last_brick = brick;
        }
        DealtVertex<Real> v;
        for (std::size_t a = 0; a < 3; ++a) v.position[a] = static_cast<Real>(p[a]);
        v.rgba = rgba.empty() ? 0 : rgba[i];
        v.in_file = next;
        out.add(bucket, &v);
      }
    });
    return out.finish();
  }

  std::filesystem::path path_;
  ImportSource source_;
  ImportNames names_;
};

class ImportVerticesStage : public Stage {
 public:
  ImportVerticesStage(const JobState& state, ImportSource source)
      : source_(std::move(source)),
        names_(source_.folder),
        plan_(ImportPlan::from_json(json::parse(read_text(state.work / names_.plan())))),
        dealt_(state.work / names_.dealt_vertices(), record_bytes()) {}

  std::string name() const override { return source_.folder + "-vertices"; }
  std::size_t task_count() const override { return plan_.buckets(); }
  std::uint64_t units() const override { return plan_.file_vertices - plan_.nonfinite_vertices; }
  std::string unit_name() const override { return "vertices"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    return dealt_.records(task) * (record_bytes() + 16 + 24 + 4 + 8 + record_bytes()) +
           DirectFile::kDefaultBuffer + (std::uint64_t{2} << 20);
  }

  json run(std::size_t task, TaskContext& context) const override {
    return plan_.info.double_positions ? weld<double>(task, context) : weld<float>(task, context);
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{4} << 20; }
  json finish(const std::vector<json>& summaries, TaskContext& context) const override {
    std::vector<std::uint64_t> first = {0};
    std::uint64_t conflicts = 0;
    for (const json& s : summaries) {
      first.push_back(first.back() + s.at("vertices").get<std::uint64_t>());
      conflicts += s.at("colour_conflicts").get<std::uint64_t>();
    }
    write_durably(context.create(names_.numbering()), json{{"first", first}}.dump());
    return {{"vertices", first.back()},
            {"welded", plan_.file_vertices - plan_.nonfinite_vertices - first.back()},
            {"colour_conflicts", conflicts}};
  }
  std::vector<std::string> obsolete() const override { return {names_.dealt_vertices()}; }

 private:
  std::size_t record_bytes() const {
    return plan_.info.double_positions ? sizeof(DealtVertex<double>) : sizeof(DealtVertex<float>);
  }

  template <class Real>
  json weld(std::size_t task, TaskContext& context) const {
    const std::vector<DealtVertex<Real>> dealt = dealt_.load<DealtVertex<Real>>(task);
    context.count_read(dealt.size() * sizeof dealt[0]);
    struct Placed {
      std::uint64_t brick;
      std::uint32_t at;
    };
    std::vector<Placed> order(dealt.size());
    for (std::uint32_t i = 0; i < dealt.size(); ++i) {
      const auto& p = dealt[i].position;
      order[i] = {plan_.brick_of({p[0], p[1], p[2]}), i};
    }
    context.check_stop();
    // -0 and 0 are equal; of vertices at one place the colour of largest value stays.
    std::sort(order.begin(), order.end(), [&](const Placed& a, const Placed& b) {
      if (a.brick != b.brick) return a.brick < b.brick;
      const auto& va = dealt[a.at];
      const auto& vb = dealt[b.at];
      if (va.position != vb.position) return va.position < vb.position;
      return va.rgba != vb.rgba ? va.rgba > vb.rgba : va.in_file < vb.in_file;
    });
    context.check_stop();
    BucketVertices out;
    std::vector<DealtNumber> numbers(dealt.size());
    std::uint64_t conflicts = 0;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const auto& v = dealt[order[i].at];
      const bool fresh = i == 0 || v.position != dealt[order[i - 1].at].position;
      if (fresh) {
        if (out.brick.empty() || out.brick.back() != order[i].brick) {
          out.brick.push_back(order[i].brick);
          out.first.push_back(static_cast<std::uint32_t>(out.position.size()));
        }
        // One zero, so that the position says nothing of the vertices that were merged.
        out.position.push_back({v.position[0] + Real{0}, v.position[1] + Real{0}, v.position[2] + Real{0}});
        if (plan_.info.colour) out.rgba.push_back(v.rgba);
      } else if (plan_.info.colour && v.rgba != out.rgba.back()) {
        ++conflicts;
      }
      numbers[order[i].at] = {v.in_file, static_cast<std::uint32_t>(out.position.size() - 1)};
    }
    DirectFile file(context.create(names_.numbers(task)), std::size_t{1} << 20);
    file.write(numbers.data(), numbers.size() * sizeof numbers[0]);
    context.count_written(file.finish() + out.save(context.create(names_.vertices(task)), plan_.info));
    context.advance(dealt.size());
    return {{"vertices", out.position.size()}, {"colour_conflicts", conflicts}};
  }

  ImportSource source_;
  ImportNames names_;
  ImportPlan plan_;
  BucketFile dealt_;
};

}  // namespace

std::unique_ptr<Stage> make_import_read_stage(const JobState& state, const ImportSource& source) {
  return std::make_unique<ImportReadStage>(state, source);
}
std::unique_ptr<Stage> make_import_vertices_stage(const JobState& state, const ImportSource& source) {
  return std::make_unique<ImportVerticesStage>(state, source);
}

}  // namespace tessera
