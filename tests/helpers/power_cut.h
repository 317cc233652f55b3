/// \file power_cut.h
/// What a machine that loses its power leaves of a folder: files that were brought to the disk are whole, of all others chance
/// decides. TESSERA_SYNCED of the fault layer (torture/fault_layer.cpp) tells which were.
#pragma once
#include <fcntl.h>
#include <sys/stat.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <tuple>
#include <vector>

#include "tests/helpers/random.h"

namespace tessera::test {

/// Of every regular file below `folder` what had not been synced stays, is cut off somewhere, reads as zeros, or the file is gone.
/// Names that were given are kept: a folder's last sync is not looked at.
/// \param synced  the file that TESSERA_SYNCED named; tells then of everything that is left, which lies on the disk
/// \returns how many files lost something
inline std::size_t lose_unsynced(const std::filesystem::path& folder, const std::filesystem::path& synced,
                                 Random& random) {
  namespace fs = std::filesystem;
  // Number and birth: numbers of files that have gone are given again.
  using FileId = std::tuple<std::uint64_t, std::int64_t, std::uint32_t>;
  std::map<FileId, std::uint64_t> safe;
  std::ifstream lines(synced);
  FileId id;
  for (std::uint64_t size = 0; lines >> std::get<0>(id) >> std::get<1>(id) >> std::get<2>(id) >> size;)
    safe[id] = std::max(safe[id], size);
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  std::size_t hurt = 0;
  for (const fs::path& file : files) {
    struct statx s {};
    if (::statx(AT_FDCWD, file.c_str(), 0, STATX_INO | STATX_SIZE | STATX_BTIME, &s) != 0) continue;
    const auto at = safe.find({s.stx_ino, s.stx_btime.tv_sec, s.stx_btime.tv_nsec});
    const std::uint64_t kept = at == safe.end() ? 0 : at->second;
    if (s.stx_size <= kept) continue;
    const std::uint64_t fate = random.below(5);
    if (fate < 2) continue;
    ++hurt;
    if (fate == 2 && kept == 0) {
      fs::remove(file);
      continue;
    }
    fs::resize_file(file, kept + random.below(s.stx_size - kept));
    if (fate == 3) fs::resize_file(file, s.stx_size);
  }
  std::ofstream left(synced);
  for (const fs::path& file : files) {
    struct statx s {};
    if (::statx(AT_FDCWD, file.c_str(), 0, STATX_INO | STATX_SIZE | STATX_BTIME, &s) == 0)
      left << s.stx_ino << ' ' << s.stx_btime.tv_sec << ' ' << s.stx_btime.tv_nsec << ' ' << s.stx_size
           << '\n';
  }
  return hurt;
}

}  // namespace tessera::test
