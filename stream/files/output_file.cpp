#include "stream/files/output_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cstring>
#include <stdexcept>
#include <string>
#include <utility>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/fault.h"
#include "stream/files/planned_writes.h"
#include "stream/files/system_reason.h"
#include "stream/files/written_hash.h"

namespace tessera {
namespace {

[[noreturn]] void fail(const std::filesystem::path& path, const char* what, int error) {
  std::string advice;
  if (error == ENOSPC || error == EDQUOT) advice = "; free space and run the same command again";
  throw ResourceError(path.string() + ": cannot " + what + ": " + os_reason(error) + advice);
}

}  // namespace

OutputFile::OutputFile(const std::filesystem::path& path)
    : path_(path), part_(output_aside(path)), fd_(create_aside(path)) {
  buffer_ = std::make_unique_for_overwrite<char[]>(kBufferBytes);
  begin_written_hash(fd_);
}

OutputFile::~OutputFile() {
  if (fd_ < 0) return;
  drop_written_hash(fd_);
  if (names_file(part_, fd_)) ::unlink(part_.c_str());  // before the lock goes with the descriptor
  ::close(fd_);
}

char* OutputFile::reserve(std::size_t bytes) {
  assert(bytes <= kBufferBytes);
  if (kBufferBytes - used_ < bytes) flush();
  return buffer_.get() + used_;
}

void OutputFile::append(const void* data, std::size_t bytes) {
  const auto* from = static_cast<const char*>(data);
  while (bytes > 0) {
    if (used_ == kBufferBytes) flush();
    const std::size_t part = std::min(bytes, kBufferBytes - used_);
    std::memcpy(buffer_.get() + used_, from, part);
    used_ += part;
    from += part;
    bytes -= part;
  }
}

void OutputFile::patch(std::uint64_t offset, const void* data, std::size_t bytes) {
  assert(offset + bytes <= size());
  flush();
  drop_written_hash(fd_);
  write_out(offset, static_cast<const char*>(data), bytes);
}

void OutputFile::write_out(std::uint64_t offset, const char* data, std::size_t bytes) {
  fault_point(FaultPoint::kWrite);
  if (const int error = write_all_at(fd_, data, bytes, offset)) fail(part_, "be written", error);
}

void OutputFile::flush() {
  const std::size_t bytes = std::exchange(used_, 0);
  append_direct(buffer_.get(), bytes);
  digest(buffer_.get(), bytes);
}

void OutputFile::append_direct(const void* data, std::size_t bytes) {
  if (used_ > 0) flush();
  write_out(flushed_, static_cast<const char*>(data), bytes);
  flushed_ += bytes;
}

void OutputFile::digest(const void* data, std::size_t bytes) {
  add_to_written_hash(fd_, data, bytes);
  digested_ += bytes;
  behind_.written(fd_, digested_);
}

void OutputFile::finish() {
  flush();
  if (digested_ != flushed_) throw std::logic_error(path_.string() + ": not all that was written was hashed");
  if (::fsync(fd_) != 0) fail(part_, "be synced", errno);
  keep_written_hash(fd_);
  ::posix_fadvise(fd_, 0, 0, POSIX_FADV_DONTNEED);
  if (!names_file(part_, fd_))
    throw ResourceError(part_.string() + ": another process has begun this output anew, which goes on there");
  if (::rename(part_.c_str(), path_.c_str()) != 0) fail(path_, "take its final name", errno);
  ::close(fd_);
  fd_ = -1;
  const std::filesystem::path folder = path_.has_parent_path() ? path_.parent_path() : ".";
  const int folder_fd = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (folder_fd < 0)
    return;  // a folder that can be written but not read: the rename stands, only its sync is lost
  ::fsync(folder_fd);
  ::close(folder_fd);
}

}  // namespace tessera
