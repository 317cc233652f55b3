/// \file las_copy.h
/// A LAS or LAZ file with all that another one has: header, variable length records, points in their order, what follows
/// them. Only records that the caller changed differ; LAZ made of LAS and the reverse differ by what says how points are
/// coded and where they end. The octree of COPC is left out, as it would not fit any more. Records may become longer by
/// numbers.
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "stream/files/output_file.h"
#include "stream/formats/laz/chunk_table.h"
#include "stream/formats/points/las_records.h"

namespace tessera {

class LasCopy {
 public:
  /// Writes what stands before the points. \param to  .las, or .laz for a compressed file
  /// \param threads  of the enclosing pool: so many chunks are compressed at a time
  /// \param scalars  of doubles that every record has at its end, in extra bytes; none = records are as long as those of `from`
  /// \pre  `from` outlives it  \throws UsageError as OutputFile, for another extension, for a source whose records are
  ///   longer than LAZ can have, and one that has extra bytes of such a name; ResourceError
  LasCopy(const LasRecords& from, const std::filesystem::path& to, int threads,
          std::vector<std::string> scalars = {});
  std::size_t record_bytes() const { return record_bytes_; }
  /// Records, in the order of the source.
  void append(const char* records, std::size_t count);
  /// What follows the points, then the final name. Returns the size of the file. \pre  all records were appended
  std::uint64_t finish();

  /// \throws UsageError for an extension that is none of theirs
  static bool is_compressed(const std::filesystem::path& to);
  /// Memory of one copy on so many threads, with up to so many scalars.
  static std::uint64_t bytes(const LasRecords& from, bool compressed, int threads, std::size_t scalars = 1);

 private:
  struct Segment {
    std::uint64_t begin = 0, end = 0;
  };
  void copy(const ReadFile& file, Segment bytes);
  void write_head(const ReadFile& file);
  bool is_left_out(const char* record) const;
  std::string extra_descriptions(const ReadFile& file) const;
  std::vector<Segment> kept_records(const ReadFile& file, std::uint32_t& count) const;
  std::vector<Segment> kept_extended(const ReadFile& file, std::uint32_t& count) const;
  void append_record(std::string_view user, std::uint16_t id, std::string_view data);
  void compress();

  const LasRecords& from_;
  std::vector<std::string> scalars_;
  std::size_t record_bytes_;
  bool compressed_;
  bool verbatim_;  ///< neither is compressed: all but the records as it is
  OutputFile file_;
  laz::Schema schema_;
  std::string pending_;  ///< records not yet compressed
  std::vector<laz::ChunkSize> table_;
  std::uint64_t begin_ = 0;  ///< of the points
  std::size_t group_ = 1;    ///< chunks compressed at a time
};

}  // namespace tessera
