/// \file page_figures.h
/// The figures of a page, each part as HTML; empty where the report has none of them.
#pragma once
#include <string>

#include "stream/files/json.h"
#include "stream/page/page_text.h"

namespace tessera {

/// Fates of the points, resolution and spacing; or the mesh that was read and what was repaired in it.
std::string input_figures(const Json& report);
/// Components, genus, holes and borders, defects.
std::string topology_figures(const PageParts& parts);
/// What is proven of the distance, and its distribution with the tolerance marked.
std::string deviation_figures(const Json& report);
/// Angles, lengths of edges, aspects.
std::string shape_figures(const Json& report, const PageParts& parts);
/// Stages with their time, memory against the cap, disk.
std::string run_figures(const Json& report);
/// Positions of 16 bits an axis, faces and colours for the script of the page, behind a text.
void add_preview_data(std::string& text, const PreviewMesh& mesh);

}  // namespace tessera
