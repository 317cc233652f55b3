#include "stream/files/durable_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>
#include <xxhash.h>

#include "octree/error.h"
#include "stream/files/file_lock.h"
#include "stream/files/planned_writes.h"
#include "stream/files/system_reason.h"

namespace tessera {
namespace {

constexpr int kAsideTries = 100;

class Descriptor {
 public:
  Descriptor(const std::filesystem::path& path, int flags, mode_t mode = 0)
      : fd_(::open(path.c_str(), flags | O_CLOEXEC, mode)) {}
  explicit Descriptor(int fd) : fd_(fd) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

/// Opened without waiting for whoever writes to a pipe. \throws InputError when it cannot be read as a file
int open_regular(const std::filesystem::path& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  struct stat info = {};
  if (fd < 0 || (::fstat(fd, &info) == 0 && S_ISREG(info.st_mode))) return fd;
  ::close(fd);
  throw InputError(path.string() + ": is no regular file; name a file here");
}

[[noreturn]] void throw_read_error(const std::filesystem::path& path, int error) {
  const std::string sentence = fmt::format("{}: cannot be read: {}", path.string(), os_reason(error));
  if (is_limit(error)) throw ResourceError(sentence);
  throw InputError(sentence);
}

void sync_path(const std::filesystem::path& path, int flags) {
  const Descriptor file(path, O_RDONLY | flags);
  if (file.get() < 0) throw_write_error(path, errno);
  if (::fsync(file.get()) != 0) throw_write_error(path, errno);
}

}  // namespace

int write_all_at(int fd, const void* data, std::uint64_t bytes, std::uint64_t offset) {
  const auto* from = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t put = ::pwrite(fd, from, bytes, static_cast<off_t>(offset));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) return put == 0 ? ENOSPC : errno;
    from += put;
    offset += static_cast<std::uint64_t>(put);
    bytes -= static_cast<std::uint64_t>(put);
  }
  return 0;
}

void throw_write_error(const std::filesystem::path& path, int error) {
  if (error == ENOSPC || error == EDQUOT) {
    throw ResourceError(fmt::format(
        "{}: {}: free some space or choose another disk with --temp; the same command then goes on",
        path.string(), std::strerror(error)));
  }
  const std::string sentence = fmt::format("{}: cannot be written: {}", path.string(), os_reason(error));
  for (const int users : {EACCES, EPERM, EROFS, ENOENT, ENOTDIR, EISDIR, ELOOP, ENAMETOOLONG}) {
    if (error == users) throw UsageError(sentence);
  }
  throw ResourceError(sentence);
}

std::uint64_t hash_file(const std::filesystem::path& path) {
  const Descriptor file(open_regular(path));
  if (file.get() < 0) throw_read_error(path, errno);
  const std::unique_ptr<XXH3_state_t, decltype(&XXH3_freeState)> state(XXH3_createState(), &XXH3_freeState);
  if (state == nullptr || XXH3_64bits_reset(state.get()) == XXH_ERROR) throw std::bad_alloc();
  std::vector<char> buffer(std::size_t{1} << 18);
  for (;;) {
    const ssize_t got = ::read(file.get(), buffer.data(), buffer.size());
    if (got == 0) break;
    if (got < 0) {
      if (errno == EINTR) continue;
      throw_read_error(path, errno);
    }
    XXH3_64bits_update(state.get(), buffer.data(), static_cast<std::size_t>(got));
  }
  return XXH3_64bits_digest(state.get());
}

std::string hex64(std::uint64_t value) {
  return fmt::format("{:016x}", value);
}

std::uint64_t hash_bytes(const void* data, std::size_t bytes) {
  return XXH3_64bits(data, bytes);
}

std::uint64_t hash_text(const std::string& text) {
  return hash_bytes(text.data(), text.size());
}

void sync_file(const std::filesystem::path& path) {
  sync_path(path, 0);
}

void sync_folder(const std::filesystem::path& path) {
  sync_path(path.empty() ? std::filesystem::path(".") : path, O_DIRECTORY);
}

void rename_durably(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) throw_write_error(to, errno);
  sync_folder(to.parent_path());
}

bool names_file(const std::filesystem::path& path, int fd) {
  struct stat opened = {}, there = {};
  return ::fstat(fd, &opened) == 0 && ::lstat(path.c_str(), &there) == 0 && opened.st_ino == there.st_ino &&
         opened.st_dev == there.st_dev;
}

int create_aside(const std::filesystem::path& path) {
  const std::filesystem::path aside = output_aside(path);
  for (int attempt = 0; attempt < kAsideTries; ++attempt) {
    const int fd = ::open(aside.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
    if (fd >= 0) {
      // Between creation and lock another process may have taken it for a leftover.
      if (try_file_lock(fd, LOCK_EX) == 0 && names_file(aside, fd)) return fd;
      ::close(fd);
      continue;
    }
    if (errno != EEXIST) throw_write_error(aside, errno);
    const Descriptor old(aside, O_RDONLY | O_NOFOLLOW | O_NONBLOCK);
    if (old.get() < 0 && errno == ENOENT) continue;
    if (old.get() < 0)
      throw UsageError(fmt::format("{}: is in the way of what {} is to be written to first: remove it",
                                   aside.string(), path.string()));
    if (try_file_lock(old.get(), LOCK_EX) != 0) break;
    // Nobody holds it: a killed run left it. The name goes, not the content, which a hard link may share.
    if (names_file(aside, old.get()) && ::unlink(aside.c_str()) != 0) throw_write_error(aside, errno);
  }
  throw UsageError(fmt::format(
      "{}: another process is writing this file: wait for it or choose another output", path.string()));
}

void write_text(const std::filesystem::path& path, const std::string& text) {
  const Descriptor file(path, O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW, 0644);
  if (file.get() < 0) throw_write_error(path, errno);
  if (const int error = write_all_at(file.get(), text.data(), text.size(), 0); error != 0)
    throw_write_error(path, error);
}

void write_durably(const std::filesystem::path& path, const std::string& text) {
  const std::filesystem::path aside = output_aside(path);
  {
    const Descriptor file(create_aside(path));
    if (const int error = write_all_at(file.get(), text.data(), text.size(), 0); error != 0)
      throw_write_error(aside, error);
    if (::fsync(file.get()) != 0) throw_write_error(aside, errno);
  }
  rename_durably(aside, path);
}

std::string read_text(const std::filesystem::path& path) {
  const Descriptor file(open_regular(path));
  if (file.get() < 0) throw_read_error(path, errno);
  std::string text;
  std::vector<char> buffer(std::size_t{1} << 16);
  for (;;) {
    const ssize_t got = ::read(file.get(), buffer.data(), buffer.size());
    if (got == 0) return text;
    if (got < 0) {
      if (errno == EINTR) continue;
      throw_read_error(path, errno);
    }
    text.append(buffer.data(), static_cast<std::size_t>(got));
  }
}

}  // namespace tessera
