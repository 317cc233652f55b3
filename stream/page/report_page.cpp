#include "stream/page/report_page.h"

#include <algorithm>
#include <chrono>
#include <span>
#include <vector>

#include <fmt/format.h>

#include "kernels/picture/caption.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/output_file.h"
#include "stream/files/path_text.h"
#include "stream/files/scratch_folder.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/page/report_value.h"
#include "stream/page/texture_sheet.h"
#include "stream/render/render.h"
#include "stream/runtime/job_report.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/report.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
constexpr double kMinMapSeconds = 3.0;                          // of a map, however short the job was
constexpr std::uint64_t kMaxPicture = std::uint64_t{64} << 20;  // bytes of a file taken into the page

std::string file_bytes(const fs::path& path) {
  std::error_code error;
  if (!fs::is_regular_file(path, error) || fs::file_size(path, error) > kMaxPicture || error) return "";
  return read_text(path);
}

std::uint64_t margin_of(const PageRequest& request) {
  return request.memory_bytes / 32;
}

/// What of the cap is left to one part.
std::uint64_t memory_left(const PageRequest& request) {
  trim_allocator();
  const std::uint64_t resident = resident_bytes() + margin_of(request);
  return request.memory_bytes > resident ? request.memory_bytes - resident : 1;
}

/// One part of the page; what stops it is told in the page, since the job itself is done.
template <class Make>
void part(std::string& note, const std::string& what, const Make& make) {
  try {
    make();
  } catch (const StoppedError&) {
    throw;
  } catch (const std::exception& e) {
    note = fmt::format("{} left out: {}", what, e.what());
  }
}

RenderOptions sheet(const PageRequest& request, const fs::path& input, const fs::path& scratch) {
  RenderOptions options;
  options.inputs = {input.string()};
  options.output = scratch / "picture.png";
  options.temp = scratch;
  options.width = 1200;
  options.height = 900;
  options.samples = 2;
  // render() sees what is held.
  trim_allocator();
  options.memory_bytes = request.memory_bytes - margin_of(request);
  return options;
}

/// At most `size` of the values from one on; of none none.
template <class T>
std::span<const T> batch_of(const std::vector<T>& values, std::size_t first, std::size_t size) {
  const std::size_t from = std::min(first, values.size());
  return std::span(values).subspan(from, std::min(size, values.size() - from));
}

void write_copy(const fs::path& path, const PreviewMesh& preview) {
  MeshHeader header;
  header.vertices = preview.position.size();
  header.faces = preview.faces.size();
  header.colour = !preview.rgba.empty();
  const auto file = create_mesh_file(path, header);
  constexpr std::size_t kBatch = 4096;
  std::vector<Double3> positions;
  for (std::size_t i = 0; i < preview.position.size(); i += positions.size()) {
    positions.clear();
    for (const Float3& p : batch_of(preview.position, i, kBatch)) positions.push_back(wide(p));
    file->vertices(positions, batch_of(preview.rgba, i, kBatch));
  }
  std::vector<MeshFace> faces;
  for (std::size_t i = 0; i < preview.faces.size(); i += faces.size()) {
    faces.clear();
    for (const auto& f : batch_of(preview.faces, i, kBatch)) faces.push_back({f[0], f[1], f[2]});
    file->faces(faces);
  }
  file->finish();
}

void draw_pictures(PageParts& parts, const PageRequest& request, const fs::path& scratch, bool whole) {
  RenderOptions options = sheet(request, request.mesh, scratch);
  parts.pictures_note = "Borders red, faces seen from behind orange, faces that close holes blue. ";
  if (!whole) {
    if (!parts.preview)
      throw ResourceError("of a mesh this large they show the preview, which is left out too");
    // The borders and edges of a copy are its own.
    options.inputs = {(scratch / "copy.ply").string()};
    options.borders = "off";
    write_copy(options.inputs.front(), *parts.preview);
    parts.pictures_note =
        fmt::format("Drawn from a copy of {} of the {} faces; faces seen from behind orange. ",
                    with_commas(parts.preview->faces.size()), with_commas(parts.preview->mesh_faces));
  }
  const RenderReport drawn = render(options);
  for (const std::string& notice : drawn.notices) parts.pictures_note += notice + ". ";
  parts.pictures = file_bytes(options.output);
}

/// What the result is compared with: the mesh of full resolution, the mesh that was decimated or smoothed, or the
/// reference given; empty where the job has none that is still there.
fs::path reference_of(const Json& report) {
  const auto path_at = [&](const char* pointer) {
    return fs::path(bytes_of_json_text(text_at(report, pointer)));
  };
  if (value_at(report, "/input").is_object())
    return path_at(text_at(report, "/options/reference").empty() ||
                           text_at(report, "/options/reference") == "surface"
                       ? "/inputs/0/path"
                       : "/inputs/1/path");
  if (value_at(report, "/options/keep-raw") == true)
    for (const Json& file : value_at(report, "/beside"))
      if (const std::string path = text_at(file, "/path"); path.find(".raw.") != std::string::npos)
        return bytes_of_json_text(path);
  return {};
}

