// Fillings of the loops of a surface with levels, each held against the faces around it.
#include <algorithm>
#include <cmath>
#include <map>

#include "kernels/holes/hole_filling.h"
#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"
#include "stream/files/json.h"
#include "stream/files/task_files.h"
#include "stream/runtime/task_counts.h"
#include "stream/stages/levels/level_ends.h"
#include "stream/stages/levels/moved_patches.h"

namespace tessera {
namespace {

constexpr std::uint64_t kHoleEndBytes = std::uint64_t{8} << 20;
constexpr std::uint64_t kNew = std::uint64_t{1} << 63;  ///< before the number of a vertex of the filling

/// A loop with what its numbers stand for.
struct Rim {
  HoleLoop loop;            ///< scan units from `corner`
  std::vector<Double3> at;  ///< its positions as the store has them
  Double3 corner{};
  std::vector<std::uint64_t> key;
  std::vector<std::uint32_t> rgba;
  double cell = 0.0;  ///< edge of the smallest cells at it
  std::size_t patch = 0;

  MeshBox box() const {
    MeshBox out = {at[0], at[0]};
    for (const Double3& p : at) include(out, p);
    return out;
  }
  static void include(MeshBox& box, const Double3& p) {
    for (std::size_t a = 0; a < 3; ++a)
      box.low[a] = std::min(box.low[a], p[a]), box.high[a] = std::max(box.high[a], p[a]);
  }
};

class LevelHolesStage : public Stage {
 public:
  explicit LevelHolesStage(const JobState& state)
      : work_(state.work),
        limit_(level_ends(state).holes),
        largest_cell_(Plan::of_work(state.work).lattice.h),
        store_(open_level_surface(state)),
        cell_(patch_cells(store_, state)),
        files_(limit_.edges > 0 ? list_level_loops(state.work) : std::vector<std::filesystem::path>{}) {}

  std::string name() const override { return "holes"; }
  std::size_t task_count() const override { return files_.size(); }
  std::uint64_t units() const override { return files_.size(); }
  std::string unit_name() const override { return "batches"; }
  std::uint64_t task_bytes(std::size_t) const override {
    return level_holes_task_bytes(store_.largest_patch_bytes(), limit_.edges);
  }

  Json run(std::size_t task, TaskContext& context) const override {
    const std::vector<std::uint64_t> numbers = load_level_loops(files_[task]);
    PackedWriter file(context.create(level_filling_file(task)), kLevelFillingKind, std::size_t{1} << 18);
    std::vector<LevelFilling> table;
    MovedPatches mesh(store_, work_);
    std::array<std::uint64_t, kHoleOutcomes> outcomes{};
    std::uint64_t loops = 0, crossing = 0, stiff = 0, vertices = 0, faces = 0;
    for (auto at = numbers.begin(); at != numbers.end(); ++loops) {
      context.check_stop();
      const auto n = static_cast<std::ptrdiff_t>(*at++);
      Rim rim = rim_of({at, at + n}, {at + n, at + 2 * n}, mesh);
      at += 2 * n;
      find_chords(rim, mesh);
      HoleFilling filling =
          fill_hole(rim.loop, {.width = limit_.width * rim.cell, .min_cosine = limit_.min_cosine});
      if (filling.outcome == HoleOutcome::kFilled) {
        const std::vector<Double3> added = placed(rim, filling);
        if (crosses(rim, filling, added, mesh)) {
          ++crossing;
          continue;
        }
        table.push_back(write(rim, filling, added, file));
        stiff += !filling.fair;
        vertices += filling.position.size(), faces += filling.faces.size();
      }
      ++outcomes[static_cast<std::size_t>(filling.outcome)];
    }
    context.count_written(file.finish(table));
    context.advance(1);
    const auto count = [&](HoleOutcome o) { return outcomes[static_cast<std::size_t>(o)]; };
    return {{"loops", loops},
            {"filled", count(HoleOutcome::kFilled)},
            {"refused_taken", count(HoleOutcome::kTaken)},
            {"refused_outer", count(HoleOutcome::kOuter)},
            {"left_wide", count(HoleOutcome::kWide)},
            {"left_sharp", count(HoleOutcome::kSharp)},
            {"left_crossing", crossing},
            {"not_fair", stiff},
            {"vertices", vertices},
            {"faces", faces}};
  }

