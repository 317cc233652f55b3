#include "stream/page/view_page.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fstream>
#include <limits>

#include <fmt/format.h>

#include "kernels/picture/caption.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/check/mesh_deviation.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/output_file.h"
#include "stream/files/path_text.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/ply_scalar.h"
#include "stream/formats/vertex_fields.h"
#include "stream/page/data_block.h"
#include "stream/render/doubt.h"
#include "stream/render/value_cells.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kMaxVertices = 3 * kMaxViewFaces;
constexpr std::string_view kPlaceholder = "<!--tessera:data-->";
constexpr std::string_view kViewBegin =
    "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
    "<meta name=\"generator\" content=\"tessera view\">\n";

/// The bundle around its place for data.
struct Bundle {
  std::string before, after;
};

Bundle read_bundle(const fs::path& path) {
  const std::string page = read_text(path);
  const std::size_t at = page.find(kPlaceholder);
  if (!page.starts_with(kViewBegin) || at == std::string::npos)
    throw InputError(path.string() + ": is no viewer of Tessera: run tools/viewer/build again");
  return {page.substr(0, at), page.substr(at + kPlaceholder.size())};
}

/// JSON inside of a page: no name of a file ends its element.
std::string settings(const Json& values) {
  std::string text = dump_json(values, -1, true);
  for (std::size_t at = 0; (at = text.find('<', at)) != std::string::npos;) text.replace(at, 1, "\\u003c");
  return "<script type=\"application/json\" id=\"tessera-view\">" + text + "</script>\n";
}

void require_counts(const fs::path& path, std::uint64_t vertices, std::uint64_t faces) {
  if (faces > kMaxViewFaces)
    throw UsageError(
        fmt::format("{}: has {} faces, and one page shows up to {}: cut it into 3D Tiles for any size "
                    "(tessera tiles {} -o "
                    "site/, then tessera view site/), or make it smaller (tessera decimate)",
                    path.string(), with_commas(faces), with_commas(kMaxViewFaces), path.string()));
  if (vertices > kMaxVertices)
    throw UsageError(
        fmt::format("{}: has {} vertices for {} faces, and one page holds up to {}: leave out those that no "
                    "face uses (tessera convert)",
                    path.string(), with_commas(vertices), with_commas(faces), with_commas(kMaxVertices)));
}

/// What is known after one pass over the file.
struct Survey {
  std::uint64_t vertices = 0, faces = 0;
  Double3 origin{};  ///< of the positions in the page
  bool has_synthetic = false;
};

/// The multiple of a power of two not below the extent that lies next to the middle: what floats of the file held near
/// zero stays as it is.
Double3 round_origin(const Double3& low, const Double3& high) {
  double extent = 0.0;
  for (std::size_t k = 0; k < 3; ++k) extent = std::max(extent, high[k] - low[k]);
  const double step = extent > 0.0 ? std::exp2(std::ceil(std::log2(extent))) : 1.0;
  Double3 origin;
  for (std::size_t k = 0; k < 3; ++k) origin[k] = std::round(0.5 * (low[k] + high[k]) / step) * step;
  return origin;
}

Survey survey(MeshReader& mesh, const fs::path& path) {
  Survey out;
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Double3 low = {kFar, kFar, kFar}, high = {-kFar, -kFar, -kFar};
  std::vector<std::uint64_t> bad;  // vertices that are not finite; faces may not use them
  mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    throw_if_stopped();
    for (const Double3& p : batch) {
      const bool finite = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
      if (!finite) bad.push_back(out.vertices);
      for (std::size_t k = 0; k < 3 && finite; ++k) {
        low[k] = std::min(low[k], p[k]);
        high[k] = std::max(high[k], p[k]);
      }
      ++out.vertices;
    }
    require_counts(path, out.vertices, 0);
  });
  mesh.read_flagged_faces([&](std::span<const MeshFace> batch, std::span<const std::uint8_t> flags) {
    throw_if_stopped();
    out.faces += batch.size();
    require_counts(path, 0, out.faces);
    out.has_synthetic =
        out.has_synthetic || std::any_of(flags.begin(), flags.end(), [](auto f) { return f != 0; });
    if (bad.empty()) return;
    for (const MeshFace& face : batch)
      for (const std::uint64_t v : face)
        if (std::binary_search(bad.begin(), bad.end(), v))
          throw InputError(
              fmt::format("{}: vertex {} is not finite, and a face uses it: repair the mesh first (tessera "
                          "decimate, smooth and remesh do)",
                          path.string(), v));
  });
  if (out.faces == 0) throw EmptyError(path.string() + ": has no face: nothing to view");
  out.origin = round_origin(low, high);
  return out;
}

