/// \file file_time.h
/// When a file was last written to.
#pragma once
#include <sys/stat.h>

#include <cstdint>

namespace tessera {

/// Nanoseconds since 1970.
inline std::int64_t modification_ns(const struct stat& status) {
  return static_cast<std::int64_t>(status.st_mtim.tv_sec) * 1000000000 + status.st_mtim.tv_nsec;
}

}  // namespace tessera
