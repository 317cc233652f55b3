/// Stages "read" and "vertices" of an import: vertices to buckets, buckets to welded vertices in a canonical
/// order.
#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "octree/error.h"
#include "stream/files/bucket_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/job_scope.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/import/file_vertices.h"
#include "stream/import/import_bytes.h"
#include "stream/import/import_ranges.h"
#include "stream/import/import_stages.h"
#include "stream/meshes/parts_at_once.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/serial_stage.h"

namespace tessera {
namespace {

/// A vertex on its way to its bucket.
template <class Real>
struct DealtVertex {
  std::array<Real, 3> position;
  std::uint32_t rgba;
  std::uint32_t in_file;
};

/// The first 32 bits of a number such that their order is that of the numbers; equal ones may belong to different
/// numbers. \pre finite
std::uint32_t leading_bits(float value) {
  const auto bits = std::bit_cast<std::uint32_t>(value + 0.0f);  // one zero
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}
std::uint32_t leading_bits(double value) {
  const auto bits = static_cast<std::uint32_t>(std::bit_cast<std::uint64_t>(value + 0.0) >> 32);
  return bits >> 31 ? ~bits : bits | 0x80000000u;
}

/// By their upper halves, those of the same in the order they were in: counting passes over the bytes that differ.
void sort_by_upper_half(std::span<std::uint64_t> values, std::vector<std::uint64_t>& scratch) {
  scratch.resize(values.size());
  std::span<std::uint64_t> from = values, to = scratch;
  for (unsigned shift = 32; shift < 64; shift += 8) {
    std::array<std::uint32_t, 257> begin{};
    for (const std::uint64_t v : from) ++begin[(v >> shift & 255u) + 1];
    if (*std::max_element(begin.begin(), begin.end()) == from.size()) continue;
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    for (const std::uint64_t v : from) to[begin[v >> shift & 255u]++] = v;
    std::swap(from, to);
  }
  if (from.data() != values.data()) std::copy(from.begin(), from.end(), values.begin());
}

/// use(values) of all that follow one another with the same upper half, where they are several.
template <class Use>
void for_runs(std::span<std::uint64_t> values, const Use& use) {
  for (std::size_t begin = 0, end = 0; begin < values.size(); begin = end) {
    while (end < values.size() && values[end] >> 32 == values[begin] >> 32) ++end;
    if (end > begin + 1) use(values.subspan(begin, end - begin));
  }
}

class ImportReadStage : public SerialStage {
 public:
  ImportReadStage(const JobState& state, ImportSource source)
      : path_(source.path(state)),
        keep_bytes_(is_given(path_)
                        ? 0
                        : import_keep_bytes(state.run)),  // what is in memory is read again for nothing
        bytes_(import_read_bytes(state.run)),
        lanes_(parts_at_once(state.run, bytes_, kImportLaneBytes)),
        source_(std::move(source)),
        names_(source_.folder) {}

  std::string name() const override { return source_.folder + "-read"; }
  std::uint64_t units() const override { return 0; }
  std::string unit_name() const override { return "vertices"; }
  std::uint64_t finish_bytes() const override { return bytes_ + (lanes_ - 1) * kImportLaneBytes; }

  Json finish(const std::vector<Json>&, TaskContext& context) const override {
    const auto mesh = open_mesh_file(path_);
    FileVertices vertices(*mesh, keep_bytes_, lanes_);
    ImportPlan plan = ImportPlan::measure(
        mesh->header(), [&](const auto& sink) { vertices.read_all(sink); }, [&] { context.check_stop(); },
        source_.brick_vertices);
    plan.confidence = mesh->mean_confidence();
    if (plan.file_vertices >= 0xffffffffu)
      throw ResourceError(path_.string() + ": has " + std::to_string(plan.file_vertices) +
                          " vertices and at most 4294967294 can be worked on: cut the mesh in parts");
    write_text(context.create(names_.plan()), dump_json(fields_to_json(plan)));
    const std::uint64_t bytes = plan.info.double_positions ? deal<double>(vertices, plan, context)
                                                           : deal<float>(vertices, plan, context);
    context.count_written(bytes);
    return {{"format", mesh->format()},
            {"vertices", plan.file_vertices},
            {"nonfinite_vertices", plan.nonfinite_vertices},
            {"h", plan.info.lattice.h},
            {"buckets", plan.buckets()}};
  }

 private:
  /// Vertices of one range, those of one bucket that follow one another together.
  template <class Real>
  struct Dealt {
    std::vector<DealtVertex<Real>> vertices;
    std::vector<BucketRun> runs;

    void clear() {
      vertices.clear();
      runs.clear();
    }
    void write(BucketFileWriter& out) const {
      std::size_t at = 0;
      for (const BucketRun& run : runs) {
        out.add_run(run.bucket, vertices.data() + at, run.count);
        at += run.count;
      }
    }
  };

