#include "stream/stages/surface/border_stage.h"

#include <algorithm>
#include <array>
#include <map>
#include <nlohmann/json.hpp>

#include "kernels/smooth/border_fairing.h"
#include "stream/points/plan.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/surface/border_moves.h"
#include "stream/stages/surface/numbered_patches.h"

namespace tessera {
namespace {

using json = nlohmann::json;

/// Faces at the border of a brick and of what it sees around it: beyond, it is torn to shreds that no line bounds.
constexpr std::size_t kMostFaces = 40'000;
constexpr std::size_t kCachedPatches = 12;
constexpr std::uint64_t kCachedStripBytes = std::uint64_t{12} << 20;
constexpr std::uint64_t kFixedBytes = std::uint64_t{4} << 20;
/// Of one face in the kernel: itself, half a vertex, what scales and beads hold.
constexpr std::uint64_t kKernelBytes = 280;

/// A face of which a vertex lies at the border.
struct StripFace {
  std::array<VertexPlace, 3> place;
  std::array<Float3, 3> at;  ///< each relative to the brick that owns it
  std::uint32_t border = 0;  ///< bit i: corner i lies at the border
};

struct Strip {
  std::vector<StripFace> faces;
  bool torn = false;  ///< there are more, which are left out
};

/// Reads the patches around the one at work, and keeps what it may need again.
class StripReader {
 public:
  StripReader(const JobState& state, const PatchStore& store, const Numbering& numbering)
      : store_(store), numbered_(state.work, store, numbering) {}

  /// \pre the patch has kept faces
  const Strip& get(std::size_t patch) {
    const auto found = strips_.find(patch);
    if (found != strips_.end()) return found->second;
    while (strip_bytes_ > kCachedStripBytes && !strips_.empty()) {  // of the smallest brick: it came first
      strip_bytes_ -= bytes_of_strip(strips_.begin()->second);
      strips_.erase(strips_.begin());
    }
    Strip& strip = strips_[patch];
    read(patch, strip);
    strip_bytes_ += bytes_of_strip(strip);
    return strip;
  }

  bool has_border(std::size_t patch) const {
    const std::vector<std::uint32_t> border = store_.load_seam(patch).components.border;
    return std::any_of(border.begin(), border.end(), [](std::uint32_t n) { return n > 0; });
  }

 private:
  struct Vertices {
    std::vector<Float3> position;
    std::vector<VertexClass> kind;
  };

  static std::uint64_t bytes_of_strip(const Strip& strip) {
    return sizeof(Strip) + strip.faces.size() * sizeof(StripFace);
  }

  const Vertices& vertices(std::size_t patch) {
    const auto found = vertices_.find(patch);
    if (found != vertices_.end()) return found->second;
    if (vertices_.size() >= kCachedPatches) vertices_.erase(vertices_.begin());
    Vertices& out = vertices_[patch];
    std::vector<std::uint32_t> rgba;
    store_.load_vertices(patch, out.position, rgba, &out.kind);
    return out;
  }

  void read(std::size_t patch, Strip& strip) {
    numbered_.load_faces(patch, faces_);
    const Vertices own = vertices(patch);  // a copy: the cache may drop it
    corner_.clear();
    for (std::uint32_t v = 0; v < own.position.size(); ++v)
      corner_.push_back(
          {{static_cast<std::uint32_t>(patch), v}, own.position[v], own.kind[v] == VertexClass::kBorder});
    for (const VertexPlace& place : faces_.foreign) {
      const Vertices& there = vertices(place.patch);
      corner_.push_back(
          {place, there.position[place.vertex], there.kind[place.vertex] == VertexClass::kBorder});
    }
    for (const PatchFace& f : faces_.faces) {
      if (!faces_.kept(f)) continue;
      StripFace face;
      for (std::size_t i = 0; i < 3; ++i) {
        const Corner& c = corner_[f[i]];
        face.place[i] = c.place;
        face.at[i] = c.at;
        face.border |= static_cast<std::uint32_t>(c.border) << i;
      }
      if (face.border == 0) continue;
      strip.torn = strip.faces.size() == kMostFaces;
      if (strip.torn) return;
      strip.faces.push_back(face);
    }
  }

  struct Corner {
    VertexPlace place;
    Float3 at;
    bool border;
  };

  const PatchStore& store_;
  NumberedPatches numbered_;
  std::map<std::size_t, Vertices> vertices_;
  std::map<std::size_t, Strip> strips_;
  std::uint64_t strip_bytes_ = 0;
  PatchFaces faces_;
  std::vector<Corner> corner_;  ///< of the patch at work, its foreign ones behind its own
};

class BorderStage : public Stage {
 public:
  explicit BorderStage(const JobState& state)
      : state_(state),
        lift_(reconstruct_options(state).smooths_border() ? Plan::of_work(state.work).noise_cells : 0.0),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)) {}

  std::string name() const override { return "border"; }
  std::size_t task_count() const override { return lift_ > 0.0 ? store_.file_count() : 0; }
  std::uint64_t units() const override { return lift_ > 0.0 ? store_.patches().size() : 0; }
  std::string unit_name() const override { return "bricks"; }

  std::uint64_t task_bytes(std::size_t task) const override {
    const auto [first, last] = store_.file_range(task);
    return border_task_bytes(store_.patches().subspan(first, last - first));
  }