void write_positions(OutputFile& page, MeshReader& mesh, const Double3& origin) {
  DataBlock block(page, "mesh-positions");
  std::vector<float> words;
  mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    throw_if_stopped();
    words.clear();
    for (const Double3& p : batch)
      for (std::size_t k = 0; k < 3; ++k) {
        const double c = p[k] - origin[k];
        words.push_back(std::isfinite(c) ? static_cast<float>(c) : 0.0f);  // no face uses it
      }
    block.add(words.data(), words.size() * sizeof(float));
  });
  block.end();
}

void write_colours(OutputFile& page, MeshReader& mesh) {
  DataBlock block(page, "mesh-colours");
  std::vector<std::uint8_t> bytes;
  mesh.read_vertices([&](std::span<const Double3>, std::span<const std::uint32_t> rgba) {
    throw_if_stopped();
    bytes.clear();
    for (const std::uint32_t c : rgba)
      for (const int shift : {0, 8, 16}) bytes.push_back(static_cast<std::uint8_t>(c >> shift));
    block.add(bytes.data(), bytes.size());
  });
  block.end();
}

/// As differences, which neighbours make small, so that they pack well.
void write_faces(OutputFile& page, MeshReader& mesh) {
  DataBlock block(page, "mesh-faces");
  std::vector<std::uint32_t> words;
  std::uint32_t last = 0;
  mesh.read_faces([&](std::span<const MeshFace> batch) {
    throw_if_stopped();
    words.clear();
    for (const MeshFace& face : batch)
      for (const std::uint64_t v : face) {
        words.push_back(static_cast<std::uint32_t>(v) - last);
        last = static_cast<std::uint32_t>(v);
      }
    block.add(words.data(), words.size() * sizeof(std::uint32_t));
  });
  block.end();
}

void write_marks(OutputFile& page, MeshReader& mesh) {
  DataBlock block(page, "mesh-synthetic");
  mesh.read_flagged_faces([&](std::span<const MeshFace>, std::span<const std::uint8_t> flags) {
    throw_if_stopped();
    block.add(flags.data(), flags.size());
  });
  block.end();
}

void write_doubts(OutputFile& page, MeshReader& mesh, const ViewOptions& options) {
  const std::uint64_t resident = resident_bytes();
  const Doubt doubt(options.uncertain, options.memory_bytes > resident ? options.memory_bytes - resident : 1);
  DataBlock block(page, "mesh-uncertain");
  std::vector<std::uint8_t> marks;
  mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    throw_if_stopped();
    marks.clear();
    for (const Double3& p : batch) {
      const bool finite = std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
      marks.push_back(finite && doubt.at(p + mesh.header().shift) ? 1 : 0);
    }
    block.add(marks.data(), marks.size());
  });
  block.end();
}

/// Faces cut small with the distance at every corner, as pictures show it: vertices of a decimated mesh lie on what it was
/// made from, its faces do not.
Json write_deviation(OutputFile& page, const fs::path& mesh, const ViewOptions& options,
                     const Double3& origin) {
  const MeshDeviation deviation(mesh, options.deviation, options.with_sign, options.temp,
                                options.memory_bytes, "view --deviation");
  const double high = options.tolerance > 0.0 ? options.tolerance : deviation.scale();
  const MemoryBudget budget(options.memory_bytes, resident_bytes());
  std::vector<float> distance;
  DataBlock block(page, "mesh-positions");
  deviation.for_each(1.5 * high, [&](const DeviationTriangle& t) {
    std::array<float, 9> words{};
    for (std::size_t c = 0; c < 9; ++c) words[c] = static_cast<float>(t.corner[c / 3][c % 3] - origin[c % 3]);
    block.add(words.data(), sizeof words);
    if (distance.size() == distance.capacity()) {  // doubled: old and new together
      const std::size_t next = std::max<std::size_t>(2 * distance.size(), std::size_t{1} << 16);
      budget.require((distance.size() + next) * sizeof(float), "view --deviation");
      distance.reserve(next);
    }
    distance.insert(distance.end(), t.deviation.begin(), t.deviation.end());
  });
  block.end();
  DataBlock values(page, "mesh-deviation");
  values.add(distance.data(), distance.size() * sizeof(float));
  values.end();
  return {
      {"reference", json_text(options.deviation.filename())}, {"high", high}, {"signed", options.with_sign}};
}

