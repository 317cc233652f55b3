/// \file direct_file.h
/// A file written once from start to end, past the page cache: on large files three times the rate of
/// buffered writes with a sync, and no dirty pages that count against the cap. Falls back to buffered writes
/// where the file system refuses direct ones (tmpfs, some network mounts).
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>

namespace tessera {

class DirectFile {
 public:
  static constexpr std::size_t kDefaultBuffer = std::size_t{4} << 20;

  /// Creates or truncates the file. `buffer_bytes` is rounded up to whole pages; it is all the memory used.
  /// \throws ResourceError naming the file and the system's reason
  explicit DirectFile(const std::filesystem::path& path, std::size_t buffer_bytes = kDefaultBuffer);
  /// Closes; a file that was not finished is incomplete (its task has failed, nobody gives it a name).
  ~DirectFile();
  DirectFile(const DirectFile&) = delete;
  DirectFile& operator=(const DirectFile&) = delete;

  /// Appends. \throws ResourceError when the disk is full or the write fails
  void write(const void* data, std::size_t bytes);
  /// Bytes appended so far: the offset of the next one.
  std::uint64_t offset() const { return offset_; }
  /// Writes the rest, cuts the file to its true size, closes. No sync, no rename. Returns the size.
  std::uint64_t finish();

 private:
  void flush(std::size_t bytes);

  struct Free {
    void operator()(std::byte* p) const;
  };
  std::filesystem::path path_;
  std::unique_ptr<std::byte, Free> buffer_;
  std::size_t capacity_ = 0;
  std::size_t filled_ = 0;
  std::uint64_t offset_ = 0;   ///< appended
  std::uint64_t written_ = 0;  ///< handed to the system
  int fd_ = -1;
  bool direct_ = false;
};

}  // namespace tessera
