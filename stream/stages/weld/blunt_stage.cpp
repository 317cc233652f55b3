#include "stream/stages/weld/blunt_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <tuple>
#include <utility>

#include "kernels/mesh/box_mask.h"
#include "kernels/smooth/crease_blunting.h"
#include "stream/files/json.h"
#include "stream/points/plan.h"
#include "stream/points/point_store.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/plan/planned_scan.h"
#include "stream/stages/weld/border_moves.h"
#include "stream/stages/weld/numbered_patches.h"

namespace tessera {
namespace {

constexpr std::uint64_t kBluntVertexBytes = std::uint64_t{8} << 20;
constexpr std::uint64_t kBluntViewBytes = std::uint64_t{16} << 20;
/// Faces of a piece: beyond, a brick is torn to shreds and stays as it is.
constexpr std::size_t kMaxBluntFaces = 80'000;
/// Of one face in the kernel: itself, three half-edges, half a vertex, and the names of its corners.
constexpr std::uint64_t kBluntFaceBytes = 220;
/// How far from a face that nobody saw faces take part, in cells: its rings, and one more.
constexpr double kBluntMargin = 6.0;

/// Reads the patches around the one at work, and keeps what it may need again. One thread's.
class BluntReader {
 public:
  BluntReader(const std::filesystem::path& work, const PatchStore& store, const Numbering& numbering)
      : store_(store),
        numbering_(numbering),
        numbered_(work, store, numbering),
        positions_(work, store, kBeforeBlunt) {}

  /// The faces around those that nobody saw, near the patch, patches in ascending order: positions in cells from its brick.
  /// \param name  of its vertices, as patch_vertex(), ascending
  /// \returns false if there are none, or too many
  bool gather(std::size_t patch, CreaseMesh& mesh, std::vector<std::uint64_t>& name) {
    const Int3 brick = brick_of_key(store_.patches()[patch].key);
    const std::vector<std::size_t> around = kept_patches_around(store_, numbering_, brick);
    BoxMask near(kLow, kHigh, 64);
    bool any = false;
    for (const std::size_t p : around) {
      const View& there = view(p);
      const Double3 shift = offset(p, brick);
      for (const std::uint32_t f : there.wanted) {
        auto [from, to] = there.box(f, shift);
        if (apart(from, to, kLow, kHigh)) continue;
        for (double& x : from) x -= kBluntMargin;
        for (double& x : to) x += kBluntMargin;
        near.mark(from, to);
        any = true;
      }
    }
    if (!any) return false;
    mesh = {};
    own_.clear(), foreign_.clear();
    for (const std::size_t p : around)
      if (!add_faces(p, offset(p, brick), near, mesh)) return false;
    join(mesh, name);
    return true;
  }

  static std::uint64_t bytes(std::span<const PatchEntry> patches) {
    std::uint64_t largest = 0;
    for (const PatchEntry& e : patches)
      largest = std::max<std::uint64_t>(largest, 80ull * e.vertices + 60ull * e.foreign + 40ull * e.faces);
    return kBluntVertexBytes + kBluntViewBytes + 2 * largest + kMaxBluntFaces * kBluntFaceBytes +
           NumberedPatches::kCacheBytes;
  }

