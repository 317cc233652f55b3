#include "stream/survey/gdal_program.h"

#include <unistd.h>

#include <algorithm>
#include <string>
#include <vector>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/output_file.h"
#include "stream/files/path_text.h"
#include "stream/files/read_file.h"
#include "stream/formats/points/projection.h"
#include "stream/import/crs_sidecar.h"
#include "stream/runtime/child_process.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

void copy_to_output(const std::filesystem::path& from, const std::filesystem::path& output) {
  constexpr std::uint64_t kPage = std::uint64_t{1} << 20;
  const ReadFile file(from);
  OutputFile out(output);
  for (std::uint64_t at = 0; at < file.size(); at += kPage) {
    throw_if_stopped();
    const std::uint64_t bytes = std::min(kPage, file.size() - at);
    file.read_at(at, out.reserve(bytes), bytes);
    out.commit(bytes);
    file.release(at, bytes);
  }
  out.finish();
}

}  // namespace

std::filesystem::path gdal_program() {
  return program_beside("tessera-gdal",
                        "it writes GeoTIFF and lines by GDAL: tools/build release tessera-gdal makes it");
}

std::string surveyed_crs(const std::filesystem::path& mesh, const std::string& given) {
  if (!given.empty()) return crs_text(given, "--crs");
  const std::string text = crs_of_mesh(mesh);
  if (text.empty()) return text;
  try {
    user_crs(text, "the .prj beside " + mesh.string());
  } catch (const UsageError& e) {
    throw InputError(std::string(e.what()) + "; correct or remove it, or name the system with --crs");
  }
  return text;
}

std::string write_by_gdal(const std::filesystem::path& scratch, const std::string& command, Json request,
                          std::uint64_t memory_bytes, const std::filesystem::path& output) {
  const std::filesystem::path result = scratch / "result", file = scratch / "request.json";
  request["result"] = json_text(result);
  write_durably(file, dump_json(request));
  const ChildResult child =
      run_program(gdal_program(), {command, file.string(), "--memory", std::to_string(memory_bytes),
                                   "--driven", std::to_string(::getpid())});
  if (child.exit_code != 0) throw_child_failure(child, "tessera-gdal");
  copy_to_output(result, output);
  std::filesystem::remove(result);
  return child.message;
}

}  // namespace tessera
