#include "stream/files/unpacked_bytes.h"

#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cstring>
#include <new>
#include <stdexcept>
#include <string>

#include "octree/error.h"

namespace tessera {

namespace {

constexpr std::size_t kPacked = std::size_t{1} << 16;
constexpr int kWindowLog = 23;  ///< the 8 MiB that every zstd decoder must have

class GzipDecoder final : public UnpackedBytes::Decoder {
 public:
  GzipDecoder() {
    if (::inflateInit2(&stream_, 16 + MAX_WBITS) != Z_OK) throw std::bad_alloc();  // 16: with gzip's header
  }
  ~GzipDecoder() override { ::inflateEnd(&stream_); }
  GzipDecoder(const GzipDecoder&) = delete;
  GzipDecoder& operator=(const GzipDecoder&) = delete;

  bool decode(std::string_view& in, std::vector<char>& out, std::size_t limit) override {
    if (ended_) ::inflateReset(&stream_);
    const std::size_t had = out.size();
    out.resize(limit);
    stream_.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(in.data()));
    stream_.avail_in = static_cast<uInt>(in.size());
    stream_.next_out = reinterpret_cast<Bytef*>(out.data() + had);
    stream_.avail_out = static_cast<uInt>(limit - had);
    const int status = ::inflate(&stream_, Z_NO_FLUSH);
    in.remove_prefix(in.size() - stream_.avail_in);
    out.resize(limit - stream_.avail_out);
    if (status == Z_MEM_ERROR) throw std::bad_alloc();
    if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR)
      throw std::runtime_error(stream_.msg ? stream_.msg : "no gzip data");
    ended_ = status == Z_STREAM_END;
    return ended_;
  }

 private:
  z_stream stream_{};
  bool ended_ = false;
};

class ZstdDecoder final : public UnpackedBytes::Decoder {
 public:
  ZstdDecoder() : stream_(::ZSTD_createDStream()) {
    if (!stream_) throw std::bad_alloc();
    ::ZSTD_DCtx_setParameter(stream_.get(), ZSTD_d_windowLogMax, kWindowLog);
  }

  bool decode(std::string_view& in, std::vector<char>& out, std::size_t limit) override {
    const std::size_t had = out.size();
    out.resize(limit);
    ZSTD_inBuffer from{in.data(), in.size(), 0};
    ZSTD_outBuffer to{out.data() + had, limit - had, 0};
    const std::size_t status = ::ZSTD_decompressStream(stream_.get(), &to, &from);
    in.remove_prefix(from.pos);
    out.resize(had + to.pos);
    if (::ZSTD_isError(status) != 0) throw std::runtime_error(::ZSTD_getErrorName(status));
    return status == 0;
  }

 private:
  struct Free {
    void operator()(ZSTD_DStream* s) const { ::ZSTD_freeDStream(s); }
  };
  std::unique_ptr<ZSTD_DStream, Free> stream_;
};

/// Text in UTF-16 after its byte order mark, as UTF-8; what is no character becomes U+FFFD. Source: RFC 2781, RFC 3629.
class Utf16Decoder final : public UnpackedBytes::Decoder {
 public:
  bool decode(std::string_view& in, std::vector<char>& out, std::size_t limit) override {
    for (;;) {
      for (; !ready_.empty(); ready_.remove_prefix(1)) {
        if (out.size() == limit) return false;
        out.push_back(ready_.front());
      }
      if (in.empty()) return !half_ && high_ == 0;
      take(static_cast<unsigned char>(in.front()));
      in.remove_prefix(1);
    }
  }

 private:
  void take(std::uint32_t byte) {
    half_ = !half_;
    if (half_) {
      first_ = byte;
      return;
    }
    if (!marked_) {
      marked_ = true;
      big_endian_ = first_ == 0xfe;
      return;
    }
    const std::uint32_t unit = big_endian_ ? first_ << 8 | byte : byte << 8 | first_;
    const bool low = unit >= 0xdc00 && unit < 0xe000;
    if (high_ != 0 && low) {
      encode(0x10000 + ((high_ - 0xd800) << 10) + (unit - 0xdc00));
      high_ = 0;
      return;
    }
    std::size_t bytes = 0;
    if (high_ != 0) bytes = append(kUnknown, 0);
    high_ = unit >= 0xd800 && unit < 0xdc00 ? unit : 0;
    if (high_ == 0) bytes = append(low ? kUnknown : unit, bytes);
    ready_ = {bytes_, bytes};
  }
  void encode(std::uint32_t c) { ready_ = {bytes_, append(c, 0)}; }
  /// Writes a character behind the `at` bytes that are there; returns how many there are then.
  std::size_t append(std::uint32_t c, std::size_t at) {
    const int more = c < 0x80 ? 0 : c < 0x800 ? 1 : c < 0x10000 ? 2 : 3;
    constexpr unsigned char kLead[] = {0x00, 0xc0, 0xe0, 0xf0};
    bytes_[at++] = static_cast<char>(kLead[more] | c >> (6 * more));
    for (int k = more - 1; k >= 0; --k) bytes_[at++] = static_cast<char>(0x80 | (c >> (6 * k) & 0x3f));
    return at;
  }

