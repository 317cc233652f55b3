/// \file spill_file.h
/// Scratch space on disk for work that exceeds its share of memory. The file has no name: whatever happens to
/// the process, nothing stays behind.
#pragma once
#include <cstdint>
#include <filesystem>

#include "stream/files/write_behind.h"

namespace tessera {

class SpillFile {
 public:
  /// Opens on first use, so that work which fits in memory touches no disk. An empty `folder` means the
  /// system's temporary folder.
  explicit SpillFile(std::filesystem::path folder) : folder_(std::move(folder)) {}
  ~SpillFile();
  SpillFile(const SpillFile&) = delete;
  SpillFile& operator=(const SpillFile&) = delete;

  /// Writes at the end, returns the offset. \throws ResourceError when the disk is full or the folder unusable
  std::uint64_t append(const void* data, std::uint64_t bytes);
  /// \throws ResourceError when the disk fails
  void read_at(std::uint64_t offset, void* to, std::uint64_t bytes) const;
  std::uint64_t size() const { return size_; }

 private:
  void open();

  std::filesystem::path folder_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
  WriteBehind behind_;
};

}  // namespace tessera
