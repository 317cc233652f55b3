#include "stream/files/json.h"

#include <algorithm>
#include <charconv>
#include <cmath>

#include <nlohmann/json.hpp>

#include "octree/error.h"

namespace tessera {
namespace {

const char* name_of(Json::Kind kind) {
  switch (kind) {
    case Json::Kind::kNull:
      return "null";
    case Json::Kind::kBoolean:
      return "a boolean";
    case Json::Kind::kSigned:
    case Json::Kind::kUnsigned:
    case Json::Kind::kFloat:
      return "a number";
    case Json::Kind::kString:
      return "a string";
    case Json::Kind::kArray:
      return "a list";
    case Json::Kind::kObject:
      return "an object";
    case Json::Kind::kDiscarded:
      break;
  }
  return "no JSON";
}

[[noreturn]] void throw_kind(Json::Kind kind, const char* wanted) {
  throw JsonError(std::string(name_of(kind)) + " where " + wanted + " is wanted");
}
[[noreturn]] void throw_missing(std::string_view key) {
  throw JsonError("\"" + std::string(key) + "\" is missing");
}
[[noreturn]] void throw_beyond(std::size_t index, std::size_t size) {
  throw JsonError("element " + std::to_string(index) + " of " + std::to_string(size) + " is wanted");
}

[[noreturn]] void throw_range(double number) {
  throw JsonError("the number " + std::to_string(number) + " where a whole number of 64 bits is wanted");
}

bool is_pair(const Json& value) {
  return value.is_array() && value.size() == 2 && value.front().is_string();
}

/// Builds the value while the text is read.
class Builder final : public nlohmann::json_sax<nlohmann::json> {
 public:
  Json root = Json::discarded();
  enum class Failure { kNone, kText, kNumber, kDepth };
  Failure failure = Failure::kNone;
  std::size_t byte = 0;  ///< where the text stops to be JSON
  std::string reason;    ///< in the library's words, with line and column

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
    reason = e.what();  // "[name of the exception] reason"
    if (const std::size_t end = reason.find("] "); end != std::string::npos) reason.erase(0, end + 2);
    failure = dynamic_cast<const nlohmann::json::out_of_range*>(&e) ? Failure::kNumber : Failure::kText;
    return false;
  }

 private:
  // Values are destroyed level by level on the stack.
  static constexpr std::size_t kMaxDepth = 512;