 private:
  struct Vertices {
    std::vector<Float3> position;
    std::vector<VertexClass> kind;
    std::uint64_t bytes() const { return position.size() * (sizeof(Float3) + 1) + 128; }
  };
  /// Whole cells around faces, from the min corner of their patch's brick.
  struct WholeBox {
    std::array<std::int16_t, 3> low, high;
  };
  using Box = std::pair<Double3, Double3>;  ///< low, high corner
  static constexpr std::size_t kRun = 32;   ///< faces one after the other lie beside each other
  /// Kept faces of a patch; positions in cells from the min corner of its brick.
  struct View {
    std::vector<Float3> own;  ///< positions of the patch's own vertices
    std::vector<Double3> foreign;
    std::vector<std::uint64_t> foreign_name;
    std::vector<PatchFace> faces;
    std::vector<std::uint8_t> synthetic;
    std::vector<std::uint8_t> border;   ///< per vertex
    std::vector<WholeBox> runs;         ///< per kRun faces: most are passed over by a look at these
    std::vector<std::uint32_t> wanted;  ///< faces at a border, or that nobody saw
    Double3 position(std::uint32_t v) const {
      return v < own.size() ? wide(own[v]) : foreign[v - own.size()];
    }
    Box box(std::uint32_t f, const Double3& shift) const {
      const PatchFace& c = faces[f];
      const Double3 p = position(c[0]), q = position(c[1]), r = position(c[2]);
      Box out;
      for (std::size_t a = 0; a < 3; ++a) {
        out.first[a] = std::min({p[a], q[a], r[a]}) + shift[a];
        out.second[a] = std::max({p[a], q[a], r[a]}) + shift[a];
      }
      return out;
    }
    std::uint64_t bytes() const {
      return own.size() * sizeof(Float3) + foreign.size() * (sizeof(Double3) + 8) + border.size() +
             faces.size() * (sizeof(PatchFace) + 1) + runs.size() * sizeof(WholeBox) + wanted.size() * 4 +
             256;
    }
  };
  /// Vertices of chosen faces, in cells from the brick at work; one of several patches comes several times.
  struct Chosen {
    std::vector<std::uint64_t> name;
    std::vector<Double3> at;
    std::vector<std::uint8_t> border;
    void clear() { name.clear(), at.clear(), border.clear(); }
    std::uint32_t add(std::uint64_t vertex, const Double3& position, std::uint8_t at_border) {
      name.push_back(vertex), at.push_back(position), border.push_back(at_border);
      return static_cast<std::uint32_t>(name.size() - 1);
    }
  };

  static constexpr double kEnd = kBrickCells + kBluntHalo;
  static constexpr Double3 kLow = {-kBluntHalo, -kBluntHalo, -kBluntHalo};
  static constexpr Double3 kHigh = {kEnd, kEnd, kEnd};

  static bool apart(const Double3& from, const Double3& to, const Double3& low, const Double3& high) {
    bool out = false;
    for (std::size_t a = 0; a < 3; ++a) out = out || from[a] > high[a] || low[a] > to[a];
    return out;
  }

  /// The faces of a patch that meet the mask; their corners are indices into own_, or behind kForeign into foreign_.
  /// \returns false where they come to too many
  bool add_faces(std::size_t patch, const Double3& shift, const BoxMask& near, CreaseMesh& mesh) {
    const View& there = view(patch);
    const std::size_t begin = mesh.faces.size();
    place_.assign(there.border.size(), kUnused);
    for (std::size_t run = 0; run < there.runs.size(); ++run) {
      Double3 low, high;
      for (std::size_t a = 0; a < 3; ++a) {
        low[a] = there.runs[run].low[a] + shift[a];
        high[a] = there.runs[run].high[a] + shift[a];
      }
      if (apart(low, high, kLow, kHigh) || !near.meets(low, high)) continue;
      const std::size_t end = std::min(there.faces.size(), (run + 1) * kRun);
      for (std::size_t f = run * kRun; f < end; ++f) {
        const auto [from, to] = there.box(static_cast<std::uint32_t>(f), shift);
        if (apart(from, to, kLow, kHigh) || !near.meets(from, to)) continue;
        if (mesh.faces.size() == kMaxBluntFaces) return false;
        mesh.unseen.push_back(there.synthetic[f]);
        mesh.faces.push_back(there.faces[f]);
        for (const std::uint32_t v : there.faces[f]) place_[v] = kUsed;
      }
    }
    if (mesh.faces.size() == begin) return true;
    const auto own = static_cast<std::uint32_t>(there.own.size());
    for (std::uint32_t v = 0; v < place_.size(); ++v) {
      if (place_[v] == kUnused) continue;
      const Double3 at = there.position(v) + shift;
      place_[v] = v < own ? own_.add(patch_vertex(patch, v), at, there.border[v])
                          : kForeign | foreign_.add(there.foreign_name[v - own], at, there.border[v]);
    }
    for (std::size_t f = begin; f < mesh.faces.size(); ++f)
      for (std::uint32_t& v : mesh.faces[f]) v = place_[v];
    return true;
  }

