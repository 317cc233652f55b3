/// \file e57_packets.h
/// The records of a scan: a section of packets, in each a piece of every bytestream. Pieces of one packet need not hold
/// the same records, values may begin in one packet and end in the next, so every stream is followed on its own.
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "stream/formats/e57/e57_pages.h"

namespace tessera {

/// A bytestream that is wanted.
struct E57Column {
  std::uint32_t stream = 0;
  unsigned bits = 0;  ///< of a value, > 0
};

/// Where the packets of a section are, found by one pass over their headers; marks at even distances let reading start
/// at any record. Memory: 8 bytes a stream and mark.
class E57Section {
 public:
  /// \param physical  of the section, as the XML says  \param streams  bytestreams that the prototype has
  /// \param declared  records; the pass ends where the columns hold so many
  /// \param spacing   bytes between marks
  /// \throws InputError naming the byte: no section of records there, a packet of unknown type, with another number of
  ///   bytestreams, or shorter than these; a wrong checksum. A section that ends early is no error
  E57Section(E57Pages& pages, std::uint64_t physical, std::uint32_t streams, std::vector<E57Column> columns,
             std::uint64_t declared, std::uint64_t spacing);

  /// Records that all columns hold, at most `declared`. Without columns: no more than the file has bytes.
  std::uint64_t records() const { return records_; }
  std::span<const E57Column> columns() const { return columns_; }
  std::uint32_t streams() const { return streams_; }

  /// A packet and the bytes that a column has before it.
  struct Position {
    std::uint64_t packet = 0;
    std::uint64_t before = 0;
  };
  /// The last mark before byte `at` of a column.
  Position find(std::size_t column, std::uint64_t at) const;

 private:
  std::uint32_t streams_;
  std::vector<E57Column> columns_;
  std::uint64_t records_ = 0;
  std::vector<std::uint64_t> marks_;  ///< per mark: the packet, then per column the bytes before it
};

/// The last packets used, so that streams a few packets apart share them.
class E57Packets {
 public:
  /// \param streams  bytestreams that every data packet must have
  E57Packets(E57Pages& pages, std::uint32_t streams) : pages_(pages), streams_(streams) {}

  struct Packet {
    std::uint64_t at = ~std::uint64_t{0};  ///< logical
    std::uint64_t next = 0;                ///< the packet after it
    std::uint64_t used = 0;                ///< larger = later
    bool data = false;                     ///< else it has nothing for anybody
    std::vector<char> bytes;
    /// Its piece of a stream. \pre data
    std::string_view piece(std::uint32_t stream) const;
  };
  /// \throws InputError as E57Section
  const Packet& get(std::uint64_t at);

 private:
  E57Pages& pages_;
  std::uint32_t streams_;
  std::uint64_t clock_ = 0;
  std::array<Packet, 4> cache_;
};

/// One column, read forward.
class E57Cursor {
 public:
  /// \param at  first byte of the column that will be read
  E57Cursor(const E57Section& section, std::size_t column, std::uint64_t at)
      : stream_(section.columns()[column].stream), position_(section.find(column, at)) {}
  /// Bytes [at, at + bytes) of the column.
  /// \pre the section has so many; `at` is where the last call ended, or a byte before: two values may share one
  void read(E57Packets& packets, std::uint64_t at, char* to, std::size_t bytes);

 private:
  std::uint32_t stream_;
  E57Section::Position position_;  ///< where the last byte came from
};

}  // namespace tessera
