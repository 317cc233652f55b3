/// \file zip_archive.h
/// A ZIP archive as it is read: its list of entries, and each of them streamed. Stored and deflated ones, ZIP64 too; what is
/// encrypted or split over several files is refused. Source: PKWARE, "APPNOTE.TXT", 6.3.10.
#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "stream/files/read_file.h"

namespace tessera {

class ZipArchive {
 public:
  struct Entry {
    std::string name;
    std::uint64_t offset = 0;  ///< of its own header
    std::uint64_t packed = 0, bytes = 0;
    std::uint32_t crc = 0;
    std::uint16_t method = 0, flags = 0;
  };

  /// \param file  outlives the archive \throws InputError for what is no archive, or one that is cut off
  explicit ZipArchive(const ReadFile& file);

  /// By its name, whose letters may be of either case, with or without a slash before it; null where there is none.
  const Entry* find(std::string_view name) const;
  /// Hands the bytes on in order; `sink` returns false to stop. \throws InputError naming entry and what is wrong with it
  void read(const Entry& entry, const std::function<bool(std::string_view)>& sink) const;

 private:
  void read_list(std::uint64_t at, std::uint64_t bytes, std::uint64_t count);
  [[noreturn]] void fail(std::uint64_t at, const std::string& what) const;

  const ReadFile& file_;
  std::vector<Entry> entries_;
};

}  // namespace tessera