  /// \param first  number in the file of the first vertex
  template <class Real>
  static void deal_batch(const ImportPlan& plan, std::uint32_t first, std::span<const Double3> positions,
                         std::span<const std::uint32_t> rgba, Dealt<Real>& dealt) {
    const GridCells brick_of = plan.bricks();
    std::uint64_t last_brick = ~std::uint64_t{0};
    BucketRun run;
    const auto end_run = [&] {
      if (run.count > 0) add_to_runs(dealt.runs, run.bucket, run.count);
      run.count = 0;
    };
    dealt.vertices.reserve(dealt.vertices.size() + positions.size());
    for (std::size_t i = 0; i < positions.size(); ++i) {
      const Double3& p = positions[i];
      if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) continue;
      const std::uint64_t brick = brick_of(p);
      if (brick != last_brick) {
        end_run();
        run.bucket = static_cast<std::uint32_t>(plan.bucket_of_brick(brick));
        last_brick = brick;
      }
      DealtVertex<Real> v;
      for (std::size_t a = 0; a < 3; ++a) v.position[a] = static_cast<Real>(p[a]);
      v.rgba = rgba.empty() ? 0 : rgba[i];
      v.in_file = first + static_cast<std::uint32_t>(i);
      dealt.vertices.push_back(v);
      ++run.count;
    }
    end_run();
  }

  template <class Real>
  std::uint64_t deal(FileVertices& vertices, const ImportPlan& plan, TaskContext& context) const {
    BucketFileWriter out(context.create(names_.dealt_vertices()), sizeof(DealtVertex<Real>), plan.buckets(),
                         kImportDealBytes);
    std::vector<Dealt<Real>> slots(vertices.lanes());
    const bool in_order = vertices.ranges() == 1;
    const auto make = [&](std::size_t range) {
      Dealt<Real>& dealt = slots[range % slots.size()];
      dealt.clear();
      std::uint64_t next = range * kImportRange;
      vertices.read(range, [&](std::span<const Double3> positions, std::span<const std::uint32_t> rgba) {
        context.check_stop();
        context.count_read(positions.size() * sizeof(std::array<Real, 3>));
        deal_batch(plan, static_cast<std::uint32_t>(next), positions, rgba, dealt);
        next += positions.size();
        if (!in_order) return;
        dealt.write(out);
        dealt.clear();
      });
    };
    parallel_in_order(vertices.ranges(), slots.size(), make,
                      [&](std::size_t range) { slots[range % slots.size()].write(out); });
    return out.finish();
  }

  std::filesystem::path path_;
  std::uint64_t keep_bytes_, bytes_;
  std::size_t lanes_;  ///< ranges on their way at once
  ImportSource source_;
  ImportNames names_;
};

class ImportVerticesStage : public Stage {
 public:
  ImportVerticesStage(const JobState& state, ImportSource source)
      : source_(std::move(source)),
        names_(source_.folder),
        plan_(fields_from_json<ImportPlan>(parse_json(read_text(state.work / names_.plan())))),
        dealt_(state.work / names_.dealt_vertices(), record_bytes()) {}

  std::string name() const override { return source_.folder + "-vertices"; }
  std::size_t task_count() const override { return plan_.buckets(); }
  std::uint64_t units() const override { return plan_.file_vertices - plan_.nonfinite_vertices; }
  std::string unit_name() const override { return "vertices"; }
  std::uint64_t task_bytes(std::size_t task) const override {
    return import_vertices_task_bytes(dealt_.records(task), record_bytes());
  }

  Json run(std::size_t task, TaskContext& context) const override {
    return plan_.info.double_positions ? weld<double>(task, context) : weld<float>(task, context);
  }

  std::uint64_t finish_bytes() const override { return kImportVerticesFinishBytes; }
  Json finish(const std::vector<Json>& summaries, TaskContext& context) const override {
    std::vector<std::uint64_t> first = {0};
    std::uint64_t conflicts = 0;
    for (const Json& s : summaries) {
      first.push_back(first.back() + s.at("vertices").get<std::uint64_t>());
      conflicts += s.at("colour_conflicts").get<std::uint64_t>();
    }
    write_text(context.create(names_.numbering()), dump_json(Json{{"first", first}}));
    return {{"vertices", first.back()},
            {"welded", plan_.file_vertices - plan_.nonfinite_vertices - first.back()},
            {"colour_conflicts", conflicts}};
  }
  std::vector<std::string> obsolete() const override { return {names_.dealt_vertices()}; }

 private:
  std::size_t record_bytes() const {
    return plan_.info.double_positions ? sizeof(DealtVertex<double>) : sizeof(DealtVertex<float>);
  }

