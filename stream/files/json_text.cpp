#include "stream/files/json_text.h"

#include <nlohmann/json.hpp>

#include "octree/error.h"

namespace tessera {

nlohmann::json parse_json(const std::string& text, const std::string& name) {
  try {
    return nlohmann::json::parse(text);
  } catch (const nlohmann::json::parse_error& e) {
    throw InputError(name + ": no JSON at byte " + std::to_string(e.byte));
  } catch (const nlohmann::json::out_of_range&) {
    throw InputError(name + ": a number in it is larger than any that can be computed with");
  }
}

nlohmann::json parse_json(const std::string& text) {
  return nlohmann::json::parse(text);
}

nlohmann::json try_parse_json(const std::string& text) {
  return nlohmann::json::parse(text, nullptr, false);
}

std::string dump_json(const nlohmann::json& value, int indent) {
  return value.dump(indent, ' ', false, nlohmann::json::error_handler_t::replace);
}

}  // namespace tessera
