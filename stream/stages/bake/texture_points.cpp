#include "stream/stages/bake/texture_points.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <compare>
#include <unordered_map>

#include "kernels/texture/point_colours.h"
#include "octree/error.h"
#include "stream/files/external_sort.h"
#include "stream/files/packed_file.h"
#include "stream/stages/bake/progress_share.h"

namespace tessera {
namespace {

constexpr PackedKind kTexturePoints = {"TSTEXPT1", "a file of coloured points"};
constexpr double kMaxTextureCells = 1 << 18;  ///< along an axis
constexpr std::uint64_t kSortingPart = 4;     ///< one so many of the time, about, beside reading
/// Of a brick: points so near to the box of a patch are kept. About an edge of the mesh; with more, points beside a mesh of
/// a part of the scan would count as points on it, and texels would be too fine.
constexpr double kNearShare = 0x1p-5;

struct TexturePoint {
  float x, y, z;  ///< from the low corner of the cell
  std::uint32_t rgba, normal;
};
static_assert(sizeof(TexturePoint) == 20);

/// Order: by cell, then by bits of all else; points that are equal are the same.
struct SortedPoint {
  std::uint64_t cell;
  std::uint32_t x, y, z;
  std::uint32_t rgba, normal, unused;
  auto operator<=>(const SortedPoint&) const = default;
};

struct TextureCellEntry {
  std::uint64_t key = 0;
  std::uint64_t points = 0;
  Section section;
};

double brick_edge(const MeshStore& mesh) {
  return mesh.info().lattice.h * kBrickCells;
}

}  // namespace

TextureCells TextureCells::around(const MeshStore& mesh, double share) {
  TextureCells cells;
  const MeshBox& box = mesh.box();
  double extent = 0.0;
  for (std::size_t a = 0; a < 3; ++a) extent = std::max(extent, box.high[a] - box.low[a]);
  const double brick = brick_edge(mesh);
  cells.edge = std::max(brick * share, (extent + 4.0 * brick) / kMaxTextureCells);
  for (std::size_t a = 0; a < 3; ++a) cells.low[a] = box.low[a] - 2.0 * brick;
  return cells;
}

Int3 TextureCells::cell_of(const Double3& p) const {
  Int3 cell{};
  for (std::size_t a = 0; a < 3; ++a) cell[a] = static_cast<std::int32_t>(std::floor((p[a] - low[a]) / edge));
  return cell;
}

std::uint64_t write_texture_points(const std::filesystem::path& path, const MeshStore& mesh,
                                   const std::filesystem::path& temp, std::uint64_t sort_bytes, bool normals,
                                   const TexturePointProgress& progress, const TexturePointGiver& give,
                                   std::uint64_t& given, std::uint64_t& kept,
                                   const TexturePointCells& wanted) {
  TextureCells cells = TextureCells::around(mesh, wanted.share);
  const TextureCells wide_cells = TextureCells::around(mesh, 1.0);
  const MeshBox all = grown(mesh.box(), brick_edge(mesh));
  std::unordered_map<std::uint64_t, std::vector<MeshBox>> near;  // of patches, by cell
  for (const MeshPatchEntry& patch : mesh.patches()) {
    const MeshBox box = grown(patch.box, kNearShare * brick_edge(mesh));
    const Int3 low = wide_cells.cell_of(box.low), high = wide_cells.cell_of(box.high);
    for (int k = low[2]; k <= high[2]; ++k)
      for (int j = low[1]; j <= high[1]; ++j)
        for (int i = low[0]; i <= high[0]; ++i) near[brick_key({i, j, k})].push_back(box);
  }
  const auto is_near = [&](const Double3& p) {
    const auto at = near.find(brick_key(wide_cells.cell_of(p)));
    return at != near.end() && std::any_of(at->second.begin(), at->second.end(), [&](const MeshBox& box) {
             return overlap(box, {p, p});
           });
  };
  ExternalSort<SortedPoint> sort(temp, sort_bytes);
  given = kept = 0;
  ProgressShare reading(progress.context, progress.steps, progress.units - progress.units / kSortingPart);
  give(reading, [&](const Double3& p, std::uint32_t rgba, const Double3& normal) {
    given += rgba != kNoPointColour;
    for (std::size_t a = 0; a < 3; ++a)
      if (!(p[a] >= all.low[a] && p[a] <= all.high[a])) return;  // nor a number
    if (wanted.near_only && !is_near(p)) return;
    const Int3 cell = cells.cell_of(p);
    SortedPoint s{};
    s.cell = brick_key(cell);
    std::array<std::uint32_t, 3> bits{};
    for (std::size_t a = 0; a < 3; ++a)
      bits[a] =
          std::bit_cast<std::uint32_t>(static_cast<float>(p[a] - (cells.low[a] + cells.edge * cell[a])));
    s.x = bits[0], s.y = bits[1], s.z = bits[2];
    s.rgba = rgba, s.normal = pack_normal(normal);
    sort.add(s);
    ++(rgba == kNoPointColour ? cells.directions : kept);
  });
  reading.complete();
  ProgressShare sorting(progress.context, kept + cells.directions, progress.units / kSortingPart);
  PackedWriter writer(path, kTexturePoints);
  std::vector<TextureCellEntry> table;
  std::vector<TexturePoint> open;
  std::uint64_t key = 0;
  const auto close = [&] {
    if (open.empty()) return;
    TextureCellEntry entry{key, open.size(), writer.append(bytes_of(open))};
    table.push_back(entry);
    sorting.advance(open.size());
    sorting.check_stop();
    open.clear();
  };
  sort.drain([&](std::span<const SortedPoint> batch) {
    for (const SortedPoint& s : batch) {
      if (s.cell != key) close(), key = s.cell;
      open.push_back({std::bit_cast<float>(s.x), std::bit_cast<float>(s.y), std::bit_cast<float>(s.z), s.rgba,
                      s.normal});
    }
  });
  close();
  sorting.complete();
  cells.points = kept;
  cells.normals = normals ? 1 : 0;
  return writer.finish(table, std::as_bytes(std::span(&cells, 1)));
}

struct TexturePoints::Impl {
  PackedFile file;
  std::vector<TextureCellEntry> table;
};

TexturePoints::TexturePoints(const std::filesystem::path& path)
    : impl_(std::make_unique<Impl>(
          Impl{PackedFile(path, kTexturePoints, sizeof(TextureCellEntry), sizeof(TextureCells)), {}})) {
  impl_->file.append_table(impl_->table);
  std::copy_n(impl_->file.info().begin(), sizeof cells_, reinterpret_cast<std::byte*>(&cells_));
}
TexturePoints::~TexturePoints() = default;

namespace {

bool meets(const TextureCells& cells, std::uint64_t key, const Int3& low, const Int3& high) {
  const Int3 at = brick_of_key(key);
  (void)cells;
  for (std::size_t a = 0; a < 3; ++a)
    if (at[a] < low[a] || at[a] > high[a]) return false;
  return true;
}

}  // namespace

std::uint64_t TexturePoints::count(const MeshBox& box) const {
  const Int3 low = cells_.cell_of(box.low), high = cells_.cell_of(box.high);
  std::uint64_t sum = 0;
  for (const TextureCellEntry& e : impl_->table)
    if (meets(cells_, e.key, low, high)) sum += e.points;
  return sum;
}

void TexturePoints::for_each_cell(
    const std::function<void(const Double3& low, const TexturePointBlock& points)>& use) const {
  for (const TextureCellEntry& e : impl_->table) {
    const Int3 cell = brick_of_key(e.key);
    Double3 low{};
    for (std::size_t a = 0; a < 3; ++a) low[a] = cells_.low[a] + cells_.edge * cell[a];
    TexturePointBlock points;
    for (const TexturePoint& p : impl_->file.load<TexturePoint>(e.section)) {
      points.position.push_back({p.x, p.y, p.z});
      points.rgba.push_back(p.rgba);
      if (cells_.normals != 0) points.normal.push_back(p.normal);
    }
    use(low, points);
  }
}

std::uint64_t TexturePoints::largest_cell() const {
  std::uint64_t largest = 0;
  for (const TextureCellEntry& e : impl_->table) largest = std::max(largest, e.points);
  return largest;
}

TexturePointBlock TexturePointBlock::take_directions() {
  TexturePointBlock directions;
  if (normal.empty()) return directions;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < rgba.size(); ++i) {
    if (rgba[i] == kNoPointColour) {
      directions.position.push_back(position[i]);
      directions.rgba.push_back(rgba[i]);
      directions.normal.push_back(normal[i]);
      continue;
    }
    position[kept] = position[i], rgba[kept] = rgba[i], normal[kept] = normal[i];
    ++kept;
  }
  position.resize(kept), rgba.resize(kept), normal.resize(kept);
  return directions;
}

TexturePointBlock TexturePoints::load(const MeshBox& box, const Double3& origin) const {
  TexturePointBlock out;
  const std::uint64_t all = count(box);
  out.position.reserve(all), out.rgba.reserve(all);
  if (cells_.normals != 0) out.normal.reserve(all);
  const Int3 low = cells_.cell_of(box.low), high = cells_.cell_of(box.high);
  for (const TextureCellEntry& e : impl_->table) {
    if (!meets(cells_, e.key, low, high)) continue;
    const Int3 cell = brick_of_key(e.key);
    Double3 corner{};
    for (std::size_t a = 0; a < 3; ++a) corner[a] = (cells_.low[a] + cells_.edge * cell[a]) - origin[a];
    for (const TexturePoint& p : impl_->file.load<TexturePoint>(e.section)) {
      out.position.push_back(narrow(corner + wide(Float3{p.x, p.y, p.z})));
      out.rgba.push_back(p.rgba);
      if (cells_.normals != 0) out.normal.push_back(p.normal);
    }
  }
  return out;
}

}  // namespace tessera
