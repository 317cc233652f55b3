/// \file json_fields.h
/// Structs as JSON objects and back, by one table of their members: a key is written once, and misspelt in neither direction.
///
///     struct Counts {
///       std::uint64_t faces = 0;
///       std::optional<double> confidence;  // left out while there is none
///       static void fields(auto& self, auto&& field) {
///         field("faces", self.faces);
///         field("confidence", self.confidence);
///       }
///     };
#pragma once
#include <optional>
#include <string_view>
#include <type_traits>
#include <vector>

#include "stream/files/json.h"

namespace tessera {

template <class T>
concept HasFields = requires(T& value) {
  T::fields(value, [](std::string_view, auto&) {});
};

template <class T>
inline constexpr bool kIsOptional = false;
template <class T>
inline constexpr bool kIsOptional<std::optional<T>> = true;
template <class T>
inline constexpr bool kIsListOfFields = false;
template <HasFields T>
inline constexpr bool kIsListOfFields<std::vector<T>> = true;

/// Anything that Json holds, and structs with fields, lists of them and optional ones.
template <class T>
Json fields_to_json(const T& value) {
  if constexpr (HasFields<T>) {
    Json out = Json::object();
    T::fields(value, [&](std::string_view key, const auto& member) {
      if constexpr (kIsOptional<std::remove_cvref_t<decltype(member)>>) {
        if (member) out[key] = fields_to_json(*member);
      } else {
        out[key] = fields_to_json(member);
      }
    });
    return out;
  } else if constexpr (kIsListOfFields<T>) {
    Json out = Json::array();
    for (const auto& element : value) out.push_back(fields_to_json(element));
    return out;
  } else {
    return Json(value);
  }
}

/// \throws JsonError for a member that is missing or of another kind
template <class T>
T fields_from_json(const Json& json) {
  if constexpr (HasFields<T>) {
    T value;
    T::fields(value, [&](std::string_view key, auto& member) {
      using Member = std::remove_cvref_t<decltype(member)>;
      if constexpr (kIsOptional<Member>) {
        if (const Json* found = json.find(key))
          member = fields_from_json<typename Member::value_type>(*found);
      } else {
        member = fields_from_json<Member>(json.at(key));
      }
    });
    return value;
  } else if constexpr (kIsListOfFields<T>) {
    T values;
    for (const Json& element : json.elements())
      values.push_back(fields_from_json<typename T::value_type>(element));
    return values;
  } else {
    return json.get<T>();
  }
}

}  // namespace tessera