  std::uint64_t finish_bytes() const override { return kHoleEndBytes; }
  Json finish(const std::vector<Json>& summaries, TaskContext&) const override {
    return sum_counts(summaries, {{"loops", 0}, {"filled", 0}, {"faces", 0}});
  }

 private:
  using Numbers = std::vector<std::uint64_t>;

  Rim rim_of(const Numbers& vertex, const Numbers& third, MovedPatches& mesh) const {
    Rim rim;
    rim.patch = vertex[0] >> 32;
    rim.cell = largest_cell_;
    rim.loop.position.resize(vertex.size());
    rim.loop.opposite.resize(vertex.size());
    rim.key.resize(vertex.size());
    if (store_.info().colour) rim.rgba.resize(vertex.size());
    // Patch by patch: few are kept.
    std::map<std::size_t, std::vector<std::size_t>> wanted;
    for (std::size_t i = 0; i < vertex.size(); ++i) {
      wanted[vertex[i] >> 32].push_back(2 * i);
      wanted[third[i] >> 32].push_back(2 * i + 1);
    }
    for (const auto& [p, places] : wanted) {
      const MeshBlock& block = mesh.get(p);
      rim.cell = std::min(rim.cell, cell_[p]);
      for (const std::size_t place : places) {
        const std::size_t i = place / 2;
        const std::uint64_t v = (place % 2 == 0 ? vertex[i] : third[i]) & 0xffffffffu;
        (place % 2 == 0 ? rim.loop.position : rim.loop.opposite)[i] = block.position[v];
        if (place % 2 != 0) continue;
        rim.key[i] = block.key[v];
        if (!rim.rgba.empty()) rim.rgba[i] = block.rgba[v];
      }
    }
    rim.at = rim.loop.position;
    // Near the origin the kernel's arithmetic is the same wherever the loop lies.
    for (std::size_t a = 0; a < 3; ++a)
      rim.corner[a] = std::floor(rim.loop.position[0][a] / largest_cell_) * largest_cell_;
    for (auto* list : {&rim.loop.position, &rim.loop.opposite})
      for (Double3& p : *list) p = p - rim.corner;
    rim.loop.rgba = rim.rgba;
    return rim;
  }

  /// use(block, face) for the faces whose boxes meet this one; vertices moved by a cell at most.
  template <class Use>
  void each_face(const MeshBox& box, MovedPatches& mesh, const Use& use) const {
    for (const std::size_t p : store_.select(grown(box, 2.0 * largest_cell_))) {
      const MeshBlock& block = mesh.get(p);
      for (const auto& f : block.faces) {
        MeshBox of = {block.position[f[0]], block.position[f[0]]};
        Rim::include(of, block.position[f[1]]), Rim::include(of, block.position[f[2]]);
        if (overlap(of, box)) use(block, f);
      }
    }
  }

  /// Edges of the mesh across the loop.
  void find_chords(Rim& rim, MovedPatches& mesh) const {
    const std::size_t n = rim.key.size();
    std::vector<std::pair<std::uint64_t, std::uint32_t>> order;
    for (std::uint32_t i = 0; i < n; ++i) order.emplace_back(rim.key[i], i);
    std::sort(order.begin(), order.end());
    const auto place = [&](std::uint64_t key) {
      const auto at = std::lower_bound(order.begin(), order.end(), std::pair(key, std::uint32_t{0}));
      return at == order.end() || at->first != key ? ~std::uint32_t{0} : at->second;
    };
    each_face(rim.box(), mesh, [&](const MeshBlock& block, const std::array<std::uint32_t, 3>& f) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [i, j] = std::minmax({place(block.key[f[k]]), place(block.key[f[(k + 1) % 3]])});
        if (j == ~std::uint32_t{0} || j == i + 1 || (i == 0 && j + 1 == n)) continue;
        rim.loop.taken.push_back({i, j});
      }
    });
    auto& taken = rim.loop.taken;
    std::sort(taken.begin(), taken.end());
    taken.erase(std::unique(taken.begin(), taken.end()), taken.end());
  }