  bool open(Json value) {
    if (open_.size() == kMaxDepth) {
      failure = Failure::kDepth;
      reason = "lists and objects nest deeper than " + std::to_string(kMaxDepth) + " levels";
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

Json::Json(const Json& other) : value_(other.value_), kind_(other.kind_) {
  if (kind_ == Kind::kString) value_.string = new std::string(*other.value_.string);
  if (kind_ == Kind::kArray) value_.array = new Array(*other.value_.array);
  if (kind_ == Kind::kObject) value_.object = new Object(*other.value_.object);
}
Json::Json(Json&& other) noexcept : value_(other.value_), kind_(std::exchange(other.kind_, Kind::kNull)) {}
Json& Json::operator=(const Json& other) {
  Json copy(other);
  return *this = std::move(copy);
}
Json& Json::operator=(Json&& other) noexcept {
  std::swap(value_, other.value_);
  std::swap(kind_, other.kind_);
  return *this;
}
Json::~Json() {
  if (kind_ == Kind::kString) delete value_.string;
  if (kind_ == Kind::kArray) delete value_.array;
  if (kind_ == Kind::kObject) delete value_.object;
}

Json::Json(const char* text) : Json(std::string(text)) {}
Json::Json(std::string_view text) : Json(std::string(text)) {}
Json::Json(const std::string& text) : Json(std::string(text)) {}
Json::Json(std::string&& text) {
  value_.string = new std::string(std::move(text));
  kind_ = Kind::kString;
}
Json::Json(Array elements) {
  value_.array = new Array(std::move(elements));
  kind_ = Kind::kArray;
}
Json::Json(Object members) {
  value_.object = new Object(std::move(members));
  kind_ = Kind::kObject;
}
Json::Json(std::initializer_list<Json> elements)
    : Json(std::all_of(elements.begin(), elements.end(), is_pair) ? object(elements) : array(elements)) {}

Json Json::array() {
  return Json(Array{});
}
Json Json::array(std::initializer_list<Json> elements) {
  return Json(Array(elements));
}
Json Json::object() {
  return Json(Object{});
}
Json Json::object(std::initializer_list<Json> pairs) {
  Object members;
  for (const Json& pair : pairs) {
    if (!is_pair(pair)) throw_kind(pair.kind(), "a key with its value");
    members.emplace(pair.front().string(), pair.back());
  }
  return Json(std::move(members));
}
Json Json::discarded() {
  Json value;
  value.kind_ = Kind::kDiscarded;
  return value;
}

std::size_t Json::size() const noexcept {
  if (is_array()) return value_.array->size();
  if (is_object()) return value_.object->size();
  return is_null() ? 0 : 1;
}

Json& Json::operator[](std::string_view key) {
  if (is_null()) *this = object();
  if (!is_object()) throw_kind(kind_, "an object");
  const auto found = value_.object->lower_bound(key);
  if (found != value_.object->end() && found->first == key) return found->second;
  return value_.object->emplace_hint(found, key, Json())->second;
}
Json& Json::operator[](std::size_t index) {
  if (is_null()) *this = array();
  if (!is_array()) throw_kind(kind_, "a list");
  if (index >= value_.array->size()) value_.array->resize(index + 1);
  return (*value_.array)[index];
}
const Json& Json::at(std::string_view key) const {
  const Json* found = member(key);
  if (found == nullptr) throw_missing(key);
  return *found;
}
const Json& Json::at(std::size_t index) const {
  if (!is_array()) throw_kind(kind_, "a list");
  if (index >= value_.array->size()) throw_beyond(index, value_.array->size());
  return (*value_.array)[index];
}
Json& Json::at(std::string_view key) {
  return const_cast<Json&>(std::as_const(*this).at(key));
}
Json& Json::at(std::size_t index) {
  return const_cast<Json&>(std::as_const(*this).at(index));
}
const Json* Json::at_path(std::string_view path) const {
  const Json* value = this;
  while (value != nullptr && !path.empty()) {
    path.remove_prefix(1);
    const std::string_view step = path.substr(0, path.find('/'));
    path.remove_prefix(step.size());
    if (!value->is_array()) {
      value = value->find(step);
      continue;
    }
    std::size_t index = 0;
    const auto [end, error] = std::from_chars(step.data(), step.data() + step.size(), index);
    const bool is_index = error == std::errc() && end == step.data() + step.size();
    value = is_index && index < value->size() ? &value->at(index) : nullptr;
  }
  return value;
}
const Json* Json::find(std::string_view key) const noexcept {
  if (!is_object()) return nullptr;
  const auto found = value_.object->find(key);
  return found == value_.object->end() ? nullptr : &found->second;
}
Json* Json::find(std::string_view key) noexcept {
  return const_cast<Json*>(std::as_const(*this).find(key));
}
const Json* Json::member(std::string_view key) const {
  if (!is_object()) throw_kind(kind_, "an object");
  return find(key);
}
std::size_t Json::erase(std::string_view key) {
  if (!is_object()) throw_kind(kind_, "an object");
  const auto found = value_.object->find(key);
  if (found == value_.object->end()) return 0;
  value_.object->erase(found);
  return 1;
}
void Json::update(const Json& members) {
  for (const auto& [key, value] : members.items()) (*this)[key] = value;
}
void Json::push_back(Json element) {
  if (is_null()) *this = array();
  if (!is_array()) throw_kind(kind_, "a list");
  value_.array->push_back(std::move(element));
}

const Json* Json::begin() const {
  return elements().data();
}
Json* Json::begin() {
  return const_cast<Json*>(std::as_const(*this).begin());
}
const Json::Object& Json::items() const {
  static const Object kNone;
  if (is_null()) return kNone;
  if (!is_object()) throw_kind(kind_, "an object");
  return *value_.object;
}
const Json::Array& Json::elements() const {
  static const Array kNone;
  if (is_null()) return kNone;
  if (!is_array()) throw_kind(kind_, "a list");
  return *value_.array;
}

bool Json::boolean() const {
  if (!is_boolean()) throw_kind(kind_, "a boolean");
  return value_.boolean;
}
double Json::number() const {
  if (kind_ == Kind::kFloat) return value_.number;
  return kind_ == Kind::kUnsigned ? static_cast<double>(natural()) : static_cast<double>(integer());
}
std::int64_t Json::integer() const {
  if (kind_ == Kind::kSigned) return value_.integer;
  if (kind_ == Kind::kUnsigned) return static_cast<std::int64_t>(value_.natural);
  if (kind_ != Kind::kFloat) throw_kind(kind_, "a number");
  if (!(std::fabs(value_.number) < 0x1p63)) throw_range(value_.number);
  return static_cast<std::int64_t>(value_.number);
}
std::uint64_t Json::natural() const {
  if (kind_ == Kind::kUnsigned) return value_.natural;
  if (kind_ != Kind::kFloat) return static_cast<std::uint64_t>(integer());
  if (!(value_.number > -1.0 && value_.number < 0x1p64)) throw_range(value_.number);
  return static_cast<std::uint64_t>(value_.number);
}
const std::string& Json::string() const {
  if (!is_string()) throw_kind(kind_, "a string");
  return *value_.string;
}
std::string Json::value(std::string_view key, const char* fallback) const {
  const Json* found = member(key);
  return found != nullptr ? found->string() : std::string(fallback);
}

std::partial_ordering operator<=>(const Json& a, const Json& b) noexcept {
  if (!a.is_number() || !b.is_number()) return std::partial_ordering::unordered;
  if (a.is_number_float() || b.is_number_float()) return a.number() <=> b.number();
  const auto is_negative = [](const Json& j) {
    return j.kind_ == Json::Kind::kSigned && j.value_.integer < 0;
  };
  if (is_negative(a) != is_negative(b)) return is_negative(b) <=> is_negative(a);
  return is_negative(a) ? a.integer() <=> b.integer() : a.natural() <=> b.natural();
}

bool operator==(const Json& a, const Json& b) noexcept {
  using Kind = Json::Kind;
  if (a.is_number() && b.is_number()) return a <=> b == std::partial_ordering::equivalent;
  if (a.kind_ != b.kind_) return false;
  switch (a.kind_) {
    case Kind::kBoolean:
      return a.value_.boolean == b.value_.boolean;
    case Kind::kString:
      return *a.value_.string == *b.value_.string;
    case Kind::kArray:
      return *a.value_.array == *b.value_.array;
    case Kind::kObject:
      return *a.value_.object == *b.value_.object;
    default:
      return a.kind_ != Kind::kDiscarded;
  }
}

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
  throw InputError(name + ": its " + builder.reason);
}

Json parse_json(const std::string& text) {
  Builder builder = build(text);
  if (builder.failure != Builder::Failure::kNone) throw JsonError(builder.reason);
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
