#include "stream/runtime/memory_budget.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <mutex>
#include <span>
#include <string_view>
#include <utility>

#include <dlfcn.h>
#include <fcntl.h>
#include <malloc.h>
#include <sys/resource.h>
#include <unistd.h>

#include <fmt/format.h>

#include "octree/error.h"

namespace tessera {

std::uint64_t parse_bytes(const std::string& text) {
  const auto refuse = [&]() -> std::uint64_t {
    throw UsageError(
        fmt::format("'{}' is not a size: write a number and K, M, G or T, like 512M or 2GiB", text));
  };
  if (text.empty() || !std::isdigit(static_cast<unsigned char>(text[0]))) return refuse();
  double number = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return refuse();
  std::string unit(end, text.data() + text.size());
  while (!unit.empty() && unit.front() == ' ') unit.erase(unit.begin());
  for (char& c : unit) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  constexpr std::array<std::string_view, 5> kUnits = {"b", "k", "m", "g", "t"};
  double scale = unit.empty() ? 1.0 : 0.0;
  double factor = 1.0;
  for (const std::string_view prefix : kUnits) {
    const std::string p(prefix);
    if (unit == p || (p != "b" && (unit == p + "b" || unit == p + "ib"))) scale = factor;
    factor *= 1024.0;
  }
  // 2^53 bytes: beyond it a double no longer counts single bytes, and no machine has them.
  if (scale == 0.0 || !std::isfinite(number) || number * scale > 9007199254740992.0) return refuse();
  return static_cast<std::uint64_t>(number * scale);
}

std::string format_bytes(std::uint64_t bytes) {
  if (bytes < 1024) return fmt::format("{} B", bytes);
  double value = static_cast<double>(bytes);
  std::size_t unit = 0;
  constexpr std::array<const char*, 6> kNames = {"B", "KiB", "MiB", "GiB", "TiB", "PiB"};
  while (value >= 1024.0 && unit + 1 < kNames.size()) {
    value /= 1024.0;
    ++unit;
  }
  return fmt::format("{:.{}f} {}", value, value < 10 ? 2 : value < 100 ? 1 : 0, kNames[unit]);
}

namespace {

constexpr std::uint64_t kUnlimited = ~std::uint64_t{0};

/// Tells a layer that a test has put below this process: it counts what is allocated beside reservations.
void note_reserved(std::uint64_t bytes) {
  using Note = void (*)(std::uint64_t);
  static const auto note = reinterpret_cast<Note>(::dlsym(RTLD_DEFAULT, "tessera_note_reserved"));
  if (note != nullptr) note(bytes);
}
constexpr double kShareOfLimit = 0.8;
constexpr std::uint64_t kMiB = std::uint64_t{1} << 20;

/// The first number of a small file, in bytes; kUnlimited for "max" or no such file.
std::uint64_t number_in(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string word;
  if (!(file >> word) || word.empty() || !std::isdigit(static_cast<unsigned char>(word[0])))
    return kUnlimited;
  return std::strtoull(word.c_str(), nullptr, 10);
}

/// The start of a /proc file, in `buffer`, with a 0 behind it; empty where it cannot be read. Stages ask several times each: no
/// stream.
std::string_view read_start(const std::filesystem::path& path, std::span<char> buffer) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return {};
  const ssize_t got = ::read(fd, buffer.data(), buffer.size() - 1);
  ::close(fd);
  if (got <= 0) return {};
  buffer[static_cast<std::size_t>(got)] = '\0';
  return {buffer.data(), static_cast<std::size_t>(got)};
}

/// A line "Name:   123 kB" near the start of a /proc file.
std::uint64_t kib_line(const std::filesystem::path& path, const std::string& name) {
  std::array<char, 8192> buffer;
  const std::string_view text = read_start(path, buffer);
  for (std::size_t line = 0; line < text.size();) {
    if (text.substr(line).starts_with(name) && text.substr(line + name.size()).starts_with(":"))
      return std::strtoull(text.data() + line + name.size() + 1, nullptr, 10) * 1024;
    const std::size_t end = text.find('\n', line);
    if (end == std::string_view::npos) break;
    line = end + 1;
  }
  return 0;
}

/// What the process holds now, from the file that has nothing else to be looked through. 0 where there is none.
std::uint64_t resident_pages() {
  std::array<char, 256> buffer;
  const std::string_view text = read_start("/proc/self/statm", buffer);
  if (text.empty()) return 0;
  char* rest = nullptr;
  std::strtoull(text.data(), &rest, 10);  // the size of the address space comes first
  return std::strtoull(rest, nullptr, 10);
}

void consider(MemoryCap& cap, std::uint64_t limit, const std::string& source) {
  if (limit == 0 || limit == kUnlimited || limit >= cap.limit) return;
  cap.limit = limit;
  cap.source = source;
}

/// The group and all its parents, up to the mount itself (inside a container the path may not be visible).
void consider_group(MemoryCap& cap, const std::filesystem::path& mount, std::filesystem::path group,
                    const std::string& file, const std::string& source) {
  for (;;) {
    consider(cap, number_in(mount / group.relative_path() / file), source + " " + group.string());
    if (!group.has_relative_path()) return;
    group = group.parent_path();
  }
}

void consider_cgroups(MemoryCap& cap, const std::filesystem::path& root) {
  const std::filesystem::path mount = root / "sys/fs/cgroup";
  consider_group(cap, mount, "/", "memory.max", "cgroup v2");
  consider_group(cap, mount / "memory", "/", "memory.limit_in_bytes", "cgroup v1");
  std::ifstream groups(root / "proc/self/cgroup");
  std::string line;
  while (std::getline(groups, line)) {
    // "0::/group" (v2) or "7:memory:/group" (v1)
    const std::size_t first = line.find(':');
    const std::size_t second = first == std::string::npos ? first : line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = "," + line.substr(first + 1, second - first - 1) + ",";
    const std::string group = line.substr(second + 1);
    if (controllers == ",,") consider_group(cap, mount, group, "memory.max", "cgroup v2");
    if (controllers.find(",memory,") != std::string::npos) {
      consider_group(cap, mount / "memory", group, "memory.limit_in_bytes", "cgroup v1");
    }
  }
}

void consider_ulimit(MemoryCap& cap, int resource, const std::string& source) {
  rlimit limit = {};
  if (::getrlimit(static_cast<__rlimit_resource>(resource), &limit) == 0 && limit.rlim_cur != RLIM_INFINITY) {
    consider(cap, limit.rlim_cur, source);
  }
}

int arenas_of(int threads) {
  return std::clamp(threads, 1, 8);
}

// Blocks above it get mappings of their own, and no arena keeps more than it at its end.
void set_kept_bytes(std::uint64_t bytes) {
  ::mallopt(M_MMAP_THRESHOLD, static_cast<int>(bytes));
  ::mallopt(M_TRIM_THRESHOLD, static_cast<int>(bytes));
}

// What the allocator keeps of freed memory. Page faults of arrays that every task makes anew are a fifth of the time of some
// stages. Each arena keeps `few` bytes, a share of the margin, or where the tasks leave the room `many`, of an eighth of the
// cap. Once tasks needed the room it is theirs to the end of the stage: there and back would cost as much.
class KeptMemory {
 public:
  // Hardly any, until set() is called.
  void clear() {
    const std::lock_guard lock(mutex_);
    few_ = many_ = kMiB;
    extra_ = small_ = 0;
    keep(Kept::kUndecided);
  }
  void set(std::uint64_t cap, int threads) {
    // The main arena and those of the threads keep as much each; the C library takes no threshold above 32 MiB.
    const std::uint64_t arenas = static_cast<std::uint64_t>(arenas_of(threads)) + 1;
    const auto share = [&](std::uint64_t bytes) { return std::clamp(bytes / arenas, kMiB, 32 * kMiB); };
    const std::lock_guard lock(mutex_);
    few_ = share(cap / 32);
    many_ = cap < kWideCap ? few_ : share(cap / 8);
    extra_ = (many_ - few_) * arenas;
    small_ = std::min(cap / 64, kSmallBytes);
    keep(Kept::kUndecided);
  }
  // \param room  bytes of the capacity that no task has reserved
  void fit(std::uint64_t room) {
    const std::lock_guard lock(mutex_);
    if (extra_ == 0 || kept_ == Kept::kFew) return;
    if (room < extra_) {
      const bool kept_many = kept_ == Kept::kMany;
      keep(Kept::kFew);
      if (kept_many) ::malloc_trim(0);
    } else if (kept_ == Kept::kUndecided) {
      keep(Kept::kMany);
    }
  }
  void trim() {
    const std::lock_guard lock(mutex_);
    if (extra_ > 0) keep(Kept::kUndecided);
    // The stages of a small job are as short as it takes to have their memory back. What stays counts as a budget's base.
    if (resident_bytes() > small_) ::malloc_trim(0);
  }

