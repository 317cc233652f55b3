#include "stream/formats/points/scan_folder.h"

#include <algorithm>
#include <cstdint>
#include <map>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kMaxDescription = std::uint64_t{1} << 20;
constexpr std::uint64_t kMaxHierarchy = std::uint64_t{64}
                                        << 20;  // of one file; they are cut at some thousand nodes

[[noreturn]] void fail(const fs::path& path, const std::string& what) {
  throw InputError(path.string() + ": " + what);
}

Json read_json(const fs::path& path, std::uint64_t maximum) {
  const ReadFile file(path);
  if (file.size() > maximum)
    fail(path, "has " + std::to_string(file.size()) + " bytes, too many for what it should be");
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, text.data(), text.size());
  Json parsed = try_parse_json(text);
  if (!parsed.is_object()) fail(path, "is no JSON object; the file is damaged");
  return parsed;
}

std::string text_of(const Json& object, const char* key) {
  const Json* at = object.find(key);
  return at != nullptr && at->is_string() ? at->get<std::string>() : "";
}

/// Files directly in the folder, sorted; hidden ones are not among them.
std::vector<fs::path> files_in(const fs::path& folder, const std::string& extension, bool below) {
  std::vector<fs::path> found;
  std::error_code error;
  const auto take = [&](const fs::directory_entry& entry) {
    if (entry.path().filename().string()[0] != '.' && lower_extension(entry.path()) == extension &&
        entry.is_regular_file())
      found.push_back(entry.path());
  };
  if (below) {
    for (fs::recursive_directory_iterator i(folder, error), end; !error && i != end; i.increment(error))
      take(*i);
  } else {
    for (fs::directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) take(*i);
  }
  if (error) fail(folder, "the folder cannot be read: " + error.message());
  std::sort(found.begin(), found.end());
  return found;
}

/// "3-1-0-7": level, x, y, z.
bool is_ept_node(const std::string& name) {
  int numbers = 1;
  bool digit = false;
  for (const char c : name) {
    if (c == '-' && digit) {
      ++numbers;
      digit = false;
    } else if (c >= '0' && c <= '9') {
      digit = true;
    } else {
      return false;
    }
  }
  return numbers == 4 && digit;
}

/// Nodes and how many points each has, of all files of the hierarchy; nothing where there are none.
std::map<std::string, std::uint64_t> ept_hierarchy(const fs::path& folder) {
  std::map<std::string, std::uint64_t> nodes;
  if (!fs::is_directory(folder)) return nodes;
  for (const fs::path& path : files_in(folder, ".json", false)) {
    const Json part = read_json(path, kMaxHierarchy);
    for (const auto& [name, count] : part.items()) {
      // -1: the node's part of the hierarchy has a file of its own, which says how many.
      if (is_ept_node(name) && count.is_number_integer() && count.get<std::int64_t>() > 0)
        nodes[name] = count.get<std::uint64_t>();
    }
  }
  return nodes;
}

ScanFolder open_ept(const fs::path& folder) {
  const fs::path description = folder / "ept.json";
  const Json ept = read_json(description, kMaxDescription);
  const std::string type = text_of(ept, "dataType");
  if (type != "laszip")
    fail(description,
         "its points are stored as '" + type.substr(0, 40) +
             "', of EPT 'laszip' is read; make one file of it with PDAL: pdal translate ept.json scan.laz");
  ScanFolder scan;
  scan.kind = "an EPT octree";
  const std::map<std::string, std::uint64_t> nodes = ept_hierarchy(folder / "ept-hierarchy");
  std::uint64_t unlisted = 0;
  if (!fs::is_directory(folder / "ept-data"))
    fail(description, "there is no folder ept-data beside it, which has the points");
  std::map<std::string, std::uint64_t> missing = nodes;
  for (const fs::path& path : files_in(folder / "ept-data", ".laz", false)) {
    const std::string name = path.stem().string();
    if (!is_ept_node(name) || (!nodes.empty() && nodes.count(name) == 0)) {
      ++unlisted;
      continue;
    }
    missing.erase(name);
    scan.nodes.push_back(path);
  }
  if (unlisted > 0)
    scan.warnings.push_back(folder.string() + ": " + std::to_string(unlisted) +
                            " files in ept-data are no nodes that the hierarchy lists; they are not read");
  if (!missing.empty()) {
    std::uint64_t points = 0;
    for (const auto& [name, count] : missing) points += count;
    scan.warnings.push_back(folder.string() + ": " + std::to_string(missing.size()) + " of " +
                            std::to_string(nodes.size()) +
                            " nodes that the hierarchy lists have no file, the first " +
                            missing.begin()->first + ": " + std::to_string(points) + " points are missing");
  }
  if (scan.nodes.empty()) fail(description, "no file in ept-data is a node of this octree");
  return scan;
}

ScanFolder open_potree(const fs::path& folder) {
  const fs::path description = folder / "cloud.js";
  const Json cloud = read_json(description, kMaxDescription);
  const std::string type = text_of(cloud, "pointAttributes");
  if (type != "LAZ" && type != "LAS")
    fail(description,
         "the nodes of this Potree octree are binary files, LAZ and LAS are read; make it anew with "
         "PotreeConverter --output-format LAZ, or read the scan that it was made of");
  ScanFolder scan;
  scan.kind = "a Potree octree";
  const std::string inner = text_of(cloud, "octreeDir");
  if (fs::path(inner).is_absolute() || inner.find("..") != std::string::npos)
    fail(description, "its octreeDir '" + inner.substr(0, 80) + "' lies outside of its folder");
  const fs::path given = folder / (inner.empty() ? "data" : inner);
  // Some copies lack the folder that the description names.
  const fs::path root = fs::is_directory(given) ? given : folder;
  for (const fs::path& path : files_in(root, type == "LAZ" ? ".laz" : ".las", true)) {
    const std::string name = path.stem().string();
    if (name[0] == 'r' && name.find_first_not_of("01234567", 1) == std::string::npos)
      scan.nodes.push_back(path);
  }
  if (scan.nodes.empty()) fail(description, "there is no node r.laz of this Potree octree below the folder");
  return scan;
}

}  // namespace

bool describes_scan_folder(const fs::path& file) {
  const fs::path name = file.filename();
  return name == "ept.json" || name == "cloud.js";
}

std::optional<ScanFolder> open_scan_folder(const fs::path& folder) {
  if (fs::is_regular_file(folder / "ept.json")) return open_ept(folder);
  if (fs::is_regular_file(folder / "cloud.js")) return open_potree(folder);
  if (fs::is_regular_file(folder / "octree.bin") && fs::is_regular_file(folder / "metadata.json"))
    fail(folder / "metadata.json",
         "this is an octree of Potree 2, which is not read; read the scan that it was made of, or a Potree 1 "
         "octree of "
         "LAZ files");
  return std::nullopt;
}

}  // namespace tessera
