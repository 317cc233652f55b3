/// \file geojson.h
/// What stands in GeoJSON (RFC 7946), whose coordinates are taken as they are.
#pragma once
#include <array>
#include <functional>
#include <string>

#include "stream/files/json.h"

namespace tessera {

/// Calls use(type, coordinates) for every geometry of an object, in order: a geometry, a Feature, a FeatureCollection or a
/// GeometryCollection. Objects that are none, and what lies too deep in collections, are passed over.
void for_geometries(const Json& object,
                    const std::function<void(const std::string& type, const Json& coordinates)>& use);

/// x and y of a corner, whatever else it says. \throws InputError where they are no finite numbers
std::array<double, 2> corner_of_geometry(const Json& corner);

}  // namespace tessera