 private:
  enum class Kept { kUndecided, kMany, kFew };
  static constexpr std::uint64_t kSmallBytes = 64 * kMiB;
  static constexpr std::uint64_t kWideCap = 512 * kMiB;  // below, holes in heaps would be too large a share

  void keep(Kept kept) {
    kept_ = kept;
    set_kept_bytes(kept == Kept::kMany ? many_ : few_);
  }

  std::mutex mutex_;
  std::uint64_t few_ = 0, many_ = 0;  // by arena
  std::uint64_t extra_ = 0;           // what all arenas keep more of many than of few
  std::uint64_t small_ = 0;           // a process that holds no more keeps all of it; 0 = none does
  Kept kept_ = Kept::kUndecided;
};

KeptMemory& kept_memory() {
  static KeptMemory kept;
  return kept;
}

}  // namespace

MemoryCap detect_memory_cap(const LimitSources& sources) {
  const auto variable = [&](const char* name) -> std::uint64_t {
    const char* text = sources.variable ? sources.variable(name) : std::getenv(name);
    return text == nullptr ? 0 : std::strtoull(text, nullptr, 10);
  };
  MemoryCap cap;
  cap.limit = kUnlimited;
  consider(cap, kib_line(sources.root / "proc/meminfo", "MemTotal"), "physical memory");
  consider_cgroups(cap, sources.root);
  // SLURM counts in MiB; 0 means all of the node.
  consider(cap, variable("SLURM_MEM_PER_NODE") * kMiB, "SLURM_MEM_PER_NODE");
  consider(cap,
           variable("SLURM_MEM_PER_CPU") * kMiB * std::max<std::uint64_t>(1, variable("SLURM_CPUS_ON_NODE")),
           "SLURM_MEM_PER_CPU");
  if (sources.ulimit) {
    consider_ulimit(cap, RLIMIT_AS, "ulimit -v");
    consider_ulimit(cap, RLIMIT_RSS, "ulimit -m");
    consider_ulimit(cap, RLIMIT_DATA, "ulimit -d");
  }
  if (cap.limit == kUnlimited)
    throw ResourceError("no memory limit can be found on this system: give --memory");
  cap.bytes = static_cast<std::uint64_t>(static_cast<double>(cap.limit) * kShareOfLimit);
  return cap;
}

