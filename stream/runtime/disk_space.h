/// \file disk_space.h
/// Whether disks can hold what is coming, asked before it comes.
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace tessera {

/// What will lie in a folder at one time.
struct DiskNeed {
  std::filesystem::path folder;  ///< is there
  std::uint64_t bytes = 0;       ///< about; without what lies there already
  std::string what;              ///< "the work directory /scratch/out.ply.tessera"
};

/// Needs of one disk are added up. A disk that does not tell what is free holds everything.
/// \param advice  what to do, if not free space: "choose a larger disk by --temp"
/// \throws ResourceError when a disk has less free
void require_disk(std::span<const DiskNeed> needs, const std::string& advice);

/// Advice of jobs whose work directory is too large for its disk.
inline constexpr const char* kLargerDisk = "choose a larger disk by --temp";

/// Bytes of all files below a folder; 0 where there is none.
std::uint64_t bytes_below(const std::filesystem::path& folder);

}  // namespace tessera
