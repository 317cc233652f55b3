// What every command writes, read back: sound, and as near as it says. The same at coordinates of surveys.
#include <catch2/catch.hpp>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <iostream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "kernels/mesh/closest_face.h"
#include "octree/vector.h"
#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "tests/helpers/command.h"
#include "tests/helpers/mesh_files.h"
#include "tests/helpers/random.h"
#include "tests/helpers/shell.h"
#include "tests/helpers/skip.h"
#include "tests/helpers/surfaces.h"
#include "tests/helpers/temp_folder.h"

namespace written_meshes_test {

namespace {

using namespace tessera;
using test::WholeMesh;
namespace fs = std::filesystem;
/// A mesh on disk, and what commands need to know of it.
struct Input {
  fs::path path;
  WholeMesh mesh;
  double size = 0.0;   ///< diagonal
  bool sound = false;  ///< passes check --strict itself
  /// And would with its vertices joined that lie at one place, as readers of STL do, which has no vertices of its own.
  bool sound_joined = false;
};

struct Command {
  std::string name;
  std::function<std::vector<std::string>(const Input&, const fs::path& out)> words;
  bool as_it_is = false;     ///< faces are written as they are: defects of the input stay
  bool bounded = false;      ///< the report's certificate is against the input
  bool moves = false;        ///< the report tells how far vertices moved
  bool may_refuse = false;   ///< meshes that it cannot work on end with 5 or 6
  bool all_formats = false;  ///< its bound or its seams are worth a look in formats of floats
};

std::string number(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.9g", value);
  return text;
}

MeshCheck checked(const fs::path& path) {
  MeshCheckOptions options;
  options.temp = path.parent_path();
  return check_mesh(*open_mesh_file(path, {.keep_bad_faces = true}), options);
}

std::string list(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& w : words) text += (text.empty() ? "" : ", ") + w;
  return text;
}

double diagonal(const WholeMesh& m) {
  Double3 low = m.points.at(0), high = low;
  for (const Double3& p : m.points)
    for (std::size_t k = 0; k < 3; ++k)
      if (std::isfinite(p[k])) low[k] = std::min(low[k], p[k]), high[k] = std::max(high[k], p[k]);
  return norm(high - low);
}

/// The mesh at (far, far, 0), in doubles.
Input put(const fs::path& path, WholeMesh mesh, double far) {
  for (Double3& p : mesh.points) p[0] += far, p[1] += far;
  mesh.header.vertices = mesh.points.size();
  mesh.header.faces = mesh.faces.size();
  mesh.header.double_positions = true;
  mesh.header.colour = false;
  mesh.header.shift = {};
  mesh.rgba.clear();
  test::write_whole(path, mesh);
  Input in{path, std::move(mesh), 0.0, false, false};
  in.size = diagonal(in.mesh);
  in.sound = checked(path).defects().empty();
  const fs::path joined = path.string() + ".joined.stl";
  WholeMesh near = in.mesh;  // where floats hold it
  for (Double3& p : near.points) p[0] -= far, p[1] -= far;
  near.header.double_positions = false;
  test::write_whole(joined, near);
  in.sound_joined = checked(joined).defects().empty();
  return in;
}

/// Two boxes and how they stand: an edit that lifts the upper third.
fs::path write_edit(const Input& in) {
  Double3 low = in.mesh.points.at(in.mesh.faces.at(0)[0]), high = low;
  for (const MeshFace& f : in.mesh.faces)
    for (const std::uint64_t v : f)
      for (std::size_t k = 0; k < 3; ++k) {
        const double c = in.mesh.points[v][k];
        if (std::isfinite(c)) low[k] = std::min(low[k], c), high[k] = std::max(high[k], c);
      }
  const double third = (high[0] - low[0]) / 3.0;
  const auto half_space = [&](double x, double outward) {
    return Json{{"point", {x, low[1], low[2]}}, {"normal", {outward, 0, 0}}};
  };
  const Json edit = {
      {"regions",
       {{{"role", "support"}, {"all", true}},
        {{"role", "handle"}, {"name", "end"}, {"half_space", half_space(high[0] - third, -1.0)}},
        {{"role", "fixed"}, {"half_space", half_space(low[0] + third, 1.0)}}}},
      {"handles", {{"end", Json::array({{{"move", {0.0, 0.0, 0.1 * in.size}}}})}}}};
  const fs::path path = in.path.string() + ".edit.json";
  test::spill(path, dump_json(edit));
  return path;
}

/// Two overlapping parts, the second one noisy.
std::pair<fs::path, fs::path> write_parts(const Input& in) {
  double low = 1e300, high = -1e300;
  for (const Double3& p : in.mesh.points)
    if (std::isfinite(p[0])) low = std::min(low, p[0]), high = std::max(high, p[0]);
  std::pair<fs::path, fs::path> out;
  for (const bool right : {false, true}) {
    WholeMesh part = in.mesh;
    std::erase_if(part.faces, [&](const MeshFace& f) {
      const double x = (in.mesh.points[f[0]][0] + in.mesh.points[f[1]][0] + in.mesh.points[f[2]][0]) / 3.0;
      return right ? x < low + 0.4 * (high - low) : x > low + 0.6 * (high - low);
    });
    test::Random random(5);
    if (right)
      for (Double3& p : part.points)
        for (double& c : p) c += random.in(-1e-4, 1e-4) * in.size;
    part.header.faces = part.faces.size();
    const fs::path path = in.path.string() + (right ? ".right.ply" : ".left.ply");
    test::write_whole(path, part);
    (right ? out.second : out.first) = path;
  }
  return out;
}

/// Points on the faces with their normals.
fs::path write_points(const Input& in, std::size_t count) {
  test::Random random(9);
  std::string text;
  double area = 0.0;
  std::vector<double> sum;
  for (const MeshFace& f : in.mesh.faces) {
    const double a =
        norm(cross(in.mesh.points[f[1]] - in.mesh.points[f[0]], in.mesh.points[f[2]] - in.mesh.points[f[0]]));
    sum.push_back(area += std::isfinite(a) ? a : 0.0);
  }
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = std::upper_bound(sum.begin(), sum.end(), area * random.unit());
    const MeshFace& f = in.mesh.faces[std::min<std::size_t>(static_cast<std::size_t>(at - sum.begin()),
                                                            in.mesh.faces.size() - 1)];
    double s = random.unit(), t = random.unit();
    if (s + t > 1.0) s = 1.0 - s, t = 1.0 - t;
    const Double3 &a = in.mesh.points[f[0]], u = in.mesh.points[f[1]] - a, v = in.mesh.points[f[2]] - a;
    const Double3 p = a + u * s + v * t, n = unit_or_zero(cross(u, v));
    for (const Double3& d : {p, n})
      for (std::size_t k = 0; k < 3; ++k) {
        char word[40];
        std::snprintf(word, sizeof word, "%.12g ", d[k]);
        text += word;
      }
    text.back() = '\n';
  }
  const fs::path path = in.path.string() + ".xyz";
  test::spill(path, text);
  return path;
}