std::uint64_t resident_bytes() {
  static const auto page = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  return resident_pages() * page;
}
std::uint64_t peak_resident_bytes() {
  return kib_line("/proc/self/status", "VmHWM");
}

void configure_allocator(int threads) {
  // Large blocks get mappings of their own: what a task frees leaves the process, and no hole in a heap keeps it.
  // Arenas hold on to memory; threads rarely allocate at once, so a few are enough.
  kept_memory().clear();
  ::mallopt(M_ARENA_MAX, arenas_of(threads));
}

void keep_freed_memory(std::uint64_t cap, int threads) {
  kept_memory().set(cap, threads);
}

void trim_allocator() {
  kept_memory().trim();
}

MemoryBudget::MemoryBudget(std::uint64_t cap, std::uint64_t base)
    : cap_(cap), base_(base), margin_(cap / 32) {
  capacity_ = cap > base + margin_ ? cap - base - margin_ : 0;
}

std::uint64_t MemoryBudget::expected_base(std::uint64_t later) {
  const std::uint64_t known = (resident_bytes() + later + 2 * kBaseStep - 1) / kBaseStep * kBaseStep;
  return std::max(known, kMinBase);
}

std::uint64_t MemoryBudget::smallest_fitting_cap(
    std::uint64_t cap, std::uint64_t base, const std::function<std::uint64_t(std::uint64_t cap)>& need) {
  for (;;) {
    const MemoryBudget tried(cap, base);
    const std::uint64_t bytes = need(cap);
    if (bytes <= tried.capacity()) return cap;
    cap = tried.smallest_cap(bytes);
  }
}

std::uint64_t MemoryBudget::smallest_cap(std::uint64_t need) const {
  // need + base <= cap - cap / 32
  const std::uint64_t cap = (need + base_) / 31 * 32 + 32;
  return (cap + kMiB - 1) / kMiB * kMiB;
}

void MemoryBudget::require(std::uint64_t need, const std::string& who, std::uint64_t would_do) const {
  if (need <= capacity_) return;
  throw ResourceError(fmt::format(
      "{} needs {} beside the {} of the process itself, which the memory cap of {} does not allow: the "
      "smallest cap "
      "that would do is --memory {}M",
      who, format_bytes(need), format_bytes(base_), format_bytes(cap_),
      std::max(would_do, smallest_cap(need)) / kMiB));
}

MemoryBudget::Reservation::Reservation(Reservation&& other) noexcept
    : budget_(std::exchange(other.budget_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}

MemoryBudget::Reservation& MemoryBudget::Reservation::operator=(Reservation&& other) noexcept {
  if (this != &other) {
    release();
    budget_ = std::exchange(other.budget_, nullptr);
    bytes_ = std::exchange(other.bytes_, 0);
  }
  return *this;
}

void MemoryBudget::Reservation::release() {
  if (budget_ != nullptr) std::exchange(budget_, nullptr)->give_back(std::exchange(bytes_, 0));
}

MemoryBudget::Reservation MemoryBudget::reserve(std::uint64_t bytes) {
  require(bytes, "a piece of work");
  std::unique_lock lock(mutex_);
  const std::uint64_t ticket = next_ticket_++;
  changed_.wait(lock, [&] { return serving_ == ticket && reserved_ + bytes <= capacity_; });
  ++serving_;
  reserved_ += bytes;
  note_reserved(reserved_);
  kept_memory().fit(capacity_ - reserved_);
  changed_.notify_all();
  return Reservation(this, bytes);
}

std::uint64_t MemoryBudget::reserved() const {
  const std::lock_guard lock(mutex_);
  return reserved_;
}

void MemoryBudget::give_back(std::uint64_t bytes) {
  const std::lock_guard lock(mutex_);
  reserved_ -= bytes;
  note_reserved(reserved_);
  changed_.notify_all();
}

}  // namespace tessera
