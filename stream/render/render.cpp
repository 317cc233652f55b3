#include "stream/render/render.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <utility>

#include "kernels/picture/camera.h"
#include "kernels/picture/caption.h"
#include "kernels/picture/picture.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/files/file_extension.h"
#include "stream/formats/meshes/mesh_io.h"
#include "stream/formats/ply_header.h"
#include "stream/formats/points/point_source.h"
#include "stream/render/mesh_pages.h"
#include "stream/render/png_file.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

// Measured with GNU time: the program; OSMesa with LLVM and the compiled shaders; readers and batches.
constexpr std::uint64_t kProgramBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kRasterizerBytes = std::uint64_t{96} << 20;
constexpr std::uint64_t kReaderBytes = std::uint64_t{16} << 20;
constexpr std::uint64_t kMinWorkBytes = std::uint64_t{32} << 20;  // vertex ranges and edge tables
constexpr std::uint64_t kMissingBytes = std::uint64_t{64}
                                        << 20;  // its sample, a patch of the mesh and its index
constexpr int kGap = 2;                         // between views, pixels
/// Drawing so few faces once more for each band takes less than the memory of all bands: pages of a system are slow to come.
constexpr std::uint64_t kFewFaces = 250'000;

/// One picture: what is in it, and where it goes.
struct Panel {
  std::vector<std::unique_ptr<SceneItem>> items;
  SceneSample sample;
  SceneBox box;
  std::string caption;
};

/// A PLY file is either; the header tells.
bool is_mesh(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".ply") {
    for (const PlyElement& element : read_ply_header(ReadFile(path)).elements) {
      if ((element.name == "face" || element.name == "tristrips") && element.count > 0) return true;
    }
    return false;
  }
  return is_mesh_extension(extension);
}

/// What is drawn, of all pictures beside each other.
std::vector<std::filesystem::path> all_inputs(const RenderOptions& options) {
  std::vector<std::filesystem::path> all;
  for (const std::vector<std::string>& names : {options.inputs, options.compare}) {
    const std::vector<std::filesystem::path> paths = expand_inputs(names);
    all.insert(all.end(), paths.begin(), paths.end());
  }
  return all;
}

bool asks_for_pages(const RenderOptions& options) {
  return options.deviation.empty() && (options.colour == "auto" || options.colour == "texture");
}

/// What pages of textures take, whatever of them the pictures beside each other share; 0 where none are shown.
std::uint64_t bytes_of_pages(const RenderOptions& options) {
  if (!asks_for_pages(options)) return 0;
  std::vector<std::filesystem::path> meshes = all_inputs(options);
  std::erase_if(meshes, [](const std::filesystem::path& path) { return !is_mesh(path); });
  return mesh_pages_bytes(meshes);
}

/// Whether the processor draws all of it without OpenGL: PictureOptions::only_faces.
bool shows_only_faces(const RenderOptions& options) {
  if (options.shade != "plain" || options.smooth || options.wire || !options.missing.empty()) return false;
  const std::vector<std::filesystem::path> all = all_inputs(options);
  return std::all_of(all.begin(), all.end(), is_mesh) && !(asks_for_pages(options) && may_have_pages(all));
}

Panel open_panel(const std::vector<std::string>& inputs, const RenderOptions& options,
                 std::uint64_t work_bytes, RenderReport& report) {
  Panel panel;
  std::vector<std::filesystem::path> meshes, clouds;
  for (const std::filesystem::path& path : expand_inputs(inputs))
    (is_mesh(path) ? meshes : clouds).push_back(path);
  const std::uint64_t share = meshes.empty() ? 0 : std::max(work_bytes / meshes.size(), kMinWorkBytes);
  for (const std::filesystem::path& path : meshes) {
    const std::uint64_t bytes = options.memory_bytes == 0 ? 0 : share;
    panel.items.push_back(options.deviation.empty() ? make_mesh_item(path, options, bytes, report)
                                                    : make_deviation_item(path, options, bytes, report));
  }
  if (!meshes.empty() && !options.missing.empty())
    panel.items.push_back(make_missing_item(meshes, options, report));
  if (!clouds.empty()) panel.items.push_back(make_points_item(clouds, options, report));
  for (const auto& item : panel.items) {
    panel.sample.merge(item->sample());
    panel.caption += (panel.caption.empty() ? "" : " + ") + item->caption();
  }
  const bool only_points = meshes.empty();
  panel.box = scene_box(panel.sample, only_points);
  return panel;
}

