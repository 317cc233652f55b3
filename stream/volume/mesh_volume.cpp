#include "stream/volume/mesh_volume.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "octree/error.h"
#include "stream/check/fixed_sum.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/volume/base_surface.h"
#include "stream/volume/difference_map.h"
#include "stream/volume/plan_faces.h"
#include "stream/volume/raster_base.h"
#include "stream/volume/toe_surface.h"
#include "stream/volume/volume_areas.h"

namespace tessera {
namespace {

/// Share of a base's upward shadow that may show down before it counts as closed.
constexpr double kMaxDownward = 0.5;
/// Faces of one patch add up to less than this many squares of the mesh's size.
constexpr double kMaxLayers = 64.0;

/// Sums of one area; order does not matter.
struct AreaSums {
  FixedSum area, fill, cut, base_surface;
};

/// Of one patch and one area.
struct AreaPart {
  CutFill volume;
  double base_surface = 0.0;  ///< of the base's faces over which it lies
};

/// Volumes of one patch of the mesh.
class PatchVolumes {
 public:
  /// \param toes  by area, or none
  PatchVolumes(const std::vector<AreaWindow>& windows, const std::vector<ToeSurface>& toes, double level)
      : windows_(windows),
        toes_(toes),
        level_(level),
        parts_(std::max<std::size_t>(1, windows.size())),
        places_(windows.size()) {}

  /// Over what lies in the grid; without one over the level, or over the toes.
  void add(const PlanFace& face, const PlanGrid* base) {
    if (face.triangle.facing() == 0) return;
    if (!toes_.empty()) return add_over_toes(face);
    for (std::size_t k = 0; k < windows_.size(); ++k) places_[k] = windows_[k].place_of(face);
    if (base == nullptr)
      add_pieces(face, nullptr);
    else
      base->for_each(face.box, [&](const PlanFace& other) { add_pieces(face, &other); });
  }
  const std::vector<AreaPart>& parts() const { return parts_; }

 private:
  void add_over_toes(const PlanFace& face) {
    for (std::size_t k = 0; k < toes_.size(); ++k)
      toes_[k].faces.for_each(face.box, found_, [&](const PlanFace& other) {
        PlanPiece piece(face.triangle.shadow());
        piece.clip(other.triangle.shadow());
        if (!piece.empty()) add_piece(piece, face, &other, 1, parts_[k]);
      });
  }

  void add_pieces(const PlanFace& face, const PlanFace* base) {
    PlanPiece whole(face.triangle.shadow());
    if (base != nullptr) whole.clip(base->triangle.shadow());
    if (whole.empty()) return;
    if (windows_.empty()) return add_piece(whole, face, base, 1, parts_[0]);
    for (std::size_t k = 0; k < windows_.size(); ++k) {
      if (places_[k] == FacePlace::kInside) add_piece(whole, face, base, 1, parts_[k]);
      if (places_[k] != FacePlace::kAcross) continue;
      for (const SignedTriangle& t : windows_[k].area().triangles) {
        PlanPiece piece = whole;
        piece.clip(t.corner);
        if (!piece.empty()) add_piece(piece, face, base, t.sign, parts_[k]);
      }
    }
  }

  void add_piece(const PlanPiece& piece, const PlanFace& face, const PlanFace* base, int sign,
                 AreaPart& to) const {
    const int facing = face.triangle.facing() * (base != nullptr ? base->triangle.facing() : 1);
    const CutFill v =
        base != nullptr ? piece.between(face.triangle, base->triangle) : piece.above(face.triangle, level_);
    to.volume.add(v, sign * facing);
    if (base == nullptr) return;
    const Double2 g = base->triangle.gradient();
    to.base_surface += sign * facing * v.area * std::sqrt(1.0 + g[0] * g[0] + g[1] * g[1]);
  }

