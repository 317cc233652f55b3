/// \file json.h
/// A JSON value whose members are compiled once. nlohmann::json is templates: every file that named a key or a list paid
/// for them again, a third of what building the stages took. It reads and writes the text still.
#pragma once
#include <array>
#include <compare>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

namespace tessera {

/// A value asked for as what it is not, or a key that is not there.
class JsonError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// An std::array, or what derives from one: vectors of coordinates.
template <class T>
concept DerivedArray = requires(T& value) {
  []<class E, std::size_t N>(std::array<E, N>&) {}(value);
};

/// Null, boolean, number, string, array or object. Objects keep their members in the order of the keys; references to
/// elements of an object stay valid while others are added.
class Json {
 public:
  enum class Kind : std::uint8_t {
    kNull,
    kBoolean,
    kSigned,
    kUnsigned,
    kFloat,
    kString,
    kArray,
    kObject,
    kDiscarded
  };
  using Array = std::vector<Json>;
  using Object = std::map<std::string, Json, std::less<>>;

  Json() noexcept = default;
  Json(std::nullptr_t) noexcept {}
  Json(const Json& other);
  Json(Json&& other) noexcept;
  Json& operator=(const Json& other);
  Json& operator=(Json&& other) noexcept;
  ~Json();

  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) Json(T number)
  noexcept {
    if constexpr (std::is_enum_v<T>) {
      kind_ = Kind::kSigned, value_.integer = static_cast<std::int64_t>(number);
    } else if constexpr (std::same_as<T, bool>) {
      kind_ = Kind::kBoolean, value_.boolean = number;
    } else if constexpr (std::floating_point<T>) {
      kind_ = Kind::kFloat, value_.number = static_cast<double>(number);
    } else if constexpr (std::signed_integral<T>) {
      kind_ = Kind::kSigned, value_.integer = number;
    } else {
      kind_ = Kind::kUnsigned, value_.natural = number;
    }
  }
  Json(const char* text);
  Json(std::string_view text);
  Json(const std::string& text);
  Json(std::string&& text);
  Json(Array elements);
  Json(Object members);
  template <class T>
  requires(!std::same_as<T, Json>) Json(const std::vector<T>& elements) : Json(from_range(elements)) {}
  template <class T, std::size_t N>
  Json(const std::array<T, N>& elements) : Json(from_range(elements)) {}
  template <class T>
  requires(!std::same_as<T, Json>) Json(const std::map<std::string, T>& members) : Json(object()) {
    for (const auto& [key, value] : members) (*this)[key] = Json(value);
  }
  /// An object if every element is a pair that begins with a string, else an array.
  Json(std::initializer_list<Json> elements);

  static Json array();
  static Json array(std::initializer_list<Json> elements);
  static Json object();
  static Json object(std::initializer_list<Json> pairs);
  /// What text that is no JSON is read as.
  static Json discarded();

  Kind kind() const noexcept { return kind_; }
  bool is_null() const noexcept { return kind_ == Kind::kNull; }
  bool is_boolean() const noexcept { return kind_ == Kind::kBoolean; }
  bool is_number() const noexcept { return kind_ >= Kind::kSigned && kind_ <= Kind::kFloat; }
  bool is_number_integer() const noexcept { return kind_ == Kind::kSigned || kind_ == Kind::kUnsigned; }
  bool is_number_unsigned() const noexcept { return kind_ == Kind::kUnsigned; }
  bool is_number_float() const noexcept { return kind_ == Kind::kFloat; }
  bool is_string() const noexcept { return kind_ == Kind::kString; }
  bool is_array() const noexcept { return kind_ == Kind::kArray; }
  bool is_object() const noexcept { return kind_ == Kind::kObject; }
  bool is_discarded() const noexcept { return kind_ == Kind::kDiscarded; }

  /// Elements, 0 of null, 1 of a value.
  std::size_t size() const noexcept;
  bool empty() const noexcept { return size() == 0; }

