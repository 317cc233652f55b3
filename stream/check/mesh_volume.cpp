#include "stream/check/mesh_volume.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>

#include "octree/error.h"
#include "stream/check/fixed_sum.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/scratch_folder.h"
#include "stream/import/import_mesh.h"
#include "stream/meshes/mesh_column.h"
#include "stream/meshes/mesh_store.h"
#include "stream/points/clip_polygon.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();
/// Share of a base's upward shadow that may show down before it counts as closed.
constexpr double kMaxDownward = 0.5;
/// Faces of one patch add up to less than this many squares of the mesh's size.
constexpr double kMaxLayers = 64.0;

struct PlanBox {
  Double2 low = {kInfinite, kInfinite}, high = {-kInfinite, -kInfinite};
  void add(const Double2& p) {
    for (std::size_t a = 0; a < 2; ++a) low[a] = std::min(low[a], p[a]), high[a] = std::max(high[a], p[a]);
  }
  bool meets(const PlanBox& o) const {
    return low[0] <= o.high[0] && o.low[0] <= high[0] && low[1] <= o.high[1] && o.low[1] <= high[1];
  }
};

PlanBox box_of(std::span<const Double2> points) {
  PlanBox box;
  for (const Double2& p : points) box.add(p);
  return box;
}

/// An area that volumes are asked of.
struct Area {
  std::string name;
  std::vector<SignedTriangle> triangles;  ///< relative to the origin
  std::vector<std::array<Double2, 2>> edges;
  std::optional<ClipPolygon> polygon;  ///< in the coordinates of the mesh
  PlanBox box;
};

/// Sums of one area; order does not matter.
struct AreaSums {
  FixedSum area, fill, cut;
};

std::vector<Area> read_areas(const std::filesystem::path& path, const Double2& origin) {
  std::vector<Area> areas;
  std::size_t n = 0;
  for (const Json& polygon : parse_json(ClipPolygon::text_of_file(path))) {
    Area area;
    area.name = std::to_string(++n);
    area.polygon = ClipPolygon::from_text(dump_json(Json::array({polygon})));
    std::vector<std::vector<Double2>> rings;
    for (const Json& ring : polygon) {
      rings.emplace_back();
      for (const Json& c : ring)
        rings.back().push_back({c[0].get<double>() - origin[0], c[1].get<double>() - origin[1]});
      for (std::size_t k = 0; k < rings.back().size(); ++k)
        area.edges.push_back({rings.back()[k], rings.back()[(k + 1) % rings.back().size()]});
      for (const Double2& p : rings.back()) area.box.add(p);
    }
    area.triangles = triangles_of_rings(rings);
    areas.push_back(std::move(area));
  }
  return areas;
}

/// A face in plan, relative to the origin.
struct PlanFace {
  PlanTriangle triangle;
  PlanBox box;
  double area = 0.0;  ///< of the face, not of its shadow
};

std::vector<PlanFace> plan_faces(const MeshBlock& block, const Double3& origin) {
  std::vector<PlanFace> faces;
  faces.reserve(block.faces.size());
  for (const auto& f : block.faces) {
    const Double3 a = block.position[f[0]] - origin, b = block.position[f[1]] - origin,
                  c = block.position[f[2]] - origin;
    PlanFace face{PlanTriangle(a, b, c), {}, 0.5 * norm(cross(b - a, c - a))};
    face.box = box_of(face.triangle.shadow());
    faces.push_back(face);
  }
  return faces;
}

