/// \file read_file.h
/// A file open for positional reads: no mapping, no shared position, safe from several threads. Or what a compressed file
/// unpacks to, as if that were the file: then one thread at a time, and forwards is fast.
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

namespace tessera {

class UnpackedBytes;

class ReadFile {
 public:
  /// \throws InputError naming the file and the system's reason, or when it is no regular file
  explicit ReadFile(const std::filesystem::path& path);
  /// What a gzip or zstd file unpacks to. \param size  of it, if it is known; else it is unpacked once to be measured
  /// \throws InputError as the other, and for a file that is damaged or truncated
  static ReadFile unpacked(const std::filesystem::path& path, std::uint64_t size = kUnknownSize);
  static constexpr std::uint64_t kUnknownSize = ~std::uint64_t{0};
  ~ReadFile();
  ReadFile(ReadFile&& other) noexcept;
  ReadFile& operator=(ReadFile&& other) noexcept;

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t size() const { return size_; }
  /// "gzip" or "zstd" if this is what the file unpacks to, else empty.
  std::string_view packed() const;
  /// Reads exactly `bytes`. \throws InputError naming file and offset when the file is shorter or unreadable
  void read_at(std::uint64_t offset, void* to, std::uint64_t bytes) const;
  /// \throws InputError when the file is not as long, or was written to, since it was opened: what was read may be of
  ///   neither version. For the end of a pass
  void require_unchanged() const;
  /// Nanoseconds since 1970, when it was opened.
  std::int64_t modified() const { return modified_; }
  /// Asks the system to fetch this range in large reads while other work goes on.
  void will_need(std::uint64_t offset, std::uint64_t bytes) const;
  /// Tells the system that this range is not needed again, so that the page cache does not grow.
  void release(std::uint64_t offset, std::uint64_t bytes) const;

 private:
  explicit ReadFile(std::unique_ptr<UnpackedBytes> bytes, std::uint64_t size);

  std::filesystem::path path_;
  int fd_ = -1;
  std::uint64_t size_ = 0;
  std::int64_t modified_ = 0;
  std::unique_ptr<UnpackedBytes> unpacked_;  ///< instead of the descriptor
};

}  // namespace tessera
