/// \file record_file.h
/// Plain records of one kind, one after the other and nothing else, as a task leaves them for the end of its stage. The
/// journal vouches for their bytes.
#pragma once
#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "stream/files/read_file.h"

namespace tessera {

/// Calls `use(std::span<const Record>)` for all records in order, at most `page` of them at a time, which is what it holds.
/// \throws InputError when the file cannot be read
template <class Record, class Use>
void for_each_page(const std::filesystem::path& path, std::size_t page, const Use& use) {
  const ReadFile file(path);
  std::vector<Record> records(page);
  for (std::uint64_t at = 0; at < file.size();) {
    const std::uint64_t bytes = std::min<std::uint64_t>(page * sizeof(Record), file.size() - at);
    file.read_at(at, records.data(), bytes);
    use(std::span<const Record>(records.data(), bytes / sizeof(Record)));
    at += bytes;
  }
}

}  // namespace tessera