/// Faces by the cells of a grid that their boxes meet.
class PlanGrid {
 public:
  PlanGrid(const std::vector<PlanFace>& faces, const PlanBox& box) : faces_(faces), box_(box) {
    side_ = std::max<std::size_t>(1, static_cast<std::size_t>(std::sqrt(static_cast<double>(faces.size()))));
    cells_.resize(side_ * side_);
    for (std::uint32_t f = 0; f < faces.size(); ++f)
      if (faces[f].box.meets(box))
        for_cells(faces[f].box, [&](std::size_t cell) { cells_[cell].push_back(f); });
  }
  /// Faces whose boxes meet this one, each once.
  template <class Use>
  void for_each(const PlanBox& box, Use&& use) const {
    for_cells(box, [&](std::size_t cell) {
      for (const std::uint32_t f : cells_[cell]) {
        const PlanBox& other = faces_[f].box;
        // In the first cell that both meet.
        const Double2 first = {std::max(box.low[0], other.low[0]), std::max(box.low[1], other.low[1])};
        if (other.meets(box) && row(first[1], 1) * side_ + row(first[0], 0) == cell) use(faces_[f]);
      }
    });
  }

 private:
  std::size_t row(double at, std::size_t axis) const {
    const double width = box_.high[axis] - box_.low[axis];
    const double t = width > 0.0 ? (at - box_.low[axis]) / width * static_cast<double>(side_) : 0.0;
    return std::min(static_cast<std::size_t>(std::max(t, 0.0)), side_ - 1);
  }
  template <class Use>
  void for_cells(const PlanBox& box, Use&& use) const {
    for (std::size_t y = row(box.low[1], 1); y <= row(box.high[1], 1); ++y)
      for (std::size_t x = row(box.low[0], 0); x <= row(box.high[0], 0); ++x) use(y * side_ + x);
  }

  const std::vector<PlanFace>& faces_;
  PlanBox box_;
  std::size_t side_ = 1;
  std::vector<std::vector<std::uint32_t>> cells_;
};

enum class FacePlace : std::uint8_t { kOutside, kInside, kAcross };

/// By boxes of edges: some faces that come near an edge count as across.
FacePlace place_of(const PlanFace& face, const Area& area, const Double3& origin) {
  if (!area.box.meets(face.box)) return FacePlace::kOutside;
  if (std::any_of(area.edges.begin(), area.edges.end(),
                  [&](const auto& e) { return box_of(e).meets(face.box); }))
    return FacePlace::kAcross;
  const Double2& at = face.triangle.shadow()[0];
  return area.polygon->holds(at[0] + origin[0], at[1] + origin[1]) ? FacePlace::kInside : FacePlace::kOutside;
}

/// Volumes of one patch of the mesh.
class PatchVolumes {
 public:
  PatchVolumes(const std::vector<Area>& areas, const VolumeOptions& options, const Double3& origin)
      : areas_(areas),
        options_(options),
        origin_(origin),
        parts_(std::max<std::size_t>(1, areas.size())),
        places_(areas.size()) {}

  void add(const PlanFace& face, const PlanGrid* base) {
    if (face.triangle.facing() == 0) return;
    for (std::size_t k = 0; k < areas_.size(); ++k) places_[k] = place_of(face, areas_[k], origin_);
    if (base == nullptr)
      add_pieces(face, nullptr);
    else
      base->for_each(face.box, [&](const PlanFace& other) { add_pieces(face, &other); });
  }
  const std::vector<CutFill>& parts() const { return parts_; }

 private:
  void add_pieces(const PlanFace& face, const PlanFace* base) {
    PlanPiece whole(face.triangle.shadow());
    if (base != nullptr) whole.clip(base->triangle.shadow());
    if (whole.empty()) return;
    if (areas_.empty()) return add_piece(whole, face, base, 1, parts_[0]);
    for (std::size_t k = 0; k < areas_.size(); ++k) {
      if (places_[k] == FacePlace::kInside) add_piece(whole, face, base, 1, parts_[k]);
      if (places_[k] != FacePlace::kAcross) continue;
      for (const SignedTriangle& t : areas_[k].triangles) {
        PlanPiece piece = whole;
        piece.clip(t.corner);
        if (!piece.empty()) add_piece(piece, face, base, t.sign, parts_[k]);
      }
    }
  }

  void add_piece(const PlanPiece& piece, const PlanFace& face, const PlanFace* base, int sign,
                 CutFill& to) const {
    const int facing = face.triangle.facing() * (base != nullptr ? base->triangle.facing() : 1);
    const CutFill v = base != nullptr ? piece.between(face.triangle, base->triangle)
                                      : piece.above(face.triangle, options_.level - origin_[2]);
    to.add(v, sign * facing);
  }

