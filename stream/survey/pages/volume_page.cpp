#include "stream/survey/pages/volume_page.h"

#include <algorithm>

#include <fmt/format.h>

#include "kernels/picture/caption.h"
#include "stream/files/path_text.h"
#include "stream/runtime/numbers.h"
#include "stream/survey/pages/area_sketch.h"

namespace tessera {
namespace {

constexpr std::size_t kNamedVolumes = 500;

std::string volume_text(double value) {
  return fmt::format("{:.8g}", value);
}

std::string bound_of(const AreaVolume& area) {
  return area.bound ? fmt::format("{:.3g}", *area.bound) : "unknown";
}

PageTable volume_table(const MeshVolumes& volumes) {
  PageTable table;
  table.columns = {"area", "plan area", "covered", "fill", "cut", "net", "may be off by"};
  const bool noise = std::any_of(volumes.areas.begin(), volumes.areas.end(),
                                 [](const AreaVolume& a) { return a.noise_bound.has_value(); });
  if (noise) table.columns.emplace_back("by noise (95 %)");
  const std::size_t shown = std::min(volumes.areas.size(), kNamedVolumes);
  for (std::size_t i = 0; i < shown; ++i) {
    const AreaVolume& a = volumes.areas[i];
    table.rows.push_back({a.name, volume_text(a.plan_area), volume_text(a.volume.area),
                          volume_text(a.volume.fill), volume_text(a.volume.cut),
                          volume_text(a.volume.fill - a.volume.cut), bound_of(a)});
    if (noise) table.rows.back().push_back(a.noise_bound ? fmt::format("{:.3g}", *a.noise_bound) : "unknown");
  }
  table.note =
      "Fill is where the mesh lies above its base, cut where below; net is fill less cut. Net may be off by "
      "what the "
      "proven tolerances of the surfaces allow; unknown where none is proven.";
  if (shown < volumes.areas.size())
    table.note += fmt::format(" The first {} of {} polygons; --csv has all.", with_commas(shown),
                              with_commas(volumes.areas.size()));
  return table;
}

}  // namespace

SurveyPage volume_page(const MeshVolumes& volumes, const std::filesystem::path& mesh, const std::string& base,
                       const VolumeOptions& options) {
  SurveyPage page;
  page.title = "Volumes", page.command = "volume";
  page.subject = json_text(mesh.filename()) + " over " +
                 (options.base.empty() ? base : json_text(options.base.filename()));
  if (volumes.areas.size() == 1) {
    const AreaVolume& a = volumes.areas.front();
    page.headlines = {{"fill", volume_text(a.volume.fill)},
                      {"cut", volume_text(a.volume.cut)},
                      {"net", volume_text(a.volume.fill - a.volume.cut)},
                      {"net may be off by", bound_of(a)}};
  }
  if (volumes.downward > 0.0)
    page.notices.push_back("faces of the mesh that show down count negative: a plan area of " +
                           number_text(volumes.downward));
  page.inputs = {
      {"mesh", json_text(mesh)},
      {"base", options.kind == VolumeBase::kLevel      ? "level " + volume_text(options.level)
               : options.kind == VolumeBase::kToe      ? "toe line of each polygon, triangulated"
               : options.kind == VolumeBase::kToePlane ? "plane through the toe line of each polygon"
                                                       : json_text(options.base)}};
  if (!options.areas.empty()) page.inputs.emplace_back("polygons", json_text(options.areas));
  if (options.tolerance >= 0.0)
    page.inputs.emplace_back("tolerance of the mesh", number_text(options.tolerance));
  if (!options.base.empty() && options.base_tolerance >= 0.0)
    page.inputs.emplace_back("tolerance of the base", number_text(options.base_tolerance));
  page.inputs.emplace_back("unit of areas and volumes", "that of the coordinates, squared and cubed");
  page.tables_title = options.areas.empty() ? "Figures" : "Figures by polygon";
  page.tables.push_back(volume_table(volumes));
  if (!options.areas.empty()) {
    page.drawings_title = "Where";
    page.drawings.push_back(area_sketch(options.areas));
  }
  return page;
}

}  // namespace tessera
