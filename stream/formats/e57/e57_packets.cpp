#include "stream/formats/e57/e57_packets.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "stream/formats/scalar.h"

namespace tessera {

namespace {

constexpr std::size_t kSectionHeader = 32;
constexpr std::size_t kPacketHeader = 4;  ///< type, flags, length - 1
constexpr std::size_t kDataHeader = 6;    ///< and the number of bytestreams; the length of each piece follows
enum PacketType : std::uint8_t { kIndex, kData, kEmpty };

struct PacketHead {
  std::uint64_t bytes = 0;  ///< the whole packet
  bool data = false;
};

/// \pre kDataHeader bytes are there
PacketHead read_head(E57Pages& pages, std::uint64_t at, std::uint32_t streams) {
  const std::string_view head = pages.view(at, kDataHeader);
  const auto type = static_cast<std::uint8_t>(head[0]);
  PacketHead packet{std::uint64_t{load_scalar<std::uint16_t>(head.data() + 2)} + 1, type == kData};
  if (type > kEmpty) pages.fail(at, "a packet of type " + std::to_string(type) + ", which E57 does not have");
  if (packet.bytes < kPacketHeader) {
    pages.fail(at, "a packet of " + std::to_string(packet.bytes) + " bytes is shorter than its own header");
  }
  if (!packet.data) return packet;
  const auto count = load_scalar<std::uint16_t>(head.data() + 4);
  if (count != streams) {
    pages.fail(at, "a packet with " + std::to_string(count) + " bytestreams, the XML section declares " +
                       std::to_string(streams));
  }
  if (kDataHeader + 2 * std::uint64_t{count} > packet.bytes) {
    pages.fail(at, "a packet of " + std::to_string(packet.bytes) + " bytes is too short for its " +
                       std::to_string(count) + " bytestreams");
  }
  return packet;
}

std::uint64_t piece_bytes(const char* packet, std::uint32_t stream) {
  return load_scalar<std::uint16_t>(packet + kDataHeader + 2 * std::size_t{stream});
}

/// Bytes that the pieces of a data packet have together, with what stands before them.
std::uint64_t filled_bytes(const char* packet, std::uint32_t streams) {
  std::uint64_t sum = kDataHeader + 2 * std::uint64_t{streams};
  for (std::uint32_t s = 0; s < streams; ++s) sum += piece_bytes(packet, s);
  return sum;
}

[[noreturn]] void fail_overfull(const E57Pages& pages, std::uint64_t at) {
  pages.fail(at, "a packet whose bytestreams are longer than it is");
}

}  // namespace

E57Section::E57Section(E57Pages& pages, std::uint64_t physical, std::uint32_t streams,
                       std::vector<E57Column> columns, std::uint64_t declared, std::uint64_t spacing)
    : streams_(streams), columns_(std::move(columns)) {
  records_ = std::min(declared, pages.bytes());
  if (columns_.empty()) return;  // all values are constants: nothing is stored
  const std::uint64_t begin = pages.logical(physical, "a section of records");
  if (kSectionHeader > pages.bytes() - begin) {
    records_ = 0;  // cut off
    return;
  }
  const std::string_view head = pages.view(begin, kSectionHeader);
  const auto kind = static_cast<std::uint8_t>(head[0]);
  if (kind != 1) pages.fail(begin, "a section of records is to start with 1, not " + std::to_string(kind));
  const auto bytes = load_scalar<std::uint64_t>(head.data() + 8);
  const auto data = load_scalar<std::uint64_t>(head.data() + 16);
  const std::uint64_t end = begin + std::min(bytes, pages.bytes() - begin);
  std::vector<std::uint64_t> have(columns_.size(), 0);
  const auto complete = [&] {
    std::uint64_t n = ~std::uint64_t{0};
    for (std::size_t c = 0; c < columns_.size(); ++c) n = std::min(n, have[c] * 8 / columns_[c].bits);
    records_ = std::min(declared, n);
    return records_ == declared;
  };
  std::uint64_t at = pages.logical(data, "the first packet of a section");
  if (at < begin) pages.fail(begin, "a section of records whose packets are to start before it");
  for (std::uint64_t marked = 0; !complete() && end - std::min(at, end) >= kDataHeader;) {
    const PacketHead packet = read_head(pages, at, streams_);
    if (packet.bytes > end - at) break;  // torn
    if (packet.data) {
      if (marks_.empty() || at - marked >= spacing) {
        marks_.push_back(at);
        marks_.insert(marks_.end(), have.begin(), have.end());
        marked = at;
      }
      const char* pieces = pages.view(at, kDataHeader + 2 * std::size_t{streams_}).data();
      if (filled_bytes(pieces, streams_) > packet.bytes) fail_overfull(pages, at);
      for (std::size_t c = 0; c < columns_.size(); ++c) have[c] += piece_bytes(pieces, columns_[c].stream);
    }
    at += packet.bytes;
  }
}

E57Section::Position E57Section::find(std::size_t column, std::uint64_t at) const {
  const std::size_t step = 1 + columns_.size();
  std::size_t low = 0;
  std::size_t high = marks_.size() / step;
  while (high - low > 1) {
    const std::size_t middle = low + (high - low) / 2;
    (marks_[middle * step + 1 + column] <= at ? low : high) = middle;
  }
  return {marks_[low * step], marks_[low * step + 1 + column]};
}

std::string_view E57Packets::Packet::piece(std::uint32_t stream) const {
  const std::uint64_t begin = filled_bytes(bytes.data(), stream);
  // What stands before the pieces has an entry for every stream, not for those up to this one alone.
  const auto streams = load_scalar<std::uint16_t>(bytes.data() + 4);
  return {bytes.data() + begin + 2 * std::size_t{streams - stream}, piece_bytes(bytes.data(), stream)};
}

const E57Packets::Packet& E57Packets::get(std::uint64_t at) {
  Packet* oldest = &cache_[0];
  for (Packet& p : cache_) {
    if (p.at == at) {
      p.used = ++clock_;
      return p;
    }
    if (p.used < oldest->used) oldest = &p;
  }
  oldest->at = ~std::uint64_t{0};  // nothing, should a read below fail
  const PacketHead head = read_head(pages_, at, streams_);
  const std::string_view bytes = pages_.view(at, static_cast<std::size_t>(head.bytes));
  if (head.data && filled_bytes(bytes.data(), streams_) > head.bytes) fail_overfull(pages_, at);
  oldest->bytes.assign(bytes.begin(), bytes.end());
  oldest->data = head.data;
  oldest->next = at + head.bytes;
  oldest->at = at;
  oldest->used = ++clock_;
  return *oldest;
}

void E57Cursor::read(E57Packets& packets, std::uint64_t at, char* to, std::size_t bytes) {
  while (bytes > 0) {
    const E57Packets::Packet& packet = packets.get(position_.packet);
    const std::string_view piece = packet.data ? packet.piece(stream_) : std::string_view();
    if (at >= position_.before + piece.size()) {
      position_ = {packet.next, position_.before + piece.size()};
      continue;
    }
    const std::string_view rest = piece.substr(static_cast<std::size_t>(at - position_.before));
    const std::size_t n = std::min(bytes, rest.size());
    std::memcpy(to, rest.data(), n);
    to += n;
    bytes -= n;
    at += n;
  }
}

}  // namespace tessera
