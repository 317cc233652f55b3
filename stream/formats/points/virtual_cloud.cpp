#include "stream/formats/points/virtual_cloud.h"

#include <algorithm>
#include <cstdint>
#include <string>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/read_file.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;
constexpr std::uint64_t kMaxVirtualCloud = std::uint64_t{64} << 20;  // of some 100,000 files

const Json* member(const Json& object, const char* key) {
  return object.is_object() ? object.find(key) : nullptr;
}

/// Whether an asset says that it is something else than the points themselves.
bool is_other_role(const Json& asset) {
  const Json* const roles = member(asset, "roles");
  if (roles == nullptr || !roles->is_array()) return false;
  bool any = false;
  for (const Json& role : *roles) {
    if (role.is_string() && role.get<std::string>() == "data") return false;
    any = true;
  }
  return any;
}

/// "%20" and the like as the bytes that they stand for, as in any URL.
std::string unescaped(const std::string& text) {
  std::string out;
  const auto hex = [](char c) {
    return c >= '0' && c <= '9'   ? c - '0'
           : c >= 'a' && c <= 'f' ? c - 'a' + 10
           : c >= 'A' && c <= 'F' ? c - 'A' + 10
                                  : -1;
  };
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '%' && i + 2 < text.size() && hex(text[i + 1]) >= 0 && hex(text[i + 2]) >= 0) {
      out.push_back(static_cast<char>(16 * hex(text[i + 1]) + hex(text[i + 2])));
      i += 2;
    } else {
      out.push_back(text[i]);
    }
  }
  return out;
}

/// \param href  a path, absolute or from the list's folder on, as it is or as in a URL
fs::path located(const fs::path& list, std::string href) {
  const auto scheme = href.find("://");
  if (href.starts_with("file://")) {
    href = unescaped(href.substr(std::string("file://").size()));
  } else if (scheme != std::string::npos || href.starts_with("/vsi")) {
    throw InputError(list.string() + ": names " + json_text(href.substr(0, 200)) +
                     ", which lies on a network; Tessera opens no connection: download the files and let the "
                     "list name the copies");
  }
  const fs::path given = bytes_of_json_text(href);
  const auto at = [&](const fs::path& p) { return p.is_absolute() ? p : list.parent_path() / p; };
  std::error_code error;
  const fs::path plain = at(given).lexically_normal();
  if (fs::exists(plain, error)) return plain;
  const fs::path decoded = at(unescaped(given.string())).lexically_normal();
  if (fs::exists(decoded, error)) return decoded;
  throw InputError(list.string() + ": names " + json_text(plain.string()) + ", and there is no such file");
}

}  // namespace

bool is_virtual_cloud(const fs::path& file) {
  return lower_extension(file) == ".vpc";
}

std::vector<fs::path> virtual_cloud_files(const fs::path& path) {
  const ReadFile file(path);
  if (file.size() > kMaxVirtualCloud)
    throw InputError(path.string() + ": has " + std::to_string(file.size()) +
                     " bytes, too many for a virtual point cloud");
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, text.data(), text.size());
  const Json parsed = try_parse_json(text);
  const Json* const features = member(parsed, "features");
  if (features == nullptr || !features->is_array())
    throw InputError(path.string() +
                     ": is no virtual point cloud: a JSON object with a list of features is expected");
  std::vector<fs::path> files;
  std::size_t number = 0;
  for (const Json& feature : *features) {
    ++number;
    const Json* const assets = member(feature, "assets");
    const Json* const data = assets != nullptr ? member(*assets, "data") : nullptr;
    const Json* href = data != nullptr && !is_other_role(*data) ? member(*data, "href") : nullptr;
    if (href == nullptr || !href->is_string())
      throw InputError(path.string() + ": feature " + std::to_string(number) +
                       " names no file: its asset 'data' has no 'href'");
    files.push_back(located(path, href->get<std::string>()));
  }
  if (files.empty()) throw InputError(path.string() + ": the virtual point cloud names no file");
  return files;
}

}  // namespace tessera
