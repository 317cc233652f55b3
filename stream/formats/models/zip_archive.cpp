#include "stream/formats/models/zip_archive.h"

#include <zlib.h>

#include <algorithm>
#include <memory>
#include <new>

#include "octree/error.h"
#include "stream/formats/byte_window.h"
#include "stream/formats/scalar.h"

namespace tessera {
namespace {

constexpr std::uint64_t kEndBytes = 22, kLongestComment = 65535, kWide = 0xffffffffULL;
constexpr std::uint64_t kEntryBytes = 46, kHeaderBytes = 30;
constexpr std::uint64_t kMostEntries = std::uint64_t{1} << 20, kMostListBytes = std::uint64_t{256} << 20;

std::uint64_t u16(const char* p) {
  return load_scalar<std::uint16_t>(p);
}
std::uint64_t u32(const char* p) {
  return load_scalar<std::uint32_t>(p);
}
std::uint64_t u64(const char* p) {
  return load_scalar<std::uint64_t>(p);
}

bool same_name(std::string_view a, std::string_view b) {
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  if (a.starts_with('/')) a.remove_prefix(1);
  if (b.starts_with('/')) b.remove_prefix(1);
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [&](char x, char y) { return lower(x) == lower(y); });
}

/// zlib's state for one raw stream.
struct Inflate {
  z_stream stream{};
  Inflate() {
    if (inflateInit2(&stream, -MAX_WBITS) != Z_OK) throw std::bad_alloc();
  }
  ~Inflate() { inflateEnd(&stream); }
  Inflate(const Inflate&) = delete;
  Inflate& operator=(const Inflate&) = delete;
};

}  // namespace

void ZipArchive::fail(std::uint64_t at, const std::string& what) const {
  throw InputError(file_.path().string() + ": byte " + std::to_string(at) + ": " + what);
}

ZipArchive::ZipArchive(const ReadFile& file) : file_(file) {
  const std::uint64_t size = file.size();
  const std::uint64_t tail_bytes = std::min(size, kEndBytes + kLongestComment);
  std::string tail(static_cast<std::size_t>(tail_bytes), '\0');
  file.read_at(size - tail_bytes, tail.data(), tail.size());
  std::size_t at = tail.rfind("PK\x05\x06");
  while (at != std::string::npos && at + kEndBytes > tail.size())
    at = at == 0 ? std::string::npos : tail.rfind("PK\x05\x06", at - 1);
  if (at == std::string::npos)
    fail(size, "the list of a ZIP archive's entries is missing at its end; it is cut off or no archive");
  const char* const end = tail.data() + at;
  std::uint64_t count = u16(end + 10), bytes = u32(end + 12), list = u32(end + 16);
  constexpr std::uint64_t kLocatorBytes = 20, kWideEndBytes = 56;
  if (at >= kLocatorBytes && tail.compare(at - kLocatorBytes, 4, "PK\x06\x07", 4) == 0) {
    const std::uint64_t wide = u64(end - kLocatorBytes + 8);
    char record[kWideEndBytes];
    if (wide > size || size - wide < sizeof record)
      fail(size - tail_bytes + at, "the ZIP64 record lies beyond the file");
    file.read_at(wide, record, sizeof record);
    if (std::string_view(record, 4) != "PK\x06\x06") fail(wide, "no ZIP64 record stands where it should");
    count = u64(record + 32), bytes = u64(record + 40), list = u64(record + 48);
  }
  if (list > size || bytes > size - list)
    fail(size - tail_bytes + at, "the list of entries lies beyond the file");
  if (count > kMostEntries || bytes > kMostListBytes)
    fail(list, "an archive of " + std::to_string(count) + " entries, more than Tessera reads");
  read_list(list, bytes, count);
}