  /// Orders the chosen vertices by their names. Own ones are in order, for patches are; foreign ones are few.
  void join(CreaseMesh& mesh, std::vector<std::uint64_t>& name) {
    std::vector<std::uint32_t> order(foreign_.name.size()), own_index(own_.name.size()),
        foreign_index(foreign_.name.size());
    std::iota(order.begin(), order.end(), 0u);
    std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
      return std::tie(foreign_.name[a], a) < std::tie(foreign_.name[b], b);
    });
    name.clear();
    const auto put = [&](const Chosen& from, std::size_t i) {
      if (name.empty() || name.back() != from.name[i]) {
        name.push_back(from.name[i]);
        mesh.position.push_back(from.at[i]);
        mesh.at_border.push_back(from.border[i]);
      }
      return static_cast<std::uint32_t>(name.size() - 1);
    };
    std::size_t next = 0;
    for (std::size_t i = 0; i < own_.name.size(); ++i) {
      for (; next < order.size() && foreign_.name[order[next]] < own_.name[i]; ++next)
        foreign_index[order[next]] = put(foreign_, order[next]);
      own_index[i] = put(own_, i);
    }
    for (; next < order.size(); ++next) foreign_index[order[next]] = put(foreign_, order[next]);
    for (auto& face : mesh.faces)
      for (std::uint32_t& v : face) v = (v & kForeign) != 0 ? foreign_index[v & ~kForeign] : own_index[v];
  }

  Double3 offset(std::size_t patch, const Int3& brick) const {
    const Int3 at = brick_of_key(store_.patches()[patch].key);
    return {double{kBrickCells} * (at[0] - brick[0]), double{kBrickCells} * (at[1] - brick[1]),
            double{kBrickCells} * (at[2] - brick[2])};
  }

  const Vertices& vertices(std::size_t patch) {
    const auto found = vertices_.find(patch);
    if (found != vertices_.end()) return found->second;
    drop_first_patches(vertices_, vertex_bytes_, kBluntVertexBytes);
    Vertices& out = vertices_[patch];
    std::vector<std::uint32_t> rgba;
    store_.load_vertices(patch, out.position, rgba, &out.kind);
    positions_.load(patch, out.position, rgba);
    vertex_bytes_ += out.bytes();
    return out;
  }

  const View& view(std::size_t patch) {
    const auto found = views_.find(patch);
    if (found != views_.end()) return found->second;
    drop_first_patches(views_, view_bytes_, kBluntViewBytes);
    View& out = views_[patch];
    numbered_.load_faces(patch, read_);
    const Int3 brick = brick_of_key(store_.patches()[patch].key);
    {
      const Vertices& here = vertices(patch);
      out.own = here.position;
      for (const VertexClass kind : here.kind) out.border.push_back(kind == VertexClass::kBorder);
    }
    for (const VertexSlot& slot : read_.foreign) {
      const Vertices& there = vertices(slot.patch);
      out.foreign.push_back(wide(there.position[slot.vertex]) + offset(slot.patch, brick));
      out.foreign_name.push_back(patch_vertex(slot.patch, slot.vertex));
      out.border.push_back(there.kind[slot.vertex] == VertexClass::kBorder);
    }
    for (std::size_t f = 0; f < read_.faces.size(); ++f) {
      const PatchFace& face = read_.faces[f];
      if (!read_.kept(face)) continue;
      out.faces.push_back(face);
      out.synthetic.push_back(read_.synthetic.empty() ? std::uint8_t{0} : read_.synthetic[f]);
      if (out.synthetic.back() || out.border[face[0]] || out.border[face[1]] || out.border[face[2]])
        out.wanted.push_back(static_cast<std::uint32_t>(out.faces.size() - 1));
    }
    for (std::size_t first = 0; first < out.faces.size(); first += kRun) {
      Box all = out.box(static_cast<std::uint32_t>(first), {});
      for (std::size_t f = first + 1; f < std::min(out.faces.size(), first + kRun); ++f) {
        const Box one = out.box(static_cast<std::uint32_t>(f), {});
        for (std::size_t a = 0; a < 3; ++a) {
          all.first[a] = std::min(all.first[a], one.first[a]);
          all.second[a] = std::max(all.second[a], one.second[a]);
        }
      }
      WholeBox& run = out.runs.emplace_back();
      for (std::size_t a = 0; a < 3; ++a) {
        run.low[a] = static_cast<std::int16_t>(std::floor(all.first[a]));
        run.high[a] = static_cast<std::int16_t>(std::ceil(all.second[a]));
      }
    }
    view_bytes_ += out.bytes();
    return out;
  }