  /// Its new vertices as the store holds positions.
  std::vector<Double3> placed(const Rim& rim, const HoleFilling& filling) const {
    std::vector<Double3> out;
    for (const Double3& p : filling.position) {
      Double3 at = p + rim.corner;
      if (!store_.info().double_positions)
        for (double& c : at) c = double{static_cast<float>(c)};
      out.push_back(at);
    }
    return out;
  }

  /// Whether faces of a filling would meet each other, or the mesh, beyond what they share.
  bool crosses(const Rim& rim, const HoleFilling& filling, const std::vector<Double3>& added,
               MovedPatches& mesh) const {
    const std::size_t n = rim.key.size();
    MeshBox box = rim.box();
    std::vector<ContactFace> faces;
    for (const auto& f : filling.faces) {
      ContactFace face;
      for (std::size_t k = 0; k < 3; ++k) {
        face.corner[k] = f[k] < n ? rim.at[f[k]] : added[f[k] - n];
        face.vertex[k] = f[k] < n ? rim.key[f[k]] : kNew | (f[k] - n);
        Rim::include(box, face.corner[k]);
      }
      if (collinear(face.corner[0], face.corner[1], face.corner[2])) return true;
      faces.push_back(face);
    }
    const std::size_t own = faces.size();
    each_face(box, mesh, [&](const MeshBlock& block, const std::array<std::uint32_t, 3>& f) {
      ContactFace face;
      for (std::size_t k = 0; k < 3; ++k)
        face.corner[k] = block.position[f[k]], face.vertex[k] = block.key[f[k]];
      if (!collinear(face.corner[0], face.corner[1], face.corner[2])) faces.push_back(face);
    });
    bool found = false;
    block_contacts(faces, kAllSpace,
                   [&](std::uint32_t i, std::uint32_t, FaceContact) { found = found || i < own; });
    return found;
  }

  LevelFilling write(const Rim& rim, const HoleFilling& filling, const std::vector<Double3>& added,
                     PackedWriter& file) const {
    LevelFilling out;
    out.patch = rim.patch;
    out.rim = static_cast<std::uint32_t>(rim.key.size());
    out.vertices = static_cast<std::uint32_t>(filling.position.size());
    out.faces = static_cast<std::uint32_t>(filling.faces.size());
    std::vector<Double3> position = rim.at;
    position.insert(position.end(), added.begin(), added.end());
    std::vector<std::uint32_t> rgba = rim.rgba;
    rgba.insert(rgba.end(), filling.rgba.begin(), filling.rgba.end());
    std::vector<std::uint64_t> patches;
    for (const std::size_t p : store_.select(grown(rim.box(), 2.0 * largest_cell_))) patches.push_back(p);
    out.position = file.append(bytes_of(position));
    out.rgba = file.append(bytes_of(rgba));
    out.names = file.append(bytes_of(rim.key));
    out.corners = file.append(bytes_of(filling.faces));
    out.patches = file.append(bytes_of(patches));
    return out;
  }

  std::filesystem::path work_;
  HoleLimit limit_;
  double largest_cell_;
  MeshStore store_;
  std::vector<double> cell_;
  std::vector<std::filesystem::path> files_;
};

}  // namespace

std::string level_filling_file(std::size_t task) {
  return kLevelHoleFolder + task_file_stem(task) + ".tsh";
}

std::uint64_t level_holes_task_bytes(std::uint64_t patch_bytes, std::uint32_t edges) {
  return hole_bytes(edges) + MovedPatches::bytes(patch_bytes) + 400 * batch_vertices(edges) + kHoleEndBytes;
}

std::unique_ptr<Stage> make_level_holes_stage(const JobState& state) {
  return std::make_unique<LevelHolesStage>(state);
}

}  // namespace tessera
