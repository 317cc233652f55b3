#include <fmt/format.h>

#include <filesystem>
#include <optional>
#include <string>

#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/volume/mesh_volume.h"

namespace tessera {
namespace {

Json json_of(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}
std::string csv_of(const std::optional<double>& value) {
  return value ? fmt::format("{:.17g}", *value) : "";
}

}  // namespace

std::optional<double> proven_tolerance(const std::filesystem::path& mesh) {
  const std::filesystem::path path = mesh.string() + ".report.json";
  std::error_code missing;
  if (!std::filesystem::exists(path, missing)) return std::nullopt;
  const ReadFile file(path);
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, text.data(), text.size());
  const Json report = try_parse_json(text);
  const auto number = [&](const char* pointer) -> std::optional<double> {
    const Json* value = report.at_path(pointer);
    return value != nullptr && value->is_number() ? std::optional(value->number()) : std::nullopt;
  };
  const std::optional<double> bytes = number("/mesh/bytes"), bound = number("/certificate/certified_max");
  if (!bytes || *bytes != static_cast<double>(std::filesystem::file_size(mesh, missing))) return std::nullopt;
  return bound;
}

std::string describe(const MeshVolumes& volumes) {
  bool noise = false;
  for (const AreaVolume& a : volumes.areas) noise = noise || a.noise_bound;
  std::string text = fmt::format("{:<10} {:>14} {:>14} {:>14} {:>14} {:>14} {:>12}{}\n", "area", "plan area",
                                 "covered", "fill", "cut", "net", "within", noise ? "   noise 95 %" : "");
  for (const AreaVolume& a : volumes.areas) {
    text += fmt::format("{:<10} {:>14.8g} {:>14.8g} {:>14.8g} {:>14.8g} {:>14.8g} {:>12}", a.name,
                        a.plan_area, a.volume.area, a.volume.fill, a.volume.cut, a.volume.fill - a.volume.cut,
                        a.bound ? fmt::format("{:.3g}", *a.bound) : "unknown");
    if (noise)
      text += a.noise_bound ? fmt::format(" {:>12.3g}", *a.noise_bound) : fmt::format(" {:>12}", "unknown");
    text += '\n';
  }
  for (const AreaVolume& a : volumes.areas)
    if (a.outline_uncovered.value_or(0.0) > 1e-8 * a.outline.value_or(0.0))
      text += fmt::format(
          "area {}: {:.6g} of the {:.6g} of its outline have no mesh; the toe line runs straight there\n",
          a.name, *a.outline_uncovered, *a.outline);
  return text;
}

std::string to_csv(const MeshVolumes& volumes) {
  std::string text = "area,plan_area,covered,fill,cut,net,bound,noise_bound,outline,outline_uncovered\n";
  for (const AreaVolume& a : volumes.areas)
    text +=
        fmt::format("{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{},{},{},{}\n", a.name, a.plan_area,
                    a.volume.area, a.volume.fill, a.volume.cut, a.volume.fill - a.volume.cut, csv_of(a.bound),
                    csv_of(a.noise_bound), csv_of(a.outline), csv_of(a.outline_uncovered));
  return text;
}

Json to_json(const MeshVolumes& volumes) {
  Json areas = Json::array();
  for (const AreaVolume& a : volumes.areas) {
    areas.push_back({{"area", a.name},
                     {"plan_area", a.plan_area},
                     {"covered", a.volume.area},
                     {"fill", a.volume.fill},
                     {"cut", a.volume.cut},
                     {"net", a.volume.fill - a.volume.cut},
                     {"surface", a.surface},
                     {"base_surface", a.base_surface},
                     {"bound", json_of(a.bound)},
                     {"noise_bound", json_of(a.noise_bound)},
                     {"outline", json_of(a.outline)},
                     {"outline_uncovered", json_of(a.outline_uncovered)}});
  }
  return {{"areas", areas}, {"downward", volumes.downward}};
}

}  // namespace tessera