  const PatchStore& store_;
  const Numbering& numbering_;
  NumberedPatches numbered_;
  PatchPositions positions_;
  std::map<std::size_t, Vertices> vertices_;
  std::map<std::size_t, View> views_;
  std::uint64_t vertex_bytes_ = 0, view_bytes_ = 0;
  PatchFaces read_;
  static constexpr std::uint32_t kForeign = std::uint32_t{1} << 31, kUsed = 0, kUnused = ~std::uint32_t{0};
  Chosen own_, foreign_;              ///< of the brick at work
  std::vector<std::uint32_t> place_;  ///< per vertex of the patch at hand
};

bool is_blunted(const ReconstructOptions& options, const Plan& plan) {
  return options.smooths_border() && plan.noise_cells > 0.0;
}

class BluntStage : public Stage {
 public:
  explicit BluntStage(const JobState& state)
      : work_(state.work),
        needed_(is_blunted(reconstruct_options(state), Plan::of_work(state.work)) &&
                std::filesystem::exists(state.work / kSurfacePointFolder)),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)) {}

  std::string name() const override { return "blunt"; }
  std::size_t task_count() const override { return needed_ ? store_.file_count() : 0; }
  std::uint64_t units() const override { return needed_ ? store_.patches().size() : 0; }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return blunt_task_bytes(store_.patches().subspan(first, last - first));
  }

  Json run(std::size_t task, TaskContext& context) const override {
    BluntReader reader(work_, store_, numbering_);
    BorderMovesWriter writer(context.create(border_moves_file_name(task, kBluntFolder)));
    CreaseMesh mesh;
    std::vector<std::uint64_t> name;
    std::vector<MovedVertex> moves;
    std::uint64_t moved = 0;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      context.check_stop();
      context.advance(1);
      if (numbering_.patches[p].kept_faces == 0 || !reader.gather(p, mesh, name)) continue;
      const auto own = std::lower_bound(name.begin(), name.end(), patch_vertex(p, 0)) - name.begin();
      const auto end = std::lower_bound(name.begin(), name.end(), patch_vertex(p + 1, 0)) - name.begin();
      const std::vector<Double3> before(mesh.position.begin() + own, mesh.position.begin() + end);
      blunt_creases(mesh);
      moves.clear();
      for (auto v = own; v < end; ++v) {
        const auto at = static_cast<std::size_t>(v);
        if (mesh.position[at] != before[static_cast<std::size_t>(v - own)])
          moves.push_back({static_cast<std::uint32_t>(name[at]), narrow(mesh.position[at])});
      }
      writer.add(store_.patches()[p].key, moves);
      moved += moves.size();
    }
    context.count_written(writer.finish());
    return {{"moved_vertices", moved}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"moved_vertices", 0}});
  }

 private:
  std::filesystem::path work_;
  bool needed_;
  PatchStore store_;
  Numbering numbering_;
};

}  // namespace

std::uint64_t blunt_task_bytes(std::span<const PatchEntry> patches) {
  return BluntReader::bytes(patches) + (std::uint64_t{2} << 20);
}

std::unique_ptr<Stage> make_blunt_stage(const JobState& state) {
  return std::make_unique<BluntStage>(state);
}

namespace {

constexpr double kBluntTime = 0.4;  ///< microseconds a face: 0.25 and 0.6 of two field scans

}  // namespace

StageForecast forecast_blunt(const PlannedScan& scan) {
  if (!is_blunted(scan.options, scan.plan)) return idle_forecast();
  return {.tasks = scan.groups.size(),
          .task_bytes = scan.patches.max_of_tasks(blunt_task_bytes),
          .sure_bytes = blunt_task_bytes({}),
          .files = scan.groups.size(),
          .processor_us = scan.faces * kBluntTime};
}

}  // namespace tessera
