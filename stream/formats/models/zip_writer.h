/// \file zip_writer.h
/// A ZIP archive into a file, entry after entry, each deflated as it comes. Of any size (ZIP64 where 4 GiB are passed), without
/// dates, so that equal entries have equal bytes. Source: PKWARE, "APPNOTE.TXT", 6.3.10.
#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "stream/files/output_file.h"

namespace tessera {

class ZipWriter {
 public:
  /// \pre  nothing was written to `file`, which outlives the writer
  explicit ZipWriter(OutputFile& file);
  ~ZipWriter();
  ZipWriter(const ZipWriter&) = delete;
  ZipWriter& operator=(const ZipWriter&) = delete;

  /// \pre  no entry is open \param name  slashes between folders, UTF-8
  void begin(const std::string& name);
  void append(std::string_view bytes);
  void end();
  /// begin(), append(), end().
  void entry(const std::string& name, std::string_view bytes);
  /// The list of entries, which makes the file an archive.
  void finish();

 private:
  struct Entry {
    std::string name;
    std::uint64_t offset = 0, bytes = 0, packed = 0;
    std::uint32_t crc = 0;
    bool large() const { return bytes >= 0xffffffffULL || packed >= 0xffffffffULL; }
  };
  struct Deflate;  ///< zlib's state

  void pack(std::string_view bytes, bool last);

  OutputFile& file_;
  std::unique_ptr<Deflate> deflate_;
  std::vector<Entry> entries_;
  std::uint64_t data_ = 0;  ///< offset of the open entry's bytes
};

}  // namespace tessera