/// Tells early that a map will take too long, so that hardly any time is spent on it.
class MapTime {
 public:
  explicit MapTime(double maximum) : maximum_(maximum) {}

  /// \param share  of the map that is drawn
  bool too_long(double share) {
    const double now = seconds_since(start_);
    if (!(share > share_)) begin_ = now;
    share_ = share;
    const double all = share >= kKnownShare ? begin_ + (now - begin_) / share : 0.0;
    return now > maximum_ || all > kSurelyLonger * maximum_;
  }

 private:
  static constexpr double kKnownShare = 0.05, kSurelyLonger = 1.25;
  double maximum_, begin_ = 0.0, share_ = 0.0;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

void draw_deviation(PageParts& parts, const Json& report, const PageRequest& request,
                    const fs::path& scratch) {
  const fs::path reference = reference_of(report);
  if (reference.empty()) return;
  if (!fs::is_regular_file(reference)) {
    parts.deviation_note =
        "No picture: what the result was made from is no longer at " + reference.string() + ".";
    return;
  }
  const std::string advice =
      fmt::format("this command does: tessera render {} --deviation {} -o deviation.png",
                  request.mesh.string(), reference.string());
  const double faces = std::max({number_at(report, "/input/faces"), number_at(report, "/raw_mesh/faces"),
                                 number_at(report, "/mesh/faces")});
  if (faces > static_cast<double>(kMaxWholeFaces)) {
    parts.deviation_note =
        fmt::format("Not drawn for more than {} faces; {}", with_commas(kMaxWholeFaces), advice);
    return;
  }
  const double maximum = request.map_seconds.value_or(std::max(kMinMapSeconds, number_at(report, "/wall_s")));
  RenderOptions options = sheet(request, request.mesh, scratch);
  options.deviation = reference;
  options.tolerance = tolerance_of_job(report);
  MapTime time(maximum);
  options.check_deviation = [&](double share) {
    if (time.too_long(share))
      throw ResourceError(
          fmt::format("its distances take more than {:.1f} s, longer than the job; {}", maximum, advice));
  };
  const RenderReport drawn = render(options);
  for (const std::string& notice : drawn.notices) parts.deviation_note += notice + ". ";
  parts.deviation = file_bytes(options.output);
}

}  // namespace

fs::path page_path(const fs::path& report) {
  fs::path page = report;
  if (page.extension() == ".json") return page.replace_extension(".html");
  return page += ".html";
}

PageParts make_page_parts(const Json& report, const PageRequest& request) {
  PageParts parts;
  const std::string output = bytes_of_json_text(text_at(report, "/output/path"));
  parts.uncertain = file_bytes(output + ".uncertain.png");
  if (value_at(report, "/coverage/picture") == true) parts.missing = file_bytes(output + ".missing.png");
  std::error_code error;
  if (value_at(report, "/refused").is_object() || !fs::is_regular_file(request.mesh, error)) {
    if (!value_at(report, "/refused").is_object())
      parts.pictures_note = "No pictures: the mesh is no longer at " + request.mesh.string() + ".";
    return parts;
  }
  std::optional<ScratchFolder> scratch;
  part(parts.pictures_note, "Pictures", [&] { scratch.emplace(request.scratch, "page"); });
  if (!scratch) return parts;
  part(parts.preview_note, "Preview",
       [&] { parts.preview = make_preview(request.mesh, scratch->path(), memory_left(request)); });
  const bool whole = number_at(report, "/mesh/faces") <= static_cast<double>(kMaxWholeFaces);
  part(parts.pictures_note, "Pictures", [&] { draw_pictures(parts, request, scratch->path(), whole); });
  if (value_at(report, "/texture").is_object())
    part(parts.textures_note, "Pages of textures",
         [&] { parts.textures = texture_sheet(request.mesh, scratch->path(), memory_left(request)); });
  part(parts.deviation_note, "A picture", [&] { draw_deviation(parts, report, request, scratch->path()); });
  if (!whole) {
    parts.check_note = fmt::format(
        "Holes, borders and shape are not counted here for more than {} faces; this command "
        "does: tessera check {}",
        with_commas(kMaxWholeFaces), request.mesh.string());
    return parts;
  }
  part(parts.check_note, "Holes, borders and shape", [&] {
    MeshCheckOptions options;
    options.memory_bytes = memory_left(request);
    options.temp = scratch->path();
    options.check_stop = throw_if_stopped;
    const auto mesh = open_mesh_file(request.mesh, {.keep_bad_faces = true});
    parts.check = check_mesh(*mesh, options);
  });
  return parts;
}

JobPage job_page() {
  const auto make = [](const JobState& state, const Json& report) -> std::function<void(const Json&)> {
    const PageRequest request{state.output,
                              fs::is_directory(state.work) ? state.work : state.output.parent_path(),
                              state.run.memory_bytes,
                              {}};
    return [parts = make_page_parts(report, request), path = page_path(report_path(state))](
               const Json& final_report) { write_page(path, final_report, parts); };
  };
  return {page_path, make, is_page};
}

void write_page(const fs::path& path, const Json& report, const PageParts& parts) {
  OutputFile file(path);
  file.append(page_text(report, parts));
  file.finish();
}

}  // namespace tessera
