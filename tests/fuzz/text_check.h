/// \file text_check.h
/// What must hold for any text given to what reads job files, scenes, edits, polygons and plans.
#pragma once
#include <cstdint>
#include <string>
#include <string_view>

#include "octree/error.h"
#include "tests/fuzz/point_reader_check.h"

namespace tessera::fuzz {

/// True if `work` ended well, false if it threw what the user is told: InputError or UsageError. Anything else escapes,
/// and the fuzzer reports it.
template <class Work>
bool accepted(Work&& work) {
  try {
    work();
    return true;
  } catch (const InputError& e) {
    require(!std::string_view(e.what()).empty(), "the message says something");
  } catch (const UsageError& e) {
    require(!std::string_view(e.what()).empty(), "the message says something");
  }
  return false;
}

inline std::string_view text_of(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace tessera::fuzz
