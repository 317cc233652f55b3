#include "stream/stages/deform/edit_script.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <sstream>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/runtime/json_reader.h"
#include "stream/runtime/option_table.h"

namespace tessera {
namespace {

constexpr int kColourWithin = 48;        ///< of 255: paint blends at its rim
constexpr double kCreaseDegrees = 30.0;  ///< which bound a patch

class Reader : public JsonReader {
 public:
  using JsonReader::JsonReader;

  EditRegion region(const Json& r, const std::string& what, std::vector<std::uint64_t>& vertices) const {
    known(r, what,
          {"role", "name", "smoothness", "all", "box", "sphere", "half_space", "geodesic", "points",
           "vertices", "painted", "patch"});
    EditRegion out;
    const Json& role = member(r, "role", what);
    if (role == "support") {
      out.role = RegionRole::kSupport;
    } else if (role == "handle") {
      out.role = RegionRole::kHandle;
    } else if (role != "fixed") {
      fail(what + ": \"role\" is fixed, support or handle");
    }
    if (r.contains("name")) {
      out.name = text(r.at("name"), what + ": \"name\"");
    } else if (out.role == RegionRole::kHandle) {
      fail(what + ": a handle wants a \"name\", which its motion is given for");
    }
    if (r.contains("smoothness")) {
      out.smoothness = number(r.at("smoothness"), what + ": \"smoothness\"");
      if (!(out.smoothness >= 0.0 && out.smoothness <= 2.0)) fail(what + ": \"smoothness\" is from 0 to 2");
    }
    std::string shape;
    for (const char* key :
         {"all", "box", "sphere", "half_space", "geodesic", "points", "vertices", "painted", "patch"})
      if (r.contains(key)) {
        if (!shape.empty()) fail(what + ": \"" + shape + "\" and \"" + key + "\": a region has one shape");
        shape = key;
      }
    if (shape.empty())
      fail(what +
           " wants a shape: all, box, sphere, half_space, geodesic, points, vertices, painted or patch");
    const Json& value = r.at(shape);
    const std::string where = what + ": \"" + shape + "\"";
    if (shape == "all") {
      if (value != true) fail(where + " takes true");
    } else if (shape == "box") {
      if (!value.is_array() || value.size() != 2) fail(where + " takes two corners");
      out.shape = RegionShape::kBox;
      const Double3 a = point(value[0], where), b = point(value[1], where);
      for (std::size_t c = 0; c < 3; ++c)
        out.low[c] = std::min(a[c], b[c]), out.high[c] = std::max(a[c], b[c]);
    } else if (shape == "sphere") {
      known(value, where, {"centre", "radius"});
      out.shape = RegionShape::kSphere;
      out.point = point(member(value, "centre", where), where);
      out.radius = number(member(value, "radius", where), where);
    } else if (shape == "half_space") {
      known(value, where, {"point", "normal"});
      out.shape = RegionShape::kHalfSpace;
      out.point = point(member(value, "point", where), where);
      out.normal = point(member(value, "normal", where), where);
      if (!(norm(out.normal) > 0.0)) fail(where + ": the normal has no direction");
    } else if (shape == "geodesic") {
      known(value, where, {"points", "distance"});
      out.shape = RegionShape::kGeodesic;
      out.points = points(member(value, "points", where), where);
      out.radius = number(member(value, "distance", where), where);
    } else if (shape == "points") {
      out.shape = RegionShape::kPoints;
      out.points = points(value, where);
    } else if (shape == "painted") {
      known(value, where, {"colour", "within"});
      out.shape = RegionShape::kPainted;
      const std::vector<double> rgb = numbers(member(value, "colour", where), 3, where + ": \"colour\"");
      for (std::size_t c = 0; c < 3; ++c) out.colour[c] = channel(rgb[c], where + ": \"colour\"");
      out.within = value.contains("within")
                       ? channel(number(value.at("within"), where + ": \"within\""), where + ": \"within\"")
                       : kColourWithin;
    } else if (shape == "patch") {
      known(value, where, {"points", "crease"});
      out.shape = RegionShape::kPatch;
      out.points = points(member(value, "points", where), where);
      out.crease_deg =
          value.contains("crease") ? number(value.at("crease"), where + ": \"crease\"") : kCreaseDegrees;
      if (!(out.crease_deg > 0.0 && out.crease_deg < 180.0))
        fail(where + ": \"crease\" is an angle between 0 and 180 degrees");
    } else {
      out.shape = RegionShape::kPoints;
      if (!value.is_array() || value.empty()) fail(where + " takes a list of numbers of vertices");
      for (const Json& v : value) {
        if (!v.is_number_unsigned()) fail(where + " takes numbers of vertices, from 0 on");
        vertices.push_back(v.get<std::uint64_t>());
      }
    }
    return out;
  }

