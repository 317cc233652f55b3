#include "stream/runtime/json_reader.h"

#include <algorithm>
#include <cmath>

#include "octree/error.h"
#include "stream/files/json.h"
#include "stream/runtime/option_table.h"

namespace tessera {

void JsonReader::fail(const std::string& what) const {
  throw InputError(name_ + ": " + what);
}

Json JsonReader::parsed(const std::string& text) const {
  return parse_json(text, name_);
}

void JsonReader::known(const Json& object, const std::string& what,
                       const std::vector<std::string>& keys) const {
  if (!object.is_object()) fail(what + " is an object");
  for (const auto& [key, value] : object.items())
    if (std::find(keys.begin(), keys.end(), key) == keys.end())
      fail("\"" + key + "\" is not known in " + what + did_you_mean(key, keys));
}

const Json& JsonReader::member(const Json& object, const char* key, const std::string& what) const {
  if (!object.contains(key)) fail(what + " wants \"" + key + "\"");
  return object.at(key);
}

const Json& JsonReader::list(const Json& object, const char* key, std::size_t minimum,
                             const std::string& what) const {
  const Json& value = member(object, key, what);
  if (!value.is_array() || value.size() < minimum)
    fail(what + ": \"" + key + "\" takes a list of at least " + std::to_string(minimum));
  return value;
}

bool JsonReader::flag(const Json& value, const std::string& what) const {
  if (!value.is_boolean()) fail(what + " takes true or false");
  return value.get<bool>();
}

std::string JsonReader::text(const Json& value, const std::string& what) const {
  if (!value.is_string()) fail(what + " takes a text");
  return value.get<std::string>();
}

double JsonReader::number(const Json& value, const std::string& what) const {
  if (!value.is_number() || !std::isfinite(value.get<double>())) fail(what + " takes a number");
  return value.get<double>();
}

std::vector<double> JsonReader::numbers(const Json& value, std::size_t count, const std::string& what) const {
  const auto refuse = [&] { fail(what + " takes " + std::to_string(count) + " numbers"); };
  if (!value.is_array() || value.size() != count) refuse();
  std::vector<double> out;
  for (const Json& v : value) {
    if (!v.is_number() || !std::isfinite(v.get<double>())) refuse();
    out.push_back(v.get<double>());
  }
  return out;
}

Double3 JsonReader::point(const Json& value, const std::string& what) const {
  const std::vector<double> n = numbers(value, 3, what);
  return {n[0], n[1], n[2]};
}

std::vector<Double3> JsonReader::points(const Json& value, const std::string& what) const {
  if (!value.is_array() || value.empty()) fail(what + " takes a list of at least one point");
  std::vector<Double3> out;
  for (const Json& v : value) out.push_back(point(v, what));
  return out;
}

}  // namespace tessera
