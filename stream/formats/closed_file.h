/// \file closed_file.h
/// An input file between two reads: its path and size, but no descriptor, so that a job may have thousands of
/// inputs.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "stream/files/read_file.h"

namespace tessera {

class ClosedFile {
 public:
  explicit ClosedFile(const ReadFile& file)
      : path_(file.path()), size_(file.size()), modified_(file.modified()), packed_(file.packed()) {}

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  /// As ReadFile::packed().
  std::string_view packed() const { return packed_; }
  /// The share of the file that a slice should have, where `target_bytes` are asked for: all of what must be unpacked in
  /// order.
  std::uint64_t slice_bytes(std::uint64_t target_bytes) const {
    return packed_.empty() ? target_bytes : ~std::uint64_t{0};
  }
  /// For the name of a format: ", unpacked from gzip", or nothing.
  std::string packed_words() const {
    return packed_.empty() ? "" : ", unpacked from " + std::string(packed_);
  }
  /// \throws InputError naming the file when it is gone, or not as long as it was, or written to since
  ReadFile open() const;

 private:
  std::filesystem::path path_;
  std::uint64_t size_;
  std::int64_t modified_;
  std::string_view packed_;
};

}  // namespace tessera