  json run(std::size_t task, TaskContext& context) const override {
    StripReader reader(state_, store_, numbering_);
    BorderMovesWriter writer(context.create(border_moves_file_name(task)));
    std::vector<StripFace> faces;
    std::vector<MovedVertex> moves;
    std::uint64_t moved = 0, torn = 0;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      context.check_stop();
      context.advance(1);
      if (numbering_.patches[p].kept_faces == 0 || !reader.has_border(p)) continue;
      if (!gather(p, reader, faces, context)) {
        ++torn;
        continue;
      }
      fair(p, faces, moves);
      writer.add(store_.patches()[p].key, moves);
      moved += moves.size();
    }
    context.count_written(writer.finish());
    return {{"moved", moved}, {"torn", torn}};
  }

  std::uint64_t finish_bytes() const override { return std::uint64_t{1} << 20; }

  json finish(const std::vector<json>& summaries, TaskContext&) const override {
    std::uint64_t moved = 0, torn = 0;
    for (const json& s : summaries) {
      moved += s.at("moved").get<std::uint64_t>();
      torn += s.at("torn").get<std::uint64_t>();
    }
    return {{"moved_vertices", moved}, {"torn_bricks", torn}};
  }

 private:
  /// Corner i of a face, in cells from the min corner of `brick`.
  Double3 corner(const StripFace& face, std::size_t i, const Int3& brick) const {
    const Int3 owner = brick_of_key(store_.patches()[face.place[i].patch].key);
    Double3 p = wide(face.at[i]);
    for (std::size_t a = 0; a < 3; ++a) p[a] += double{kBrickCells} * (owner[a] - brick[a]);
    return p;
  }

  /// Faces at the border within reach of the patch, patches in ascending order. \returns false if there are too many
  bool gather(std::size_t patch, StripReader& reader, std::vector<StripFace>& faces,
              TaskContext& context) const {
    faces.clear();
    const Int3 brick = brick_of_key(store_.patches()[patch].key);
    std::vector<std::size_t> around;
    for (int d = 0; d < 27; ++d) {
      const Int3 n = {brick[0] + d % 3 - 1, brick[1] + d / 3 % 3 - 1, brick[2] + d / 9 - 1};
      if (n[0] < 0 || n[1] < 0 || n[2] < 0) continue;
      const std::int64_t at = store_.find(brick_key(n));
      if (at >= 0 && numbering_.patches[static_cast<std::size_t>(at)].kept_faces > 0)
        around.push_back(static_cast<std::size_t>(at));
    }
    std::sort(around.begin(), around.end());
    for (const std::size_t p : around) {
      context.check_stop();
      const Strip& strip = reader.get(p);
      if (strip.torn) return false;
      for (const StripFace& f : strip.faces) {
        bool near = false;
        for (std::size_t i = 0; i < 3; ++i) {
          const Double3 at = corner(f, i, brick);
          near = near || std::all_of(at.begin(), at.end(), [](double x) {
                   return x >= -kBorderReach && x <= kBrickCells + kBorderReach;
                 });
        }
        if (!near) continue;
        if (faces.size() == kMostFaces) return false;
        faces.push_back(f);
      }
    }
    return true;
  }

  /// The patch's own vertices that move.
  void fair(std::size_t patch, const std::vector<StripFace>& faces, std::vector<MovedVertex>& moves) const {
    const auto rank = [](const VertexPlace& v) { return std::uint64_t{v.patch} << 32 | v.vertex; };
    std::vector<std::uint64_t> names;
    names.reserve(3 * faces.size());
    for (const StripFace& f : faces)
      for (const VertexPlace& v : f.place) names.push_back(rank(v));
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    const Int3 brick = brick_of_key(store_.patches()[patch].key);
    BorderStrip strip;
    strip.position.resize(names.size());
    strip.at_border.resize(names.size());
    strip.faces.reserve(faces.size());
    for (const StripFace& f : faces) {
      auto& face = strip.faces.emplace_back();
      for (std::size_t i = 0; i < 3; ++i) {
        const auto v = std::lower_bound(names.begin(), names.end(), rank(f.place[i])) - names.begin();
        face[i] = static_cast<std::uint32_t>(v);
        strip.position[face[i]] = corner(f, i, brick);
        strip.at_border[face[i]] = f.border >> i & 1u;
      }
    }
    const auto own = std::lower_bound(names.begin(), names.end(), std::uint64_t{patch} << 32);
    const auto end = std::lower_bound(own, names.end(), std::uint64_t{patch + 1} << 32);
    const std::vector<Double3> before(strip.position.begin() + (own - names.begin()),
                                      strip.position.begin() + (end - names.begin()));
    fair_border(strip, lift_);
    moves.clear();
    for (auto v = own; v != end; ++v) {
      const Double3& at = strip.position[static_cast<std::size_t>(v - names.begin())];
      if (at != before[static_cast<std::size_t>(v - own)])
        moves.push_back({static_cast<std::uint32_t>(*v), narrow(at)});
    }
  }

  JobState state_;
  double lift_;  ///< cells; 0 = nothing moves
  PatchStore store_;
  Numbering numbering_;
};

}  // namespace

std::uint64_t border_task_bytes(std::span<const PatchEntry> patches) {
  std::uint64_t vertices = 0, faces = 0;
  for (const PatchEntry& e : patches) {
    vertices = std::max<std::uint64_t>(vertices, 48ull * e.vertices + 48ull * e.foreign);
    faces = std::max<std::uint64_t>(faces, 13ull * e.faces);
  }
  return kCachedPatches * vertices / 3 + 2 * vertices + faces +
         kMostFaces * (sizeof(StripFace) + kKernelBytes) + kCachedStripBytes +
         kMostFaces * sizeof(StripFace) + NumberedPatches::kCacheBytes + kFixedBytes;
}

std::unique_ptr<Stage> make_border_stage(const JobState& state) {
  return std::make_unique<BorderStage>(state);
}

}  // namespace tessera
