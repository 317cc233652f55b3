/// \file view_page.h
/// The page of `tessera view`: the viewer's bundle (tools/viewer) with what it shall show put into its one place for data.
/// A mesh goes in whole, streamed: single precision around an origin of its own, deflated, so that one file is enough.
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "stream/page/report_page.h"

namespace tessera {

/// Above, browsers want levels of detail: 3D Tiles.
inline constexpr std::uint64_t kMaxViewFaces = kMaxWholeFaces;

/// What the person chose.
struct ViewOptions {
  std::string up = "z";  ///< x, y or z
  /// Mesh to colour the distance to, instead of other colours; empty = none.
  std::filesystem::path deviation;
  /// OUT.uncertain.ply, for colours by doubt; empty = none; not with deviation.
  std::filesystem::path uncertain;
  double tolerance = 0.0;          ///< end of the scale of deviations, scan units; 0 = 99th percentile
  bool with_sign = false;          ///< in front of or behind the reference, not only how far
  std::uint64_t memory_bytes = 0;  ///< cap on the peak resident memory
  std::filesystem::path temp;      ///< folder for what does not fit
};

/// Looks at header and counts, so that what cannot work is refused at once.
/// \throws UsageError more than kMaxViewFaces faces, or three times as many vertices; EmptyError no face; InputError
void require_viewable(const std::filesystem::path& mesh);

/// Writes the page of a mesh, in the colours of the deviations that its vertices carry (`deviate`) unless options name others.
/// \param bundle  viewer.html
/// \throws as require_viewable(), also where the header lied; InputError a corner of a face is not finite, or `bundle` is
///   none of ours; ResourceError when the disk is full or the cap cannot suffice
void write_mesh_view(const std::filesystem::path& page, const std::filesystem::path& bundle,
                     const std::filesystem::path& mesh, const ViewOptions& options);

/// Whether it is a file of points, without faces, that `deviate` gave their deviations: write_points_view() shows it.
/// \throws InputError
bool is_deviation_cloud(const std::filesystem::path& path);
/// Whether its vertices or points have deviations, which views are coloured by.
bool has_deviations(const std::filesystem::path& path);

/// Writes the page of points of any number with deviations: the means of at most 200,000 cubes, each a small octahedron.
/// \throws as write_mesh_view(); EmptyError where no point has a deviation
void write_points_view(const std::filesystem::path& page, const std::filesystem::path& bundle,
                       const std::filesystem::path& points, const ViewOptions& options);

/// Writes the page of a tileset that is served below it. \param url  relative to the page, percent-encoded
void write_tiles_view(const std::filesystem::path& page, const std::filesystem::path& bundle,
                      const std::string& name, const std::string& url, const std::string& up);

/// Whether write_mesh_view() wrote this file.
bool is_view(const std::filesystem::path& path);

}  // namespace tessera
