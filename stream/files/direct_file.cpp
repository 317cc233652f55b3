#include "stream/files/direct_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string>

#include "octree/error.h"
#include "stream/files/fault.h"
#include "stream/files/system_reason.h"
#include "stream/files/written_hash.h"

namespace tessera {
namespace {

// Every file system in use takes 4096; smaller logical blocks divide it.
constexpr std::size_t kPage = 4096;

ResourceError failure(const std::filesystem::path& path, std::uint64_t offset) {
  const std::string reason =
      errno == ENOSPC ? "the disk is full; free space and run the same command again" : os_reason(errno);
  return ResourceError(path.string() + ": byte " + std::to_string(offset) + ": cannot be written: " + reason);
}

}  // namespace

void DirectFile::Free::operator()(std::byte* p) const {
  std::free(p);
}

DirectFile::DirectFile(const std::filesystem::path& path, std::size_t buffer_bytes)
    : path_(path), capacity_(std::max(kPage, (buffer_bytes + kPage - 1) / kPage * kPage)) {
  buffer_.reset(static_cast<std::byte*>(std::aligned_alloc(kPage, capacity_)));
  if (!buffer_) throw std::bad_alloc();
  constexpr int kFlags = O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC;
  fd_ = ::open(path.c_str(), kFlags | O_DIRECT, 0644);
  direct_ = fd_ >= 0;
  if (!direct_ && errno == EINVAL) fd_ = ::open(path.c_str(), kFlags, 0644);
  if (fd_ < 0) throw failure(path_, 0);
  begin_written_hash(fd_);
}

DirectFile::~DirectFile() {
  if (fd_ < 0) return;
  drop_written_hash(fd_);
  ::close(fd_);
}

void DirectFile::flush(std::size_t bytes) {
  fault_point(FaultPoint::kWrite);
  std::size_t done = 0;
  while (done < bytes) {
    const ssize_t put =
        ::pwrite(fd_, buffer_.get() + done, bytes - done, static_cast<off_t>(written_ + done));
    if (put < 0 && errno == EINTR) continue;
    if (put < 0 && errno == EINVAL && direct_) {  // accepted at open, refused at write
      ::fcntl(fd_, F_SETFL, ::fcntl(fd_, F_GETFL) & ~O_DIRECT);
      direct_ = false;
      continue;
    }
    if (put <= 0) throw failure(path_, written_ + done);
    done += static_cast<std::size_t>(put);
    if (direct_ && done < bytes) done -= done % kPage;  // a short direct write goes on at a whole page
  }
  written_ += bytes;
  filled_ = 0;
}

void DirectFile::write(const void* data, std::size_t bytes) {
  const auto* from = static_cast<const std::byte*>(data);
  offset_ += bytes;
  while (bytes > 0) {
    const std::size_t part = std::min(bytes, capacity_ - filled_);
    std::memcpy(buffer_.get() + filled_, from, part);
    filled_ += part;
    from += part;
    bytes -= part;
    if (filled_ < capacity_) continue;
    add_to_written_hash(fd_, buffer_.get(), capacity_);
    flush(capacity_);
  }
}

std::uint64_t DirectFile::finish() {
  if (filled_ > 0) {
    add_to_written_hash(fd_, buffer_.get(), filled_);
    const std::size_t whole = (filled_ + kPage - 1) / kPage * kPage;
    std::memset(buffer_.get() + filled_, 0, whole - filled_);
    flush(whole);
  }
  if (::ftruncate(fd_, static_cast<off_t>(offset_)) != 0) throw failure(path_, offset_);
  keep_written_hash(fd_);
  const int fd = fd_;
  fd_ = -1;
  if (::close(fd) != 0) throw failure(path_, offset_);
  return offset_;
}

}  // namespace tessera
