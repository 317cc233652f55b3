/// \file virtual_cloud.h
/// Virtual point clouds (.vpc): a list of files of points that are one scan, as QGIS and PDAL make it. Source: PDAL wrench, "Virtual
/// Point Cloud (VPC)", draft of 2023: a GeoJSON FeatureCollection of STAC items, whose asset `data` names a file.
#pragma once
#include <filesystem>
#include <vector>

namespace tessera {

/// Whether a file's name ends as theirs do.
bool is_virtual_cloud(const std::filesystem::path& file);

/// The files that it names, in its order, relative ones from its own folder on. Overviews, which repeat points, are none of them.
/// \throws InputError for what is none, for one without files, and for files that lie elsewhere on a network
std::vector<std::filesystem::path> virtual_cloud_files(const std::filesystem::path& path);

}  // namespace tessera
