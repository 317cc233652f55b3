#include "stream/runtime/memory_budget.h"

#include <atomic>
#include <catch2/catch.hpp>
#include <map>
#include <random>
#include <thread>
#include <vector>

#include "octree/error.h"
#include "tests/helpers/shell.h"

namespace memory_budget_test {

using namespace tessera;
using test::spill;
using test::TempFolder;

namespace {

constexpr std::uint64_t kMiB = 1u << 20;
constexpr std::uint64_t kGiB = 1u << 30;

/// A system with 16 GiB and nothing else.
LimitSources plain_sources(const TempFolder& root) {
  spill(root / "proc/meminfo", "MemTotal:       16777216 kB\nMemFree: 1 kB\n");
  return {root.path(), [](const char*) -> const char* { return nullptr; }, false};
}

}  // namespace

TEST_CASE("sizes: a number and a unit in powers of 1024", "[unit]") {
  CHECK(parse_bytes("0") == 0);
  CHECK(parse_bytes("1000000") == 1000000);
  CHECK(parse_bytes("64KB") == 65536);
  CHECK(parse_bytes("512M") == 512 * kMiB);
  CHECK(parse_bytes("512mib") == 512 * kMiB);
  CHECK(parse_bytes("2G") == 2 * kGiB);
  CHECK(parse_bytes("1.5GiB") == 1536 * kMiB);
  CHECK(parse_bytes("1 T") == 1024 * kGiB);
  CHECK(parse_bytes("7b") == 7);
}

TEST_CASE("sizes: everything else is refused with the word in the message", "[unit]") {
  for (const char* text :
       {"", "G", "-1G", "1X", "1GG", "1Gi", "1e400", "0x10", "1 000", "nan", "99999999T"}) {
    CAPTURE(text);
    CHECK_THROWS_AS(parse_bytes(text), UsageError);
  }
  CHECK_THROWS_WITH(parse_bytes("12Q"), Catch::Contains("12Q"));
}

TEST_CASE("sizes: printed with three digits", "[unit]") {
  CHECK(format_bytes(1023) == "1023 B");
  CHECK(format_bytes(1536) == "1.50 KiB");
  CHECK(format_bytes(20 * kGiB) == "20.0 GiB");
  CHECK(format_bytes(512 * kMiB) == "512 MiB");
}

TEST_CASE("cap: physical memory times 0.8 when nothing else limits", "[unit]") {
  const TempFolder root;
  const MemoryCap cap = detect_memory_cap(plain_sources(root));
  CHECK(cap.limit == 16 * kGiB);
  CHECK(cap.bytes == static_cast<std::uint64_t>(0.8 * 16 * static_cast<double>(kGiB)));
  CHECK(cap.source == "physical memory");
}

TEST_CASE("cap: the smallest limit wins and is named", "[unit]") {
  const TempFolder root;
  LimitSources sources = plain_sources(root);
  SECTION("cgroup v2, the parent is tighter than the group") {
    spill(root / "proc/self/cgroup", "0::/user/job\n");
    spill(root / "sys/fs/cgroup/user/job/memory.max", "max\n");
    spill(root / "sys/fs/cgroup/user/memory.max", "2147483648\n");
    const MemoryCap cap = detect_memory_cap(sources);
    CHECK(cap.limit == 2 * kGiB);
    CHECK(cap.source == "cgroup v2 /user");
  }
  SECTION("cgroup v2 at the mount, as a container sees it") {
    spill(root / "proc/self/cgroup", "0::/../elsewhere\n");
    spill(root / "sys/fs/cgroup/memory.max", "1073741824\n");
    CHECK(detect_memory_cap(sources).limit == kGiB);
  }
  SECTION("cgroup v1, whose no-limit is a huge number") {
    spill(root / "proc/self/cgroup", "3:cpu:/a\n7:hugetlb,memory:/slurm/job_3\n");
    spill(root / "sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
    spill(root / "sys/fs/cgroup/memory/slurm/job_3/memory.limit_in_bytes", "3221225472\n");
    const MemoryCap cap = detect_memory_cap(sources);
    CHECK(cap.limit == 3 * kGiB);
    CHECK(cap.source == "cgroup v1 /slurm/job_3");
  }
  SECTION("SLURM per node, in MiB") {
    sources.variable = [](const char* name) {
      return std::string(name) == "SLURM_MEM_PER_NODE" ? "4096" : nullptr;
    };
    CHECK(detect_memory_cap(sources).limit == 4 * kGiB);
    CHECK(detect_memory_cap(sources).source == "SLURM_MEM_PER_NODE");
  }
  SECTION("SLURM per processor") {
    sources.variable = [](const char* name) -> const char* {
      const std::map<std::string, const char*> set = {{"SLURM_MEM_PER_CPU", "1024"},
                                                      {"SLURM_CPUS_ON_NODE", "3"}};
      const auto at = set.find(name);
      return at == set.end() ? nullptr : at->second;
    };
    CHECK(detect_memory_cap(sources).limit == 3 * kGiB);
  }
  SECTION("SLURM 0 means the whole node") {
    sources.variable = [](const char* name) {
      return std::string(name) == "SLURM_MEM_PER_NODE" ? "0" : nullptr;
    };
    CHECK(detect_memory_cap(sources).source == "physical memory");
  }
}

TEST_CASE("cap: this process has one, and resident memory below it", "[unit]") {
  const MemoryCap cap = detect_memory_cap();
  CHECK(cap.bytes > 0);
  CHECK_FALSE(cap.source.empty());
  CHECK(resident_bytes() > 0);
  CHECK(peak_resident_bytes() >= resident_bytes());
}

TEST_CASE("budget: what does not fit alone is refused with the smallest cap that would", "[unit]") {
  const MemoryBudget budget(64 * kMiB, 20 * kMiB);
  CHECK(budget.capacity() == 42 * kMiB);
  budget.require(42 * kMiB, "a task");
  CHECK_THROWS_AS(budget.require(42 * kMiB + 1, "a task"), ResourceError);
  CHECK_THROWS_WITH(budget.require(100 * kMiB, "task 7 of stage surface"),
                    Catch::Contains("task 7 of stage surface") && Catch::Contains("--memory 124M"));
  SECTION("and that cap does do, a MiB less does not") {
    for (const std::uint64_t need : {43 * kMiB, 100 * kMiB, 777 * kMiB + 13, 5000 * kMiB}) {
      const std::uint64_t cap = budget.smallest_cap(need);
      CHECK(MemoryBudget(cap, 20 * kMiB).capacity() >= need);
      CHECK(MemoryBudget(cap - 2 * kMiB, 20 * kMiB).capacity() < need);
    }
  }
}

TEST_CASE("budget: a cap below the base has no capacity", "[unit]") {
  CHECK(MemoryBudget(kMiB, 2 * kMiB).capacity() == 0);
}

TEST_CASE("budget: reservations go back, once, when they go", "[unit]") {
  MemoryBudget budget(32 * kMiB, 0);
  {
    MemoryBudget::Reservation a = budget.reserve(10 * kMiB);
    MemoryBudget::Reservation b = std::move(a);
    CHECK(budget.reserved() == 10 * kMiB);
    a = budget.reserve(5 * kMiB);
    CHECK(budget.reserved() == 15 * kMiB);
    b.release();
    b.release();
    CHECK(budget.reserved() == 5 * kMiB);
  }
  CHECK(budget.reserved() == 0);
}

TEST_CASE("budget: random loads from many threads never exceed it and all end", "[property]") {
  MemoryBudget budget(64, 0);  // capacity 62
  std::atomic<std::uint64_t> taken{0};
  std::atomic<std::uint64_t> highest{0};
  std::atomic<int> served{0};
  std::vector<std::thread> threads;
  for (unsigned t = 0; t < 6; ++t) {
    threads.emplace_back([&, t] {
      std::mt19937 random(t);
      for (int i = 0; i < 500; ++i) {
        // One in eight asks for everything: small ones must not keep it waiting for ever.
        const std::uint64_t need = random() % 8 == 0 ? budget.capacity() : random() % 40;
        const auto reservation = budget.reserve(need);
        const std::uint64_t now = taken += need;
        for (std::uint64_t seen = highest; now > seen && !highest.compare_exchange_weak(seen, now);) {
        }
        ++served;
        taken -= need;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(served == 6 * 500);
  CHECK(highest <= budget.capacity());
  CHECK(highest > 40);
  CHECK(budget.reserved() == 0);
}

#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
namespace {

/// Writes so many bytes in arrays of 2 MiB, and frees them: into the heap, where such arrays get no mappings of their own.
void use_and_free(std::uint64_t bytes) {
  constexpr std::size_t kArray = std::size_t{2} << 20;
  std::vector<std::vector<char>> arrays;
  for (std::uint64_t used = 0; used < bytes; used += kArray) arrays.emplace_back(kArray, 'x');
}

}  // namespace

TEST_CASE("allocator: freed memory is kept while the budget has room, and goes when tasks need it",
          "[memory]") {
  configure_allocator(2);
  trim_allocator();
  const std::uint64_t base = resident_bytes();
  keep_freed_memory(kGiB, 2);  // 10 MiB by arena, or 32 with room
  {
    MemoryBudget budget(kGiB, 0);
    const auto small = budget.reserve(100 * kMiB);
    use_and_free(24 * kMiB);
    CHECK(resident_bytes() > base + 20 * kMiB);
    SECTION("tasks that leave it to them") {
      const auto second = budget.reserve(500 * kMiB);
      CHECK(resident_bytes() > base + 20 * kMiB);
    }
    SECTION("tasks that do not, and what they free after that") {
      const auto second = budget.reserve(budget.capacity() - 110 * kMiB);
      CHECK(resident_bytes() < base + 16 * kMiB);
      use_and_free(24 * kMiB);
      CHECK(resident_bytes() < base + 16 * kMiB);
    }
  }
  configure_allocator(2);
  trim_allocator();
}

TEST_CASE("allocator: a process that is small beside its cap keeps what it freed between stages",
          "[memory]") {
  configure_allocator(2);
  trim_allocator();
  const std::uint64_t base = resident_bytes();
  for (const bool small : {true, false}) {
    CAPTURE(small);
    keep_freed_memory(small ? 16 * kGiB : 2 * base, 2);
    use_and_free(4 * kMiB);
    if (small && base > 56 * kMiB) continue;  // other tests left too much
    trim_allocator();
    CHECK((resident_bytes() > base + 3 * kMiB) == small);
  }
  configure_allocator(2);
  trim_allocator();
}
#endif

TEST_CASE("allocator: freed blocks leave the process", "[memory]") {
  configure_allocator(2);
  // What was freed before, by other tests too, may go or be taken again at any time: only the fall tells.
  trim_allocator();
  std::uint64_t full = 0;
  {
    std::vector<std::vector<char>> blocks;
    for (int i = 0; i < 64; ++i) blocks.emplace_back(2 * kMiB, 'x');
    full = resident_bytes();
    CHECK(full > 128 * kMiB);
  }
  CHECK(resident_bytes() + 112 * kMiB < full);
}

}  // namespace memory_budget_test
