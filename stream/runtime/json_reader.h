/// \file json_reader.h
/// What JSON that people wrote may hold: what is wrong with it is said with the file's name and what was meant.
#pragma once
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "octree/lattice.h"
#include "stream/files/json.h"

namespace tessera {

/// What a file may hold. Each takes what a value is called in messages, as "region 3"; all throw InputError.
class JsonReader {
 public:
  /// \param name  of the file
  explicit JsonReader(std::string name) : name_(std::move(name)) {}

  [[noreturn]] void fail(const std::string& what) const;
  /// As parse_json().
  Json parsed(const std::string& text) const;
  /// An object with no keys but these.
  void known(const Json& object, const std::string& what, const std::vector<std::string>& keys) const;
  const Json& member(const Json& object, const char* key, const std::string& what) const;
  /// A member that is a list of at least so many.
  const Json& list(const Json& object, const char* key, std::size_t minimum, const std::string& what) const;
  bool flag(const Json& value, const std::string& what) const;
  std::string text(const Json& value, const std::string& what) const;
  /// Finite ones.
  double number(const Json& value, const std::string& what) const;
  std::vector<double> numbers(const Json& value, std::size_t count, const std::string& what) const;
  Double3 point(const Json& value, const std::string& what) const;
  /// A list of at least one.
  std::vector<Double3> points(const Json& value, const std::string& what) const;

 private:
  std::string name_;
};

}  // namespace tessera
