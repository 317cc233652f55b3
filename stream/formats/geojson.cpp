#include "stream/formats/geojson.h"

#include <cmath>

#include "octree/error.h"
#include "stream/files/json.h"

namespace tessera {
namespace {

constexpr int kMaxGeometryDepth = 32;  ///< of collections in collections

using GeometryUse = std::function<void(const std::string& type, const Json& coordinates)>;

void walk_geometries(const Json& object, const GeometryUse& use, int depth) {
  if (!object.is_object() || depth > kMaxGeometryDepth) return;
  const auto each = [&](const char* key) {
    const Json* list = object.find(key);
    if (list != nullptr && list->is_array())
      for (const Json& item : *list) walk_geometries(item, use, depth + 1);
  };
  const std::string type = object.value("type", std::string());
  if (type == "Feature" && object.contains("geometry"))
    walk_geometries(object.at("geometry"), use, depth + 1);
  else if (type == "FeatureCollection")
    each("features");
  else if (type == "GeometryCollection")
    each("geometries");
  else if (object.contains("coordinates"))
    use(type, object.at("coordinates"));
}

}  // namespace

void for_geometries(const Json& object, const GeometryUse& use) {
  walk_geometries(object, use, 0);
}

std::array<double, 2> corner_of_geometry(const Json& corner) {
  if (!corner.is_array() || corner.size() < 2 || !corner[0].is_number() || !corner[1].is_number())
    throw InputError("a corner is no pair of numbers");
  const std::array<double, 2> c = {corner[0].get<double>(), corner[1].get<double>()};
  if (!std::isfinite(c[0]) || !std::isfinite(c[1])) throw InputError("a corner is not finite");
  return c;
}

}  // namespace tessera