  const std::vector<Area>& areas_;
  const VolumeOptions& options_;
  Double3 origin_;
  std::vector<CutFill> parts_;
  std::vector<FacePlace> places_;  ///< of the face at hand, per area
};

/// What the faces of a store add up to.
struct Surfaces {
  double up = 0.0, down = 0.0;  ///< shadows of those that show upwards and downwards
  std::vector<double> area;     ///< of the faces that touch an area, upright ones too
};

Surfaces add_surfaces(const MeshStore& store, const std::vector<Area>& areas, const Double3& origin,
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
        for (const PlanFace& f : plan_faces(store.load(std::array{p}), origin)) {
          shadows[f.triangle.facing() + 1] += PlanPiece(f.triangle.shadow()).area();
          for (std::size_t k = 0; k < of.size(); ++k)
            if (areas.empty() || place_of(f, areas[k], origin) != FacePlace::kOutside) of[k] += f.area;
        }
        const std::lock_guard lock(mutex);
        up.add(shadows[2]), down.add(shadows[0]);
        for (std::size_t k = 0; k < of.size(); ++k) area[k].add(of[k]);
      });
  Surfaces out{up.value(), down.value(), {}};
  for (const FixedSum& a : area) out.area.push_back(a.value());
  return out;
}

double polygon_area(const Area& area) {
  double sum = 0.0;
  for (const SignedTriangle& t : area.triangles) sum += t.sign * PlanPiece(t.corner).area();
  return sum;
}

}  // namespace

MeshVolumes measure_volumes(const std::filesystem::path& mesh, const VolumeOptions& options) {
  const ScratchFolder scratch(options.temp, "volume");
  RunOptions run;
  run.memory_bytes = options.memory_bytes;
  run.threads = options.threads > 0 ? options.threads : core_count();
  const MeshStore store = import_mesh(mesh, scratch.path(), "mesh", run, throw_if_stopped);
  std::optional<MeshStore> base;
  if (!options.base.empty())
    base.emplace(import_mesh(options.base, scratch.path(), "base", run, throw_if_stopped));
  const Double3 origin = store.box().low;
  const std::vector<Area> areas =
      options.areas.empty() ? std::vector<Area>{} : read_areas(options.areas, {origin[0], origin[1]});

  WorkerPool pool(run.threads);
  MemoryBudget budget(options.memory_bytes, resident_bytes());
  const Surfaces own = add_surfaces(store, areas, origin, pool, budget);
  Surfaces below;
  if (base) {
    below = add_surfaces(*base, areas, origin, pool, budget);
    if (below.down > kMaxDownward * below.up)
      throw UsageError(fmt::format(
          "{}: {:.3g} % of what it shows upwards it shows downwards too, so it has no one height to "
          "count from: give an open surface as --base",
          options.base.string(), 100.0 * below.down / std::max(below.up, 1e-300)));
  }

  const double size = std::max({store.diagonal(), base ? base->diagonal() : 0.0, 1e-300});
  const double height = size + (base ? 0.0 : std::abs(options.level - origin[2]));
  const std::size_t count = std::max<std::size_t>(1, areas.size());
  std::vector<AreaSums> sums(count);
  for (AreaSums& s : sums) {
    s.area = FixedSum(kMaxLayers * size * size), s.fill = s.cut = FixedSum(kMaxLayers * size * size * height);
  }
  const auto under_patch = [&](std::size_t p) { return column_of(store.patches()[p].box, base->box()); };
  std::mutex mutex;
  pool.run_tasks(
      store.patches().size(),
      [&](std::size_t p) {
        const std::uint64_t of_mesh = store.block_bytes(std::array{p});
        return 3 * (of_mesh + (base ? base->block_bytes(base->select(under_patch(p))) : 0));
      },
      budget,
      [&](std::size_t p) {
        throw_if_stopped();
        const std::vector<PlanFace> faces = plan_faces(store.load(std::array{p}), origin);
        std::vector<PlanFace> under;
        PlanBox box;
        for (const PlanFace& f : faces) box.add(f.box.low), box.add(f.box.high);
        if (base) under = plan_faces(base->load_box(under_patch(p)), origin);
        const PlanGrid grid(under, box);
        PatchVolumes volumes(areas, options, origin);
        for (const PlanFace& f : faces) volumes.add(f, base ? &grid : nullptr);
        const std::lock_guard lock(mutex);
        for (std::size_t k = 0; k < count; ++k) {
          const CutFill& part = volumes.parts()[k];
          sums[k].area.add(part.area), sums[k].fill.add(part.fill), sums[k].cut.add(part.cut);
        }
      });

  MeshVolumes out;
  out.downward = own.down;
  for (std::size_t k = 0; k < count; ++k) {
    AreaVolume a;
    a.name = areas.empty() ? "all" : areas[k].name;
    a.volume = {sums[k].area.value(), sums[k].fill.value(), sums[k].cut.value()};
    a.plan_area = areas.empty() ? own.up - own.down : polygon_area(areas[k]);
    a.surface = own.area[k], a.base_surface = base ? below.area[k] : 0.0;
    if (options.tolerance >= 0.0 && (!base || options.base_tolerance >= 0.0))
      a.bound = options.tolerance * a.surface + (base ? options.base_tolerance * a.base_surface : 0.0);
    out.areas.push_back(a);
  }
  return out;
}

