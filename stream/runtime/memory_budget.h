/// \file memory_budget.h
/// Memory is a promise: what a job may use, what it uses, and who may start.
#pragma once
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <mutex>
#include <string>

namespace tessera {

/// "2G", "512M", "1.5GiB", "64KB", "1000000": a number and a unit, in powers of 1024, letter case ignored.
/// \throws UsageError for anything else
std::uint64_t parse_bytes(const std::string& text);

/// "1.50 GiB": three digits, powers of 1024.
std::string format_bytes(std::uint64_t bytes);

/// The most that a task asks for on account of what it may find, as it is told before it looks: under most caps a task alone gets
/// it. And a cap, in MiB, under which that is `bytes`.
constexpr std::uint64_t largest_guess_bytes(std::uint64_t cap) {
  return cap / 4 * 3;
}
constexpr std::uint64_t cap_mib_for_guess(std::uint64_t bytes) {
  return (bytes / 3 * 4 >> 20) + 1;
}

/// What limits this process. Paths and variables can be replaced, for tests.
struct LimitSources {
  std::filesystem::path root = "/";                  ///< where proc/ and sys/ are looked up
  std::function<const char*(const char*)> variable;  ///< getenv if empty
  bool ulimit = true;
};

struct MemoryCap {
  std::uint64_t bytes = 0;  ///< the smallest limit, times 0.8
  std::string source;  ///< which one: "physical memory", "cgroup v2 /user.slice", "SLURM_MEM_PER_NODE", ...
  std::uint64_t limit = 0;  ///< the limit itself
};

/// The smallest of physical memory, cgroup v1/v2 (own group and its parents), SLURM_MEM_PER_NODE,
/// SLURM_MEM_PER_CPU x SLURM_CPUS_ON_NODE, ulimit -v, -m and -d; times 0.8.
MemoryCap detect_memory_cap(const LimitSources& sources = {});

/// Resident memory of this process now and at its highest, bytes.
std::uint64_t resident_bytes();
std::uint64_t peak_resident_bytes();

/// Makes freed memory go back to the system: large blocks get mappings of their own, few arenas. Once, before
/// threads start.
void configure_allocator(int threads);
/// Lets the process keep some of what its tasks free for those to come, which spares them page faults: less than the margin of a
/// MemoryBudget of this cap, an eighth of the cap while reservations leave that room. \pre configure_allocator was called
void keep_freed_memory(std::uint64_t cap, int threads);
/// Gives back what the allocator still holds, if the process is larger than 64 MiB or 1/64 of the cap.
void trim_allocator();

/// Admission by bytes. A task asks for its whole need at once and holds nothing while it waits, so nobody
/// waits for each other: no deadlock. What is asked first is served first, so a large task is not starved by
/// small ones.
class MemoryBudget {
 public:
  static constexpr std::uint64_t kBaseStep = std::uint64_t{4} << 20;  ///< a base is told in whole ones
  static constexpr std::uint64_t kMinBase = std::uint64_t{24} << 20;  ///< what commands hold, and a little
  /// The base to count with before the work starts: code is still to be paged in, and two runs differ by some pages.
  /// \param later  what the process is known to hold then beside its code
  static std::uint64_t expected_base(std::uint64_t later = 0);
  /// The smallest cap from `cap` on that holds what is needed under it.
  /// \param need  bytes of the largest task; grows slower than the cap
  static std::uint64_t smallest_fitting_cap(std::uint64_t cap, std::uint64_t base,
                                            const std::function<std::uint64_t(std::uint64_t cap)>& need);

  /// \param cap   promise for the process
  /// \param base  what the process holds without any task (resident bytes now)
  MemoryBudget(std::uint64_t cap, std::uint64_t base);

  /// Bytes that all tasks together may hold: the cap less the base less a margin (1/32 of the cap) for what
  /// the allocator and the stacks of threads lose.
  std::uint64_t capacity() const { return capacity_; }
  /// The smallest cap under which a task of `need` bytes can run, rounded up to MiB.
  std::uint64_t smallest_cap(std::uint64_t need) const;
  /// \param would_do  the smallest cap that would, where more is known than `need`; 0 = smallest_cap(need)
  /// \throws ResourceError when `need` exceeds the capacity, naming `who` and the smallest cap that would do
  void require(std::uint64_t need, const std::string& who, std::uint64_t would_do = 0) const;

  /// Bytes of the capacity, given back when it goes.
  class Reservation {
   public:
    Reservation() = default;
    Reservation(MemoryBudget* budget, std::uint64_t bytes) : budget_(budget), bytes_(bytes) {}
    Reservation(Reservation&& other) noexcept;
    Reservation& operator=(Reservation&& other) noexcept;
    ~Reservation() { release(); }
    std::uint64_t bytes() const { return bytes_; }
    void release();

   private:
    MemoryBudget* budget_ = nullptr;
    std::uint64_t bytes_ = 0;
  };

  /// Waits until `bytes` are free and it is this caller's turn. Hold no reservation when calling.
  /// \throws ResourceError when bytes exceed the capacity
  Reservation reserve(std::uint64_t bytes);
  std::uint64_t reserved() const;

 private:
  void give_back(std::uint64_t bytes);

  std::uint64_t cap_ = 0;
  std::uint64_t base_ = 0;
  std::uint64_t margin_ = 0;
  std::uint64_t capacity_ = 0;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::uint64_t reserved_ = 0;
  std::uint64_t next_ticket_ = 0;
  std::uint64_t serving_ = 0;
};

}  // namespace tessera