/// Pictures are made in floats, whose squares must stay numbers.
void require_drawable(const SceneBox& box) {
  constexpr double kWidest = 1e15;
  for (std::size_t k = 0; k < 3; ++k)
    if (!(box.high[k] - box.low[k] <= kWidest))
      throw InputError("the scene is " + number_text(box.high[k] - box.low[k]) +
                       " wide, and pictures are made of at most " + number_text(kWidest) +
                       ": scale it, or leave out what lies so far away");
}

std::vector<ViewSpec> chosen_views(const RenderOptions& options, const Double3& origin) {
  std::vector<std::string> names = options.views;
  if (names.empty() && options.eye) names = {"custom"};
  if (names.empty()) names = {"iso", "iso2", "front", "top"};
  std::vector<ViewSpec> views;
  for (const std::string& name : names) {
    if (name != "custom") {
      views.push_back(parse_view(name, options.up));
      continue;
    }
    if (!options.eye || !options.target)
      throw UsageError("--view custom needs --eye x,y,z and --target x,y,z");
    Double3 eye = *options.eye, target = *options.target;
    for (std::size_t i = 0; i < 3; ++i) eye[i] -= origin[i], target[i] -= origin[i];
    views.push_back(eye_view(eye, target, options.up));
  }
  return views;
}

/// Rectangles for `count` views: the grid whose cells are closest to 4 : 3.
std::vector<PictureView> grid(std::size_t count, int width, int height) {
  int best_columns = 1;
  double best = 1e30;
  const auto n = static_cast<int>(count);
  for (int columns = 1; columns <= n; ++columns) {
    const int rows = (n + columns - 1) / columns;
    const double aspect = (static_cast<double>(width) / columns) / (static_cast<double>(height) / rows);
    const double empty = static_cast<double>(rows * columns - n) / n;
    const double miss = std::max(aspect / (4.0 / 3.0), (4.0 / 3.0) / aspect) + empty;
    if (miss < best) best = miss, best_columns = columns;
  }
  const int rows = (n + best_columns - 1) / best_columns;
  std::vector<PictureView> views;
  for (int i = 0; i < n; ++i) {
    const int column = i % best_columns, row = i / best_columns;
    PictureView view;
    view.x = column * (width + kGap) / best_columns;
    view.y = row * (height + kGap) / rows;
    view.width = (column + 1) * (width + kGap) / best_columns - kGap - view.x;
    view.height = (row + 1) * (height + kGap) / rows - kGap - view.y;
    views.push_back(view);
  }
  return views;
}

/// The largest of 1, 2, 5 x 10^k up to `maximum`.
double round_length(double maximum) {
  double unit = 1.0;
  while (unit > maximum) unit /= 10.0;
  while (unit * 10.0 <= maximum) unit *= 10.0;
  if (unit * 5.0 <= maximum) return unit * 5.0;
  return unit * 2.0 <= maximum ? unit * 2.0 : unit;
}

std::string short_number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

