#include "stream/stages/coverage/face_source.h"

#include <algorithm>
#include <map>
#include <span>

#include "stream/stages/surface/hole_files.h"
#include "stream/stages/weld/numbered_patches.h"
#include "stream/stages/weld/patch_positions.h"

namespace tessera {
namespace {

constexpr std::size_t kHeldPatches = 32;  ///< whose vertices are kept for those around them
constexpr std::size_t kMinStorePatches = 16, kMaxStoreTasks = 400;
constexpr std::uint64_t kPlacedVertexBytes = sizeof(Double3) + 4, kPlacedFaceBytes = 12;

Double3 placed(const Float3& at, const Int3& brick) {
  Double3 p = wide(at);
  for (std::size_t a = 0; a < 3; ++a) p[a] += brick[a] * double{kBrickCells};
  return p;
}

/// One thread's view of welded patches: keeps the vertices of the last ones.
class WeldedReader {
 public:
  WeldedReader(const std::filesystem::path& work, const PatchStore& store, const Numbering& numbering)
      : store_(store), numbering_(numbering), numbered_(work, store, numbering), positions_(work, store) {}

  void read(std::size_t patch, PlacedFaces& out) {
    out.position.clear();
    out.faces.clear();
    if (numbering_.patches[patch].kept_faces == 0) return;
    numbered_.load_faces(patch, faces_);
    const Int3 brick = brick_of_key(store_.patches()[patch].key);
    for (const Float3& at : own(patch)) out.position.push_back(placed(at, brick));
    for (const VertexSlot& slot : faces_.foreign)
      out.position.push_back(
          placed(own(slot.patch).at(slot.vertex), brick_of_key(store_.patches()[slot.patch].key)));
    for (const PatchFace& f : faces_.faces)
      if (faces_.kept(f)) out.faces.push_back(f);
  }

  /// A vertex by its number in the output.
  Double3 vertex(std::uint64_t number) {
    const auto& all = numbering_.patches;
    const auto after =
        std::upper_bound(all.begin(), all.end(), number,
                         [](std::uint64_t n, const PatchSpan& p) { return n < p.first_vertex; });
    const auto patch = static_cast<std::size_t>(after - all.begin()) - 1;
    auto [it, fresh] = kept_.try_emplace(patch);
    if (fresh) {
      std::vector<std::uint32_t> rgba;
      numbered_.load_kept_vertices(patch, it->second, rgba);
    }
    const Double3 at =
        placed(it->second.at(number - all[patch].first_vertex), brick_of_key(store_.patches()[patch].key));
    if (kept_.size() > kHeldPatches)
      kept_.erase(kept_.begin()->first == patch ? std::next(kept_.begin()) : kept_.begin());
    return at;
  }

 private:
  /// Own vertices of a patch. The reference holds until the next call.
  const std::vector<Float3>& own(std::size_t patch) {
    const auto found = own_.find(patch);
    if (found != own_.end()) return found->second;
    if (own_.size() >= kHeldPatches) own_.erase(own_.begin());  // of the smallest brick: it came first
    std::vector<Float3>& position = own_[patch];
    std::vector<std::uint32_t> rgba;
    positions_.load(patch, position, rgba);
    return position;
  }

  const PatchStore& store_;
  const Numbering& numbering_;
  NumberedPatches numbered_;
  PatchPositions positions_;
  PatchFaces faces_;
  std::map<std::size_t, std::vector<Float3>> own_, kept_;
};

class WeldedFaces : public FaceSource {
 public:
  explicit WeldedFaces(const JobState& state)
      : work_(state.work),
        store_(open_patches(state.work)),
        numbering_(Numbering::load(state.work / kNumberingFile)),
        fillings_(list_filling_files(state.work)) {
    for (const PatchEntry& e : store_.patches()) {
      vertices_ = std::max<std::uint64_t>(vertices_, e.vertices + std::uint64_t{e.foreign});
      faces_ = std::max<std::uint64_t>(faces_, e.faces);
    }
  }

  std::size_t task_count() const override { return store_.file_count() + fillings_.size(); }
  std::uint64_t face_count() const override { return numbering_.faces; }
  std::uint64_t task_bytes(std::size_t task) const override {
    const bool fills = task >= store_.file_count();
    return welded_faces_bytes(vertices_, faces_,
                              fills ? std::filesystem::file_size(fillings_[task - store_.file_count()]) : 0);
  }

