/// \file skip.h
/// For tests that need what a machine may lack. Catch2 2 cannot skip a test, so ctest looks for these words (the
/// property SKIP_REGULAR_EXPRESSION in tests/CMakeLists.txt).
#pragma once
#include <filesystem>
#include <iostream>
#include <string>

namespace tessera::test {

/// ctest then counts the test as skipped, whatever it checks: return right after.
inline void skip(const std::string& why) {
  std::cout << "SKIPPED: " << why << std::endl;
}

/// The folder of real scans and meshes beside the repository, or skips the test: `if (!has_shared_data()) return;`
inline const std::filesystem::path kSharedData = TESSERA_SHARED_DATA;
inline bool has_shared_data() {
  if (std::filesystem::is_directory(kSharedData)) return true;
  skip("no real data at " + kSharedData.string());
  return false;
}

}  // namespace tessera::test