std::vector<Command> commands(std::size_t scan_points) {
  using Words = std::vector<std::string>;
  const auto one = [](const std::string& name, std::function<Words(const Input&)> more) {
    return [=](const Input& in, const fs::path& out) {
      Words w = {name, in.path.string(), "-o", out.string()};
      for (const std::string& m : more(in)) w.push_back(m);
      return w;
    };
  };
  const auto scaled = [](Words words) {  // "*0.01" is that share of the diagonal
    return [=](const Input& in) {
      Words w = words;
      for (std::string& s : w)
        if (s[0] == '*') s = number(std::strtod(s.c_str() + 1, nullptr) * in.size);
      return w;
    };
  };
  std::vector<Command> all;
  const auto add = [&](const std::string& name, const std::string& command, Words words) -> Command& {
    all.push_back({name, one(command, scaled(words))});
    return all.back();
  };
  add("convert", "convert", {}).as_it_is = true;
  add("decimate", "decimate", {"--tolerance", "*0.002"}).bounded = true;
  all.back().all_formats = true;
  add("decimate, smoothed", "decimate", {"--tolerance", "*0.002", "--smooth", "implicit"}).bounded = true;
  all.push_back({"decimate to a count", [](const Input& in, const fs::path& out) {
                   return Words{"decimate",   in.path.string(), "-o",
                                out.string(), "--target-faces", std::to_string(in.mesh.faces.size() / 4 + 4)};
                 }});
  all.back().bounded = true;
  add("remesh", "remesh", {"--edge", "*0.04"}).bounded = true;
  all.back().all_formats = true;
  add("remesh within", "remesh", {"--edge", "*0.03", "--tolerance", "*0.003"}).bounded = true;
  all.back().may_refuse = true;
  add("remesh, adaptive", "remesh", {"--tolerance", "*0.005", "--adaptive"}).bounded = true;
  all.back().may_refuse = true;
  add("resample", "resample", {}).bounded = true;
  for (const Words& how :
       {Words{}, Words{"--lambda", "5000"}, Words{"--method", "denoise"}, Words{"--method", "bilateral"},
        Words{"--method", "taubin", "--steps", "10"}, Words{"--tolerance", "*0.001", "--lambda", "3"},
        Words{"--method", "curvature-flow", "--steps", "2"}}) {
    add("smooth " + list(how), "smooth", how).moves = true;
    all.back().may_refuse = true;
  }
  for (const Words& how :
       {Words{}, Words{"--offset", "*0.02"}, Words{"--offset", "*0.02", "--corners", "mitre"},
        Words{"--offset", "*-0.01"}, Words{"--shell", "*0.05"}, Words{"--method", "mc"}}) {
    Words more = {"--resolution", "*0.015625"};
    more.insert(more.end(), how.begin(), how.end());
    add("resurface " + list(how), "resurface", more).may_refuse = true;
    all.back().all_formats = how.empty();
  }
  for (const std::string sign : {"+", "-", "*"})
    all.push_back({"csg " + sign,
                   [=](const Input& in, const fs::path& out) {
                     WholeMesh moved = in.mesh;
                     for (Double3& p : moved.points)
                       p = p + Double3{0.125 * in.size, 0.0625 * in.size, 0.03125 * in.size};
                     const fs::path other = in.path.string() + ".moved.ply";
                     test::write_whole(other, moved);
                     return Words{"csg", in.path.string(), sign,           other.string(),
                                  "-o",  out.string(),     "--resolution", number(in.size / 64)};
                   },
                   false, false, false, true});
  all.push_back({"merge",
                 [](const Input& in, const fs::path& out) {
                   const auto [left, right] = write_parts(in);
                   return Words{"merge", left.string(), right.string(), "-o", out.string()};
                 },
                 false, false, false, true});
  all.push_back({"deform",
                 [](const Input& in, const fs::path& out) {
                   return Words{"deform", in.path.string(), write_edit(in).string(), "-o", out.string()};
                 },
                 true, false, false, true});
  for (const Words& how : {Words{}, Words{"--tolerance", "*0.003"}, Words{"--holes", "close"}})
    all.push_back({"reconstruct " + list(how),
                   [=](const Input& in, const fs::path& out) {
                     Words w = {"reconstruct",  write_points(in, scan_points).string(),
                                "-o",           out.string(),
                                "--columns",    "x,y,z,nx,ny,nz",
                                "--resolution", number(in.size / 64)};
                     for (const std::string& m : scaled(how)(in)) w.push_back(m);
                     return w;
                   },
                   false, false, false, true});
  return all;
}