void add_captions(Image& image, const std::vector<PictureView>& views, const std::vector<ViewSpec>& specs,
                  const std::string& title) {
  const double cap = std::clamp(image.height / 85.0, 7.0, 22.0);
  const auto available = static_cast<double>(image.width) - 3.0 * cap;
  std::string text = title;
  while (text.size() > 4 && caption_width(text, cap) > available) text.pop_back();
  if (!text.empty()) draw_caption(image, 1.2 * cap, 2.2 * cap, cap, text);
  for (std::size_t i = 0; i < views.size(); ++i) {
    const PictureView& v = views[i];
    const double base = v.y + v.height - 1.1 * cap;
    draw_caption(image, v.x + 1.2 * cap, base, 0.9 * cap, specs[i].name);
    if (!v.camera.orthographic) continue;
    const double per_pixel = 2.0 * v.camera.half_width / v.width;
    const double length = round_length(0.25 * v.width * per_pixel);
    const double right = v.x + v.width - 1.4 * cap;
    const double left = right - length / per_pixel;
    draw_scale_bar(image, left, base - 0.35 * cap, right - left, 0.35 * cap);
    const std::string label = short_number(length);
    draw_caption(image, left - caption_width(label, 0.9 * cap) - 0.8 * cap, base, 0.9 * cap, label);
  }
}

/// A bar of colours up the right side, the ends and the middle of the scale beside it.
void add_legend(Image& image, const ColourLegend& legend) {
  const double cap = std::clamp(image.height / 85.0, 7.0, 22.0);
  const int bar = static_cast<int>(1.6 * cap), height = static_cast<int>(0.36 * image.height);
  const int right = image.width - static_cast<int>(1.4 * cap), top = static_cast<int>(5.0 * cap);
  if (right - bar <= 0 || top + height >= image.height) return;
  for (int y = 0; y < height; ++y) {
    const double value = legend.high + (legend.low - legend.high) * (y + 0.5) / height;
    const std::uint32_t rgba = deviation_colour(value, legend.high, legend.with_sign);
    for (int x = right - bar; x < right; ++x) {
      const bool frame = y == 0 || y == height - 1 || x == right - bar || x == right - 1;
      for (int c = 0; c < 3; ++c)
        image.pixel(x, top + y)[c] = frame ? std::uint8_t{60} : static_cast<std::uint8_t>(rgba >> (8 * c));
    }
  }
  for (const double share : {0.0, 0.5, 1.0}) {
    const std::string label = short_number(legend.low + (legend.high - legend.low) * share);
    draw_caption(image, right - bar - caption_width(label, 0.9 * cap) - 0.6 * cap,
                 top + (1.0 - share) * height + 0.45 * cap, 0.9 * cap, label);
  }
  const double width = caption_width(legend.title, 0.9 * cap);
  draw_caption(image, right - width, top - 1.2 * cap, 0.9 * cap, legend.title);
}

/// Whether something of the scene lies before what is seen at `at`, nearer by more than `margin` within `halo` around it.
bool hidden(const Camera& camera, const Double3& place, const Double2& at, const Double2& halo, double margin,
            std::span<const Float3> scene) {
  const double depth = dot(place, camera.back) + margin;
  return std::any_of(scene.begin(), scene.end(), [&](const Float3& s) {
    const Double3 p = {s[0], s[1], s[2]};
    if (!(dot(p, camera.back) > depth)) return false;
    const std::optional<Double2> seen = position_in_view(camera, p);
    return seen && std::abs((*seen)[0] - at[0]) <= halo[0] && std::abs((*seen)[1] - at[1]) <= halo[1];
  });
}

/// Rings around the places, their labels beside them; what a view does not show has none there.
void add_marks(Image& image, const std::vector<PictureView>& views, const std::vector<RenderMark>& marks,
               const Double3& origin, const SceneBox& box, std::span<const Float3> scene) {
  constexpr double kBefore = 0.03;  // of the diagonal: nearer ones are of the same side
  const double cap = std::clamp(image.height / 85.0, 7.0, 22.0), radius = 0.8 * cap;
  const double margin = kBefore * norm(box.high - box.low);
  for (const PictureView& view : views)
    for (const RenderMark& mark : marks) {
      const Double3 place = mark.at - origin;
      const std::optional<Double2> at = position_in_view(view.camera, place);
      if (!at || hidden(view.camera, place, *at, {radius / view.width, radius / view.height}, margin, scene))
        continue;
      const double x = view.x + (0.5 + 0.5 * (*at)[0]) * view.width,
                   y = view.y + (0.5 - 0.5 * (*at)[1]) * view.height;
      if (x - radius < view.x || x + radius >= view.x + view.width || y - radius < view.y ||
          y + radius >= view.y + view.height)
        continue;
      draw_ring(image, x, y, radius);
      const double width = caption_width(mark.label, cap), right = x + 1.4 * radius;
      draw_caption(image, right + width < view.x + view.width ? right : x - 1.4 * radius - width,
                   y + 0.5 * cap, cap, mark.label);
    }
}