  const std::vector<AreaWindow>& windows_;
  const std::vector<ToeSurface>& toes_;
  double level_;  ///< relative to the origin
  std::vector<AreaPart> parts_;
  std::vector<FacePlace> places_;  ///< of the face at hand, per area
  std::vector<std::uint32_t> found_;
};

/// What the faces of a store add up to.
struct Surfaces {
  double up = 0.0, down = 0.0;  ///< shadows of those that show upwards and downwards
  std::vector<double> area;     ///< of the faces that touch an area, upright ones too
};

Surfaces add_surfaces(const MeshStore& store, const std::vector<VolumeArea>& areas, const Double3& origin,
                      WorkerPool& pool, MemoryBudget& budget) {
  const double size = std::max(store.diagonal(), 1e-300), unit = kMaxLayers * size * size;
  FixedSum up(unit), down(unit);
  std::vector<FixedSum> area(std::max<std::size_t>(1, areas.size()), FixedSum(unit));
  std::mutex mutex;
  pool.run_tasks(
      store.patches().size(), [&](std::size_t p) { return 3 * store.block_bytes(std::array{p}); }, budget,
      [&](std::size_t p) {
        throw_if_stopped();
        double shadows[3] = {0.0, 0.0, 0.0};
        std::vector<double> of(area.size(), 0.0);
        const std::vector<PlanFace> faces = plan_faces(triangles_of(store.load(std::array{p}), origin));
        const std::vector<AreaWindow> windows = windows_of(areas, faces, origin);
        for (const PlanFace& f : faces) {
          shadows[f.triangle.facing() + 1] += PlanPiece(f.triangle.shadow()).area();
          for (std::size_t k = 0; k < of.size(); ++k)
            if (areas.empty() || windows[k].place_of(f) != FacePlace::kOutside) of[k] += f.area;
        }
        const std::lock_guard lock(mutex);
        up.add(shadows[2]), down.add(shadows[0]);
        for (std::size_t k = 0; k < of.size(); ++k) area[k].add(of[k]);
      });
  Surfaces out{up.value(), down.value(), {}};
  for (const FixedSum& a : area) out.area.push_back(a.value());
  return out;
}

/// What volumes are counted from, made ready.
struct Base {
  std::optional<MeshStore> store;        ///< of a mesh
  std::unique_ptr<BaseSurface> surface;  ///< of a mesh or raster
  std::vector<ToeSurface> toes;          ///< by area
  double low = 0.0, high = 0.0;          ///< heights
  bool is_toe() const { return !toes.empty(); }
};

bool has_one_height(const Surfaces& mesh) {
  return mesh.down <= kMaxDownward * mesh.up;
}

std::string shown_downwards(const Surfaces& mesh, const std::filesystem::path& path) {
  return fmt::format("{}: {:.3g} % of what it shows upwards it shows downwards too", path.string(),
                     100.0 * mesh.down / std::max(mesh.up, 1e-300));
}

void require_open(const Surfaces& mesh, const std::filesystem::path& path, const std::string& instead) {
  if (!has_one_height(mesh))
    throw UsageError(shown_downwards(mesh, path) + ", so it has no one height to count from: " + instead);
}

/// Of the base: what noise adds, and what its tolerance bounds.
void bound_volume(AreaVolume& a, const VolumeOptions& options, const ToeSurface* toe) {
  const bool level = options.kind == VolumeBase::kLevel;
  if (options.tolerance >= 0.0 && (level || toe != nullptr || options.base_tolerance >= 0.0))
    a.bound = options.tolerance * a.surface + (toe != nullptr ? options.tolerance * toe->displaced
                                               : level        ? 0.0
                                                              : options.base_tolerance * a.base_surface);
  if (!options.noise.known() && !options.base_noise.known()) return;
  const double area = std::max(0.0, a.volume.area);
  a.noise_bound = bound95(options.noise.variance(area) +
                          (toe != nullptr ? toe->variance : options.base_noise.variance(area)));
}

/// Adds up the prisms of all patches.
class VolumeSums {
 public:
  VolumeSums(const MeshStore& store, const Base& base, const std::vector<VolumeArea>& areas,
             const Double3& origin, double level)
      : store_(store),
        base_(base),
        areas_(areas),
        origin_(origin),
        level_(level - origin[2]),
        sums_(std::max<std::size_t>(1, areas.size())) {
    const double size =
        std::max({store.diagonal(), base.store ? base.store->diagonal() : 0.0, base.high - base.low, 1e-300});
    const double height = size + std::max(std::abs(base.low - origin[2]), std::abs(base.high - origin[2]));
    for (AreaSums& s : sums_) {
      s.area = FixedSum(kMaxLayers * size * size);
      s.fill = s.cut = FixedSum(kMaxLayers * size * size * height);
      // The faces of a base may be as steep as it is high.
      s.base_surface = FixedSum(kMaxLayers * size * size * 1e6);
    }
  }

  void run(WorkerPool& pool, MemoryBudget& budget) {
    pool.run_tasks(
        store_.patches().size(),
        [&](std::size_t p) {
          return 3 * store_.block_bytes(std::array{p}) +
                 (base_.surface ? base_.surface->window_bytes(store_.patches()[p].box) : 0);
        },
        budget, [&](std::size_t p) { add_patch(p); });
  }

  const AreaSums& of(std::size_t area) const { return sums_[area]; }