/// Text keeps every bit, as the doubles of PLY do; STL and GLB round to floats, which is to be in what is told.
const std::vector<std::string> kFormats = {".ply", ".obj", ".stl", ".glb"};

bool is_of_floats(const fs::path& path) {
  return path.extension() == ".stl" || path.extension() == ".glb";
}

/// How the commands of one input ended.
struct Tally {
  std::size_t runs = 0;                        ///< command x mesh x coordinates x format
  std::size_t passed = 0;                      ///< sound, and as near as it says
  std::size_t reported = 0;                    ///< not sound, of an input that is not, and the report says so
  std::size_t as_they_were = 0;                ///< defects of the input, in faces written as they are
  std::map<std::string, std::size_t> refused;  ///< by the first words on stderr
};

/// The message without paths and figures, so that equal reasons count as one.
std::string reason(const test::CommandResult& result) {
  std::string text;
  std::istringstream words(result.errors.substr(0, result.errors.find('\n')));
  for (std::string w; words >> w && text.size() < 70;)
    if (w.find('/') == std::string::npos && w.find_first_of("0123456789") == std::string::npos)
      text += (text.empty() ? "" : " ") + w;
  return "exit " + std::to_string(result.code) + ": " + text;
}

void print(const Tally& t, const std::string& name) {
  std::cout << name << ": " << t.runs << " runs, " << t.passed << " passed, " << t.reported << " told, "
            << t.as_they_were << " as they were\n";
  for (const auto& [why, times] : t.refused) std::cout << "  refused " << times << " times, " << why << "\n";
  std::cout << std::flush;
}

