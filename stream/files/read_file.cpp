#include "stream/files/read_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "octree/error.h"
#include "stream/files/file_time.h"
#include "stream/files/system_reason.h"
#include "stream/files/unpacked_bytes.h"

namespace tessera {

ReadFile::ReadFile(const std::filesystem::path& path) : path_(path) {
  // Without O_NONBLOCK a pipe would wait for somebody who writes to it.
  fd_ = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  struct stat info {};
  if (fd_ >= 0 && ::fstat(fd_, &info) == 0 && !S_ISREG(info.st_mode)) {
    ::close(fd_);
    throw InputError(path.string() +
                     (S_ISDIR(info.st_mode)
                          ? ": is a folder; a file is needed here"
                          : ": is a pipe or device; what is read here is read more than once: write it to a "
                            "file first"));
  }
  if (fd_ < 0 || ::fstat(fd_, &info) != 0) {
    const int error = errno;
    if (fd_ >= 0) ::close(fd_);
    const std::string sentence = path.string() + ": cannot be opened: " + os_reason(error);
    if (is_limit(error)) throw ResourceError(sentence);
    throw InputError(sentence);
  }
  size_ = static_cast<std::uint64_t>(info.st_size);
  modified_ = modification_ns(info);
}

ReadFile::ReadFile(std::unique_ptr<UnpackedBytes> bytes, std::uint64_t size)
    : path_(bytes->file().path()),
      size_(size == kUnknownSize ? bytes->size() : size),
      modified_(bytes->file().modified()),
      unpacked_(std::move(bytes)) {}

ReadFile ReadFile::unpacked(const std::filesystem::path& path, std::uint64_t size) {
  return ReadFile(std::make_unique<UnpackedBytes>(path), size);
}

std::string_view ReadFile::packed() const {
  return unpacked_ ? unpacked_->format() : std::string_view();
}

ReadFile::~ReadFile() {
  if (fd_ >= 0) ::close(fd_);
}

ReadFile::ReadFile(ReadFile&& other) noexcept
    : path_(std::move(other.path_)),
      fd_(std::exchange(other.fd_, -1)),
      size_(other.size_),
      modified_(other.modified_),
      unpacked_(std::move(other.unpacked_)) {}

ReadFile& ReadFile::operator=(ReadFile&& other) noexcept {
  std::swap(path_, other.path_);
  std::swap(fd_, other.fd_);
  std::swap(size_, other.size_);
  std::swap(modified_, other.modified_);
  std::swap(unpacked_, other.unpacked_);
  return *this;
}

void ReadFile::read_at(std::uint64_t offset, void* to, std::uint64_t bytes) const {
  auto* out = static_cast<char*>(to);
  std::uint64_t done = unpacked_ ? unpacked_->read_at(offset, out, bytes) : 0;
  if (unpacked_ && done < bytes) {
    throw InputError(path_.string() + ": byte " + std::to_string(offset + done) +
                     " of what it unpacks to: cannot read " + std::to_string(bytes - done) +
                     " bytes: it ends here");
  }
  while (done < bytes) {
    const ssize_t got = ::pread(fd_, out + done, bytes - done, static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      const std::string reason = got == 0 ? "the file ends here" : std::strerror(errno);
      throw InputError(path_.string() + ": byte " + std::to_string(offset + done) + ": cannot read " +
                       std::to_string(bytes - done) + " bytes: " + reason);
    }
    done += static_cast<std::uint64_t>(got);
  }
}

void ReadFile::require_unchanged() const {
  if (unpacked_) return unpacked_->file().require_unchanged();
  struct stat info {};
  if (::fstat(fd_, &info) == 0 && static_cast<std::uint64_t>(info.st_size) == size_ &&
      modification_ns(info) == modified_)
    return;
  throw InputError(path_.string() + ": has changed since it was opened, when it had " +
                   std::to_string(size_) +
                   " bytes; inputs must not change while they are read: run the command again");
}

void ReadFile::will_need(std::uint64_t offset, std::uint64_t bytes) const {
  if (unpacked_) return;
  ::posix_fadvise(fd_, static_cast<off_t>(offset), static_cast<off_t>(bytes), POSIX_FADV_WILLNEED);
}

void ReadFile::release(std::uint64_t offset, std::uint64_t bytes) const {
  if (unpacked_) return;
  ::posix_fadvise(fd_, static_cast<off_t>(offset), static_cast<off_t>(bytes), POSIX_FADV_DONTNEED);
}

}  // namespace tessera
