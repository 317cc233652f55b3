#include "stream/files/durable_file.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <memory>
#include <system_error>
#include <vector>

#include <fcntl.h>
#include <unistd.h>

#include <fmt/format.h>
#include <xxhash.h>

#include "octree/error.h"

namespace tessera {
namespace {

class Descriptor {
 public:
  Descriptor(const std::filesystem::path& path, int flags, mode_t mode = 0)
      : fd_(::open(path.c_str(), flags | O_CLOEXEC, mode)) {}
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

[[noreturn]] void throw_read_error(const std::filesystem::path& path, int error) {
  throw InputError(fmt::format("{}: cannot be read: {}", path.string(), std::strerror(error)));
}

void sync_path(const std::filesystem::path& path, int flags) {
  const Descriptor file(path, O_RDONLY | flags);
  if (file.get() < 0) throw_write_error(path, errno);
  if (::fsync(file.get()) != 0) throw_write_error(path, errno);
}

}  // namespace

void throw_write_error(const std::filesystem::path& path, int error) {
  if (error == ENOSPC || error == EDQUOT) {
    throw ResourceError(fmt::format(
        "{}: {}: free some space or choose another disk with --temp; the same command then goes on",
        path.string(), std::strerror(error)));
  }
  const std::string sentence = fmt::format("{}: cannot be written: {}", path.string(), std::strerror(error));
  for (const int users : {EACCES, EPERM, EROFS, ENOENT, ENOTDIR, EISDIR}) {
    if (error == users) throw UsageError(sentence);
  }
  throw ResourceError(sentence);
}

std::uint64_t hash_file(const std::filesystem::path& path) {
  const Descriptor file(path, O_RDONLY);
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

void write_durably(const std::filesystem::path& path, const std::string& text) {
  std::filesystem::path aside = path;
  aside += ".part";
  {
    const Descriptor file(aside, O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (file.get() < 0) throw_write_error(aside, errno);
    std::size_t done = 0;
    while (done < text.size()) {
      const ssize_t wrote = ::write(file.get(), text.data() + done, text.size() - done);
      if (wrote < 0) {
        if (errno == EINTR) continue;
        throw_write_error(aside, errno);
      }
      done += static_cast<std::size_t>(wrote);
    }
    if (::fsync(file.get()) != 0) throw_write_error(aside, errno);
  }
  rename_durably(aside, path);
}

std::string read_text(const std::filesystem::path& path) {
  const Descriptor file(path, O_RDONLY);
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
