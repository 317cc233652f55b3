/// \file crs.h
/// The coordinate system that a scan says it is in: as WKT, or by codes of EPSG (GeoTIFF keys). Read and compared by its
/// text alone; PROJ (projection.h) is asked where texts differ.
#pragma once
#include <string>
#include <vector>

#include "stream/files/read_file.h"

namespace tessera {

struct Crs {
  std::string name;    ///< "RGF93 v1 / Lambert-93", "EPSG:2229", or what the keys cite; empty = none is named
  std::string wkt;     ///< as the file has it, without trailing zeros; empty where it has keys alone
  int horizontal = 0;  ///< code of EPSG; 0 = unknown
  int vertical = 0;
  bool geographic = false;   ///< its coordinates are degrees of longitude and latitude
  double height_unit = 0.0;  ///< of heights, in metres; 0 = it does not say

  bool known() const { return !name.empty(); }
};

/// WGS 84, longitude first: what degrees without a word are taken for.
Crs longitude_and_latitude();

/// Whether both may be one system as far as codes, texts and names tell: where they are there on both sides, one of them
/// is equal; what names none agrees with all.
bool may_be_same(const Crs& a, const Crs& b);

/// From the text alone: its name, and its codes where it ends with them.
Crs crs_of_wkt(const std::string& wkt);

/// From variable length records of LAS (and LAZ): the WKT where the header's bit 4 or a point format from 6 on says so,
/// whatever GeoTIFF keys say; else WKT too, completed by codes, unless keys name another system by code. Source: ASPRS, LAS Specification 1.4 R15,
/// "Coordinate Reference System (CRS) Representation"; OGC GeoTIFF 1.1 (OGC 19-008r4), keys and key directory.
/// \param warnings  gets a sentence where records are damaged or differ: no reason not to read the points
Crs las_crs(const ReadFile& file, std::vector<std::string>& warnings);

}  // namespace tessera
