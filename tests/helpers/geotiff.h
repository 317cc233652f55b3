/// \file geotiff.h
/// Rasters that `tessera` wrote, read back by GDAL's own programs.
#pragma once
#include <catch2/catch.hpp>

#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::test {

/// Says that the case is skipped where they are not there.
inline bool has_gdal() {
  if (shell("gdalinfo --version").code == 0) return true;
  skip("there is no gdalinfo (gdal-bin)");
  return false;
}

inline Json geotiff_info(const std::filesystem::path& file) {
  const Outcome r = shell("gdalinfo -json " + file.string());
  INFO(r.said);
  REQUIRE(r.code == 0);
  CHECK(r.said.find("Warning") == std::string::npos);
  CHECK(r.said.find("ERROR") == std::string::npos);
  return parse_json(r.said);
}

/// Values of cells, rows from the north.
template <class T>
std::vector<T> geotiff_values(const std::filesystem::path& file) {
  const TempFolder folder;
  const std::filesystem::path raw = folder / "raw";
  REQUIRE(shell("gdal_translate -q -of ENVI -co INTERLEAVE=BIP " + file.string() + " " + raw.string()).code ==
          0);
  const std::string bytes = file_bytes(raw);
  std::vector<T> out(bytes.size() / sizeof(T));
  std::memcpy(out.data(), bytes.data(), out.size() * sizeof(T));
  return out;
}

}  // namespace tessera::test