  static constexpr std::uint32_t kUnknown = 0xfffd;
  bool marked_ = false, big_endian_ = false, half_ = false;
  std::uint32_t first_ = 0;  ///< of the two bytes of a unit
  std::uint32_t high_ = 0;   ///< a surrogate that waits for the low one
  char bytes_[8] = {};
  std::string_view ready_;  ///< of bytes_, not yet handed out
};

}  // namespace

std::string_view packed_format(std::string_view head) {
  if (head.substr(0, 3) == "\x1f\x8b\x08") return "gzip";
  if (head.substr(0, 4) == "\x28\xb5\x2f\xfd") return "zstd";
  const std::string_view mark = head.substr(0, 2);
  if (mark == "\xfe\xff" || (mark == "\xff\xfe" && head.substr(2, 2) != std::string_view("\0\0", 2)))
    return "UTF-16";
  return {};
}

UnpackedBytes::UnpackedBytes(const std::filesystem::path& path) : file_(path) {
  char head[4] = {};
  const std::uint64_t there = std::min<std::uint64_t>(file_.size(), sizeof head);
  file_.read_at(0, head, there);
  format_ = packed_format({head, static_cast<std::size_t>(there)});
  if (format_.empty()) throw InputError(path.string() + ": is neither gzip nor zstd nor UTF-16");
  restart();
}

UnpackedBytes::~UnpackedBytes() = default;

void UnpackedBytes::restart() {
  if (format_ == "gzip") {
    decoder_ = std::make_unique<GzipDecoder>();
  } else if (format_ == "UTF-16") {
    decoder_ = std::make_unique<Utf16Decoder>();
  } else {
    decoder_ = std::make_unique<ZstdDecoder>();
  }
  rest_ = {};
  packed_at_ = begin_ = 0;
  member_ended_ = pending_ = false;
  before_.clear();
  block_.clear();
}

/// The next packed bytes. False at the end of the file, where a member or frame has to end.
bool UnpackedBytes::refill() {
  const std::uint64_t n = std::min<std::uint64_t>(kPacked, file_.size() - packed_at_);
  if (n == 0) {
    if (member_ended_) return false;
    throw InputError(file_.path().string() + ": byte " + std::to_string(packed_at_) + ": the " +
                     std::string(format_) + " data ends before its end; the file is truncated");
  }
  packed_.resize(static_cast<std::size_t>(n));
  file_.read_at(packed_at_, packed_.data(), n);
  packed_at_ += n;
  rest_ = {packed_.data(), packed_.size()};
  if (packed_at_ == file_.size()) file_.require_unchanged();
  return true;
}

/// Unpacks a block behind the last one. False at the end.
bool UnpackedBytes::next_block() {
  begin_ += block_.size();
  before_.swap(block_);
  block_.clear();
  while (block_.size() < kBlock) {
    if (rest_.empty() && !pending_ && !refill()) break;
    const std::uint64_t at = packed_at_ - rest_.size();
    try {
      member_ended_ = decoder_->decode(rest_, block_, kBlock);
    } catch (const std::runtime_error& e) {
      throw InputError(
          file_.path().string() + ": byte " + std::to_string(at) + ": what follows cannot be unpacked as " +
          std::string(format_) + " (" + e.what() +
          "); the file is damaged, or packed in a way that takes more than 8 MiB to unpack: unpack it first");
    }
    pending_ = block_.size() == kBlock && !member_ended_;
  }
  return !block_.empty();
}

std::uint64_t UnpackedBytes::read_at(std::uint64_t offset, char* to, std::uint64_t bytes) {
  std::uint64_t done = 0;
  if (offset < begin_ - before_.size()) restart();
  while (done < bytes) {
    const std::uint64_t at = offset + done;
    const bool earlier = at < begin_;
    const std::vector<char>& from = earlier ? before_ : block_;
    const std::uint64_t skip = at - (earlier ? begin_ - before_.size() : begin_);
    if (skip >= from.size()) {
      if (!next_block()) break;
      continue;
    }
    const std::uint64_t n = std::min<std::uint64_t>(bytes - done, from.size() - skip);
    std::memcpy(to + done, from.data() + skip, static_cast<std::size_t>(n));
    done += n;
  }
  return done;
}

std::uint64_t UnpackedBytes::size() {
  while (next_block()) {
  }
  return begin_;
}

}  // namespace tessera
