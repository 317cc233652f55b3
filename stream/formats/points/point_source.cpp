#include "stream/formats/points/point_source.h"

#include <algorithm>
#include <string_view>
#include <utility>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/read_file.h"
#include "stream/files/unpacked_bytes.h"
#include "stream/formats/byte_window.h"
#include "stream/formats/ply_header.h"
#include "stream/formats/points/e57_points.h"
#include "stream/formats/points/las_points.h"
#include "stream/formats/points/pcd_points.h"
#include "stream/formats/points/ply_points.h"
#include "stream/formats/points/ptx_points.h"
#include "stream/formats/points/text_points.h"

namespace tessera {

namespace {

/// Formats that are known but not read, told by their first bytes.
struct Refusal {
  std::string_view magic;
  std::string_view sentence;
};
constexpr std::string_view kMesh =
    "is a mesh, not a scan; to read its vertices as points, make it a PLY: tessera convert IN -o OUT.ply";
constexpr Refusal kRefusals[] = {
    {"\xfd"
     "7zXZ",
     "is compressed (xz); unpack it first"},
    {"PK\x03\x04", "is an archive (zip); unpack it first"},
    {"OFF", kMesh},
    {"solid ", kMesh},
    {"glTF", kMesh},
};

bool starts_ply(std::string_view head) {
  return head.substr(0, 3) == "ply" && head.find_first_of("\r\n ") == 3;
}

/// Whether to read as text what is no other format: by extension, because the user names its columns, or by its look.
bool is_text(const std::string& extension, const ReadFile& file, const ReadOptions& options) {
  const bool surely = is_text_points_extension(extension) && extension != ".txt" && extension != ".dat";
  return surely || (!options.columns.empty() && is_printable(file)) || looks_like_text_points(file);
}

/// Text and PLY that gzip or zstd packed. Whether it is text is seen before it is unpacked to the end: what claims to be
/// small and unpacks to one endless line is left alone.
std::unique_ptr<PointFile> open_packed_points(const std::filesystem::path& path, const ReadOptions& options) {
  const std::string name = path.string();
  const std::string extension = lower_extension(path.stem());
  std::vector<char> first(UnpackedBytes::kBlock);
  first.resize(static_cast<std::size_t>(UnpackedBytes(path).read_at(0, first.data(), first.size())));
  const std::string_view text(first.data(), first.size());
  if (text.empty()) throw InputError(name + ": unpacks to nothing");
  if (text.size() == UnpackedBytes::kBlock && text.find_first_of("\r\n") == std::string_view::npos) {
    throw InputError(name + ": unpacks to a first line of more than " +
                     std::to_string(UnpackedBytes::kBlock) + " bytes; this is not a text file of points");
  }
  const bool ply = starts_ply(text);
  if (!ply && (extension == ".ply" || text.find('\0') != std::string_view::npos)) {
    throw InputError(name + ": is compressed, and no text or PLY file of points; unpack it first");
  }
  const ReadFile file = ReadFile::unpacked(path);
  ReadOptions smaller = options;  // chunks, that is: the decoder's window takes their place in memory
  smaller.chunk_points = std::min<std::size_t>(options.chunk_points, 32768);
  if (ply) return open_ply_points(file, smaller);
  if (extension == ".ptx" || looks_like_ptx(file)) return open_ptx_points(file, smaller);
  if (is_text(extension, file, options)) return open_text_points(file, smaller);
  throw InputError(name + ": is compressed, and no text or PLY file of points; unpack it first");
}

}  // namespace

void PointChunk::clear() {
  x.clear(), y.clear(), z.clear();
  nx.clear(), ny.clear(), nz.clear();
  rgba.clear();
  sensor.clear();
  echo.clear();
  intensity.clear();
}

void PointChunk::append(const PointChunk& from, std::size_t i) {
  const auto add = [i](const auto& a, auto& b) {
    if (!a.empty()) b.push_back(a[i]);
  };
  add(from.x, x), add(from.y, y), add(from.z, z);
  add(from.nx, nx), add(from.ny, ny), add(from.nz, nz);
  add(from.rgba, rgba), add(from.sensor, sensor), add(from.echo, echo), add(from.intensity, intensity);
}

std::unique_ptr<PointFile> open_point_file(const std::filesystem::path& path, const ReadOptions& options) {
  const std::string name = path.string();
  std::error_code error;
  const std::filesystem::file_status status = std::filesystem::status(path, error);
  if (status.type() == std::filesystem::file_type::not_found)
    throw InputError(name + ": there is no such file");
  if (std::filesystem::is_directory(status)) throw InputError(name + ": is a folder, not a file of points");
  if (!error && !std::filesystem::is_regular_file(status)) {
    throw InputError(name +
                     ": is not a regular file; points are read twice, so pipes and devices cannot be used");
  }
  const ReadFile file(path);
  if (file.size() == 0) throw InputError(name + ": is empty");
  char bytes[16] = {};
  const std::uint64_t there = std::min<std::uint64_t>(file.size(), sizeof bytes);
  file.read_at(0, bytes, there);
  const std::string_view head(bytes, static_cast<std::size_t>(there));
  if (head.substr(0, 4) == "LASF") return open_las_points(file, options);
  if (head.substr(0, 8) == "ASTM-E57") return open_e57_points(file, options);
  if (starts_ply(head)) return open_ply_points(file, options);
  if (!packed_format(head).empty()) return open_packed_points(path, options);
  for (const Refusal& r : kRefusals) {
    if (head.substr(0, r.magic.size()) == r.magic) throw InputError(name + ": " + std::string(r.sentence));
  }
  const std::string extension = lower_extension(path);
  if (extension == ".pcd" || head.substr(0, 6) == "# .PCD") return open_pcd_points(file, options);
  if (extension == ".ptx" || looks_like_ptx(file)) return open_ptx_points(file, options);
  if (extension == ".las" || extension == ".laz" || extension == ".ply" || extension == ".e57") {
    throw InputError(name + ": does not start as a " + extension.substr(1) +
                     " file does; it is damaged or misnamed");
  }
  if (is_mesh_extension(extension)) {
    throw InputError(name + ": " + std::string(kMesh));
  }
  if (is_text(extension, file, options)) return open_text_points(file, options);
  throw InputError(name + ": is of no known format; PLY, LAS, LAZ, E57, PCD, XYZ, PTS, PTX and CSV are read" +
                   (is_text_points_extension(extension) && is_printable(file)
                        ? ", and text of any other kind where --columns names its columns"
                        : ""));
}

std::uint64_t missing_points(const PointFileInfo& info, const ReadCounts& total) {
  const std::uint64_t found = total.points + total.withheld + total.empty;
  return std::max(total.missing, info.declared_points > found ? info.declared_points - found : 0);
}

std::string left_out_sentence(const PointFileInfo& info) {
  constexpr std::size_t kMax = 8;
  constexpr std::size_t kLongest = 40;
  std::string text = "fields left out, as nothing here takes them: ";
  for (std::size_t i = 0; i < std::min(kMax, info.left_out.size()); ++i) {
    text += i > 0 ? ", " : "";
    for (const char c : info.left_out[i].substr(0, kLongest)) text += c >= ' ' && c != '\x7f' ? c : '?';
  }
  return text + (info.left_out.size() > kMax ? ", ..." : "");
}

std::vector<std::string> refuted_claims(const PointFileInfo& info, const ReadCounts& total,
                                        const Double3& read_min, const Double3& read_max) {
  std::vector<std::string> sentences;
  const std::uint64_t found = total.points + total.withheld + total.empty;
  // What opening the file already found wrong is not said twice.
  const bool said = std::any_of(info.warnings.begin(), info.warnings.end(), [](const std::string& w) {
    return w.find("the header declares") != std::string::npos;
  });
  if (info.declared_points != found && info.declared_points != 0 && !said) {
    sentences.push_back("the header declares " + std::to_string(info.declared_points) + " points, " +
                        std::to_string(found) + " were read");
  }
  if (total.surplus > 0) sentences.push_back(surplus_sentence(total.surplus));
  bool outside = false;
  bool wide = false;
  for (std::size_t a = 0; a < 3 && info.has_bounds && read_min[a] <= read_max[a]; ++a) {
    const double slack =
        1e-6 * std::max(info.declared_max[a] - info.declared_min[a], read_max[a] - read_min[a]);
    outside =
        outside || read_min[a] < info.declared_min[a] - slack || read_max[a] > info.declared_max[a] + slack;
    wide = wide || read_min[a] > info.declared_min[a] + slack || read_max[a] < info.declared_max[a] - slack;
  }
  if (outside) sentences.emplace_back("points lie outside the bounds that the header declares");
  if (wide && !outside) sentences.emplace_back(kWideBounds);
  return sentences;
}

}  // namespace tessera
