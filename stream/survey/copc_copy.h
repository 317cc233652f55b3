/// \file copc_copy.h
/// The points of a LAS or LAZ file as COPC, with all that they say: records of old formats (0 to 3) become those of LAS 1.4 that COPC
/// asks for (6, 7), those of 6 to 8 stay to the byte. Variable length records go along, coordinate systems as WKT.
/// Source: LAS Specification 1.4 R15 (ASPRS); COPC 1.0 (Hobu).
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "stream/files/output_file.h"
#include "stream/formats/copc/copc_nodes.h"
#include "stream/formats/laz/schema.h"
#include "stream/formats/points/las_records.h"

namespace tessera {

/// A record of format 0 to 3 as one of 6 or 7: scan angles in steps of 0.006 degrees, flags and class apart. Bytes beyond the
/// format go along. \param to  of so many bytes as from takes, longer by what its new format is
void upgrade_las_record(const char* from, std::size_t from_bytes, int from_format, char* to);
/// 6 or 7 for 0 to 3, and 6, 7, 8 as they are; -1 for formats with waveforms.
int copc_point_format(int las_format);

class CopcCopy {
 public:
  /// \param threads  of the enclosing pool \pre `from` outlives it
  /// \throws UsageError as OutputFile, and for a source with waveforms or longer records than CopcNodes takes
  CopcCopy(const LasRecords& from, const std::filesystem::path& to);
  /// Records of the source's format, in any order.
  void append(const char* records, std::size_t count);
  /// Deals them to nodes, writes all, gives it its name. Returns the size of the file.
  std::uint64_t finish();
  /// Memory of one copy; what nodes take is told by those of plain scans.
  static std::uint64_t bytes(const LasRecords& from);

 private:
  void write_records();
  void append_record(std::string_view user, std::uint16_t id, std::string_view description,
                     std::string_view data);
  void write_nodes();
  void write_header();

  const LasRecords& from_;
  OutputFile file_;
  int format_;
  std::size_t record_bytes_;
  laz::Schema schema_;
  CopcNodes nodes_;
  std::string upgraded_;
  std::uint32_t records_ = 0;  ///< between header and points
  std::uint64_t begin_ = 0, hierarchy_at_ = 0;
  bool wkt_ = false;
  std::uint64_t points_ = 0;
  std::array<std::int32_t, 3> low_{}, high_{};
  std::array<std::uint64_t, 15> by_return_{};
  double first_time_ = 0.0, last_time_ = 0.0;
};

}  // namespace tessera
