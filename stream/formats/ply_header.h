/// \file ply_header.h
/// The header of a PLY file, of points or meshes, and the way past elements that nobody asked for.
/// Counts are claims of the file: never allocate by them, never trust that so many elements follow.
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "stream/files/read_file.h"
#include "stream/formats/byte_window.h"
#include "stream/formats/scalar.h"

namespace tessera {

enum class PlyEncoding { kAscii, kLittleEndian, kBigEndian };

struct PlyProperty {
  std::string name;
  ScalarType type = ScalarType::kFloat32;  ///< of the value, or of the list's items
  bool list = false;
  ScalarType count_type = ScalarType::kUint8;  ///< lists only; never a float type
};

struct PlyElement {
  std::string name;
  std::uint64_t count = 0;
  std::vector<PlyProperty> properties;

  bool has_list() const;
  /// Bytes of one binary element. \pre !has_list()
  std::size_t stride() const;
  /// Index of the property, or -1.
  int find(std::string_view property) const;
  /// Byte offset of a property in one binary element. \pre no list before it
  std::size_t offset(std::size_t property) const;
};

struct PlyHeader {
  PlyEncoding encoding = PlyEncoding::kAscii;
  std::vector<PlyElement> elements;
  std::vector<std::string> comments;  ///< `comment` lines, without the keyword
  std::vector<std::string> obj_info;  ///< `obj_info` lines, without the keyword
  std::vector<std::string> warnings;  ///< what was tolerated, one sentence each
  std::uint64_t data_begin = 0;       ///< byte offset of the first element
  std::uint64_t lines = 0;            ///< lines of the header, for messages about ascii data
  char line_end = '\n';  ///< last byte of a line: '\n', or '\r' in files of old Macintosh programs

  bool big_endian() const { return encoding == PlyEncoding::kBigEndian; }
  /// Index of the element, or -1.
  int find(std::string_view element) const;
  /// "ascii", "binary little endian" or "binary big endian".
  std::string encoding_name() const;
};

/// Reads the header. Lines may end in LF, CRLF or CR; blank lines are skipped. A line of prose, which only lacks its
/// keyword `comment`, is taken for one, with a warning: no word of it means anything here, nor nearly does the first.
/// \throws InputError naming file, line and what is wrong: no PLY, no end_header within 4 MiB, an unknown type,
///   encoding or keyword, a count that is no number, a property before any element, a repeated property
PlyHeader read_ply_header(const ReadFile& file);

/// What is said of ascii lines that hold more values than the header declares. \pre lines > 0
std::string surplus_sentence(std::uint64_t lines);

/// Moves past up to `count` binary elements. Returns how many were complete; fewer when the file ends early.
/// Elements without lists are skipped without being read.
std::uint64_t skip_ply_elements(const PlyElement& element, bool big_endian, std::uint64_t count,
                                ByteWindow& window);

}  // namespace tessera