  /// The member or element, made as null if it is not there.
  Json& operator[](std::string_view key);
  Json& operator[](std::size_t index);
  /// \throws JsonError where it is not there
  const Json& operator[](std::string_view key) const { return at(key); }
  const Json& operator[](std::size_t index) const { return at(index); }
  const Json& at(std::string_view key) const;
  const Json& at(std::size_t index) const;
  Json& at(std::string_view key);
  Json& at(std::size_t index);
  /// By path, "/mesh/faces/0"; null where there is none.
  const Json* at_path(std::string_view path) const;
  /// Null where there is none, or this is no object.
  const Json* find(std::string_view key) const noexcept;
  Json* find(std::string_view key) noexcept;
  bool contains(std::string_view key) const noexcept { return find(key) != nullptr; }
  std::size_t erase(std::string_view key);
  /// Members of another object over those of this.
  void update(const Json& members);
  void push_back(Json element);
  const Json& front() const { return at(std::size_t{0}); }
  const Json& back() const { return at(size() - 1); }
  Json& back() { return at(size() - 1); }

  /// Elements; none of null. \throws JsonError for anything else
  const Json* begin() const;
  const Json* end() const { return begin() + (is_array() ? size() : 0); }
  Json* begin();
  Json* end() { return begin() + (is_array() ? size() : 0); }
  /// Members; none of null. \throws JsonError for anything else
  const Object& items() const;

  /// Numbers become any number as by static_cast, arrays vectors and arrays. \throws JsonError for another kind, and for a
  /// whole number that 64 bits do not hold
  template <class T>
  T get() const {
    if constexpr (std::same_as<T, Json>) {
      return *this;
    } else if constexpr (std::same_as<T, bool>) {
      return boolean();
    } else if constexpr (std::floating_point<T>) {
      return static_cast<T>(number());
    } else if constexpr (std::unsigned_integral<T>) {
      return static_cast<T>(natural());
    } else if constexpr (std::integral<T>) {
      return static_cast<T>(integer());
    } else if constexpr (std::same_as<T, std::string>) {
      return string();
    } else {
      T value;
      get_to(value);
      return value;
    }
  }
  template <class T>
  requires(!DerivedArray<T>) void get_to(T& value) const { value = get<T>(); }
  template <class T>
  void get_to(std::vector<T>& values) const {
    values.clear();
    for (const Json& element : elements()) values.push_back(element.get<T>());
  }
  template <class T, std::size_t N>
  void get_to(std::array<T, N>& values) const {
    for (std::size_t i = 0; i < N; ++i) at(i).get_to(values[i]);
  }
  /// The member, or what stands for it. \throws JsonError where this is no object
  template <class T>
  T value(std::string_view key, const T& fallback) const {
    const Json* found = member(key);
    return found != nullptr ? found->get<T>() : fallback;
  }
  std::string value(std::string_view key, const char* fallback) const;

  bool boolean() const;
  double number() const;
  std::int64_t integer() const;
  std::uint64_t natural() const;
  const std::string& string() const;
  const Array& elements() const;

  /// Numbers are equal whatever their kind.
  friend bool operator==(const Json& a, const Json& b) noexcept;
  /// Of numbers alone.
  friend std::partial_ordering operator<=>(const Json& a, const Json& b) noexcept;

 private:
  template <class Range>
  static Json from_range(const Range& range) {
    Json out = array();
    for (const auto& element : range) out.push_back(Json(element));
    return out;
  }
  const Json* member(std::string_view key) const;

  union Value {
    bool boolean;
    std::int64_t integer;
    std::uint64_t natural;
    double number;
    std::string* string;
    Array* array;
    Object* object;
  };
  Value value_ = {};
  Kind kind_ = Kind::kNull;
};

/// JSON that people wrote. \param name  of the file, for messages
/// \throws InputError naming it and the byte where it is no JSON, or that a number is beyond all reading
Json parse_json(const std::string& text, const std::string& name);

/// JSON that the program wrote itself. \throws JsonError
Json parse_json(const std::string& text);

/// A discarded value where the text is no JSON.
Json try_parse_json(const std::string& text);

/// What is no UTF-8 becomes U+FFFD. \param indent  spaces a level; negative: all in one line
/// \param ascii  everything beyond ASCII is escaped
std::string dump_json(const Json& value, int indent = -1, bool ascii = false);

}  // namespace tessera