  int channel(double value, const std::string& what) const {
    if (!(value >= 0.0 && value <= 255.0)) fail(what + " takes numbers from 0 to 255");
    return static_cast<int>(value);
  }

  Placement step(const Json& s, const std::string& what) const {
    known(s, what, {"move", "rotate", "scale", "matrix"});
    if (s.size() != 1) fail(what + ": one of move, rotate, scale and matrix a step; a list has several");
    Placement p;
    if (s.contains("move")) {
      p.shift = point(s.at("move"), what + ": \"move\"");
    } else if (s.contains("rotate")) {
      const Json& r = s.at("rotate");
      const std::string where = what + ": \"rotate\"";
      known(r, where, {"axis", "angle", "centre"});
      const Double3 axis = unit_or_zero(point(member(r, "axis", where), where));
      if (axis == Double3{0, 0, 0}) fail(where + ": the axis has no direction");
      const Double3 centre = r.contains("centre") ? point(r.at("centre"), where) : Double3{};
      p = rotation(axis, number(member(r, "angle", where), where)).about(centre);
    } else if (s.contains("scale")) {
      const Json& r = s.at("scale");
      const std::string where = what + ": \"scale\"";
      known(r, where, {"factor", "centre"});
      const Json& f = member(r, "factor", where);
      const std::vector<double> v =
          f.is_number() ? std::vector<double>(3, number(f, where)) : numbers(f, 3, where);
      p.matrix = {v[0], 0, 0, 0, v[1], 0, 0, 0, v[2]};
      p = p.about(r.contains("centre") ? point(r.at("centre"), where) : Double3{});
    } else {
      const std::vector<double> m = numbers(s.at("matrix"), 12, what + ": \"matrix\"");
      for (std::size_t r = 0; r < 3; ++r) {
        for (std::size_t c = 0; c < 3; ++c) p.matrix[3 * r + c] = m[4 * r + c];
        p.shift[r] = m[4 * r + 3];
      }
    }
    return p;
  }

  void motions(const Json& handles, EditScript& out) const {
    if (!handles.is_object()) fail("\"handles\" has one motion by the name of each handle");
    for (const auto& [name, motion] : handles.items()) {
      const std::string what = "the motion of '" + name + "'";
      if (motion.is_object() && motion.contains("targets")) {
        known(motion, what, {"targets"});
        targets(name, points(motion.at("targets"), what + ": \"targets\""), out);
        continue;
      }
      Placement all;
      for (const Json& s : motion.is_array() ? motion : Json::array({motion})) all = step(s, what).after(all);
      out.handles.push_back(name);
      out.motions.push_back(all);
    }
  }

