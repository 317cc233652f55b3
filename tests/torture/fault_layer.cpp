// A disk and a clock that fail, preloaded below a command (LD_PRELOAD). TESSERA_FAULT says how, and which call is hit:
//   full:N        the N-th write of a regular file and all after it find no room (ENOSPC)
//   write-error:N, read-error:N, sync-error:N   the N-th such call fails once with EIO
//   short:SEED    reads and writes do a part of what they are asked for, and every eighth is interrupted (EINTR)
//   clock:SEED    the wall clock jumps by up to a year at every look
// TESSERA_SYNCED names a file that gets a line of every file that was brought to the disk, as it was then (helpers/power_cut.h).
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>

namespace {

enum class Kind { kNone, kFull, kWriteError, kReadError, kSyncError, kShort, kClock };

struct Fault {
  Kind kind = Kind::kNone;
  std::uint64_t number = 0;
};

const Fault& fault() {
  static const Fault f = [] {
    Fault out;
    const char* text = std::getenv("TESSERA_FAULT");
    if (text == nullptr) return out;
    const char* colon = std::strchr(text, ':');
    if (colon == nullptr) return out;
    const auto length = static_cast<std::size_t>(colon - text);
    const auto is = [&](const char* word) {
      return std::strlen(word) == length && std::strncmp(text, word, length) == 0;
    };
    out.kind = is("full")          ? Kind::kFull
               : is("write-error") ? Kind::kWriteError
               : is("read-error")  ? Kind::kReadError
               : is("sync-error")  ? Kind::kSyncError
               : is("short")       ? Kind::kShort
               : is("clock")       ? Kind::kClock
                                   : Kind::kNone;
    out.number = std::strtoull(colon + 1, nullptr, 10);
    return out;
  }();
  return f;
}

std::atomic<std::uint64_t> reads{0}, writes{0}, syncs{0}, looks{0};

bool is_file(int fd) {
  struct stat s {};
  return ::fstat(fd, &s) == 0 && S_ISREG(s.st_mode);
}

std::uint64_t mixed(std::uint64_t x) {
  x += fault().number * 0x9e3779b97f4a7c15u;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

/// The function that this layer stands before.
template <class Function>
Function next(Function, const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}

/// Whether this write fails; sets errno.
bool write_fails(int fd) {
  const Kind kind = fault().kind;
  if ((kind != Kind::kFull && kind != Kind::kWriteError) || !is_file(fd)) return false;
  const std::uint64_t n = ++writes;
  if (kind == Kind::kFull ? n < fault().number : n != fault().number) return false;
  errno = kind == Kind::kFull ? ENOSPC : EIO;
  return true;
}
bool read_fails(int fd) {
  if (fault().kind != Kind::kReadError || !is_file(fd) || ++reads != fault().number) return false;
  errno = EIO;
  return true;
}
bool sync_fails() {
  if (fault().kind != Kind::kSyncError || ++syncs != fault().number) return false;
  errno = EIO;
  return true;
}
/// Syncs by `real` and notes it, in one call below the functions of this layer, which count and fail.
int noted_sync(int (*real)(int), int fd) {
  static const char* const path = std::getenv("TESSERA_SYNCED");
  // As long as it was before is what is safe then: another thread may append meanwhile.
  struct statx s {};
  const bool known =
      path != nullptr && ::statx(fd, "", AT_EMPTY_PATH, STATX_INO | STATX_SIZE | STATX_BTIME, &s) == 0;
  if (real(fd) != 0) return -1;
  if (!known) return 0;
  static const int log = ::open(path, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
  char line[96];
  const int length =
      std::snprintf(line, sizeof line, "%llu %lld %u %llu\n", static_cast<unsigned long long>(s.stx_ino),
                    static_cast<long long>(s.stx_btime.tv_sec), s.stx_btime.tv_nsec,
                    static_cast<unsigned long long>(s.stx_size));
  ::syscall(SYS_write, log, line, static_cast<std::size_t>(length));
  return 0;
}
/// How much of `count` bytes is done; -1: interrupted.
ssize_t part_of(int fd, std::size_t count, std::atomic<std::uint64_t>& calls) {
  if (fault().kind != Kind::kShort || count == 0 || !is_file(fd)) return static_cast<ssize_t>(count);
  const std::uint64_t m = mixed(++calls);
  if (m % 8 == 0) {
    errno = EINTR;
    return -1;
  }
  return static_cast<ssize_t>(m % 3 == 0 ? 1 + (m >> 8) % count : count);
}

}  // namespace

extern "C" {

ssize_t write(int fd, const void* data, std::size_t count) {
  static const auto real = next(&::write, "write");
  if (write_fails(fd)) return -1;
  const ssize_t part = part_of(fd, count, writes);
  return part < 0 ? -1 : real(fd, data, static_cast<std::size_t>(part));
}
ssize_t pwrite(int fd, const void* data, std::size_t count, off_t at) {
  static const auto real = next(&::pwrite, "pwrite");
  if (write_fails(fd)) return -1;
  const ssize_t part = part_of(fd, count, writes);
  return part < 0 ? -1 : real(fd, data, static_cast<std::size_t>(part), at);
}
ssize_t pwrite64(int fd, const void* data, std::size_t count, off_t at) {
  return ::pwrite(fd, data, count, at);
}
int ftruncate(int fd, off_t size) noexcept {
  static const auto real = next(&::ftruncate, "ftruncate");
  return write_fails(fd) ? -1 : real(fd, size);
}
ssize_t read(int fd, void* data, std::size_t count) {
  static const auto real = next(&::read, "read");
  if (read_fails(fd)) return -1;
  const ssize_t part = part_of(fd, count, reads);
  return part < 0 ? -1 : real(fd, data, static_cast<std::size_t>(part));
}
ssize_t pread(int fd, void* data, std::size_t count, off_t at) {
  static const auto real = next(&::pread, "pread");
  if (read_fails(fd)) return -1;
  const ssize_t part = part_of(fd, count, reads);
  return part < 0 ? -1 : real(fd, data, static_cast<std::size_t>(part), at);
}
ssize_t pread64(int fd, void* data, std::size_t count, off_t at) {
  return ::pread(fd, data, count, at);
}
int fsync(int fd) {
  static const auto real = next(&::fsync, "fsync");
  return sync_fails() ? -1 : noted_sync(real, fd);
}
int fdatasync(int fd) {
  static const auto real = next(&::fdatasync, "fdatasync");
  return sync_fails() ? -1 : noted_sync(real, fd);
}
int clock_gettime(clockid_t clock, struct timespec* time) noexcept {
  static const auto real = next(&::clock_gettime, "clock_gettime");
  const int result = real(clock, time);
  constexpr std::uint64_t kYear = 31'536'000;
  if (result == 0 && clock == CLOCK_REALTIME && fault().kind == Kind::kClock)
    time->tv_sec += static_cast<time_t>(mixed(++looks) % (2 * kYear)) - static_cast<time_t>(kYear);
  return result;
}

}  // extern "C"
