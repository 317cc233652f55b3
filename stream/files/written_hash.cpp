#include "stream/files/written_hash.h"

#include <sys/stat.h>

#include <compare>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include "stream/files/durable_file.h"
#include "stream/files/file_time.h"

namespace tessera {
namespace {

/// A file as it was when it was whole.
struct WrittenFile {
  std::uint64_t device = 0, inode = 0, bytes = 0;
  std::int64_t modified = 0;
  auto operator<=>(const WrittenFile&) const = default;
};

WrittenFile written_file(const struct stat& info) {
  return {info.st_dev, info.st_ino, static_cast<std::uint64_t>(info.st_size), modification_ns(info)};
}

class WrittenHashes {
 public:
  void begin(int fd) {
    auto state = std::make_shared<XXH3_state_t>();
    XXH3_64bits_reset(state.get());
    const std::lock_guard lock(mutex_);
    open_[fd] = std::move(state);
  }
  std::shared_ptr<XXH3_state_t> find_open(int fd) {
    const std::lock_guard lock(mutex_);
    const auto found = open_.find(fd);
    return found == open_.end() ? nullptr : found->second;
  }
  void drop(int fd) {
    const std::lock_guard lock(mutex_);
    open_.erase(fd);
  }
  /// Emptied when it gets long: what it does not know is read.
  void keep(const WrittenFile& file, std::uint64_t hash) {
    const std::lock_guard lock(mutex_);
    if (whole_.size() >= kMax) whole_.clear();
    whole_[file] = hash;
  }
  std::optional<std::uint64_t> find_whole(const WrittenFile& file) {
    const std::lock_guard lock(mutex_);
    const auto found = whole_.find(file);
    return found == whole_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  static constexpr std::size_t kMax = 4096;
  std::mutex mutex_;
  std::map<int, std::shared_ptr<XXH3_state_t>> open_;  ///< by descriptor
  std::map<WrittenFile, std::uint64_t> whole_;
};

WrittenHashes& written_hashes() {
  static WrittenHashes hashes;
  return hashes;
}

}  // namespace

void begin_written_hash(int fd) {
  written_hashes().begin(fd);
}

void add_to_written_hash(int fd, const void* data, std::size_t bytes) {
  if (const auto state = written_hashes().find_open(fd)) XXH3_64bits_update(state.get(), data, bytes);
}

void drop_written_hash(int fd) {
  written_hashes().drop(fd);
}

void keep_written_hash(int fd) {
  const auto state = written_hashes().find_open(fd);
  if (!state) return;
  written_hashes().drop(fd);
  struct stat info {};
  if (::fstat(fd, &info) == 0) written_hashes().keep(written_file(info), XXH3_64bits_digest(state.get()));
}

std::uint64_t hash_written_file(const std::filesystem::path& path) {
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0)
    if (const auto hash = written_hashes().find_whole(written_file(info))) return *hash;
  return hash_file(path);
}

}  // namespace tessera
