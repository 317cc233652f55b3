#include "stream/stages/tiles/point_site.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>
#include <memory>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/scratch_folder.h"
#include "stream/files/system_reason.h"
#include "stream/formats/points/projection.h"
#include "stream/import/crs_sidecar.h"
#include "stream/points/file_notices.h"
#include "stream/points/point_summary.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/stages/tiles/tile_mesh.h"
#include "stream/stages/tiles/tiles_stage.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kPointBytes = 16;  // three whole numbers of 32 bits, a colour
constexpr std::uint64_t kSiteSliceBytes = std::uint64_t{4} << 20;
constexpr std::size_t kMostTilesOfFile = 1000;
constexpr double kNarrowSteps = 65535.0;  // that 16 bits can tell

struct SiteSurvey : SummedBounds {
  bool colour = false;
  Crs crs;
};

SiteSurvey survey_site(const PointSiteOptions& options, const ReadOptions& read, PointSiteReport& report) {
  SiteSurvey all;
  FileNotices notices;
  for (const fs::path& path : options.inputs) {
    throw_if_stopped();
    const PointSummary s = summarize_points(path, read);
    all.add(s);
    report.not_finite += s.not_finite;
    all.colour = all.colour || s.info.attributes.colour;
    const Crs& crs = s.info.crs;
    if (all.crs.known() && crs.known() && !is_same_crs(all.crs, crs))
      throw InputError(path.string() + ": is in " + crs.name + ", others are in " + all.crs.name +
                       "; make tiles of scans of one coordinate system");
    if (!all.crs.known() || (all.crs.wkt.empty() && !crs.wkt.empty())) all.crs = crs;
    for (const std::string& w : s.warnings) notices.add(path, w);
  }
  for (std::string& line : notices.lines()) report.notes.push_back(std::move(line));
  if (all.finite == 0)
    throw EmptyError("the inputs hold no point with finite coordinates; nothing is written");
  return all;
}

/// A power of two not below `value` > 0.
double power_of_two(double value) {
  int exponent = 0;
  const double part = std::frexp(value, &exponent);
  return std::ldexp(1.0, part == 0.5 ? exponent - 1 : exponent);
}

/// Positions as whole numbers of steps from an origin: so fine that no scan has more, and 32 bits hold them.
struct SiteGrid {
  Double3 origin{};
  double step = 1.0;

  explicit SiteGrid(const SiteSurvey& all) {
    double extent = 0.0, farthest = 0.0;
    for (std::size_t a = 0; a < 3; ++a) {
      extent = std::max(extent, all.max[a] - all.min[a]);
      farthest = std::max({farthest, std::fabs(all.min[a]), std::fabs(all.max[a])});
    }
    step = power_of_two(std::max({extent * 0x1p-30, farthest * 0x1p-46, 1e-12}));
    for (std::size_t a = 0; a < 3; ++a)
      origin[a] = std::round((all.min[a] + 0.5 * (all.max[a] - all.min[a])) / (1024 * step)) * (1024 * step);
  }
};

void take_points(const PointSiteOptions& options, const ReadOptions& read, const SiteGrid& grid,
                 std::size_t window, CopcNodes& nodes, std::uint64_t expected) {
  std::uint64_t taken = 0;
  for (const fs::path& path : options.inputs) {
    const auto file = open_point_file(path, read);
    const std::vector<InputSlice> slices = file->slices(0, kSiteSliceBytes);
    std::vector<std::vector<std::string>> ring(window);
    const auto pack = [&](std::size_t slice, const std::function<void(std::string&)>& sink) {
      file->read(slices[slice], [&](const PointChunk& chunk) {
        throw_if_stopped();
        std::string bytes;
        for (std::size_t i = 0; i < chunk.size(); ++i) {
          const Double3 p = {chunk.x[i], chunk.y[i], chunk.z[i]};
          if (!(std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]))) continue;
          std::int32_t q[4];
          for (std::size_t a = 0; a < 3; ++a)
            q[a] = static_cast<std::int32_t>(std::floor((p[a] - grid.origin[a]) / grid.step + 0.5));
          const std::uint32_t rgba = chunk.rgba.empty() ? 0xffffffffu : chunk.rgba[i];
          std::memcpy(&q[3], &rgba, sizeof rgba);
          bytes.append(reinterpret_cast<const char*>(q), kPointBytes);
        }
        sink(bytes);
      });
    };
    const auto add = [&](const std::string& bytes) {
      nodes.add(bytes);
      taken += bytes.size() / kPointBytes;
    };
    if (slices.size() == 1) {  // may be of any size
      pack(0, [&](std::string& bytes) { add(bytes); });
      continue;
    }
    parallel_in_order(
        slices.size(), window,
        [&](std::size_t slice) {
          ring[slice % window].clear();
          pack(slice, [&](std::string& bytes) { ring[slice % window].push_back(std::move(bytes)); });
        },
        [&](std::size_t slice) {
          for (const std::string& bytes : ring[slice % window]) add(bytes);
        });
  }
  if (taken != expected) throw InputError("an input changed while it was read; run the command again");
}