struct Surface {
  explicit Surface(const WholeMesh& mesh) : points(mesh.points) {
    for (const MeshFace& f : mesh.faces) {
      const bool there = std::all_of(f.begin(), f.end(), [&](std::uint64_t v) {
        return v < points.size() && std::isfinite(norm(points[v]));
      });
      if (there)
        faces.push_back({static_cast<std::uint32_t>(f[0]), static_cast<std::uint32_t>(f[1]),
                         static_cast<std::uint32_t>(f[2])});
    }
    for (Double3& p : points)
      if (!std::isfinite(norm(p))) p = {};
    if (!faces.empty()) origin = points[faces[0][0]];
    index = ClosestFaces(points, faces, origin);
  }
  double distance(const Double3& p) const {
    const auto hit = index.closest(p - origin, 1e300, ClosestFaces::kNone);
    const auto& f = faces[index.face(hit.slot)];
    return test::triangle_distance(p - origin, points[f[0]] - origin, points[f[1]] - origin,
                                   points[f[2]] - origin);
  }
  std::vector<Double3> points;
  std::vector<std::array<std::uint32_t, 3>> faces;
  Double3 origin{};
  ClosestFaces index;
};

double rounding(const Surface& s) {
  double maximum = 0.0;
  for (const Double3& p : s.points) maximum = std::max(maximum, norm(p));
  return 0x1p-50 * maximum;
}

/// The largest distance found at points of one surface to the other; vertices, and as many points of the area.
double sampled(const Surface& from, const Surface& to, std::size_t count) {
  test::Random random(13);
  double maximum = 0.0, area = 0.0;
  std::vector<double> sum;
  for (const auto& f : from.faces) {
    sum.push_back(area +=
                  norm(cross(from.points[f[1]] - from.points[f[0]], from.points[f[2]] - from.points[f[0]])));
    if (sum.size() * 3 <= count)
      for (const std::uint32_t v : f) maximum = std::max(maximum, to.distance(from.points[v]));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const auto at = std::upper_bound(sum.begin(), sum.end(), area * random.unit()) - sum.begin();
    const auto& f = from.faces[std::min(static_cast<std::size_t>(at), from.faces.size() - 1)];
    double s = random.unit(), t = random.unit();
    if (s + t > 1.0) s = 1.0 - s, t = 1.0 - t;
    const Double3& a = from.points[f[0]];
    maximum = std::max(maximum, to.distance(a + (from.points[f[1]] - a) * s + (from.points[f[2]] - a) * t));
  }
  return maximum;
}

