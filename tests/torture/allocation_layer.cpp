// Counts what a command allocates beside its reservations, preloaded below it (LD_PRELOAD). The budget tells how much is
// reserved (memory_budget.cpp). To the file that TESSERA_ALLOCATIONS names, at exit, two lines:
//   beyond BYTES   most bytes that were alive at one time above what was reserved then, of all that came to be since
//                  nothing was reserved
//   beside BYTES   the largest single block that was allocated while nothing was reserved
#include <dlfcn.h>
#include <malloc.h>

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>

namespace {

std::atomic<std::int64_t> alive{0}, base{0}, reserved{0}, beyond{0}, unreserved{0};

void raise(std::atomic<std::int64_t>& maximum, std::int64_t value) {
  std::int64_t seen = maximum.load(std::memory_order_relaxed);
  while (value > seen && !maximum.compare_exchange_weak(seen, value, std::memory_order_relaxed)) {
  }
}

void* note(void* p) {
  if (p == nullptr) return p;
  const auto bytes = static_cast<std::int64_t>(::malloc_usable_size(p));
  const std::int64_t now = alive.fetch_add(bytes) + bytes;
  const std::int64_t allowed = reserved.load();
  if (allowed > 0)
    raise(beyond, now - base.load() - allowed);
  else
    raise(unreserved, bytes);
  return p;
}
void drop(void* p) {
  if (p != nullptr) alive.fetch_sub(static_cast<std::int64_t>(::malloc_usable_size(p)));
}

/// What dlsym() itself asks for before it has found the real functions.
char first_bytes[4096];
std::size_t first_used = 0;
bool is_first(const void* p) {
  return p >= first_bytes && p < first_bytes + sizeof first_bytes;
}
void* from_first(std::size_t bytes) {
  void* p = first_bytes + first_used;
  first_used += (bytes + 15) / 16 * 16;
  if (first_used > sizeof first_bytes) std::abort();
  return p;
}

template <class Function>
Function real(const char* name) {
  return reinterpret_cast<Function>(::dlsym(RTLD_NEXT, name));
}
using Malloc = void* (*)(std::size_t);
using Calloc = void* (*)(std::size_t, std::size_t);
using Realloc = void* (*)(void*, std::size_t);
using Aligned = void* (*)(std::size_t, std::size_t);
using Free = void (*)(void*);
bool looking = false;
Malloc real_malloc = nullptr;
Calloc real_calloc = nullptr;
Realloc real_realloc = nullptr;
Aligned real_memalign = nullptr;
Free real_free = nullptr;

/// False while the real functions are being looked up.
bool ready() {
  if (real_free != nullptr) return true;
  if (looking) return false;
  looking = true;
  real_malloc = real<Malloc>("malloc");
  real_calloc = real<Calloc>("calloc");
  real_realloc = real<Realloc>("realloc");
  real_memalign = real<Aligned>("memalign");
  real_free = real<Free>("free");
  looking = false;
  return true;
}

__attribute__((destructor)) void tell() {
  const char* path = std::getenv("TESSERA_ALLOCATIONS");
  if (path == nullptr) return;
  const long long maximum[2] = {static_cast<long long>(beyond.load()),
                                static_cast<long long>(unreserved.load())};
  if (std::FILE* file = std::fopen(path, "a")) {
    std::fprintf(file, "beyond %lld\nbeside %lld\n", maximum[0], maximum[1]);
    std::fclose(file);
  }
}

}  // namespace

extern "C" {

void tessera_note_reserved(std::uint64_t bytes) {
  if (bytes == 0 || reserved.load() == 0) base = alive.load();
  reserved = static_cast<std::int64_t>(bytes);
}

void* malloc(std::size_t bytes) {
  return ready() ? note(real_malloc(bytes)) : from_first(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) {
  return ready() ? note(real_calloc(count, bytes)) : from_first(count * bytes);
}
void* realloc(void* p, std::size_t bytes) {
  if (is_first(p)) {
    void* fresh = malloc(bytes);
    std::memcpy(fresh, p, bytes);
    return fresh;
  }
  ready();
  drop(p);
  return note(real_realloc(p, bytes));
}
void* memalign(std::size_t alignment, std::size_t bytes) {
  ready();
  return note(real_memalign(alignment, bytes));
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  return memalign(alignment, bytes);
}
int posix_memalign(void** p, std::size_t alignment, std::size_t bytes) {
  *p = memalign(alignment, bytes);
  return *p == nullptr ? 12 : 0;
}
void free(void* p) {
  if (is_first(p)) return;
  ready();
  drop(p);
  real_free(p);
}
}