bool overlap(const SceneBox& a, const SceneBox& b) {
  bool meet = true;
  for (std::size_t i = 0; i < 3; ++i) meet = meet && a.low[i] <= b.high[i] && b.low[i] <= a.high[i];
  return meet;
}

std::vector<Float3> relative(const SceneSample& sample, const SceneBox& box, const Double3& origin) {
  std::vector<Float3> points;
  for (const Double3& p : sample.points()) {
    bool in = true;
    Float3 q{};
    for (std::size_t i = 0; i < 3; ++i) {
      in = in && (!box.trimmed || (p[i] >= box.low[i] && p[i] <= box.high[i]));
      q[i] = static_cast<float>(p[i] - origin[i]);
    }
    if (in) points.push_back(q);
  }
  return points;
}

/// \throws UsageError
Shade shade_of(const std::string& word) {
  if (word == "plain") return Shade::kPlain;
  if (word == "gloss") return Shade::kGloss;
  if (word == "lines") return Shade::kLines;
  throw UsageError("--shade " + word + ": use plain, gloss or lines");
}

PictureOptions picture_options(const RenderOptions& options, int width, bool only_faces) {
  PictureOptions out;
  out.only_faces = only_faces;
  out.width = width;
  out.height = options.height;
  out.supersample = options.samples;
  out.occlusion = options.occlusion;
  out.shade = shade_of(options.shade);
  return out;
}

/// All but the pixels and what the scene keeps. What a caller holds counts: a page is drawn at the end of a job, its second picture
/// with the rasterizer of the first one loaded.
std::uint64_t fixed_bytes(bool only_faces) {
  const std::uint64_t loaded = rasterizer_loaded() ? kRasterizerBytes : 0, own = kProgramBytes + loaded,
                      resident = resident_bytes();
  return kProgramBytes + (only_faces ? loaded : kRasterizerBytes) + kReaderBytes +
         (resident > own ? resident - own : 0);
}

/// What pixels take, and how many bands of a panel are held at a time.
struct Pixels {
  std::uint64_t band = 0;
  std::size_t bands = 0, at_once = 0;

  Pixels(const RenderOptions& options, const std::vector<ViewSpec>& specs, int width, bool only_faces) {
    const PictureOptions picture = picture_options(options, width, only_faces);
    std::vector<PictureView> views = grid(specs.size(), width, options.height);
    for (std::size_t i = 0; i < views.size(); ++i) views[i].camera.orthographic = specs[i].orthographic;
    band = band_bytes(picture, views);
    at_once = bands = picture_bands(picture, views).size();
  }
  std::uint64_t bytes() const { return band * at_once; }
};

