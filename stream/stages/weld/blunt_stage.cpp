#include "stream/stages/weld/blunt_stage.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

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
  /// \param name  of its vertices, as patch_vertex()
  /// \returns false if there are none, or too many
  bool gather(std::size_t patch, CreaseMesh& mesh, std::vector<std::uint64_t>& name) {
    const Int3 brick = brick_of_key(store_.patches()[patch].key);
    const std::vector<std::size_t> around = kept_patches_around(store_, numbering_, brick);
    const Double3 low = {-kBluntHalo, -kBluntHalo, -kBluntHalo};
    constexpr double kEnd = kBrickCells + kBluntHalo;
    const Double3 high = {kEnd, kEnd, kEnd};
    BoxMask near(low, high, 64);
    Double3 first = high, last = low;  // around what is marked
    bool any = false;
    for (const std::size_t p : around) {
      const View& there = view(p);
      for (const std::uint32_t f : there.wanted)
        with_box(there, f, offset(p, brick), low, high, [&](Double3 from, Double3 to) {
          for (double& x : from) x -= kBluntMargin;
          for (double& x : to) x += kBluntMargin;
          near.mark(from, to);
          for (std::size_t a = 0; a < 3; ++a)
            first[a] = std::min(first[a], from[a]), last[a] = std::max(last[a], to[a]);
          any = true;
        });
    }
    if (!any) return false;
    for (std::size_t a = 0; a < 3; ++a)
      first[a] = std::max(first[a], low[a]), last[a] = std::min(last[a], high[a]);
    mesh = {};
    std::vector<std::uint64_t> corner;
    std::vector<Double3> at;
    std::vector<std::uint8_t> border;
    for (const std::size_t p : around) {
      const View& there = view(p);
      const Double3 shift = offset(p, brick);
      for (std::uint32_t f = 0; f < there.faces.size(); ++f) {
        if (there.boxes[f].apart(first, last, shift)) continue;
        with_box(there, f, shift, low, high, [&](const Double3& from, const Double3& to) {
          if (mesh.unseen.size() > kMaxBluntFaces || !near.meets(from, to)) return;
          mesh.unseen.push_back(there.synthetic[f]);
          for (const std::uint32_t i : there.faces[f]) {
            corner.push_back(there.name[i]);
            at.push_back(there.position[i] + shift);
            border.push_back(there.border[i]);
          }
        });
      }
    }
    if (mesh.unseen.size() > kMaxBluntFaces) return false;
    name = corner;
    std::sort(name.begin(), name.end());
    name.erase(std::unique(name.begin(), name.end()), name.end());
    mesh.position.resize(name.size());
    mesh.at_border.resize(name.size());
    mesh.faces.resize(mesh.unseen.size());
    for (std::size_t c = 0; c < corner.size(); ++c) {
      const auto v = std::lower_bound(name.begin(), name.end(), corner[c]) - name.begin();
      mesh.faces[c / 3][c % 3] = static_cast<std::uint32_t>(v);
      mesh.position[static_cast<std::size_t>(v)] = at[c];
      mesh.at_border[static_cast<std::size_t>(v)] = border[c];
    }
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
  /// Whole cells around a face, from the min corner of its patch's brick.
  struct WholeBox {
    std::array<std::int16_t, 3> low, high;
    bool apart(const Double3& from, const Double3& to, const Double3& shift) const {
      bool out = false;
      for (std::size_t a = 0; a < 3; ++a)
        out = out || low[a] + shift[a] > to[a] || from[a] > high[a] + shift[a];
      return out;
    }
  };
  /// Kept faces of a patch; positions in cells from the min corner of its brick.
  struct View {
    std::vector<Double3> position;
    std::vector<std::uint64_t> name;
    std::vector<PatchFace> faces;
    std::vector<std::uint8_t> synthetic;
    std::vector<std::uint8_t> border;   ///< per vertex
    std::vector<WholeBox> boxes;        ///< per face: most are passed over by a look at these
    std::vector<std::uint32_t> wanted;  ///< faces at a border, or that nobody saw
    std::uint64_t bytes() const {
      return position.size() * (sizeof(Double3) + 9) +
             faces.size() * (sizeof(PatchFace) + 1 + sizeof(WholeBox)) + wanted.size() * 4 + 256;
    }
  };

  Double3 offset(std::size_t patch, const Int3& brick) const {
    const Int3 at = brick_of_key(store_.patches()[patch].key);
    return {double{kBrickCells} * (at[0] - brick[0]), double{kBrickCells} * (at[1] - brick[1]),
            double{kBrickCells} * (at[2] - brick[2])};
  }

  /// use(low, high) with the box of a face if it meets one.
  template <class Use>
  static void with_box(const View& there, std::uint32_t f, const Double3& shift, const Double3& low,
                       const Double3& high, const Use& use) {
    Double3 from = there.position[there.faces[f][0]] + shift, to = from;
    for (const std::uint32_t i : there.faces[f])
      for (std::size_t a = 0; a < 3; ++a) {
        from[a] = std::min(from[a], there.position[i][a] + shift[a]);
        to[a] = std::max(to[a], there.position[i][a] + shift[a]);
      }
    bool apart = false;
    for (std::size_t a = 0; a < 3; ++a) apart = apart || from[a] > high[a] || low[a] > to[a];
    if (!apart) use(from, to);
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
    const auto own = static_cast<std::uint32_t>(read_.index.size() - read_.foreign.size());
    const auto add = [&](std::size_t owner, std::uint32_t v) {
      const Vertices& there = vertices(owner);
      out.position.push_back(wide(there.position[v]) + offset(owner, brick));
      out.border.push_back(there.kind[v] == VertexClass::kBorder);
      out.name.push_back(patch_vertex(owner, v));
    };
    for (std::uint32_t v = 0; v < own; ++v) add(patch, v);
    for (const VertexSlot& slot : read_.foreign) add(slot.patch, slot.vertex);
    for (std::size_t f = 0; f < read_.faces.size(); ++f) {
      if (!read_.kept(read_.faces[f])) continue;
      out.faces.push_back(read_.faces[f]);
      out.synthetic.push_back(read_.synthetic.empty() ? std::uint8_t{0} : read_.synthetic[f]);
      const PatchFace& face = out.faces.back();
      if (out.synthetic.back() || out.border[face[0]] || out.border[face[1]] || out.border[face[2]])
        out.wanted.push_back(static_cast<std::uint32_t>(out.faces.size() - 1));
      WholeBox& box = out.boxes.emplace_back();
      for (std::size_t a = 0; a < 3; ++a) {
        const auto [min, max] =
            std::minmax({out.position[face[0]][a], out.position[face[1]][a], out.position[face[2]][a]});
        box.low[a] = static_cast<std::int16_t>(std::floor(min));
        box.high[a] = static_cast<std::int16_t>(std::ceil(max));
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

constexpr double kBluntTime = 1.0;  ///< microseconds a face: 0.7 to 2.2 on field scans

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
