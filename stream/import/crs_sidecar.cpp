#include "stream/import/crs_sidecar.h"

#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/read_file.h"

namespace tessera {
namespace {

/// What is larger is no coordinate system.
constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 20;

std::string text_of(const std::filesystem::path& path) {
  std::error_code error;
  if (!std::filesystem::is_regular_file(path, error)) return "";
  const ReadFile file(path);
  if (file.size() > kMaxBytes) return "";
  std::string text(static_cast<std::size_t>(file.size()), '\0');
  file.read_at(0, text.data(), text.size());
  return text;
}

std::string crs_of_input(const Json& report) {
  const Json inputs = report.value("inputs", Json::array());
  return inputs.empty() ? "" : crs_of_mesh(bytes_of_json_text(inputs.front().at("path").get<std::string>()));
}

}  // namespace

std::filesystem::path crs_sidecar_path(const std::filesystem::path& mesh) {
  std::filesystem::path path = mesh;
  return path += ".prj";
}

std::string crs_of_mesh(const std::filesystem::path& mesh) {
  std::filesystem::path shared = mesh;
  shared.replace_extension(".prj");
  const std::string own = text_of(crs_sidecar_path(mesh));
  return own.empty() ? text_of(shared) : own;
}

SidecarOutput found_crs() {
  return {crs_sidecar_path, "the coordinate system beside -o", false, [](const Json& report) {
            const Json crs = report.value("coordinate_system", Json());
            return crs.is_object() ? bytes_of_json_text(crs.value("wkt", "")) : std::string();
          }};
}

SidecarOutput carried_crs() {
  return {crs_sidecar_path, "the coordinate system beside -o", false, crs_of_input};
}

}  // namespace tessera
