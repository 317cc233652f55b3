#include "stream/stages/resample/blend_file.h"

#include <array>
#include <set>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/json_reader.h"

namespace tessera {

std::vector<NamedCurve> parse_curves(const std::string& text, const std::string& name) {
  const JsonReader read(name);
  const Json file = read.parsed(text);
  read.known(file, "the file", {"blends"});
  std::vector<NamedCurve> out;
  std::set<std::string> names;
  for (const Json& b : read.list(file, "blends", 1, "the file")) {
    const std::string what = "blend " + std::to_string(out.size() + 1);
    read.known(b, what, {"name", "points", "width", "closed"});
    NamedCurve t;
    t.name = what;
    if (b.contains("name")) t.name = read.text(b.at("name"), what + ": \"name\"");
    if (!names.insert(t.name).second) read.fail("two blends are called \"" + t.name + "\"");
    for (const Json& p : read.list(b, "points", 2, what))
      t.points.push_back(read.point(p, what + ": each of \"points\""));
    if (b.contains("closed")) t.closed = read.flag(b.at("closed"), what + ": \"closed\"");
    if (t.closed && t.points.size() < 3) read.fail(what + " is closed: it wants three points at least");
    for (std::size_t i = 0; i + (t.closed ? 0 : 1) < t.points.size(); ++i)
      if (t.points[i] == t.points[(i + 1) % t.points.size()])
        read.fail(what + ": two points that follow each other are the same");
    t.width = read.number(read.member(b, "width", what), what + ": \"width\"");
    if (!(t.width > 0.0)) read.fail(what + ": \"width\" takes a number above 0");
    out.push_back(std::move(t));
  }
  return out;
}

std::vector<ProfileKnot> parse_profile(const std::string& text, const std::string& name) {
  const JsonReader read(name);
  const Json file = read.parsed(text);
  read.known(file, "the file", {"knots"});
  std::vector<ProfileKnot> out;
  for (const Json& k : read.list(file, "knots", 2, "the file")) {
    const std::string what = "knot " + std::to_string(out.size() + 1);
    read.known(k, what, {"at", "way"});
    ProfileKnot knot;
    const auto pair = [&](const char* key) {
      const std::vector<double> n = read.numbers(read.member(k, key, what), 2, what + ": \"" + key + "\"");
      return std::array<double, 2>{n[0], n[1]};
    };
    knot.at = pair("at");
    knot.tangent = pair("way");
    out.push_back(knot);
  }
  if (out.front().at != Double2{0.0, 0.0} || out.back().at != Double2{1.0, 0.0})
    read.fail("the first knot is at [0, 0] and the last at [1, 0]: there the flanks begin");
  return out;
}

std::string read_curves_text(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  parse_curves(text, file.string());
  return dump_json(parse_json(text));
}

std::string read_profile_text(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  parse_profile(text, file.string());
  return dump_json(parse_json(text));
}

}  // namespace tessera
