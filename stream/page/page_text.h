/// \file page_text.h
/// The report of a job as one HTML file for people: what went in, what came out, how it ran. Everything stands in it: styles,
/// script, pictures, the preview; a policy in its head forbids it to load anything.
#pragma once
#include <filesystem>
#include <optional>
#include <string>

#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "stream/page/preview_mesh.h"

namespace tessera {

/// What a page shows beside the figures of the report. A part that is not there says why in its note.
struct PageParts {
  std::string pictures, pictures_note;    ///< PNG: the result from four sides
  std::string deviation, deviation_note;  ///< PNG: its distance to what it was made from
  std::string uncertain;                  ///< PNG: where the sides of points are in doubt
  std::string missing;                    ///< PNG: what of the scan is missing in the result
  std::string textures, textures_note;    ///< PNG: pages of textures side by side
  std::optional<PreviewMesh> preview;
  std::string preview_note;
  std::optional<MeshCheck> check;
  std::string check_note;
};

/// \param report  of schema 1 (stream/runtime/report.h); what it lacks is left out
/// \post  a pure function of both
std::string page_text(const Json& report, const PageParts& parts);

/// Whether the file begins as page_text() begins.
bool is_page(const std::filesystem::path& path);

}  // namespace tessera
