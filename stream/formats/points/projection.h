/// \file projection.h
/// Coordinate systems as PROJ understands them: whether two texts mean one system, which UTM zone a place is in, and
/// points out of one system into another. Without libproj.so.25 nothing is known and nothing can be projected.
#pragma once
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stream/formats/points/crs.h"

namespace tessera {

/// Whether both have the same projection, parameters, units and datum in the plane, whatever the style of their texts
/// (OGC, ESRI, codes). Nothing where PROJ cannot tell. Answers are remembered.
std::optional<bool> same_projection(const Crs& a, const Crs& b);

/// may_be_same(), and where that tells of different texts same_projection().
bool is_same_crs(const Crs& a, const Crs& b);

/// Metres of the unit of a projected system's plane; 0 for other systems, and where PROJ cannot tell.
double plane_unit(const Crs& crs);

/// What a user names: "EPSG:25832", WKT, or anything else that PROJ takes for a coordinate system; with its WKT.
/// \throws UsageError naming `option` where it is none
Crs user_crs(const std::string& text, const std::string& option);

/// What a file of that name holds, else the text itself. \throws as user_crs
std::string crs_text(const std::string& text, const std::string& option);

/// The UTM zone of a place, in degrees, on the datum of the system as far as EPSG has zones of it, else WGS 84.
/// \throws InputError for a place that has none (beyond 84 north or 80 south, or no degrees)
Crs utm_zone(const Crs& geographic, double longitude, double latitude);

/// Points from one system into another, in the plane; heights change their unit only. One thread at a time. Results are
/// whole numbers of 2^-14 units (0.06 mm), so that they do not hang on the last bits of a library's sine.
class Projection {
 public:
  /// \throws InputError naming both systems where PROJ knows no way from one to the other
  Projection(const Crs& from, const Crs& to);
  ~Projection();
  /// Places that have none in the other system become not-a-number.
  void apply(std::vector<double>& x, std::vector<double>& y, std::vector<double>& z) const;

 private:
  struct Proj;
  std::unique_ptr<Proj> proj_;
  double height_scale_ = 1.0;
};

}  // namespace tessera
