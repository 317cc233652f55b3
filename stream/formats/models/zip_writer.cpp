#include "stream/formats/models/zip_writer.h"

#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <new>

namespace tessera {
namespace {

constexpr int kPackingLevel = 3;                   // of XML: 4 would take half as long again for 4 % less
constexpr std::uint16_t kNoTime = 0, kDay = 0x21;  // 1980-01-01, the first that ZIP knows
constexpr std::uint16_t kUtf8 = 0x0800, kDeflated = 8, kZip64 = 1;
constexpr std::uint16_t kPadding = 0xa220;  // extra field that Open Packaging keeps for growth
constexpr std::size_t kExtraBytes = 20, kPackBuffer = std::size_t{1} << 16;
constexpr std::uint64_t kNarrow = 0xffffffffULL;  // stands where the extra field has the number

/// Numbers one behind the other, little endian.
class ZipRecord {
 public:
  ZipRecord& u16(std::uint64_t value) { return put(value, 2); }
  ZipRecord& u32(std::uint64_t value) { return put(value, 4); }
  ZipRecord& u64(std::uint64_t value) { return put(value, 8); }
  const std::string& bytes() const { return bytes_; }

 private:
  ZipRecord& put(std::uint64_t value, int count) {
    for (int k = 0; k < count; ++k) bytes_.push_back(static_cast<char>(value >> (8 * k) & 255u));
    return *this;
  }
  std::string bytes_;
};

/// Version to the sizes of an entry, as both its header and the list have it.
void put_common(ZipRecord& r, std::uint32_t crc, std::uint64_t packed, std::uint64_t bytes, bool large) {
  r.u16(large ? 45 : 20).u16(kUtf8).u16(kDeflated).u16(kNoTime).u16(kDay).u32(crc);
  r.u32(large ? kNarrow : packed).u32(large ? kNarrow : bytes);
}

}  // namespace

struct ZipWriter::Deflate {
  z_stream stream{};
  std::uint32_t crc = 0;
  std::uint64_t bytes = 0;
  char buffer[kPackBuffer];

  Deflate() {
    // A negative window is a raw stream, without zlib's own header.
    if (deflateInit2(&stream, kPackingLevel, Z_DEFLATED, -MAX_WBITS, 8, Z_DEFAULT_STRATEGY) != Z_OK)
      throw std::bad_alloc();
  }
  ~Deflate() { deflateEnd(&stream); }
};

ZipWriter::ZipWriter(OutputFile& file) : file_(file), deflate_(std::make_unique<Deflate>()) {}
ZipWriter::~ZipWriter() = default;

void ZipWriter::begin(const std::string& name) {
  deflateReset(&deflate_->stream);
  deflate_->crc = static_cast<std::uint32_t>(crc32(0, nullptr, 0));
  deflate_->bytes = 0;
  entries_.push_back({name, file_.size(), 0, 0, 0});
  // The sizes follow in end(): room is kept for what their numbers may need.
  ZipRecord r;
  r.u32(0x04034b50);
  put_common(r, 0, 0, 0, false);
  r.u16(name.size()).u16(kExtraBytes);
  file_.append(r.bytes());
  file_.append(name);
  file_.append(std::string(kExtraBytes, '\0'));
  data_ = file_.size();
}

void ZipWriter::pack(std::string_view bytes, bool last) {
  z_stream& z = deflate_->stream;
  z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  z.avail_in = static_cast<uInt>(bytes.size());
  int state = Z_OK;
  do {
    z.next_out = reinterpret_cast<Bytef*>(deflate_->buffer);
    z.avail_out = kPackBuffer;
    state = deflate(&z, last ? Z_FINISH : Z_NO_FLUSH);
    file_.append(deflate_->buffer, kPackBuffer - z.avail_out);
  } while (z.avail_out == 0 || (last && state != Z_STREAM_END));
}

void ZipWriter::append(std::string_view bytes) {
  constexpr std::size_t kStep = std::size_t{1} << 20;
  for (; !bytes.empty(); bytes.remove_prefix(std::min(kStep, bytes.size()))) {
    const std::string_view step = bytes.substr(0, kStep);
    deflate_->crc = static_cast<std::uint32_t>(
        crc32(deflate_->crc, reinterpret_cast<const Bytef*>(step.data()), static_cast<uInt>(step.size())));
    deflate_->bytes += step.size();
    pack(step, false);
  }
}

void ZipWriter::end() {
  pack({}, true);
  Entry& e = entries_.back();
  e.bytes = deflate_->bytes;
  e.packed = file_.size() - data_;
  e.crc = deflate_->crc;
  ZipRecord head;
  put_common(head, e.crc, e.packed, e.bytes, e.large());
  file_.patch(e.offset + 4, head.bytes().data(), head.bytes().size());
  ZipRecord extra;
  if (e.large())
    extra.u16(kZip64).u16(16).u64(e.bytes).u64(e.packed);
  else
    extra.u16(kPadding).u16(16).u16(0xa028).u16(0).u32(0).u64(0);
  file_.patch(data_ - kExtraBytes, extra.bytes().data(), extra.bytes().size());
}

void ZipWriter::entry(const std::string& name, std::string_view bytes) {
  begin(name);
  append(bytes);
  end();
}

void ZipWriter::finish() {
  const std::uint64_t list = file_.size();
  for (const Entry& e : entries_) {
    const bool far = e.offset >= kNarrow;
    ZipRecord extra;
    if (e.large() || far) extra.u16(kZip64).u16((e.large() ? 16u : 0u) + (far ? 8u : 0u));
    if (e.large()) extra.u64(e.bytes).u64(e.packed);
    if (far) extra.u64(e.offset);
    ZipRecord r;
    r.u32(0x02014b50).u16(45);
    put_common(r, e.crc, e.packed, e.bytes, e.large());
    r.u16(e.name.size()).u16(extra.bytes().size()).u16(0).u16(0).u16(0).u32(0);
    r.u32(far ? kNarrow : e.offset);
    file_.append(r.bytes());
    file_.append(e.name);
    file_.append(extra.bytes());
  }
  const std::uint64_t bytes = file_.size() - list, end = file_.size();
  ZipRecord r;
  if (list >= kNarrow || bytes >= kNarrow) {
    r.u32(0x06064b50).u64(44).u16(45).u16(45).u32(0).u32(0);
    r.u64(entries_.size()).u64(entries_.size()).u64(bytes).u64(list);
    r.u32(0x07064b50).u32(0).u64(end).u32(1);
  }
  r.u32(0x06054b50).u16(0).u16(0).u16(entries_.size()).u16(entries_.size());
  r.u32(std::min(bytes, kNarrow)).u32(std::min(list, kNarrow)).u16(0);
  file_.append(r.bytes());
}

}  // namespace tessera
