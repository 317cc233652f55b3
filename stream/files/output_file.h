/// \file output_file.h
/// One file written once, in order, through a fixed buffer. It is called output_aside(path) until finish()
/// has synced it, so that no file bears its final name before it is complete. Written data leaves the page cache
/// as it goes.
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include "stream/files/write_behind.h"

namespace tessera {

class OutputFile {
 public:
  /// Creates the file aside, replacing a leftover. Allocates the buffer (kBufferBytes) and nothing else later.
  /// \throws UsageError when it cannot be created (folder missing, not writable), or another process writes this output
  explicit OutputFile(const std::filesystem::path& path);
  /// Removes the part file unless finish() succeeded.
  ~OutputFile();
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;

  static constexpr std::size_t kBufferBytes = std::size_t{8} << 20;

  /// Room for `bytes` at the end of the file, to be formatted in place and then commit()ted (as many or
  /// fewer). \pre bytes <= kBufferBytes
  char* reserve(std::size_t bytes);
  void commit(std::size_t bytes) { used_ += bytes; }
  void append(const void* data, std::size_t bytes);
  void append(std::string_view text) { append(text.data(), text.size()); }
  /// As append(), past the buffer. Who calls it hands the same bytes in the same order to digest(), all of them before anything
  /// else is called.
  void append_direct(const void* data, std::size_t bytes);
  /// Hashes what append_direct() wrote and has it brought to the disk; from one thread at a time, beside later append_direct().
  void digest(const void* data, std::size_t bytes);
  /// Overwrites bytes that were appended before. \pre offset + bytes <= size()
  void patch(std::uint64_t offset, const void* data, std::size_t bytes);
  std::uint64_t size() const { return flushed_ + used_; }
  const std::filesystem::path& path() const { return path_; }

  /// Flushes, syncs, renames to the final name, syncs the folder.
  /// \throws ResourceError when the disk is full or fails (as append, reserve and patch do)
  void finish();

 private:
  void flush();
  void write_out(std::uint64_t offset, const char* data, std::size_t bytes);

  std::filesystem::path path_, part_;
  int fd_ = -1;
  std::unique_ptr<char[]> buffer_;
  std::size_t used_ = 0;
  std::uint64_t flushed_ = 0;
  std::uint64_t digested_ = 0;  ///< hashed, of `flushed_`
  WriteBehind behind_;
};

}  // namespace tessera