 private:
  void targets(const std::string& name, std::vector<Double3> to, EditScript& out) const {
    std::optional<std::size_t> found;
    for (std::size_t i = 0; i < out.regions.size(); ++i)
      if (out.regions[i].role == RegionRole::kHandle && out.regions[i].name == name) {
        if (found) fail("'" + name + "' has targets: it is one region of points or vertices");
        found = i;
      }
    if (!found)
      fail("'" + name + "' has targets: they are given with its region, in the edit itself, not with a pose");
    EditRegion& region = out.regions[*found];
    if (region.shape != RegionShape::kPoints)
      fail("'" + name + "' has targets: its region is a list of points or vertices");
    const std::size_t count = region.points.size() + out.vertices[*found].size();
    if (count != to.size())
      fail("'" + name + "' has " + std::to_string(count) + " points and " + std::to_string(to.size()) +
           " targets: give one for each");
    region.targets = std::move(to);
  }
};

}  // namespace

std::string read_edit_text(const std::filesystem::path& file) {
  const std::string text = dump_json(Reader(file.string()).parsed(read_text(file)));
  parse_edit(text, file.string());
  return text;
}

EditScript parse_edit(const std::string& text, const std::string& name) {
  const Reader reader(name);
  const Json root = reader.parsed(text);
  reader.known(root, "the edit", {"order", "anisotropic", "details", "keep_volume", "regions", "handles"});
  EditScript out;
  if (root.contains("order")) {
    const Json& order = root.at("order");
    if (order != 1 && order != 2 && order != 3) reader.fail("\"order\" is 1, 2 or 3");
    out.order = order.get<int>();
  }
  if (root.contains("anisotropic")) {
    if (!root.at("anisotropic").is_boolean()) reader.fail("\"anisotropic\" is true or false");
    out.anisotropic = root.at("anisotropic").get<bool>();
  }
  if (root.contains("details")) {
    const Json& details = root.at("details");
    if (details != "turned" && details != "volumes") reader.fail("\"details\" is turned or volumes");
    out.volumes = details == "volumes";
  }
  if (root.contains("keep_volume")) {
    if (!root.at("keep_volume").is_boolean()) reader.fail("\"keep_volume\" is true or false");
    out.keep_volume = root.at("keep_volume").get<bool>();
    if (out.keep_volume && !out.volumes) reader.fail("\"keep_volume\" goes with \"details\": \"volumes\"");
  }
  if (root.contains("regions")) {
    if (!root.at("regions").is_array()) reader.fail("\"regions\" takes a list of regions");
    for (const Json& r : root.at("regions")) {
      out.vertices.emplace_back();
      out.regions.push_back(
          reader.region(r, "region " + std::to_string(out.vertices.size()), out.vertices.back()));
    }
  }
  if (root.contains("handles")) reader.motions(root.at("handles"), out);
  return out;
}

std::string with_controls(const std::string& edit, const std::filesystem::path& file) {
  static const char* const kName = "control points";
  Json root = edit.empty() ? Json{{"regions", {{{"role", "support"}, {"all", true}}}}} : parse_json(edit);
  Json points = Json::array(), targets = Json::array();
  std::istringstream lines(read_text(file));
  std::string line;
  for (std::size_t number = 1; std::getline(lines, line); ++number) {
    std::erase_if(line, [](char c) { return c == ' ' || c == '\t' || c == '\r'; });
    if (line.empty() || line[0] == '#') continue;
    const std::vector<double> n = numbers_of(line, 6);
    if (n.empty())
      throw InputError(file.string() + ":" + std::to_string(number) +
                       ": a control point is six numbers, x,y,z,X,Y,Z: where it is and where it belongs");
    points.push_back({n[0], n[1], n[2]});
    targets.push_back({n[3], n[4], n[5]});
  }
  if (points.empty()) throw InputError(file.string() + ": it holds no control point");
  root["regions"].push_back({{"role", "handle"}, {"name", kName}, {"points", points}});
  root["handles"][kName] = {{"targets", targets}};
  const std::string text = dump_json(root);
  parse_edit(text, file.string());
  return text;
}

std::vector<EditPose> read_poses(const std::filesystem::path& file) {
  const Reader reader(file.string());
  const Json root = reader.parsed(read_text(file));
  std::vector<EditPose> out;
  const auto add = [&](const std::string& name, const Json& pose) {
    EditPose p{name, dump_json(Json{{"handles", reader.member(pose, "handles", "a pose")}})};
    parse_edit(p.text, file.string());
    out.push_back(std::move(p));
  };
  if (!root.is_object() || !root.contains("poses")) {
    add("", root);
    return out;
  }
  reader.known(root, "the file", {"poses"});
  if (!root.at("poses").is_array() || root.at("poses").empty())
    reader.fail("\"poses\" takes a list of at least one pose");
  for (const Json& pose : root.at("poses")) {
    reader.known(pose, "a pose", {"name", "handles"});
    const std::string number = std::to_string(out.size() + 1);
    const Json name = pose.value("name", Json(number));
    if (!name.is_string() || name.get<std::string>().find('/') != std::string::npos)
      reader.fail("the \"name\" of pose " + number + " becomes part of a file's name: a text without '/'");
    for (const EditPose& p : out)
      if (p.name == name) reader.fail("two poses have the name '" + p.name + "'");
    add(name.get<std::string>(), pose);
  }
  return out;
}

std::vector<Placement> pose_of(const EditScript& script, std::span<const std::string> handles) {
  std::vector<Placement> out(handles.size());
  for (std::size_t i = 0; i < script.handles.size(); ++i) {
    const auto at = std::find(handles.begin(), handles.end(), script.handles[i]);
    if (at == handles.end())
      throw InputError("there is a motion for '" + script.handles[i] + "', but no handle of this name" +
                       did_you_mean(script.handles[i], {handles.begin(), handles.end()}));
    out[static_cast<std::size_t>(at - handles.begin())] = script.motions[i];
  }
  return out;
}

}  // namespace tessera
