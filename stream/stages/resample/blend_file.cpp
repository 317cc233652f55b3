#include "stream/stages/resample/blend_file.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json_text.h"
#include "stream/runtime/option_table.h"

namespace tessera {
namespace {

using json = nlohmann::json;

class Reader {
 public:
  explicit Reader(std::string name) : name_(std::move(name)) {}

  [[noreturn]] void fail(const std::string& what) const { throw InputError(name_ + ": " + what); }

  void known(const json& object, const std::string& what, const std::vector<std::string>& keys) const {
    if (!object.is_object()) fail(what + " is an object");
    for (const auto& [key, value] : object.items())
      if (std::find(keys.begin(), keys.end(), key) == keys.end())
        fail("\"" + key + "\" is not known in " + what + did_you_mean(key, keys));
  }
  const json& member(const json& object, const char* key, const std::string& what) const {
    if (!object.contains(key)) fail(what + " wants \"" + key + "\"");
    return object.at(key);
  }
  const json& list(const json& object, const char* key, std::size_t least, const std::string& what) const {
    const json& value = member(object, key, what);
    if (!value.is_array() || value.size() < least)
      fail(what + ": \"" + key + "\" takes a list of at least " + std::to_string(least));
    return value;
  }
  template <std::size_t kCount>
  std::array<double, kCount> numbers(const json& value, const std::string& what) const {
    std::array<double, kCount> out;
    if (!value.is_array() || value.size() != kCount)
      fail(what + " takes " + std::to_string(kCount) + " numbers");
    for (std::size_t i = 0; i < kCount; ++i) {
      if (!value[i].is_number() || !std::isfinite(value[i].get<double>()))
        fail(what + " takes " + std::to_string(kCount) + " numbers");
      out[i] = value[i].get<double>();
    }
    return out;
  }

 private:
  std::string name_;
};

}  // namespace

std::vector<NamedTrack> parse_tracks(const std::string& text, const std::string& name) {
  const Reader read(name);
  const json file = parse_json(text, name);
  read.known(file, "the file", {"blends"});
  std::vector<NamedTrack> out;
  std::set<std::string> names;
  for (const json& b : read.list(file, "blends", 1, "the file")) {
    const std::string what = "blend " + std::to_string(out.size() + 1);
    read.known(b, what, {"name", "points", "width", "closed"});
    NamedTrack t;
    t.name = what;
    if (b.contains("name")) {
      if (!b.at("name").is_string()) read.fail(what + ": \"name\" takes a text");
      t.name = b.at("name").get<std::string>();
    }
    if (!names.insert(t.name).second) read.fail("two blends are called \"" + t.name + "\"");
    for (const json& p : read.list(b, "points", 2, what))
      t.points.push_back(read.numbers<3>(p, what + ": each of \"points\""));
    if (b.contains("closed")) {
      if (!b.at("closed").is_boolean()) read.fail(what + ": \"closed\" takes true or false");
      t.closed = b.at("closed").get<bool>();
    }
    if (t.closed && t.points.size() < 3) read.fail(what + " is closed: it wants three points at least");
    for (std::size_t i = 0; i + (t.closed ? 0 : 1) < t.points.size(); ++i)
      if (t.points[i] == t.points[(i + 1) % t.points.size()])
        read.fail(what + ": two points that follow each other are the same");
    const json& width = read.member(b, "width", what);
    if (!width.is_number() || !(width.get<double>() > 0.0) || !std::isfinite(width.get<double>()))
      read.fail(what + ": \"width\" takes a number above 0");
    t.width = width.get<double>();
    out.push_back(std::move(t));
  }
  return out;
}

std::vector<ProfileKnot> parse_profile(const std::string& text, const std::string& name) {
  const Reader read(name);
  const json file = parse_json(text, name);
  read.known(file, "the file", {"knots"});
  std::vector<ProfileKnot> out;
  for (const json& k : read.list(file, "knots", 2, "the file")) {
    const std::string what = "knot " + std::to_string(out.size() + 1);
    read.known(k, what, {"at", "way"});
    ProfileKnot knot;
    knot.at = read.numbers<2>(read.member(k, "at", what), what + ": \"at\"");
    knot.way = read.numbers<2>(read.member(k, "way", what), what + ": \"way\"");
    out.push_back(knot);
  }
  if (out.front().at != Double2{0.0, 0.0} || out.back().at != Double2{1.0, 0.0})
    read.fail("the first knot is at [0, 0] and the last at [1, 0]: there the flanks begin");
  return out;
}

std::string read_tracks_text(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  parse_tracks(text, file.string());
  return json::parse(text).dump();
}

std::string read_profile_text(const std::filesystem::path& file) {
  const std::string text = read_text(file);
  parse_profile(text, file.string());
  return json::parse(text).dump();
}

}  // namespace tessera
