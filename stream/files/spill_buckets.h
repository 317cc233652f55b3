/// \file spill_buckets.h
/// Records partitioned into buckets, in memory while they fit a budget and in a spill file beyond it. A
/// bucket gives its records back in the order they came.
#pragma once
#include <algorithm>
#include <cassert>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "stream/files/spill_file.h"

namespace tessera {

/// Bytes that several SpillBuckets share, and the file that takes what does not fit.
struct SpillPool {
  SpillPool(const std::filesystem::path& folder, std::uint64_t memory_bytes)
      : file(folder), limit(memory_bytes) {}
  SpillFile file;
  std::uint64_t limit;
  std::uint64_t used = 0;  ///< full chunks kept in memory
};

template <class Record>
class SpillBuckets {
  static_assert(std::is_trivially_copyable_v<Record>);

 public:
  /// Besides the pool, memory grows to buckets * chunk_bytes for chunks being filled, and one more while
  /// reading.
  SpillBuckets(SpillPool& pool, std::size_t buckets, std::size_t chunk_bytes)
      : pool_(&pool), capacity_(std::max<std::size_t>(1, chunk_bytes / sizeof(Record))), buckets_(buckets) {}
  SpillBuckets(const SpillBuckets&) = delete;
  SpillBuckets& operator=(const SpillBuckets&) = delete;

  void add(std::size_t bucket, const Record& record) {
    Bucket& b = buckets_[bucket];
    if (b.filled == b.capacity) grow(b);
    b.open[b.filled++] = record;
    ++b.count;
  }
  std::uint64_t count(std::size_t bucket) const { return buckets_[bucket].count; }
  std::size_t size() const { return buckets_.size(); }

  /// Hands out the records of a bucket in batches, oldest first.
  void for_each(std::size_t bucket, const std::function<void(std::span<const Record>)>& sink) const {
    const Bucket& b = buckets_[bucket];
    std::unique_ptr<Record[]> buffer;
    for (const Chunk& chunk : b.chunks) {
      if (chunk.memory) {
        sink({chunk.memory.get(), capacity_});
        continue;
      }
      if (!buffer) buffer = std::make_unique_for_overwrite<Record[]>(capacity_);
      pool_->file.read_at(chunk.offset, buffer.get(), capacity_ * sizeof(Record));
      sink({buffer.get(), capacity_});
    }
    if (b.filled > 0) sink({b.open.get(), b.filled});
  }
  /// Frees the memory of a bucket that is not needed again.
  void release(std::size_t bucket) {
    for (const Chunk& chunk : buckets_[bucket].chunks) {
      if (chunk.memory) pool_->used -= capacity_ * sizeof(Record);
    }
    buckets_[bucket] = Bucket{};
  }

 private:
  struct Chunk {
    std::unique_ptr<Record[]> memory;  ///< null: in the file, at offset
    std::uint64_t offset = 0;
  };
  struct Bucket {
    std::vector<Chunk> chunks;  ///< full ones, capacity_ records each
    std::unique_ptr<Record[]> open;
    std::size_t filled = 0;
    std::size_t capacity = 0;
    std::uint64_t count = 0;
  };

  void grow(Bucket& b) {
    if (b.capacity < capacity_) {  // small buckets stay small
      const std::size_t capacity = std::min(capacity_, std::max<std::size_t>(2 * b.capacity, 64));
      auto wider = std::make_unique_for_overwrite<Record[]>(capacity);
      std::copy_n(b.open.get(), b.filled, wider.get());
      b.open = std::move(wider);
      b.capacity = capacity;
      return;
    }
    const std::uint64_t bytes = capacity_ * sizeof(Record);
    if (pool_->used + bytes <= pool_->limit) {
      pool_->used += bytes;
      b.chunks.push_back({std::move(b.open), 0});
      b.open = std::make_unique_for_overwrite<Record[]>(capacity_);
    } else {
      b.chunks.push_back({nullptr, pool_->file.append(b.open.get(), bytes)});
    }
    b.filled = 0;
  }

  SpillPool* pool_;
  std::size_t capacity_;
  std::vector<Bucket> buckets_;
};

}  // namespace tessera