/// What is wrong with what a command wrote; empty when nothing is.
std::string fault(const Command& command, const Input& in, const fs::path& out, std::size_t samples,
                  Tally& tally) {
  tally.runs += 1;
  fs::remove(out);
  std::vector<std::string> words = command.words(in, out);
  words.insert(words.end(), {"--force", "--progress", "none"});
  const std::string& name = words.front();
  if (name == "convert") words.resize(words.size() - 2);
  if (name != "convert" && name != "reconstruct" && name != "decimate" && name != "smooth")
    words.emplace_back("--no-html");
  const test::CommandResult result = test::tessera_command(words);
  if (result.code != 0) {
    const bool reported = (result.code == 5 || result.code == 6) && !result.errors.empty();
    if (reported && (command.may_refuse || (result.code == 6 && is_of_floats(out)))) {
      tally.refused[reason(result)] += 1;
      return "";
    }
    return "ends with " + std::to_string(result.code) + ": " + result.errors;
  }
  const fs::path report = out.string() + ".report.json";
  if (const auto defects = checked(out).defects(); defects.empty()) {
    tally.passed += 1;
  } else if ((!in.sound && command.as_it_is) || (!in.sound_joined && out.extension() == ".stl")) {
    tally.as_they_were += 1;
  } else {
    // Or it says why not, of a mesh that was not sound, or that floats cannot hold.
    const std::string said = result.errors + (fs::exists(report) ? test::file_bytes(report) : "");
    const bool reported =
        (!in.sound || is_of_floats(out)) && (said.find("check --strict") != std::string::npos ||
                                             said.find("floats of 32 bits") != std::string::npos);
    if (!reported) return list(defects);
    tally.reported += 1;
  }
  if (!command.bounded && !command.moves) return "";
  const Json reported = parse_json(test::file_bytes(report));
  if (command.bounded) {
    const Json& maximum = reported.at("certificate").at("certified_max");
    if (!maximum.is_number()) return "";
    const Surface was(in.mesh), is(test::read_whole(out));
    if (was.faces.empty() || is.faces.empty()) return "";
    const double found = std::max(sampled(was, is, samples), sampled(is, was, samples));
    // Points of the area are told to a few of the last bits of their coordinates.
    if (found > maximum.get<double>() + rounding(was))
      return "is " + number(found) + " off, told at most " + number(maximum.get<double>());
  } else {
    const Surface was(in.mesh), is(test::read_whole(out));
    const double found = std::max(sampled(was, is, samples), sampled(is, was, samples)),
                 maximum = reported.at("mesh").at("largest_move").get<double>();
    // A face moves with its corners. Faces that the import takes away or turns have none: they have no area.
    if (found > maximum + 1e-6 * in.size + rounding(was))
      return "moved " + number(found) + ", told at most " + number(maximum);
  }
  return "";
}

/// Faults of all commands on one input, a line each.
std::string faults(const std::vector<Command>& all, const Input& in, const fs::path& folder,
                   std::size_t samples, const std::vector<std::string>& formats, Tally& tally) {
  const char* only = std::getenv("TESSERA_TEST_COMMANDS");  // part of a name, with its format: "remesh.ply"
  std::string text;
  for (const Command& c : all)
    for (const std::string& format : formats) {
      if (only != nullptr && (c.name + format).find(only) == std::string::npos) continue;
      if (&format != &formats.front() && !c.as_it_is && !c.all_formats) continue;
      const std::string wrong = fault(c, in, folder / ("out" + format), samples, tally);
      if (!wrong.empty())
        text += in.path.filename().string() + ", " + c.name + ", " + format + ": " + wrong + "\n";
    }
  return text;
}

void append(WholeMesh& to, const std::vector<Double3>& points, const std::vector<MeshFace>& faces) {
  const std::uint64_t first = to.points.size();
  to.points.insert(to.points.end(), points.begin(), points.end());
  for (const MeshFace& f : faces) to.faces.push_back({first + f[0], first + f[1], first + f[2]});
}