/// End of a scale that all but one in a hundred values lie within, either way: a little more, by less than one in 100.
class ScaleEnd {
 public:
  void add(double value) {
    if (std::isnan(value)) return;
    ++counts_[std::bit_cast<std::uint32_t>(static_cast<float>(std::abs(value))) >> kDropped], ++all_;
  }
  std::uint64_t count() const { return all_; }
  double end() const {
    std::uint64_t below = 0;
    for (std::uint32_t k = 0; k < counts_.size(); ++k) {
      below += counts_[k];
      if (100 * below < 99 * all_) continue;
      const float end = std::bit_cast<float>((k + 1) << kDropped);
      return std::isfinite(end) ? double{end} : double{std::numeric_limits<float>::max()};
    }
    return 1.0;
  }

 private:
  static constexpr unsigned kDropped = 16;  ///< of a float's bits: seven of its fraction stay
  std::vector<std::uint64_t> counts_ = std::vector<std::uint64_t>(std::size_t{1} << (32 - kDropped));
  std::uint64_t all_ = 0;
};

/// What the vertices carry, and its scale.
Json write_carried(OutputFile& page, const PlyScalar& scalar, const ViewOptions& options) {
  ScaleEnd scale;
  std::vector<float> words;
  DataBlock block(page, "mesh-deviation");
  scalar.read([&](std::span<const Double3>, std::span<const double> values) {
    throw_if_stopped();
    words.clear();
    for (const double v : values) scale.add(v), words.push_back(static_cast<float>(v));
    block.add(words.data(), words.size() * sizeof(float));
  });
  block.end();
  return {{"high", options.tolerance > 0.0 ? options.tolerance : scale.end()}, {"signed", true}};
}

/// Octahedra at the cells that have a value, with a corner in every direction of the axes.
struct Octahedra {
  std::vector<float> positions, values;
  std::vector<std::uint32_t> faces;

