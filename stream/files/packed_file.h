/// \file packed_file.h
/// The one format of the files between stages: sections of bytes, a table that says what and where they are, a footer
/// (layout: stream/README.md). An XXH3 guards each section, the table and the footer. What is damaged is named with
/// file, byte and what to do. Tables and sections hold trivially copyable records as they lie in memory.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <initializer_list>
#include <memory>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "stream/files/direct_file.h"
#include "stream/files/read_file.h"

namespace tessera {

/// What a file holds.
struct PackedKind {
  char magic[9];     ///< eight characters, the last of them count the versions of its content
  const char* name;  ///< in messages, with its article
};

struct Section {
  std::uint64_t offset = 0;
  std::uint64_t bytes = 0;
  std::uint64_t hash = 0;  ///< XXH3
};

template <class Range>
std::span<const std::byte> bytes_of(const Range& values) {
  static_assert(std::is_trivially_copyable_v<typename Range::value_type>);
  return std::as_bytes(std::span(values.data(), values.size()));
}
template <class T>
std::span<std::byte> buffer_of(std::vector<T>& values) {
  static_assert(std::is_trivially_copyable_v<T>);
  return std::as_writable_bytes(std::span(values));
}

/// Writes one file past the page cache; memory is the buffer.
class PackedWriter {
 public:
  PackedWriter(const std::filesystem::path& path, const PackedKind& kind,
               std::size_t buffer_bytes = DirectFile::kDefaultBuffer);
  Section append(std::span<const std::byte> data) { return append({data}); }
  /// One section of several parts.
  Section append(std::initializer_list<std::span<const std::byte>> parts);
  /// Table, info and footer; closes (no sync, no rename: the task commits). Returns the size of the file.
  template <class Entry>
  std::uint64_t finish(const std::vector<Entry>& table, std::span<const std::byte> info = {}) {
    return finish(bytes_of(table), sizeof(Entry), info);
  }

 private:
  std::uint64_t finish(std::span<const std::byte> table, std::uint64_t entry_bytes,
                       std::span<const std::byte> info);
  PackedKind kind_;
  DirectFile file_;
};

/// Reads one. Holds no table. Thread-safe. Everything throws InputError for what is damaged.
class PackedFile {
 public:
  /// Checks magic, footer, and that sizes of entries and info are those of this version.
  PackedFile(const std::filesystem::path& path, const PackedKind& kind, std::size_t entry_bytes,
             std::size_t info_bytes = 0);

  const std::filesystem::path& path() const { return file_.path(); }
  std::span<const std::byte> info() const { return info_; }
  /// The whole table, checked, behind what `to` holds.
  template <class Entry>
  void append_table(std::vector<Entry>& to) const {
    const std::size_t old = to.size();
    to.resize(old + entries_);
    read_table(std::as_writable_bytes(std::span(to).subspan(old)));
  }
  template <class Entry>
  std::vector<Entry> table() const {
    std::vector<Entry> out;
    append_table(out);
    return out;
  }
  /// Some entries of a table that was checked before.
  template <class Entry>
  std::vector<Entry> entries(std::uint64_t first, std::uint64_t count) const {
    std::vector<Entry> out(count);
    file_.read_at(table_offset_ + first * sizeof(Entry), out.data(), count * sizeof(Entry));
    return out;
  }
  /// A whole section, checked, into these parts. \pre their sizes add up to it
  void read(const Section& section, std::initializer_list<std::span<std::byte>> parts) const;
  template <class T>
  std::vector<T> load(const Section& section) const {
    std::vector<T> out(section.bytes / sizeof(T));
    read(section, {buffer_of(out)});
    return out;
  }
  /// Part of a section, not checked.
  void read_part(const Section& section, std::uint64_t from, void* to, std::uint64_t bytes) const;
  void will_need(const Section& section) const { file_.will_need(section.offset, section.bytes); }
  void release(const Section& section) const { file_.release(section.offset, section.bytes); }
  [[noreturn]] void damaged(std::uint64_t offset, const std::string& what) const;

 private:
  friend class SectionReader;
  void read_table(std::span<std::byte> to) const;
  void check(const Section& section, std::uint64_t hash) const;

  ReadFile file_;
  std::uint64_t entries_ = 0, table_offset_ = 0, table_hash_ = 0;
  std::vector<std::byte> info_;
};

/// Reads a section from front to back in parts of any size; with the last part its checksum is compared.
class SectionReader {
 public:
  SectionReader(const PackedFile& file, const Section& section);
  ~SectionReader();
  std::uint64_t left() const { return section_.bytes - done_; }
  void next(void* to, std::uint64_t bytes);

 private:
  struct Hash;
  const PackedFile& file_;
  Section section_;
  std::uint64_t done_ = 0;
  std::unique_ptr<Hash> hash_;
};

[[noreturn]] void throw_out_of_order(const std::filesystem::path& path, std::uint64_t key);

/// The tables of several files of a kind, one after the other. \tparam Entry  of one brick, has `key`
template <class Entry>
class PackedTables {
 public:
  /// \throws InputError also when keys do not ascend over all files
  PackedTables(const std::vector<std::filesystem::path>& paths, const PackedKind& kind) {
    files_.reserve(paths.size());
    for (const auto& path : paths) {
      const std::size_t first = entries_.size();
      const PackedFile& file = files_.emplace_back(path, kind, sizeof(Entry));
      file.append_table(entries_);
      end_.push_back(entries_.size());
      for (std::size_t i = std::max<std::size_t>(1, first); i < entries_.size(); ++i)
        if (entries_[i - 1].key >= entries_[i].key) throw_out_of_order(path, entries_[i].key);
    }
  }
  const std::vector<Entry>& entries() const { return entries_; }
  const Entry& operator[](std::size_t entry) const { return entries_[entry]; }
  std::size_t file_count() const { return files_.size(); }
  std::size_t file_index(std::size_t entry) const {
    return static_cast<std::size_t>(std::upper_bound(end_.begin(), end_.end(), entry) - end_.begin());
  }
  const PackedFile& file_of(std::size_t entry) const { return files_[file_index(entry)]; }
  const PackedFile& file_of(const Entry& entry) const {
    return file_of(static_cast<std::size_t>(&entry - entries_.data()));
  }
  /// Entries [first, last) of a file.
  std::pair<std::size_t, std::size_t> file_range(std::size_t file) const {
    return {file == 0 ? 0 : end_[file - 1], end_[file]};
  }
  /// The entry of a brick, null without one.
  const Entry* find(std::uint64_t key) const {
    const auto it = std::lower_bound(entries_.begin(), entries_.end(), key,
                                     [](const Entry& e, std::uint64_t k) { return e.key < k; });
    return it == entries_.end() || it->key != key ? nullptr : &*it;
  }
  /// Its index, -1 without one.
  std::int64_t index_of(std::uint64_t key) const {
    const Entry* found = find(key);
    return found ? found - entries_.data() : -1;
  }

 private:
  std::vector<PackedFile> files_;
  std::vector<std::size_t> end_;
  std::vector<Entry> entries_;
};

}  // namespace tessera