WholeMesh box(const Double3& at, const Double3& size) {
  WholeMesh m;
  for (std::uint32_t v = 0; v < 8; ++v)
    m.points.push_back(
        {at[0] + (v & 1 ? size[0] : 0.0), at[1] + (v & 2 ? size[1] : 0.0), at[2] + (v & 4 ? size[2] : 0.0)});
  m.faces = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
             {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return m;
}

WholeMesh of_surface(const test::Surface& s) {
  WholeMesh m;
  m.points = s.position;
  for (const auto& f : s.faces) m.faces.push_back({f[0], f[1], f[2]});
  return m;
}

/// Parts as made by CAD programs: boxes with walls on planes of any lattice of round numbers, a thin plate, a ball.
WholeMesh parts() {
  WholeMesh m = box({0, 0, 0}, {1, 1, 1});
  const WholeMesh plate = box({2, 0, 0}, {1, 1, 0.0625});
  append(m, plate.points, plate.faces);
  WholeMesh ball = of_surface(test::sphere(3, 0.5));
  for (Double3& p : ball.points) p = p + Double3{1.5, 0.5, 2.0};
  append(m, ball.points, ball.faces);
  return m;
}

/// A scan: open, noisy, with a ridge.
WholeMesh terrain() {
  test::Random random(3);
  return of_surface(test::height_grid(24, 4.0, [&](double x, double y) {
    return 0.4 * std::sin(2.0 * x) * std::cos(1.5 * y) + std::max(0.0, 0.5 - std::abs(x - 2.0)) +
           random.in(-0.01, 0.01);
  }));
}

/// Defects of all kinds that importers meet.
WholeMesh dirty() {
  WholeMesh m = of_surface(test::sphere(3, 1.0));
  m.faces.push_back(m.faces[10]);                                       // twice
  m.faces.push_back({m.faces[20][0], m.faces[20][1], m.faces[20][1]});  // repeats a vertex
  m.points.push_back((m.points[m.faces[30][0]] + m.points[m.faces[30][1]]) * 0.5);
  m.faces.push_back(
      {m.faces[30][0], m.faces[30][1], m.points.size() - 1});  // no area, a third face at an edge
  m.points.push_back({9, 9, 9});                               // of no face
  std::swap(m.faces[40][0], m.faces[40][1]);                   // turned over
  const WholeMesh shares = box(m.points[0], {0.5, 0.5, 0.5});  // meets the ball in one vertex
  const std::uint64_t first = m.points.size();
  append(m, shares.points, shares.faces);
  for (MeshFace& f : m.faces)
    for (std::uint64_t& v : f)
      if (v == first) v = 0;
  const WholeMesh through = box({-0.25, -0.25, -2}, {0.5, 0.5, 4});  // crosses it
  append(m, through.points, through.faces);
  return m;
}

}  // namespace

namespace {

/// What every command writes of a mesh near the origin and at survey coordinates, in every format.
void check_written(const std::string& name, const WholeMesh& mesh) {
  const test::TempFolder folder;
  const std::vector<Command> all = commands(4000);
  for (const double far : {0.0, 1e5, 5e6}) {
    const Input in = put(folder / (name + ".ply"), mesh, far);
    CAPTURE(name, far);
    Tally tally;
    const std::string wrong = faults(all, in, folder.path(), 2000, kFormats, tally);
    CHECK(wrong == "");
  }
}

}  // namespace

// A case a mesh, so that they run beside each other.
TEST_CASE("written meshes: of parts all is sound and as near as it says, at survey coordinates too",
          "[property]") {
  check_written("parts", parts());
}

TEST_CASE("written meshes: of terrain all is sound and as near as it says, at survey coordinates too",
          "[property]") {
  check_written("terrain", terrain());
}

TEST_CASE("written meshes: of a dirty mesh all is sound or told, at survey coordinates too", "[property]") {
  check_written("dirty", dirty());
}

TEST_CASE("written meshes: what every command writes of real meshes is sound and as near as it says",
          "[property][.large][.shared]") {
  if (!test::has_shared_data()) return;
  const test::TempFolder folder;
  const std::vector<Command> all = commands(100'000);
  const char* only = std::getenv("TESSERA_TEST_MESHES");  // part of a name: to look at one
  const char* offset_text = std::getenv("TESSERA_TEST_FAR");
  std::vector<fs::path> paths;
  for (const char* subfolder : {"meshes", "dirty"})
    for (const auto& entry : fs::directory_iterator(test::kSharedData / subfolder)) {
      const std::string extension = entry.path().extension().string();
      if (extension != ".ply" && extension != ".obj" && extension != ".stl" && extension != ".off") continue;
      if (only == nullptr || entry.path().filename().string().find(only) != std::string::npos)
        paths.push_back(entry.path());
    }
  std::sort(paths.begin(), paths.end());
  for (const fs::path& path : paths) {
    const WholeMesh mesh = test::read_whole(path);
    if (mesh.faces.empty()) continue;
    for (const double far : {0.0, 1e5, 5e6}) {
      if (offset_text != nullptr && std::strtod(offset_text, nullptr) != far) continue;
      const Input in = put(folder / (path.stem().string() + ".ply"), mesh, far);
      CAPTURE(path, far);
      Tally tally;
      const std::string wrong = faults(all, in, folder.path(), 100'000, kFormats, tally);
      std::cout << wrong << std::flush;
      print(tally, path.filename().string() + " at " + number(far));
      CHECK(wrong == "");
    }
  }
}

}  // namespace written_meshes_test