 private:
  void add_patch(std::size_t p) {
    throw_if_stopped();
    const std::vector<PlanFace> faces = plan_faces(triangles_of(store_.load(std::array{p}), origin_));
    const std::vector<AreaWindow> windows = windows_of(areas_, faces, origin_);
    PatchVolumes volumes(windows, base_.toes, level_);
    if (base_.surface) {
      PlanBox box;
      for (const PlanFace& f : faces) box.add(f.box.low), box.add(f.box.high);
      base_.surface->for_triangles(store_.patches()[p].box, [&](std::span<const SpaceTriangle> triangles) {
        throw_if_stopped();
        const std::vector<PlanFace> under = plan_faces(triangles);
        PlanBox of_batch, shared;
        for (const PlanFace& f : under) of_batch.add(f.box.low), of_batch.add(f.box.high);
        for (std::size_t a = 0; a < 2; ++a)
          shared.low[a] = std::max(box.low[a], of_batch.low[a]),
          shared.high[a] = std::min(box.high[a], of_batch.high[a]);
        const PlanGrid grid(under, shared);
        for (const PlanFace& f : faces)
          if (f.box.meets(of_batch)) volumes.add(f, &grid);
      });
    } else {
      for (const PlanFace& f : faces) volumes.add(f, nullptr);
    }
    const std::lock_guard lock(mutex_);
    for (std::size_t k = 0; k < sums_.size(); ++k) {
      const AreaPart& part = volumes.parts()[k];
      sums_[k].area.add(part.volume.area), sums_[k].fill.add(part.volume.fill);
      sums_[k].cut.add(part.volume.cut), sums_[k].base_surface.add(part.base_surface);
    }
  }

  const MeshStore& store_;
  const Base& base_;
  const std::vector<VolumeArea>& areas_;
  Double3 origin_;
  double level_;
  std::vector<AreaSums> sums_;
  std::mutex mutex_;
};

}  // namespace

MeshVolumes measure_volumes(const std::filesystem::path& mesh, const VolumeOptions& options) {
  const ScratchFolder scratch(options.temp, "volume");
  RunOptions run;
  run.memory_bytes = options.memory_bytes;
  run.threads = options.threads > 0 ? options.threads : core_count();
  MeshVolumes out;
  Base base;
  const MeshStore store = import_mesh(mesh, scratch.path(), "mesh", run, throw_if_stopped);
  const Double3 origin = store.box().low;
  const std::vector<VolumeArea> areas =
      options.areas.empty() ? std::vector<VolumeArea>{} : read_areas(options.areas, {origin[0], origin[1]});
  WorkerPool pool(run.threads);
  Surfaces own, below;
  {
    MemoryBudget budget(options.memory_bytes, resident_bytes());
    base.low = base.high = options.level;
    if (options.kind == VolumeBase::kMesh) {
      base.store.emplace(import_mesh(options.base, scratch.path(), "base", run, throw_if_stopped));
      below = add_surfaces(*base.store, areas, origin, pool, budget);
      require_open(below, options.base, "give an open surface as --base");
      base.surface = mesh_base(*base.store, origin);
    } else if (options.kind == VolumeBase::kRaster) {
      auto raster = std::make_unique<RasterBase>(options.base, options.crs, origin, scratch.path(),
                                                 options.memory_bytes);
      out.warnings += raster->warnings();
      base.surface = std::move(raster);
    } else if (options.kind != VolumeBase::kLevel) {
      base.toes = span_toes(store, options.areas, areas, origin,
                            options.kind == VolumeBase::kToePlane ? ToeKind::kPlane : ToeKind::kTriangles,
                            options.toe_gap, options.noise, pool, budget);
      base.low = store.box().low[2], base.high = store.box().high[2];
      for (const ToeSurface& toe : base.toes)
        base.low = std::min(base.low, origin[2] + toe.low),
        base.high = std::max(base.high, origin[2] + toe.high);
    }
    if (base.surface) base.low = base.surface->low(), base.high = base.surface->high();
    own = add_surfaces(store, areas, origin, pool, budget);
    if (base.is_toe()) require_open(own, mesh, "toe lines are those of an open surface");
    if (!has_one_height(own))
      out.warnings += shown_downwards(own, mesh) +
                      ": fill and cut count every layer of it; the net of a closed body is its volume\n";
  }

  MemoryBudget budget(options.memory_bytes, resident_bytes());  // toes are held
  VolumeSums sums(store, base, areas, origin, options.level);
  sums.run(pool, budget);
  out.downward = own.down;
  for (std::size_t k = 0; k < std::max<std::size_t>(1, areas.size()); ++k) {
    const AreaSums& sum = sums.of(k);
    AreaVolume a;
    a.name = areas.empty() ? "all" : areas[k].name;
    a.volume = {sum.area.value(), sum.fill.value(), sum.cut.value()};
    a.plan_area = areas.empty() ? own.up - own.down : areas[k].plan_area();
    a.surface = own.area[k];
    a.base_surface = base.store ? below.area[k] : sum.base_surface.value();
    if (base.is_toe()) a.outline = base.toes[k].outline, a.outline_uncovered = base.toes[k].uncovered;
    bound_volume(a, options, base.is_toe() ? &base.toes[k] : nullptr);
    out.areas.push_back(a);
  }
  if (options.map.empty()) return out;
  DifferenceMap map;
  map.surface = base.surface.get(), map.toes = &base.toes, map.areas = &areas;
  map.level = options.level, map.low = base.low, map.high = base.high, map.origin = origin;
  map.cell = options.cell, map.crs = options.crs, map.memory_bytes = options.memory_bytes;
  out.warnings += write_difference(store, map, scratch.path(), pool, budget, options.map);
  return out;
}

}  // namespace tessera
