#include "stream/formats/points/las_copy.h"

#include <algorithm>
#include <cstring>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/formats/laz/chunk_encoder.h"
#include "stream/formats/scalar.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"

namespace tessera {

namespace {

constexpr std::size_t kVlrHead = 54, kEvlrHead = 60;
constexpr std::size_t kUserIdBytes = 16;
constexpr std::uint32_t kChunkRecords = 50000;
constexpr std::size_t kMaxGroup = 8;
constexpr std::size_t kCopyBytes = std::size_t{1} << 20;
constexpr int kFormatMask = 0x3f, kCompressedFlag = 0x80;

/// Where the header says that it ends, at least what every header has.
std::uint64_t header_end(const LasHeader& header) {
  return std::min(std::max(header.records_at, std::uint64_t{LasField::kHeader12}), header.begin);
}

bool has_user(const char* head, std::string_view user) {
  return std::string_view(head + 2, kUserIdBytes).substr(0, user.size()) == user &&
         (user.size() == kUserIdBytes || head[2 + user.size()] == '\0');
}

bool is_extra_record(const char* head) {
  return has_user(head, LasExtraField::kUserId) &&
         load_scalar<std::uint16_t>(head + 18) == LasExtraField::kRecordId;
}

}  // namespace

bool LasCopy::is_compressed(const std::filesystem::path& to) {
  const std::string extension = lower_extension(to);
  if (extension != ".las" && extension != ".laz")
    throw UsageError(to.string() + ": points with classes are written as .las or .laz");
  return extension == ".laz";
}

std::uint64_t LasCopy::bytes(const LasRecords& from, bool compressed, int threads, std::size_t scalars) {
  const std::uint64_t plain = OutputFile::kBufferBytes + kCopyBytes;
  if (!compressed) return plain;
  const std::uint64_t group = std::min<std::uint64_t>(static_cast<std::uint64_t>(threads), kMaxGroup);
  // Records, perhaps longer by a few numbers, their code, and the models and layers of those at work.
  return plain + group * (2 * kChunkRecords * (from.record_bytes() + scalars * sizeof(double)) +
                          (std::uint64_t{4} << 20));
}

LasCopy::LasCopy(const LasRecords& from, const std::filesystem::path& to, int threads,
                 std::vector<std::string> scalars)
    : from_(from),
      scalars_(std::move(scalars)),
      record_bytes_(from.record_bytes() + scalars_.size() * sizeof(double)),
      compressed_(is_compressed(to)),
      verbatim_(!compressed_ && !from.header().compressed && scalars_.empty()),
      file_(to),
      group_(std::min<std::size_t>(static_cast<std::size_t>(threads), kMaxGroup)) {
  const ReadFile file = from.file().open();
  if (verbatim_) {
    copy(file, {0, from.header().begin});
    return;
  }
  if (compressed_) {
    const int format = from.header().point_format;
    const std::size_t bare = laz::schema_for(format, 0, kChunkRecords).record_bytes();
    schema_ = laz::schema_for(format, record_bytes_ - bare, kChunkRecords);
    const std::vector<char> record = laz::schema_record(schema_);
    try {
      laz::parse_schema({record.data(), record.size()}, format, record_bytes_);
    } catch (const laz::Damage& e) {
      throw UsageError(to.string() + ": LAZ cannot hold these points: it " + e.what() + "; write .las");
    }
    pending_.reserve(group_ * kChunkRecords * record_bytes_);
  }
  write_head(file);
}

void LasCopy::copy(const ReadFile& file, Segment bytes) {
  std::vector<char> buffer(
      static_cast<std::size_t>(std::min<std::uint64_t>(kCopyBytes, bytes.end - bytes.begin)));
  for (std::uint64_t at = bytes.begin; at < bytes.end;) {
    throw_if_stopped();
    const std::uint64_t n = std::min<std::uint64_t>(buffer.size(), bytes.end - at);
    file.read_at(at, buffer.data(), n);
    file_.append(buffer.data(), static_cast<std::size_t>(n));
    at += n;
  }
}

/// Whether a record between header and points is not copied: it goes, or is written anew.
bool LasCopy::is_left_out(const char* record) const {
  return has_user(record, laz::Schema::kUserId) || has_user(record, "copc") ||
         (!scalars_.empty() && is_extra_record(record));
}

/// Of all extra bytes, those of the source first; of what it does not describe that nothing is known.
std::string LasCopy::extra_descriptions(const ReadFile& file) const {
  const LasHeader& header = from_.header();
  std::string text;
  std::uint64_t at = header_end(header);
  for (std::uint32_t i = 0; i < header.record_count && at + kVlrHead <= header.begin; ++i) {
    char head[kVlrHead];
    file.read_at(at, head, sizeof head);
    const std::uint64_t end = std::min(at + kVlrHead + load_scalar<std::uint16_t>(head + 20), header.begin);
    if (is_extra_record(head)) {
      const std::size_t old = text.size(), bytes = static_cast<std::size_t>(end - at - kVlrHead);
      text.resize(old + bytes - bytes % LasExtraField::kBytes);
      file.read_at(at + kVlrHead, text.data() + old, text.size() - old);
    }
    at = end;
  }
  const std::string added = las_extra_doubles(scalars_);
  std::size_t known = 0;
  for (std::size_t k = 0; k < text.size(); k += LasExtraField::kBytes) {
    known += las_extra_size(text.data() + k);
    for (std::size_t s = 0; s < scalars_.size(); ++s)
      if (std::memcmp(text.data() + k + 4, added.data() + s * LasExtraField::kBytes + 4, 32) == 0)
        throw UsageError(from_.file().path().string() + ": its points have extra bytes '" + scalars_[s] +
                         "' already; measure the scan that it was made of");
  }
  const std::size_t bare = laz::schema_for(header.point_format, 0, kChunkRecords).record_bytes();
  for (std::size_t unknown = from_.record_bytes() - bare; unknown > known;) {
    const std::size_t part = std::min<std::size_t>(unknown - known, 255);
    const auto description = las_extra_unknown(part);
    text.append(description.data(), description.size());
    known += part;
  }
  return text + added;
}

void LasCopy::append_record(std::string_view user, std::uint16_t id, std::string_view data) {
  if (data.size() > 0xffff)
    throw UsageError(file_.path().string() + ": its extra bytes have too many descriptions for a record");
  std::array<char, kVlrHead> front{};
  std::memcpy(&front[2], user.data(), user.size());
  const auto length = static_cast<std::uint16_t>(data.size());
  std::memcpy(&front[18], &id, 2);
  std::memcpy(&front[20], &length, 2);
  file_.append(front.data(), front.size());
  file_.append(data);
}

/// All records between header and points but those left out, and last what else stands there. \param count  of the
/// records kept
std::vector<LasCopy::Segment> LasCopy::kept_records(const ReadFile& file, std::uint32_t& count) const {
  const LasHeader& header = from_.header();
  std::vector<Segment> kept;
  std::uint64_t at = header_end(header), begin = at;
  count = header.record_count;
  for (std::uint32_t i = 0; i < header.record_count && at + kVlrHead <= header.begin; ++i) {
    char head[kVlrHead];
    file.read_at(at, head, sizeof head);
    const std::uint64_t end = std::min(at + kVlrHead + load_scalar<std::uint16_t>(head + 20), header.begin);
    if (is_left_out(head)) {
      kept.push_back({begin, at});
      begin = end;
      --count;
    }
    at = end;
  }
  kept.push_back({begin, at});
  kept.push_back({at, header.begin});
  return kept;
}

/// All that follows the points but records of COPC. \param count  of the records kept
std::vector<LasCopy::Segment> LasCopy::kept_extended(const ReadFile& file, std::uint32_t& count) const {
  const LasHeader& header = from_.header();
  std::uint64_t begin = header.end;
  if (!header.compressed) begin = header.begin + from_.points() * from_.record_bytes();
  std::vector<Segment> kept;
  char head[LasField::kHeader14] = {};
  file.read_at(0, head, std::min<std::uint64_t>(sizeof head, file.size()));
  if (head[LasField::kVersionMinor] >= 4) {
    count = load_scalar<std::uint32_t>(head + LasField::kEvlrCount);
    auto at = load_scalar<std::uint64_t>(head + LasField::kFirstEvlr);
    const std::uint32_t all = count;
    for (std::uint32_t i = 0; i < all && at >= begin && at <= file.size() && file.size() - at >= kEvlrHead;
         ++i) {
      char record[kEvlrHead];
      file.read_at(at, record, sizeof record);
      const auto length = load_scalar<std::uint64_t>(record + 20);
      const std::uint64_t end = length > file.size() - at - kEvlrHead ? file.size() : at + kEvlrHead + length;
      if (has_user(record, "copc")) {
        kept.push_back({begin, at});
        begin = end;
        --count;
      }
      at = end;
    }
  }
  kept.push_back({begin, file.size()});
  return kept;
}

void LasCopy::write_head(const ReadFile& file) {
  const LasHeader& header = from_.header();
  std::vector<char> head(static_cast<std::size_t>(header_end(header)));
  file.read_at(0, head.data(), head.size());
  file_.append(head.data(), head.size());
  std::uint32_t count = 0;
  const std::vector<Segment> kept = kept_records(file, count);
  for (std::size_t i = 0; i + 1 < kept.size(); ++i) copy(file, kept[i]);
  if (!scalars_.empty()) {
    append_record(LasExtraField::kUserId, LasExtraField::kRecordId, extra_descriptions(file));
    ++count;
    const auto length = static_cast<std::uint16_t>(record_bytes_);
    file_.patch(LasField::kRecordLength, &length, sizeof length);
  }
  if (compressed_) {
    const std::vector<char> record = laz::schema_record(schema_);
    append_record(laz::Schema::kUserId, laz::Schema::kRecordId, {record.data(), record.size()});
    ++count;
  }
  copy(file, kept.back());
  begin_ = file_.size();
  const auto offset = static_cast<std::uint32_t>(begin_);
  file_.patch(LasField::kPointOffset, &offset, sizeof offset);
  file_.patch(LasField::kRecordCount, &count, sizeof count);
  const auto format =
      static_cast<char>((header.point_format & kFormatMask) | (compressed_ ? kCompressedFlag : 0));
  file_.patch(LasField::kPointFormat, &format, 1);
  if (compressed_) file_.append(std::string_view("\0\0\0\0\0\0\0\0", 8));  // where the chunk table begins
}

void LasCopy::append(const char* records, std::size_t count) {
  const std::size_t bytes = count * record_bytes_;
  if (!compressed_) {
    file_.append(records, bytes);
    return;
  }
  const std::size_t full = group_ * kChunkRecords * record_bytes_;
  for (std::size_t at = 0; at < bytes;) {
    const std::size_t part = std::min(full - pending_.size(), bytes - at);
    pending_.append(records + at, part);
    at += part;
    if (pending_.size() == full) compress();
  }
}

void LasCopy::compress() {
  const std::size_t chunk = kChunkRecords * record_bytes_;
  std::vector<std::vector<char>> coded((pending_.size() + chunk - 1) / chunk);
  parallel_for(coded.size(), [&](std::size_t i) {
    coded[i] = laz::encode_chunk(schema_, std::string_view(pending_).substr(i * chunk, chunk));
  });
  for (const std::vector<char>& c : coded) {
    file_.append(c.data(), c.size());
    table_.push_back({0, static_cast<std::uint32_t>(c.size())});
  }
  pending_.clear();
}

std::uint64_t LasCopy::finish() {
  const ReadFile file = from_.file().open();
  const std::uint64_t old_tail = from_.header().compressed
                                     ? from_.header().end
                                     : from_.header().begin + from_.points() * from_.record_bytes();
  if (compressed_) {
    compress();
    const std::uint64_t table_begin = file_.size();
    const std::vector<char> table = laz::chunk_table(table_, false);
    file_.append(table.data(), table.size());
    file_.patch(begin_, &table_begin, sizeof table_begin);
  }
  const std::uint64_t new_tail = file_.size();
  if (verbatim_) {
    copy(file, {old_tail, file.size()});
  } else {
    std::uint32_t count = 0;
    for (const Segment& s : kept_extended(file, count)) copy(file, s);
    char head[LasField::kHeader14] = {};
    file.read_at(0, head, std::min<std::uint64_t>(sizeof head, file.size()));
    const auto move = [&](std::size_t field) {
      const auto at = load_scalar<std::uint64_t>(head + field);
      if (at < old_tail) return;
      const std::uint64_t moved = at - old_tail + new_tail;
      file_.patch(field, &moved, sizeof moved);
    };
    if (head[LasField::kVersionMinor] >= 3) move(LasField::kWaveform);
    if (head[LasField::kVersionMinor] >= 4) {
      move(LasField::kFirstEvlr);
      constexpr std::uint64_t kNone = 0;
      if (count == 0) file_.patch(LasField::kFirstEvlr, &kNone, sizeof kNone);
      file_.patch(LasField::kEvlrCount, &count, sizeof count);
    }
  }
  const std::uint64_t size = file_.size();
  file.require_unchanged();
  file_.finish();
  return size;
}

}  // namespace tessera