double edge_of(const CopcCube& cube, int level) {
  return std::ldexp(cube.edge, -level);
}
/// Of the positions in a tile; no point is moved farther than that.
double step_of(const CopcCube& cube, const SiteGrid& grid, int level) {
  return std::max(grid.step, power_of_two(edge_of(cube, level) / (kNarrowSteps - 2.0)));
}

std::string point_glb(const std::string& records, const SiteGrid& grid, double step, bool colour) {
  const std::size_t n = records.size() / kPointBytes;
  MeshBlock block;
  for (std::size_t i = 0; i < n; ++i) {
    std::int32_t q[3];
    std::memcpy(q, records.data() + i * kPointBytes, sizeof q);
    block.position.push_back({q[0] * grid.step, q[1] * grid.step, q[2] * grid.step});
    if (!colour) continue;
    std::uint32_t rgba = 0;
    std::memcpy(&rgba, records.data() + i * kPointBytes + 12, sizeof rgba);
    block.rgba.push_back(rgba);
  }
  return tile_glb(quantise_tile(block, TileGrid{{0, 0, 0}, step}, {}));
}

/// Moves what is done to where it belongs: old tiles go, the tileset comes last. All tiles are synced at once: there may be thousands.
void move_site(const fs::path& from, const fs::path& to) {
  const int fd = ::open(from.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const bool synced = fd >= 0 && ::syncfs(fd) == 0;
  const int error = errno;
  if (fd >= 0) ::close(fd);
  if (!synced) throw ResourceError(to.string() + ": its tiles do not reach the disk: " + os_reason(error));
  fs::create_directories(to);
  fs::remove(to / "tileset.json");
  fs::remove_all(to / "tiles");
  fs::rename(from / "tiles", to / "tiles");
  fs::rename(from / "tileset.json", to / "tileset.json");
}

}  // namespace

void write_point_tilesets(const std::vector<CopcNode>& nodes, const CopcCube& cube,
                          const std::array<double, 16>& transform, std::size_t most_tiles,
                          const std::function<void(const std::string&, const std::string&)>& sink) {
  using Key = std::array<std::int32_t, 4>;
  const auto key_of = [](const CopcNode& n) { return Key{n.level, n.at[0], n.at[1], n.at[2]}; };
  std::map<Key, std::size_t> index;  // within its level, which names its file
  std::map<Key, std::vector<Key>> below;
  std::int32_t level = -1;
  std::size_t number = 0;
  for (const CopcNode& n : nodes) {
    if (n.level != level) level = n.level, number = 0;
    index[key_of(n)] = number++;
    if (n.level > 0) below[{n.level - 1, n.at[0] / 2, n.at[1] / 2, n.at[2] / 2}].push_back(key_of(n));
  }
  // From the deepest level upwards: where a file would have too many tiles, those below get files of their own.
  std::map<Key, std::size_t> inside;
  std::map<Key, bool> own_file;
  for (auto n = nodes.rbegin(); n != nodes.rend(); ++n) {
    const Key key = key_of(*n);
    std::size_t count = 1;
    for (const Key& child : below[key]) count += inside[child];
    if (count > most_tiles) {
      count = 1 + below[key].size();
      for (const Key& child : below[key]) own_file[child] = !below[child].empty();
    }
    inside[key] = count;
  }
  const auto header = [&](const Key& key) {
    const double edge = edge_of(cube, key[0]);
    // Positions are rounded: the box has room for half a step of the coarsest tile of this size.
    const double half = 0.5 * edge * (1.0 + 4.0 / kNarrowSteps);
    Double3 middle;
    for (std::size_t a = 0; a < 3; ++a) middle[a] = cube.min[a] + (key[a + 1] + 0.5) * edge;
    return Json{
        {"boundingVolume", {{"box", {middle[0], middle[1], middle[2], half, 0, 0, 0, half, 0, 0, 0, half}}}},
        {"geometricError", below[key].empty() ? 0.0 : edge / (1 << CopcNodes::kCellLevels)}};
  };
  const auto write = [&](const std::string& name, Json root) {
    const Json error = root.at("geometricError");
    root["refine"] = "ADD";
    sink(name, dump_json(Json{{"asset", {{"version", "1.1"}, {"generator", "Tessera"}}},
                              {"geometricError", error},
                              {"root", std::move(root)}}));
  };
  const std::function<Json(const Key&, const std::string&)> tile = [&](const Key& key,
                                                                       const std::string& up) {
    Json out = header(key);
    out["content"] = {{"uri", up + tile_file(key[0], index[key])}};
    for (const Key& child : below[key]) {
      if (!own_file[child]) {
        out["children"].push_back(tile(child, up));
        continue;
      }
      std::string name = tile_file(child[0], index[child]);
      name.replace(name.rfind('.'), std::string::npos, ".json");
      Json link = header(child);
      link["content"] = {{"uri", up + name}};
      out["children"].push_back(std::move(link));
      write(name, tile(child, "../../"));
    }
    return out;
  };
  Json root = tile(key_of(nodes.front()), "");
  root["transform"] = std::vector<double>(transform.begin(), transform.end());
  write("", std::move(root));
}