Image draw_panel(Panel& panel, const std::vector<ViewSpec>& specs, const std::vector<Float3>& fit_points,
                 const Double3& origin, const RenderOptions& options, const PictureOptions& pixels,
                 std::size_t at_once, RenderReport& report) {
  const int width = pixels.width;
  std::vector<PictureView> views = grid(specs.size(), width, options.height);
  Double3 low{}, high{};
  for (std::size_t i = 0; i < 3; ++i) {
    low[i] = panel.box.low[i] - origin[i];
    high[i] = panel.box.high[i] - origin[i];
  }
  for (std::size_t i = 0; i < views.size(); ++i) {
    const double aspect = static_cast<double>(views[i].width) / views[i].height;
    if (options.focus.empty()) {
      views[i].camera = fit_camera(specs[i], fit_points, aspect, options.zoom);
    } else {
      const Double3 centre = {options.focus[0] - origin[0], options.focus[1] - origin[1],
                              options.focus[2] - origin[2]};
      views[i].camera = focus_camera(specs[i], centre, options.focus[3], aspect, options.zoom);
    }
    set_depth_range(views[i].camera, low, high);
  }
  Picture picture(pixels, views);
  report.renderer = picture.renderer();
  DrawContext context;
  context.origin = origin;
  context.box = panel.box;
  context.options = &options;
  Image image = blank_picture(pixels);
  const std::vector<PictureBand> bands = picture_bands(pixels, views);
  for (std::size_t first = 0; first < bands.size(); first += at_once) {
    picture.begin(std::span(bands).subspan(first, std::min(at_once, bands.size() - first)));
    for (const auto& item : panel.items) item->draw(picture, context);
    picture.finish(image);
  }
  if (options.captions) add_captions(image, views, specs, options.titles ? panel.caption : "");
  add_marks(image, views, options.marks, origin, panel.box, fit_points);
  for (const auto& item : panel.items)
    if (const auto legend = item->legend()) {
      add_legend(image, *legend);
      break;  // one scale for all
    }
  return image;
}

}  // namespace

void RenderOptions::validate() const {
  if (inputs.empty()) throw UsageError("no input: name a mesh or a point file to draw");
  if (output.empty()) throw UsageError("no output: give -o PICTURE.png");
  if (lower_extension(output) != ".png") {
    throw UsageError("-o " + output.string() +
                     ": pictures are written as PNG; give a name that ends in .png");
  }
  const auto check = [](bool fine, const std::string& what) {
    if (!fine) throw UsageError(what);
  };
  check(width >= 64 && width <= 16384 && height >= 64 && height <= 16384,
        "--size " + std::to_string(width) + "x" + std::to_string(height) +
            ": each side must be from 64 to 16384");
  check(samples >= 1 && samples <= 4, "--samples " + std::to_string(samples) + ": must be from 1 to 4");
  check(std::isfinite(zoom) && zoom > 0.0, "--zoom must be above 0");
  check(deviation.empty() || (std::isfinite(tolerance) && tolerance >= 0.0),
        "--tolerance must be above 0, or left out");
  check(!deviation.empty() || (tolerance == 0.0 && !with_sign),
        "--tolerance and --signed need --deviation REFERENCE");
  check(std::isfinite(missing_distance) && missing_distance >= 0.0,
        "--missing-distance must be above 0, or left out");
  check(!missing.empty() || missing_distance == 0.0, "--missing-distance needs --missing SCAN");
  check(deviation.empty() || uncertain.empty(),
        "--uncertain: leave it out with --deviation, or that with it");
  check(std::isfinite(splat) && splat >= 0.0, "--splat must be 0 (automatic) or above");
  check(occlusion >= 0.0 && occlusion <= 2.0, "--occlusion must be from 0 to 2");
  check(
      colour == "auto" || colour == "texture" || colour == "vertex" || colour == "clay" || colour == "height",
      "--colour " + colour + ": use auto, texture, vertex, clay or height");
  check(deviation.empty() || colour != "texture",
        "--colour texture: leave it out with --deviation, whose colours say something else");
  check(borders == "auto" || borders == "on" || borders == "off",
        "--borders " + borders + ": use auto, on or off");
  check(backs == "auto" || backs == "show" || backs == "cut", "--backs " + backs + ": use auto, show or cut");
  shade_of(shade);
  check(focus.empty() || (focus.size() == 4 && focus[3] > 0.0),
        "--focus: expected x,y,z,radius with radius above 0");
  check(dot(up, up) > 0.0, "--up must not be zero");
}