  Octahedra(const ValueMap& map, const Double3& origin) {
    constexpr std::array<std::array<std::uint32_t, 3>, 8> kFaces = {
        {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
    constexpr double kRadius = 0.7;  // of a cell: those of neighbours touch
    std::uint32_t last = 0, first = 0;
    for (const ValueCell& cell : map.cells) {
      if (std::isnan(cell.mean)) continue;
      for (unsigned corner = 0; corner < 6; ++corner) {
        Double3 p = cell.centre - origin;
        p[corner / 2] += (corner % 2 == 0 ? kRadius : -kRadius) * map.cell;
        for (const double c : p) positions.push_back(static_cast<float>(c));
        values.push_back(static_cast<float>(cell.mean));
      }
      for (const auto& face : kFaces)
        for (const std::uint32_t v : face) faces.push_back(first + v - last), last = first + v;
      first += 6;
    }
  }
  static constexpr std::uint64_t kCellBytes = 6 * 4 * sizeof(float) + 24 * sizeof(std::uint32_t);
};

}  // namespace

void require_viewable(const fs::path& path) {
  const auto mesh = open_mesh_file(path);
  require_counts(path, mesh->header().vertices, mesh->header().faces);
}

void write_mesh_view(const fs::path& page, const fs::path& bundle, const fs::path& path,
                     const ViewOptions& options) {
  const Bundle around = read_bundle(bundle);
  const auto mesh = open_mesh_file(path);
  require_counts(path, mesh->header().vertices, mesh->header().faces);
  const MemoryBudget budget(options.memory_bytes, resident_bytes());
  budget.require(OutputFile::kBufferBytes + DataBlock::kMemoryBytes, "view");
  const Survey seen = survey(*mesh, path);
  Json values = {
      {"kind", "mesh"}, {"name", json_text(path.filename())}, {"up", options.up}, {"faces", seen.faces}};
  values["origin"] = seen.origin + mesh->header().shift;
  OutputFile file(page);
  file.append(around.before);
  if (options.deviation.empty()) {
    write_positions(file, *mesh, seen.origin);
    write_faces(file, *mesh);
    if (mesh->header().colour) write_colours(file, *mesh);
    if (seen.has_synthetic) write_marks(file, *mesh);
    if (!options.uncertain.empty())
      write_doubts(file, *mesh, options);
    else if (const auto carried = PlyScalar::open(path, kDeviationName); carried)
      values["deviation"] = write_carried(file, *carried, options);
  } else {
    values["deviation"] = write_deviation(file, path, options, seen.origin);
  }
  file.append(settings(values));
  file.append(around.after);
  file.finish();
}

bool has_deviations(const fs::path& path) {
  return PlyScalar::open(path, kDeviationName).has_value();
}

bool is_deviation_cloud(const fs::path& path) {
  const auto scalar = PlyScalar::open(path, kDeviationName);
  return scalar && !scalar->has_faces();
}

void write_points_view(const fs::path& page, const fs::path& bundle, const fs::path& path,
                       const ViewOptions& options) {
  constexpr std::size_t kMaxSpots = 200'000;
  const Bundle around = read_bundle(bundle);
  const auto scalar = PlyScalar::open(path, kDeviationName);
  if (!scalar) throw InputError(path.string() + ": its points have no deviation");
  const MemoryBudget budget(options.memory_bytes, resident_bytes());
  budget.require(OutputFile::kBufferBytes + DataBlock::kMemoryBytes + ValueCells::bytes() +
                     2 * kMaxSpots * Octahedra::kCellBytes,
                 "view");
  constexpr double kFar = std::numeric_limits<double>::infinity();
  Double3 low = {kFar, kFar, kFar}, high = {-kFar, -kFar, -kFar};
  double largest = 0.0;
  ScaleEnd scale;
  const auto each = [&](const auto& use) {
    scalar->read([&](std::span<const Double3> positions, std::span<const double> values) {
      throw_if_stopped();
      for (std::size_t i = 0; i < values.size(); ++i) {
        const Double3& p = positions[i];
        if (std::isfinite(values[i]) && std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]))
          use(p, values[i]);
      }
    });
  };
  each([&](const Double3& p, double value) {
    for (std::size_t k = 0; k < 3; ++k) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
    largest = std::max(largest, std::abs(value));
    scale.add(value);
  });
  if (scale.count() == 0) throw EmptyError(path.string() + ": no point has a deviation: nothing to view");
  ValueCells cells(low, high, largest > 0.0 ? largest : 1.0, kMaxSpots);
  each([&](const Double3& p, double value) { cells.add(p, value); });
  const ValueMap map = cells.finish();
  const Double3 origin = round_origin(low, high);
  const Octahedra spots(map, origin);
  Json values = {{"kind", "mesh"},          {"name", json_text(path.filename())},
                 {"up", options.up},        {"faces", spots.faces.size() / 3},
                 {"points", scale.count()}, {"spots", map.cells.size()},
                 {"origin", origin}};
  values["deviation"] = {{"high", options.tolerance > 0.0 ? options.tolerance : scale.end()},
                         {"signed", true}};
  OutputFile file(page);
  file.append(around.before);
  const auto write = [&](const char* id, const auto& words) {
    DataBlock block(file, id);
    block.add(words.data(), words.size() * sizeof words.front());
    block.end();
  };
  write("mesh-positions", spots.positions);
  write("mesh-faces", spots.faces);
  write("mesh-deviation", spots.values);
  file.append(settings(values));
  file.append(around.after);
  file.finish();
}

void write_tiles_view(const fs::path& page, const fs::path& bundle, const std::string& name,
                      const std::string& url, const std::string& up) {
  const Bundle around = read_bundle(bundle);
  OutputFile file(page);
  file.append(around.before);
  file.append(settings({{"kind", "tiles"}, {"name", json_text(name)}, {"url", url}, {"up", up}}));
  file.append(around.after);
  file.finish();
}

bool is_view(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string start(kViewBegin.size(), '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  return file.gcount() == static_cast<std::streamsize>(start.size()) && start == kViewBegin;
}

}  // namespace tessera
