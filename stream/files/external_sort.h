/// \file external_sort.h
/// Sorts any number of records under a byte budget: sorted runs in an unnamed temporary file, merged on the
/// way out. What fits in the budget never touches the disk.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>
#include <type_traits>
#include <utility>
#include <vector>

#include "stream/files/spill_file.h"

namespace tessera {

/// \tparam Less  a strict total order: records that it calls equal come out in any order, so they must not differ
template <class Record, class Less = std::less<Record>>
class ExternalSort {
  static_assert(std::is_trivially_copyable_v<Record>);

 public:
  /// \param memory_bytes  all that the sort allocates, at least about 100 kB
  ExternalSort(std::filesystem::path temp, std::uint64_t memory_bytes, Less less = {})
      : temp_(std::move(temp)),
        less_(less),
        capacity_(static_cast<std::size_t>(std::max<std::uint64_t>(memory_bytes / sizeof(Record), 64))),
        file_(std::make_unique<SpillFile>(temp_)) {}

  void add(const Record& record) {
    if (records_.size() == capacity_) write_run();
    if (records_.size() == records_.capacity()) {  // grow by hand: doubling must not overshoot the budget
      records_.reserve(std::min(capacity_, std::max<std::size_t>(2 * records_.capacity(), 4096)));
    }
    records_.push_back(record);
  }

  /// Hands out everything in order, in batches, and empties the sort.
  /// \throws ResourceError when the disk is full or fails (as add does)
  void drain(const std::function<void(std::span<const Record>)>& sink) {
    if (runs_.empty()) {
      std::sort(records_.begin(), records_.end(), less_);
      if (!records_.empty()) sink(records_);
    } else {
      if (!records_.empty()) write_run();
      std::vector<Record>().swap(records_);
      while (runs_.size() > kFanIn) merge_groups();
      merge(runs_, sink);
    }
    std::vector<Record>().swap(records_);
    runs_.clear();
    file_ = std::make_unique<SpillFile>(temp_);
  }

  std::size_t runs() const { return runs_.size(); }

 private:
  static constexpr std::size_t kFanIn =
      64;  // below it one merge does; each run still gets a buffer worth a seek
  struct Run {
    std::uint64_t offset = 0;  ///< bytes in the file
    std::uint64_t count = 0;
  };
  /// A run while it is merged.
  struct Cursor {
    Run rest;
    std::vector<Record> buffer;
    std::size_t next = 0;
  };

  void write_run() {
    std::sort(records_.begin(), records_.end(), less_);
    runs_.push_back({file_->append(records_.data(), records_.size() * sizeof(Record)), records_.size()});
    records_.clear();
  }

  bool refill(Cursor& cursor, std::size_t capacity) const {
    const std::size_t count = static_cast<std::size_t>(std::min<std::uint64_t>(capacity, cursor.rest.count));
    cursor.buffer.resize(count);
    cursor.next = 0;
    file_->read_at(cursor.rest.offset, cursor.buffer.data(), count * sizeof(Record));
    cursor.rest.offset += count * sizeof(Record);
    cursor.rest.count -= count;
    return count > 0;
  }

  void merge(std::span<const Run> runs, const std::function<void(std::span<const Record>)>& sink) const {
    const std::size_t capacity = std::max<std::size_t>(1, capacity_ / (runs.size() + 1));
    std::vector<Cursor> cursors(runs.size());
    std::vector<std::uint32_t> heap;  // runs by their next record, smallest on top
    const auto later = [&](std::uint32_t a, std::uint32_t b) {
      return less_(cursors[b].buffer[cursors[b].next], cursors[a].buffer[cursors[a].next]);
    };
    for (std::uint32_t i = 0; i < runs.size(); ++i) {
      cursors[i].rest = runs[i];
      if (refill(cursors[i], capacity)) heap.push_back(i);
    }
    std::make_heap(heap.begin(), heap.end(), later);
    std::vector<Record> out;
    out.reserve(capacity);
    while (!heap.empty()) {
      std::pop_heap(heap.begin(), heap.end(), later);
      Cursor& cursor = cursors[heap.back()];
      out.push_back(cursor.buffer[cursor.next++]);
      if (out.size() == capacity) {
        sink(out);
        out.clear();
      }
      if (cursor.next < cursor.buffer.size() || refill(cursor, capacity)) {
        std::push_heap(heap.begin(), heap.end(), later);
      } else {
        heap.pop_back();
      }
    }
    if (!out.empty()) sink(out);
  }

  void merge_groups() {
    auto merged = std::make_unique<SpillFile>(temp_);
    std::vector<Run> longer;
    for (std::size_t first = 0; first < runs_.size(); first += kFanIn) {
      const std::span<const Run> group(runs_.data() + first, std::min(kFanIn, runs_.size() - first));
      Run run{merged->size(), 0};
      merge(group, [&](std::span<const Record> batch) {
        merged->append(batch.data(), batch.size() * sizeof(Record));
        run.count += batch.size();
      });
      longer.push_back(run);
    }
    runs_ = std::move(longer);
    file_ = std::move(merged);
  }

  const std::filesystem::path temp_;
  const Less less_;
  const std::size_t capacity_;
  std::unique_ptr<SpillFile> file_;
  std::vector<Record> records_;
  std::vector<Run> runs_;
};

}  // namespace tessera
