/// \file write_behind.h
/// Keeps a file that is written in order out of the page cache: dirty pages stay below two windows, enough to keep a
/// disk busy, little enough for a small machine.
#pragma once
#include <fcntl.h>

#include <cstdint>

namespace tessera {

class WriteBehind {
 public:
  /// The file now holds `size` bytes.
  void written(int fd, std::uint64_t size) {
    if (size - started_ < kWindowBytes) return;
    // Wait for the window before last, then start the last one: writing and formatting overlap.
    if (started_ > released_) {
      const auto from = static_cast<off_t>(released_);
      const auto bytes = static_cast<off_t>(started_ - released_);
      ::sync_file_range(fd, from, bytes,
                        SYNC_FILE_RANGE_WAIT_BEFORE | SYNC_FILE_RANGE_WRITE | SYNC_FILE_RANGE_WAIT_AFTER);
      ::posix_fadvise(fd, from, bytes, POSIX_FADV_DONTNEED);
      released_ = started_;
    }
    ::sync_file_range(fd, static_cast<off_t>(started_), static_cast<off_t>(size - started_),
                      SYNC_FILE_RANGE_WRITE);
    started_ = size;
  }

 private:
  static constexpr std::uint64_t kWindowBytes = std::uint64_t{32} << 20;
  std::uint64_t started_ = 0;   ///< write-back was asked for up to here
  std::uint64_t released_ = 0;  ///< on disk and out of the page cache up to here
};

}  // namespace tessera