void ZipArchive::read_list(std::uint64_t at, std::uint64_t bytes, std::uint64_t count) {
  ByteWindow window(file_, at, at + bytes, std::size_t{1} << 18);
  for (std::uint64_t i = 0; i < count; ++i) {
    if (window.remaining() < kEntryBytes) fail(window.offset(), "the list of entries ends too early");
    const std::uint64_t begin = window.offset();
    const std::string_view head = window.peek(kEntryBytes);
    if (!head.starts_with("PK\x01\x02")) fail(begin, "no entry stands where the list should have one");
    const std::uint64_t name = u16(head.data() + 28), extra = u16(head.data() + 30),
                        comment = u16(head.data() + 32);
    const std::uint64_t all = kEntryBytes + name + extra + comment;
    if (window.remaining() < all) fail(begin, "the list of entries ends too early");
    const char* const p = window.peek(static_cast<std::size_t>(all)).data();
    Entry e;
    e.flags = static_cast<std::uint16_t>(u16(p + 8)), e.method = static_cast<std::uint16_t>(u16(p + 10));
    e.crc = static_cast<std::uint32_t>(u32(p + 16));
    e.packed = u32(p + 20), e.bytes = u32(p + 24), e.offset = u32(p + 42);
    e.name.assign(p + kEntryBytes, static_cast<std::size_t>(name));
    const char* field = p + kEntryBytes + name;
    for (std::uint64_t left = extra; left >= 4;) {
      const std::uint64_t n = std::min(u16(field + 2), left - 4);
      if (u16(field) == 1) {  // ZIP64: what did not fit above, in this order
        const char *value = field + 4, *const stop = value + n;
        for (std::uint64_t* number : {&e.bytes, &e.packed, &e.offset})
          if (*number == kWide && stop - value >= 8) *number = u64(value), value += 8;
      }
      field += 4 + n, left -= 4 + n;
    }
    if (e.offset > file_.size() || file_.size() - e.offset < kHeaderBytes || e.packed > file_.size())
      fail(begin, "an entry lies beyond the file, which is cut off or damaged");
    entries_.push_back(std::move(e));
    window.skip(all);
  }
}

const ZipArchive::Entry* ZipArchive::find(std::string_view name) const {
  for (const Entry& e : entries_)
    if (same_name(e.name, name)) return &e;
  return nullptr;
}

void ZipArchive::read(const Entry& entry, const std::function<bool(std::string_view)>& sink) const {
  const std::string who = "entry '" + entry.name.substr(0, 80) + "' ";
  if ((entry.flags & 1u) != 0) fail(entry.offset, who + "is encrypted, which Tessera does not read");
  if (entry.method != 0 && entry.method != 8)
    fail(entry.offset,
         who + "is packed by method " + std::to_string(entry.method) + "; only deflate is read");
  char head[kHeaderBytes];
  file_.read_at(entry.offset, head, sizeof head);
  if (std::string_view(head, 4) != "PK\x03\x04")
    fail(entry.offset, who + "does not begin where the list says");
  const std::uint64_t begin = entry.offset + kHeaderBytes + u16(head + 26) + u16(head + 28);
  if (begin > file_.size() || entry.packed > file_.size() - begin)
    fail(entry.offset, who + "lies beyond the file");
  ByteWindow window(file_, begin, begin + entry.packed, std::size_t{1} << 18, true);
  auto crc = static_cast<std::uint32_t>(crc32(0, nullptr, 0));
  std::uint64_t bytes = 0;
  const auto hand_on = [&](std::string_view piece) {
    crc = static_cast<std::uint32_t>(
        crc32(crc, reinterpret_cast<const Bytef*>(piece.data()), static_cast<uInt>(piece.size())));
    bytes += piece.size();
    return sink(piece);
  };
  if (entry.method == 0) {
    while (window.remaining() > 0) {
      const std::string_view piece = window.peek(1);
      if (!hand_on(piece)) return;
      window.skip(piece.size());
    }
  } else {
    Inflate unpacked;
    z_stream& z = unpacked.stream;
    const auto buffer = std::make_unique<char[]>(std::size_t{1} << 16);
    for (int state = Z_OK; state != Z_STREAM_END;) {
      const std::string_view piece = window.peek(1);
      z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(piece.data()));
      z.avail_in = static_cast<uInt>(piece.size());
      z.next_out = reinterpret_cast<Bytef*>(buffer.get());
      z.avail_out = 1u << 16;
      state = inflate(&z, Z_NO_FLUSH);
      const std::size_t made = (std::size_t{1} << 16) - z.avail_out;
      const std::size_t taken = piece.size() - z.avail_in;
      if (state != Z_OK && state != Z_STREAM_END && state != Z_BUF_ERROR)
        fail(window.offset(), who + "is damaged: its packed bytes make no sense");
      if (made == 0 && taken == 0 && state != Z_STREAM_END) fail(window.offset(), who + "is cut off");
      window.skip(taken);
      if (made > 0 && !hand_on({buffer.get(), made})) return;
    }
  }
#ifdef FUZZING_BUILD_MODE_UNSAFE_FOR_PRODUCTION
  crc = entry.crc;  // so that damage gets past it
#endif
  if (bytes != entry.bytes || crc != entry.crc)
    fail(begin, who + "is damaged: its checksum or size is not what the list says");
}

}  // namespace tessera
