#include "stream/files/json_text.h"

#include <cstddef>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "octree/error.h"

namespace tessera {
namespace {

/// Builds the value while the text is read.
class Builder final : public nlohmann::json_sax<nlohmann::json> {
 public:
  Json root = Json::discarded();
  enum class Failure { kNone, kText, kNumber, kDepth };
  Failure failure = Failure::kNone;
  std::size_t byte = 0;  ///< where the text stops to be JSON

  bool null() override { return add(nullptr); }
  bool boolean(bool value) override { return add(value); }
  bool number_integer(number_integer_t value) override { return add(value); }
  bool number_unsigned(number_unsigned_t value) override { return add(value); }
  bool number_float(number_float_t value, const string_t&) override { return add(value); }
  bool string(string_t& value) override { return add(std::move(value)); }
  bool binary(binary_t&) override { return false; }
  bool start_object(std::size_t) override { return open(Json::object()); }
  bool start_array(std::size_t) override { return open(Json::array()); }
  bool end_object() override { return close(); }
  bool end_array() override { return close(); }
  bool key(string_t& name) override {
    key_ = std::move(name);
    return true;
  }
  bool parse_error(std::size_t at, const std::string&, const nlohmann::detail::exception& e) override {
    byte = at;
    failure = dynamic_cast<const nlohmann::json::out_of_range*>(&e) ? Failure::kNumber : Failure::kText;
    return false;
  }

 private:
  // Values are destroyed level by level on the stack.
  static constexpr std::size_t kMaxDepth = 512;

  bool open(Json value) {
    if (open_.size() == kMaxDepth) {
      failure = Failure::kDepth;
      return false;
    }
    open_.push_back(&insert(std::move(value)));
    return true;
  }
  bool close() {
    open_.pop_back();
    return true;
  }
  bool add(Json value) {
    insert(std::move(value));
    return true;
  }
  Json& insert(Json value) {
    if (open_.empty()) return root = std::move(value);
    Json& parent = *open_.back();
    if (parent.is_object()) return parent[key_] = std::move(value);
    parent.push_back(std::move(value));
    return parent.back();
  }

  std::vector<Json*> open_;  ///< objects and lists around the value at hand
  std::string key_;
};

Builder build(const std::string& text) {
  Builder builder;
  nlohmann::json::sax_parse(text, &builder);
  return builder;
}

nlohmann::json to_library(const Json& value) {
  switch (value.kind()) {
    case Json::Kind::kBoolean:
      return value.boolean();
    case Json::Kind::kSigned:
      return value.integer();
    case Json::Kind::kUnsigned:
      return value.natural();
    case Json::Kind::kFloat:
      return value.number();
    case Json::Kind::kString:
      return value.string();
    case Json::Kind::kArray: {
      nlohmann::json out = nlohmann::json::array();
      for (const Json& element : value) out.push_back(to_library(element));
      return out;
    }
    case Json::Kind::kObject: {
      nlohmann::json out = nlohmann::json::object();
      for (const auto& [key, member] : value.items()) out.emplace(key, to_library(member));
      return out;
    }
    default:
      return nullptr;
  }
}

}  // namespace

Json parse_json(const std::string& text, const std::string& name) {
  Builder builder = build(text);
  switch (builder.failure) {
    case Builder::Failure::kNone:
      return std::move(builder.root);
    case Builder::Failure::kText:
      throw InputError(name + ": no JSON at byte " + std::to_string(builder.byte));
    case Builder::Failure::kNumber:
      throw InputError(name + ": a number in it is larger than any that can be computed with");
    case Builder::Failure::kDepth:
      break;
  }
  throw InputError(name + ": its lists and objects nest deeper than 512 levels");
}

Json parse_json(const std::string& text) {
  Builder builder = build(text);
  if (builder.failure != Builder::Failure::kNone) throw JsonError("the text is no JSON");
  return std::move(builder.root);
}

Json try_parse_json(const std::string& text) {
  Builder builder = build(text);
  return builder.failure == Builder::Failure::kNone ? std::move(builder.root) : Json::discarded();
}

std::string dump_json(const Json& value, int indent, bool ascii) {
  return to_library(value).dump(indent, ' ', ascii, nlohmann::json::error_handler_t::replace);
}

}  // namespace tessera
