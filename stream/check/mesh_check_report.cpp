/// What a mesh check says, to people and to programs.
#include <array>
#include <charconv>
#include <string>

#include "stream/check/mesh_check.h"
#include "stream/files/json.h"
#include "stream/runtime/numbers.h"

namespace tessera {
namespace {

/// 1234567 as "1,234,567".
std::string grouped(std::uint64_t n) {
  const std::string digits = std::to_string(n);
  std::string text;
  for (std::size_t i = 0; i < digits.size(); ++i) {
    if (i > 0 && (digits.size() - i) % 3 == 0) text += ',';
    text += digits[i];
  }
  return text;
}

std::string number(double value) {
  char text[32];
  return {text, std::to_chars(text, text + sizeof text, value, std::chars_format::general, 9).ptr};
}

std::string counted(std::uint64_t n, const char* one, const char* many) {
  return grouped(n) + " " + (n == 1 ? one : many);
}

std::string vector_text(const Double3& v) {
  return number(v[0]) + " " + number(v[1]) + " " + number(v[2]);
}

}  // namespace

std::vector<std::string> MeshCheck::defects() const {
  std::vector<std::string> list;
  const auto say = [&](std::uint64_t n, const char* one, const char* many) {
    if (n > 0) list.push_back(counted(n, one, many));
  };
  say(bad_index_faces, "face names a vertex that does not exist", "faces name vertices that do not exist");
  say(nonfinite_vertices, "vertex is not finite", "vertices are not finite");
  say(unreferenced_vertices, "vertex belongs to no face", "vertices belong to no face");
  say(degenerate_faces, "face repeats a vertex", "faces repeat a vertex");
  say(zero_area_faces, "face has no area", "faces have no area");
  say(duplicate_faces, "face repeats another", "faces repeat others");
  say(nonmanifold_edges, "edge has more than two faces", "edges have more than two faces");
  say(nonmanifold_vertices, "vertex is not manifold", "vertices are not manifold");
  say(inconsistent_edges, "edge joins faces of opposite orientation",
      "edges join faces of opposite orientation");
  if (crossings)
    for (const std::string& defect : crossings->defects()) list.push_back(defect);
  return list;
}

Json to_json(const MeshCheck& check) {
  Json loops = Json::array();
  for (const BoundaryLoop& loop : check.largest_loops) {
    loops.push_back({{"edges", loop.edges}, {"closed", loop.closed}});
  }
  Json components = Json::array();
  for (const MeshComponent& part : check.largest_components) {
    components.push_back({{"vertices", part.vertices},
                          {"edges", part.edges},
                          {"faces", part.faces},
                          {"boundary_edges", part.boundary_edges},
                          {"defects", part.defects},
                          {"euler", part.euler()},
                          {"genus", part.solid() ? Json(part.genus()) : Json()}});
  }
  Json json = {{"format", check.format},
               {"welded", check.welded},
               {"file_vertices", check.file_vertices},
               {"declared_vertices", check.declared_vertices},
               {"declared_faces", check.declared_faces},
               {"vertices", check.vertices},
               {"faces", check.faces},
               {"edges", check.edges},
               {"unreferenced_vertices", check.unreferenced_vertices},
               {"nonfinite_vertices", check.nonfinite_vertices},
               {"bad_index_faces", check.bad_index_faces},
               {"degenerate_faces", check.degenerate_faces},
               {"zero_area_faces", check.zero_area_faces},
               {"duplicate_faces", check.duplicate_faces},
               {"boundary_edges", check.boundary_edges},
               {"nonmanifold_edges", check.nonmanifold_edges},
               {"inconsistent_edges", check.inconsistent_edges},
               {"nonmanifold_vertices", check.nonmanifold_vertices},
               {"boundary_loops", check.boundary_loops},
               {"open_loops", check.open_loops},
               {"largest_loops", loops},
               {"components", check.components},
               {"solid_components", check.solid_components},
               {"total_genus", check.total_genus},
               {"largest_components", components},
               {"min", check.min},
               {"max", check.max},
               {"solid", check.solid()},
               {"defects", check.defects()}};
  if (check.has_shape) {
    json["area"] = check.area;
    json["volume"] = check.solid() ? Json(check.volume) : Json();
    json["min_edge"] = check.min_edge;
    json["mean_edge"] = check.mean_edge;
    json["max_edge"] = check.max_edge;
    json["aspect_bounds"] = kAspectBounds;
    json["aspect_histogram"] = check.aspect_histogram;
    json["min_angle_deg"] = check.min_angle_deg;
    json["max_angle_deg"] = check.max_angle_deg;
    json["max_edge_ratio"] = check.max_edge_ratio;
  }
  if (check.cleanliness) json["cleanliness"] = to_json(*check.cleanliness);
  if (check.quality) json["quality"] = to_json(*check.quality);
  if (check.crossings) json["crossings"] = to_json(*check.crossings);
  return json;
}

std::string describe(const MeshCheck& check) {
  std::string text;
  const auto line = [&](const std::string& name, const std::string& value) {
    text += name + std::string(name.size() < 14 ? 14 - name.size() : 1, ' ') + value + "\n";
  };
  line("format", check.format);
  std::string vertices = grouped(check.vertices);
  if (check.welded)
    vertices.append(" (merged by position from ").append(grouped(check.file_vertices)).append(")");
  line("vertices", vertices);
  line("faces", grouped(check.faces));
  line("edges", grouped(check.edges));
  std::string parts =
      grouped(check.components) + ", " + grouped(check.solid_components) + " closed and sound";
  if (check.solid_components > 0) parts += ", genus " + std::to_string(check.total_genus) + " together";
  line("components", parts);
  for (std::size_t i = 0; i < check.largest_components.size() && i < 4 && check.components > 1; ++i) {
    const MeshComponent& part = check.largest_components[i];
    line("", counted(part.faces, "face", "faces") + ", Euler " + std::to_string(part.euler()) + ", " +
                 counted(part.boundary_edges, "boundary edge", "boundary edges"));
  }
  std::string borders = counted(check.boundary_edges, "boundary edge", "boundary edges");
  if (check.boundary_edges > 0) {
    borders += " in " + counted(check.boundary_loops, "loop", "loops");
    if (check.open_loops > 0) borders += ", " + grouped(check.open_loops) + " not closed";
    borders += "; longest:";
    for (std::size_t i = 0; i < check.largest_loops.size() && i < 8; ++i) {
      borders.append(" ").append(grouped(check.largest_loops[i].edges));
    }
  }
  line("borders", borders);
  line("bounds", vector_text(check.min) + " to " + vector_text(check.max));
  if (check.has_shape) {
    line("area", number(check.area));
    if (check.solid()) {
      line("volume", number(check.volume) + (check.volume < 0 ? " (faces point inwards)" : ""));
    }
    line("edge length", number(check.min_edge) + " to " + number(check.max_edge) + ", mean " +
                            number(check.mean_edge) + " over the sides of faces");
    std::string aspects;
    for (std::size_t i = 0; i < check.aspect_histogram.size(); ++i) {
      if (i > 0) aspects += ", ";
      if (i < kAspectBounds.size()) {
        aspects += '<';
        aspects += number(kAspectBounds[i]);
      } else {
        aspects += "more";
      }
      aspects += ": ";
      aspects += grouped(check.aspect_histogram[i]);
    }
    line("aspect", aspects);
    line("face angles", number_text(check.min_angle_deg) + " to " + number_text(check.max_angle_deg) +
                            " degrees; longest to shortest edge of a face at most " +
                            number_text(check.max_edge_ratio));
  }
  if (check.cleanliness) text += describe(*check.cleanliness);
  if (check.quality)
    for (const auto& [name, said] : quality_lines(*check.quality)) line(name, said);
  if (check.crossings) text += describe(*check.crossings);
  const std::vector<std::string> defects = check.defects();
  for (const std::string& defect : defects) line("defect", defect);
  if (defects.empty()) line("defects", "none");
  return text;
}

}  // namespace tessera