RenderReport render(const RenderOptions& given) {
  given.validate();
  RenderOptions options = given;
  // A wrong name fails before anything is read.
  const std::vector<ViewSpec> requested = chosen_views(options, {0, 0, 0});
  RenderReport report;
  const auto panels = static_cast<int>(1 + options.compare.size());
  const int panel_width = (options.width - (panels - 1) * kGap) / panels;
  if (panel_width < 64)
    throw UsageError("--size: too narrow for " + std::to_string(panels) + " pictures side by side");

  const bool only_faces = shows_only_faces(options);
  Pixels pixels(options, requested, panel_width, only_faces);
  const std::uint64_t image_bytes = 3 * static_cast<std::uint64_t>(options.width + panel_width) *
                                    static_cast<std::uint64_t>(options.height);
  std::uint64_t fixed = fixed_bytes(only_faces) + image_bytes + (options.missing.empty() ? 0 : kMissingBytes),
                minimum = fixed + pixels.band + kMinWorkBytes;
  const auto lacks = [&](const std::string& what, std::uint64_t bytes) {
    return what + " needs --memory " + std::to_string(((bytes - 1) >> 20) + 1) + "M or more; the cap is " +
           format_bytes(options.memory_bytes);
  };
  if (options.memory_bytes != 0 && options.memory_bytes < minimum) {
    throw ResourceError(lacks("render: a picture of " + std::to_string(options.width) + "x" +
                                  std::to_string(options.height) + " with --samples " +
                                  std::to_string(options.samples),
                              minimum));
  }
  if (const std::uint64_t pages = options.memory_bytes == 0 ? 0 : bytes_of_pages(options); pages > 0) {
    options.pages = options.memory_bytes >= minimum + pages;
    const std::string why = lacks("render: a picture with the pages of textures", minimum + pages);
    if (!options.pages && options.colour == "texture") throw ResourceError(why);
    if (options.pages)
      fixed += pages;
    else
      report.notices.push_back(why + "; drawn without textures");
  }
  std::uint64_t work = 0;
  if (options.memory_bytes != 0) {
    // Bands that are not held are drawn from further readings of what is in the picture.
    const std::uint64_t available = options.memory_bytes - fixed;
    if (available < pixels.bytes() + kMinWorkBytes)
      pixels.at_once = std::clamp<std::size_t>((available - kMinWorkBytes) / pixels.band, 1, pixels.bands);
    work = available - pixels.bytes();
  }

  Image sheet;
  sheet.width = options.width;
  sheet.height = options.height;
  if (panels > 1)
    sheet.rgb.assign(3 * static_cast<std::size_t>(sheet.width) * static_cast<std::size_t>(sheet.height), 160);
  std::vector<Float3> fit_points;  // of the first panel: all panels have its cameras
  std::vector<ViewSpec> specs;
  Double3 origin{};
  SceneBox shown;
  for (int i = 0; i < panels; ++i) {
    const std::vector<std::string> inputs =
        i == 0 ? options.inputs : std::vector<std::string>{options.compare[static_cast<std::size_t>(i - 1)]};
    const std::uint64_t faces_before = report.faces;
    Panel panel = open_panel(inputs, options, work, report);
    const bool has_few = only_faces && report.faces - faces_before <= kFewFaces;
    if (i == 0) {
      if (!options.missing.empty() && report.measured_points == 0)
        throw UsageError(
            "--missing needs a mesh among what is drawn: it shows what that leaves out of the scan");
      for (std::size_t k = 0; k < 3; ++k) origin[k] = 0.5 * (panel.box.low[k] + panel.box.high[k]);
      shown = panel.box;
      require_drawable(shown);
      fit_points = relative(panel.sample, panel.box, origin);
      specs = chosen_views(options, origin);
    }
    if (!overlap(panel.box, shown)) {
      report.notices.push_back(options.compare[static_cast<std::size_t>(i - 1)] +
                               ": lies outside of what the first picture shows");
    }
    Image image =
        draw_panel(panel, specs, fit_points, origin, options,
                   picture_options(options, panel_width, only_faces), has_few ? 1 : pixels.at_once, report);
    if (panels == 1)
      sheet = std::move(image);
    else
      paste(sheet, image, i * (panel_width + kGap), 0);
  }
  write_png(options.output, sheet, PngContent::kShades);
  return report;
}

}  // namespace tessera