  void read(std::size_t task, const std::function<void(const PlacedFaces&)>& use) const override {
    WeldedReader reader(work_, store_, numbering_);
    if (task >= store_.file_count()) return use(filling(reader, fillings_[task - store_.file_count()]));
    PlacedFaces out;
    const auto [first, last] = store_.file_range(task);
    for (std::size_t p = first; p < last; ++p) {
      reader.read(p, out);
      use(out);
    }
  }

 private:
  static PlacedFaces filling(WeldedReader& reader, const std::filesystem::path& file) {
    const HoleFillings filling = HoleFillings::load(file);
    PlacedFaces out;
    out.position = filling.position;
    std::map<std::uint64_t, std::uint32_t> rim;  // vertices of the mesh, in order of their numbers
    for (const auto& face : filling.faces)
      for (const std::uint64_t v : face)
        if ((v & HoleFillings::kNew) == 0) rim.emplace(v, 0);
    for (auto& [number, index] : rim) {
      index = static_cast<std::uint32_t>(out.position.size());
      out.position.push_back(reader.vertex(number));
    }
    for (const auto& face : filling.faces) {
      auto& f = out.faces.emplace_back();
      for (std::size_t k = 0; k < 3; ++k)
        f[k] = (face[k] & HoleFillings::kNew) != 0 ? static_cast<std::uint32_t>(face[k] & ~HoleFillings::kNew)
                                                   : rim.at(face[k]);
    }
    return out;
  }

  std::filesystem::path work_;
  PatchStore store_;
  Numbering numbering_;
  std::vector<std::filesystem::path> fillings_;
  std::uint64_t vertices_ = 0, faces_ = 0;
};

class StoredFaces : public FaceSource {
 public:
  StoredFaces(MeshStore store, const Lattice& lattice)
      : store_(std::move(store)),
        lattice_(lattice),
        per_task_(
            std::max(kMinStorePatches, (store_.patches().size() + kMaxStoreTasks - 1) / kMaxStoreTasks)) {}

  std::size_t task_count() const override { return (store_.patches().size() + per_task_ - 1) / per_task_; }
  std::uint64_t face_count() const override { return store_.face_count(); }
  std::uint64_t task_bytes(std::size_t) const override {
    return stored_faces_bytes(store_.largest_patch_bytes());
  }

  void read(std::size_t task, const std::function<void(const PlacedFaces&)>& use) const override {
    const std::size_t last = std::min(store_.patches().size(), (task + 1) * per_task_);
    PlacedFaces out;
    for (std::size_t p = task * per_task_; p < last; ++p) {
      const MeshBlock block = store_.load(std::span(&p, 1));
      out.position.resize(block.position.size());
      for (std::size_t a = 0; a < 3; ++a) {
        const double origin = static_cast<double>(lattice_.origin_brick[a] * kBrickCells);
        for (std::size_t v = 0; v < block.position.size(); ++v)
          out.position[v][a] = (block.position[v][a] + store_.info().shift[a]) / lattice_.h - origin;
      }
      out.faces.assign(block.faces.begin(), block.faces.end());
      use(out);
    }
  }

 private:
  MeshStore store_;
  Lattice lattice_;
  std::size_t per_task_;
};

}  // namespace

std::unique_ptr<FaceSource> welded_faces(const JobState& state) {
  return std::make_unique<WeldedFaces>(state);
}
std::unique_ptr<FaceSource> stored_faces(MeshStore store, const Lattice& lattice) {
  return std::make_unique<StoredFaces>(std::move(store), lattice);
}

std::uint64_t welded_faces_bytes(std::uint64_t vertices, std::uint64_t faces, std::uint64_t filling_bytes) {
  return (kHeldPatches * sizeof(Float3) + kPlacedVertexBytes + sizeof(Double3) + 60) * vertices +
         2 * (kPlacedFaceBytes + 12) * faces + 5 * filling_bytes + NumberedPatches::kCacheBytes;
}
std::uint64_t stored_faces_bytes(std::uint64_t block_bytes) {
  return 2 * block_bytes;
}

}  // namespace tessera