  /// Indices of the vertices in the lower halves, by brick, then by position.
  template <class Real>
  std::vector<std::uint64_t> sort_vertices(const std::vector<DealtVertex<Real>>& dealt,
                                           std::vector<std::uint64_t>& bricks,
                                           std::vector<std::uint32_t>& first) const {
    const GridCells brick_of = plan_.bricks();
    std::vector<std::uint64_t> brick(dealt.size());
    for (std::size_t i = 0; i < dealt.size(); ++i) {
      const auto& p = dealt[i].position;
      brick[i] = brick_of({p[0], p[1], p[2]});
      if (bricks.empty() || bricks.back() != brick[i]) bricks.push_back(brick[i]);
    }
    std::sort(bricks.begin(), bricks.end());
    bricks.erase(std::unique(bricks.begin(), bricks.end()), bricks.end());
    const auto brick_index = [&](std::size_t i, std::size_t last) {
      if (last < bricks.size() && bricks[last] == brick[i]) return last;
      return static_cast<std::size_t>(std::lower_bound(bricks.begin(), bricks.end(), brick[i]) -
                                      bricks.begin());
    };
    first.assign(bricks.size() + 1, 0);
    std::size_t last = 0;
    for (std::size_t i = 0; i < dealt.size(); ++i) ++first[(last = brick_index(i, last)) + 1];
    std::partial_sum(first.begin(), first.end(), first.begin());
    std::vector<std::uint64_t> order(dealt.size());
    std::vector<std::uint32_t> next(first.begin(), first.end());
    for (std::size_t i = 0; i < dealt.size(); ++i)
      order[next[last = brick_index(i, last)]++] =
          std::uint64_t{leading_bits(dealt[i].position[0])} << 32 | i;
    // -0 and 0 are equal; of vertices at one place the colour of largest value stays.
    const auto before = [&](std::uint64_t a, std::uint64_t b) {
      const auto& va = dealt[static_cast<std::uint32_t>(a)];
      const auto& vb = dealt[static_cast<std::uint32_t>(b)];
      if (va.position != vb.position) return va.position < vb.position;
      return va.rgba != vb.rgba ? va.rgba > vb.rgba : va.in_file < vb.in_file;
    };
    std::vector<std::uint64_t> scratch;
    for (std::size_t b = 0; b < bricks.size(); ++b) {
      const std::span<std::uint64_t> of_brick(order.data() + first[b], first[b + 1] - first[b]);
      sort_by_upper_half(of_brick, scratch);
      for_runs(of_brick, [&](std::span<std::uint64_t> same) {
        if (sizeof(Real) > sizeof(std::uint32_t)) return std::sort(same.begin(), same.end(), before);
        for (std::uint64_t& v : same)  // of the same x
          v = std::uint64_t{leading_bits(dealt[static_cast<std::uint32_t>(v)].position[1])} << 32 |
              static_cast<std::uint32_t>(v);
        std::sort(same.begin(), same.end());
        for_runs(same, [&](std::span<std::uint64_t> run) { std::sort(run.begin(), run.end(), before); });
      });
    }
    return order;
  }

  template <class Real>
  Json weld(std::size_t task, TaskContext& context) const {
    const std::vector<DealtVertex<Real>> dealt = dealt_.load<DealtVertex<Real>>(task);
    context.count_read(dealt.size() * sizeof dealt[0]);
    std::vector<std::uint64_t> bricks;  // in order
    std::vector<std::uint32_t> first;   // place of the first vertex of each, one more at the end
    const std::vector<std::uint64_t> order = sort_vertices<Real>(dealt, bricks, first);
    context.check_stop();
    BucketVertices out;
    out.position.reserve(dealt.size());
    if (plan_.info.colour) out.rgba.reserve(dealt.size());
    std::vector<DealtNumber> numbers(dealt.size());
    std::uint64_t conflicts = 0;
    std::size_t brick = 0;
    for (std::size_t i = 0; i < order.size(); ++i) {
      const auto at = static_cast<std::uint32_t>(order[i]);
      const auto& v = dealt[at];
      const bool fresh = i == 0 || v.position != dealt[static_cast<std::uint32_t>(order[i - 1])].position;
      if (fresh) {
        if (i == first[brick]) {
          out.brick.push_back(bricks[brick++]);
          out.first.push_back(static_cast<std::uint32_t>(out.position.size()));
        }
        // One zero, so that the position says nothing of the vertices that were merged.
        out.position.push_back({v.position[0] + Real{0}, v.position[1] + Real{0}, v.position[2] + Real{0}});
        if (plan_.info.colour) out.rgba.push_back(v.rgba);
      } else if (plan_.info.colour && v.rgba != out.rgba.back()) {
        ++conflicts;
      }
      numbers[at] = {v.in_file, static_cast<std::uint32_t>(out.position.size() - 1)};
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