std::optional<double> proven_tolerance(const std::filesystem::path& mesh) {
  const std::filesystem::path path = mesh.string() + ".report.json";
  std::error_code missing;
  if (!std::filesystem::exists(path, missing)) return std::nullopt;
  const ReadFile file(path);
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, text.data(), text.size());
  const Json report = try_parse_json(text);
  const auto number = [&](const char* pointer) -> std::optional<double> {
    const Json* value = report.at_path(pointer);
    return value != nullptr && value->is_number() ? std::optional(value->number()) : std::nullopt;
  };
  const std::optional<double> bytes = number("/mesh/bytes"), bound = number("/certificate/certified_max");
  if (!bytes || *bytes != static_cast<double>(std::filesystem::file_size(mesh, missing))) return std::nullopt;
  return bound;
}

std::string describe(const MeshVolumes& volumes) {
  std::string text = fmt::format("{:<10} {:>14} {:>14} {:>14} {:>14} {:>14} {:>12}\n", "area", "plan area",
                                 "covered", "fill", "cut", "net", "within");
  for (const AreaVolume& a : volumes.areas)
    text += fmt::format("{:<10} {:>14.8g} {:>14.8g} {:>14.8g} {:>14.8g} {:>14.8g} {:>12}\n", a.name,
                        a.plan_area, a.volume.area, a.volume.fill, a.volume.cut, a.volume.fill - a.volume.cut,
                        a.bound ? fmt::format("{:.3g}", *a.bound) : "unknown");
  return text;
}

std::string to_csv(const MeshVolumes& volumes) {
  std::string text = "area,plan_area,covered,fill,cut,net,bound\n";
  for (const AreaVolume& a : volumes.areas)
    text += fmt::format("{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{}\n", a.name, a.plan_area, a.volume.area,
                        a.volume.fill, a.volume.cut, a.volume.fill - a.volume.cut,
                        a.bound ? fmt::format("{:.17g}", *a.bound) : "");
  return text;
}

Json to_json(const MeshVolumes& volumes) {
  Json areas = Json::array();
  for (const AreaVolume& a : volumes.areas)
    areas.push_back({{"area", a.name},
                     {"plan_area", a.plan_area},
                     {"covered", a.volume.area},
                     {"fill", a.volume.fill},
                     {"cut", a.volume.cut},
                     {"net", a.volume.fill - a.volume.cut},
                     {"surface", a.surface},
                     {"base_surface", a.base_surface},
                     {"bound", a.bound ? Json(*a.bound) : Json()}});
  return {{"areas", areas}, {"downward", volumes.downward}};
}

}  // namespace tessera
