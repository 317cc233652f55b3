#include "stream/survey/section_axis.h"

#include <optional>
#include <string>

#include "kernels/survey/section_frame.h"
#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/formats/geojson.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMaxAxisBytes = std::uint64_t{64} << 20;
constexpr std::size_t kMaxAxisCorners = 100000;

std::vector<Double2> corners_of(const Json& line) {
  if (!line.is_array()) throw InputError("its line is no list of corners");
  if (line.size() > kMaxAxisCorners)
    throw InputError("its line has more than " + std::to_string(kMaxAxisCorners) + " corners; simplify it");
  std::vector<Double2> corners;
  for (const Json& corner : line) corners.push_back(corner_of_geometry(corner));
  return corners;
}

}  // namespace

std::vector<Double2> read_axis(const std::filesystem::path& path) {
  const std::string name = path.string();
  const ReadFile file(path);
  if (file.size() > kMaxAxisBytes) throw InputError(name + ": is too large for an axis");
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, text.data(), text.size());
  std::optional<std::vector<Double2>> axis;
  try {
    const Json root = try_parse_json(text);
    if (root.is_discarded()) throw InputError("is not JSON");
    for_geometries(root, [&](const std::string& type, const Json& coordinates) {
      if (axis) return;
      if (type == "LineString") axis = corners_of(coordinates);
      if (type == "MultiLineString" && coordinates.is_array() && !coordinates.empty())
        axis = corners_of(coordinates.front());
    });
    if (!axis) throw InputError("holds no LineString");
    if (axis_pieces(*axis).empty()) throw InputError("its line has no length");
  } catch (const InputError& e) {
    throw InputError(name + ": " + e.what() + "; --line wants GeoJSON in the coordinates of the mesh");
  } catch (const JsonError&) {
    throw InputError(name + ": is no GeoJSON; --line wants that, in the coordinates of the mesh");
  }
  return *axis;
}

}  // namespace tessera
