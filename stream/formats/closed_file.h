/// \file closed_file.h
/// An input file between two reads: its path and size, but no descriptor, so that a job may have thousands of
/// inputs.
#pragma once
#include <cstdint>
#include <filesystem>

#include "stream/files/read_file.h"

namespace tessera {

class ClosedFile {
 public:
  explicit ClosedFile(const ReadFile& file)
      : path_(file.path()), size_(file.size()), modified_(file.modified()) {}

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  /// \throws InputError naming the file when it is gone, or not as long as it was, or written to since
  ReadFile open() const;

 private:
  std::filesystem::path path_;
  std::uint64_t size_;
  std::int64_t modified_;
};

}  // namespace tessera
