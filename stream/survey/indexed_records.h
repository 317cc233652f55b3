/// \file indexed_records.h
/// Records that are made in any order and wanted in that of their indices.
#pragma once
#include <algorithm>
#include <bit>
#include <cstdint>
#include <optional>
#include <vector>

#include "stream/files/spill_buckets.h"

namespace tessera {

/// \tparam Record  trivially copyable, with a member `place` of 32 bits that is this class's own; a default one stands where
/// none was added
template <class Record>
class IndexedRecords {
 public:
  /// \param count  of indices  \param buffer_bytes  for buckets being filled, beside the pool
  IndexedRecords(SpillPool& pool, std::uint64_t count, std::uint64_t buffer_bytes)
      : group_records_(std::max(kMinGroup, std::bit_ceil(count / kMaxGroups + 1))) {
    constexpr std::uint64_t kMinChunk = 4096, kMaxChunk = 262144;
    const auto groups = static_cast<std::size_t>(count / group_records_ + 1);
    buckets_.emplace(pool, groups,
                     static_cast<std::size_t>(std::clamp(buffer_bytes / groups, kMinChunk, kMaxChunk)));
  }
  /// One thread at a time. \pre every index once at most
  void add(std::uint64_t index, Record record) {
    record.place = static_cast<std::uint32_t>(index % group_records_);
    buckets_->add(static_cast<std::size_t>(index / group_records_), record);
  }
  /// From index 0 on. \pre all were added
  const Record& next() {
    const std::uint64_t place = next_ % group_records_;
    if (place == 0) load(static_cast<std::size_t>(next_ / group_records_));
    ++next_;
    return group_[static_cast<std::size_t>(place)];
  }

 private:
  static constexpr std::uint64_t kMinGroup = 1u << 18, kMaxGroups = 2048;
  void load(std::size_t group) {
    group_.assign(static_cast<std::size_t>(group_records_), Record{});
    buckets_->for_each(group, [&](std::span<const Record> some) {
      for (const Record& r : some) group_[r.place] = r;
    });
  }

  std::uint64_t group_records_;  ///< consecutive records that are read together
  std::optional<SpillBuckets<Record>> buckets_;
  std::uint64_t next_ = 0;
  std::vector<Record> group_;
};

}  // namespace tessera
