/// \file skip.h
/// For tests that need what a machine may lack. Catch2 2 cannot skip a test, so ctest looks for these words (the
/// property SKIP_REGULAR_EXPRESSION in tests/CMakeLists.txt).
#pragma once
#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <string>

namespace tessera::test {

/// ctest then counts the test as skipped, whatever it checks: return right after.
inline void skip(const std::string& why) {
  std::cout << "SKIPPED: " << why << std::endl;
}

/// What lies beside the repository, for cases with the tag [.shared] alone: ../shared, or the folder that the environment names
/// as TESSERA_SHARED; empty = none.
inline std::filesystem::path shared_folder() {
  const char* named = std::getenv("TESSERA_SHARED");
  return named != nullptr ? named : TESSERA_SOURCE_DIR "/../shared";
}

/// The real scans and meshes in it, or skips the test: `if (!has_shared_data()) return;`
inline const std::filesystem::path kSharedData = shared_folder() / "data";
inline bool has_shared_data() {
  if (std::filesystem::is_directory(kSharedData)) return true;
  skip("no real data at " + kSharedData.string());
  return false;
}

}  // namespace tessera::test