PointSiteReport write_point_site(const PointSiteOptions& options) {
  PointSiteReport report;
  const ReadOptions read{.columns = {}, .chunk_points = 16384};
  const fs::path parent = fs::absolute(options.site).lexically_normal().parent_path();
  const ScratchFolder scratch(parent, "tiles");
  const fs::path work = scratch.path() / "site";
  fs::create_directories(work / "tiles");
  WorkerPool pool(options.threads);
  pool.run_here([&] {
    const SiteSurvey all = survey_site(options, read, report);
    const SiteGrid grid(all);
    constexpr std::uint64_t kLargestSort = std::uint64_t{256} << 20;
    CopcNodes nodes(scratch.path(), kPointBytes, std::min(options.memory_bytes / 4, kLargestSort));
    const auto threads = static_cast<std::size_t>(pool.threads());
    take_points(options, read, grid, threads + 1, nodes, all.finite);
    nodes.build({grid.step, grid.step, grid.step}, {0, 0, 0}, options.site);
    const std::vector<CopcNode>& tiles = nodes.nodes();
    std::size_t first_of_level = 0;
    const auto write_tile = [&](const std::string& name, const std::string& bytes) {
      std::ofstream file(work / name, std::ios::binary);
      if (!file.write(bytes.data(), static_cast<std::streamsize>(bytes.size())).flush())
        throw ResourceError(options.site.string() + ": a tile cannot be written: " + os_reason(errno));
      report.bytes += bytes.size();
    };
    std::vector<std::string> glb(threads + 1);
    parallel_in_order(
        tiles.size(), glb.size(),
        [&](std::size_t i) {
          throw_if_stopped();
          glb[i % glb.size()] = point_glb(nodes.records(tiles[i]), grid,
                                          step_of(nodes.cube(), grid, tiles[i].level), all.colour);
        },
        [&](std::size_t i) {
          if (i == 0 || tiles[i].level != tiles[i - 1].level) {
            first_of_level = i;
            fs::create_directories(work / "tiles" / std::to_string(tiles[i].level));
          }
          write_tile(tile_file(tiles[i].level, i - first_of_level), glb[i % glb.size()]);
          report.points += tiles[i].points;
        });
    std::string wkt = all.crs.known() ? all.crs.wkt : crs_of_mesh(options.inputs.front());
    if (wkt.empty() && all.crs.horizontal > 0)
      wkt = user_crs("EPSG:" + std::to_string(all.crs.horizontal), "the coordinate system of the inputs").wkt;
    Double3 half;
    for (std::size_t a = 0; a < 3; ++a) half[a] = 0.5 * (all.max[a] - all.min[a]);
    report.frame = site_frame(wkt, grid.origin, half);
    write_point_tilesets(tiles, nodes.cube(), report.frame.transform, kMostTilesOfFile,
                         [&](const std::string& name, const std::string& text) {
                           write_tile(name.empty() ? "tileset.json" : name, text);
                           ++report.tilesets;
                         });
    report.tiles = tiles.size();
    report.levels = tiles.back().level + 1;
    report.colour = all.colour;
    report.spacing = nodes.cube().edge / (1 << CopcNodes::kCellLevels);
  });
  move_site(work, options.site);
  return report;
}

}  // namespace tessera
