#include "stream/formats/points/laz_chunks.h"

#include <algorithm>

#include "octree/error.h"
#include "stream/formats/laz/chunk_decoder.h"
#include "stream/formats/laz/chunk_table.h"
#include "stream/formats/scalar.h"

namespace tessera {

namespace {

/// Not even points that are all alike take fewer bits: no symbol's share reaches one.
constexpr std::uint64_t kMaxPointsPerByte = 2048;
/// Of chunks, so many at least, looked at to believe a table.
constexpr std::size_t kCheckedHeads = 64;
constexpr const char* kAdvice = "; get the file anew, or compress it anew from the original";

[[noreturn]] void fail_chunk(const ReadFile& file, std::uint64_t byte, const std::string& what) {
  throw InputError(file.path().string() + ": byte " + std::to_string(byte) + ": " + what);
}

class ChunkFinder {
 public:
  ChunkFinder(const ReadFile& file, const LasHeader& header, const laz::Schema& schema)
      : file_(file), header_(header), schema_(schema), begin_(header.begin), end_(header.end) {}

  LazChunks find() {
    if (!schema_.chunked()) {
      one_run("");
      return std::move(chunks_);
    }
    std::vector<laz::ChunkSize> table;
    std::string why = read_table(table);
    if (why.empty()) why = contradiction(table);
    if (why.empty()) {
      from_table(table);
    } else if (schema_.layered()) {
      walk(why);
    } else if (variable()) {
      fail_chunk(file_, header_.begin,
                 "the chunk table " + why + ", and chunks of many sizes cannot be read without" + kAdvice);
    } else {
      one_run(why);
    }
    return std::move(chunks_);
  }

 private:
  bool variable() const { return schema_.chunk_points == laz::Schema::kVariable; }
  std::uint64_t declared() const { return header_.info.declared_points; }

  void add_edge(std::uint64_t at, std::uint64_t points) { chunks_.edges.push_back({at, points}); }

  /// Empty, or what is wrong with the table; begin_ and end_ become those of the chunks.
  std::string read_table(std::vector<laz::ChunkSize>& table) {
    const std::uint64_t size = file_.size();
    if (end_ - begin_ < 8) {
      begin_ = end_;
      return "is missing: the file ends before it";
    }
    const auto number_at = [&](std::uint64_t offset) {
      char bytes[8];
      file_.read_at(offset, bytes, sizeof bytes);
      return load_scalar<std::int64_t>(bytes);
    };
    std::int64_t at = number_at(begin_);
    begin_ += 8;
    if (at == -1) at = number_at(size - 8);
    const auto offset = static_cast<std::uint64_t>(at);
    if (at < 0 || offset < begin_ || offset >= size)
      return offset >= size && at > 0 ? "is missing: it should begin at byte " + std::to_string(at) +
                                            ", the file ends at " + std::to_string(size)
                                      : "is missing: it was never written";
    try {
      FileFeed feed(file_, offset, size);
      table = laz::read_chunk_table(feed, variable(), offset - begin_);
    } catch (const laz::Damage& e) {
      return std::string("is damaged: it ") + e.what();
    }
    end_ = offset;
    return "";
  }

  /// Decodes it: whether it ends where the table says. Of points coded one by one nothing else tells.
  bool is_first_chunk(const laz::ChunkSize& chunk, bool only) const {
    constexpr std::size_t kBatch = 1024;
    std::uint64_t left = variable() ? chunk.points : schema_.chunk_points;
    if (only && !variable()) left = std::min(left, declared());
    if (left == 0 || left > chunk.bytes * kMaxPointsPerByte) return false;
    FileFeed feed(file_, begin_, begin_ + chunk.bytes);
    std::vector<char> records(kBatch * schema_.record_bytes());
    try {
      const auto decoder = laz::decode_pointwise(schema_, feed);
      for (; left > 0; left -= std::min<std::uint64_t>(left, kBatch))
        decoder->decode(records.data(), static_cast<std::size_t>(std::min<std::uint64_t>(left, kBatch)));
      decoder->require_used_up();
    } catch (const laz::Damage&) {
      return false;
    }
    return true;
  }

  /// Empty, or how the table differs from the file: it must cover all bytes between the first chunk and itself, and give
  /// layered chunks the sizes that their heads have. A count of the header that differs alone is the header's error.
  std::string contradiction(const std::vector<laz::ChunkSize>& table) const {
    std::uint64_t bytes = 0;
    std::uint64_t points = 0;
    for (const laz::ChunkSize& c : table) bytes += c.bytes, points += c.points;
    if (bytes != end_ - begin_)
      return "contradicts the file: it lists " + std::to_string(table.size()) + " chunks of " +
             std::to_string(bytes) + " bytes, the chunks have " + std::to_string(end_ - begin_);
    if (!schema_.layered()) {
      const bool counts_agree =
          variable() ? points == declared()
                     : (declared() + schema_.chunk_points - 1) / schema_.chunk_points == table.size();
      if (counts_agree || table.empty() || is_first_chunk(table[0], table.size() == 1)) return "";
      return "contradicts the file: the first chunk does not end where it says";
    }
    // All heads where the counts differ, else a few: each is a read of its own.
    const std::size_t step =
        variable() && points != declared() ? 1 : std::max<std::size_t>(1, table.size() / kCheckedHeads);
    std::uint64_t at = begin_;
    for (std::size_t i = 0; i < table.size(); at += table[i].bytes, ++i) {
      if (i % step != 0 && i + 1 != table.size()) continue;
      laz::LayeredHead head;
      try {
        head = read_head(at);
      } catch (const laz::EndOfBytes&) {
        head.bytes = 0;
      }
      if (head.bytes != table[i].bytes || (variable() && head.points != table[i].points))
        return "contradicts the file: it gives chunk " + std::to_string(i + 1) + " " +
               std::to_string(table[i].bytes) + " bytes, the chunk itself says " + std::to_string(head.bytes);
    }
    return "";
  }

  void from_table(const std::vector<laz::ChunkSize>& table) {
    std::uint64_t at = begin_;
    std::uint64_t points = 0;
    chunks_.edges.reserve(table.size() + 1);
    for (std::size_t i = 0; i < table.size(); ++i) {
      add_edge(at, points);
      points += variable()             ? table[i].points
                : i + 1 < table.size() ? schema_.chunk_points
                                       : last_points(at, points);
      at += table[i].bytes;
    }
    add_edge(at, points);
    limit_points();
    compare_counts();
  }

  /// Of the last chunk of those of one size: layered ones say so themselves, of others the header knows.
  std::uint64_t last_points(std::uint64_t at, std::uint64_t before) const {
    if (schema_.layered()) {
      const laz::LayeredHead head = read_head(at);
      return std::min<std::uint64_t>(head.points, schema_.chunk_points);
    }
    return std::min<std::uint64_t>(declared() > before ? declared() - before : 0, schema_.chunk_points);
  }

  laz::LayeredHead read_head(std::uint64_t at) const {
    return laz::read_layered_head(schema_, [&](std::uint64_t from, std::uint64_t to) {
      return std::make_unique<FileFeed>(file_, std::min(at + from, end_), std::min(at + to, end_));
    });
  }

  /// A chunk cannot have more points than its bytes can say.
  void limit_points() {
    for (std::size_t i = 0; i + 1 < chunks_.edges.size(); ++i) {
      const std::uint64_t bytes = chunks_.edges[i + 1].begin - chunks_.edges[i].begin;
      if (chunks_.points_of(i) > bytes * kMaxPointsPerByte)
        fail_chunk(file_, chunks_.edges[i].begin,
                   "chunk " + std::to_string(i + 1) + " claims " + std::to_string(chunks_.points_of(i)) +
                       " points in " + std::to_string(bytes) + " bytes, which cannot be" + kAdvice);
    }
  }

  void compare_counts() {
    const std::uint64_t found = chunks_.points();
    const bool left_out = chunks_.size() > 0 && chunks_.points_of(chunks_.size() - 1) == 0;
    if (found == declared() && !left_out) return;
    const std::string both = "the header declares " + std::to_string(declared()) +
                             " points, the chunks hold " + std::to_string(found);
    if (found < declared()) {
      chunks_.missing = declared() - found;
      chunks_.warnings.push_back(both + ": it is truncated, or the count is wrong");
    } else if (schema_.layered() || variable()) {
      chunks_.warnings.push_back(both + ": all of them are read");
    } else {
      chunks_.warnings.push_back(both + " or more: all that can be told apart are read");
    }
  }

  /// Layered chunks, each of which says where it ends.
  void walk(const std::string& why) {
    std::uint64_t at = begin_;
    std::uint64_t points = 0;
    add_edge(at, points);
    while (at < end_ && (declared() == 0 || points < declared())) {
      laz::LayeredHead head;
      try {
        head = read_head(at);
      } catch (const laz::EndOfBytes&) {
        break;
      }
      // What is no head is what follows the chunks.
      if (head.points == 0 || head.points > head.bytes * kMaxPointsPerByte ||
          (!variable() && head.points > schema_.chunk_points))
        break;
      if (chunks_.edges.size() > laz::kMaxChunks)
        fail_chunk(file_, at,
                   "more than " + std::to_string(laz::kMaxChunks) +
                       " chunks cannot be read; compress the file anew");
      chunks_.cut_off = head.bytes > end_ - at;
      at += std::min(head.bytes, end_ - at);
      points += head.points;
      add_edge(at, points);
    }
    limit_points();
    warn_of_table(why, points);
  }

  /// Chunks that cannot be told apart without reading them.
  void one_run(const std::string& why) {
    chunks_.in_order = chunks_.cut_off = true;
    const std::uint64_t maximum = (end_ - begin_) * kMaxPointsPerByte;
    add_edge(begin_, 0);
    add_edge(end_, std::min(declared(), maximum));
    warn_of_table(why, chunks_.points());
  }

  void warn_of_table(const std::string& why, std::uint64_t points) {
    if (declared() > points) chunks_.missing = declared() - points;
    if (!why.empty())
      chunks_.warnings.push_back("the chunk table " + why + "; the header declares " +
                                 std::to_string(declared()) + " points, those that are there are read");
  }

  const ReadFile& file_;
  const LasHeader& header_;
  const laz::Schema& schema_;
  std::uint64_t begin_, end_;  ///< of all chunks
  LazChunks chunks_;
};

}  // namespace

LazChunks LazChunks::picked(const std::vector<std::size_t>& chunks) const {
  LazChunks few;
  few.cut_off = cut_off && !chunks.empty() && chunks.back() + 1 == size();
  std::uint64_t points = 0;
  for (const std::size_t c : chunks) {
    few.edges.push_back({edges[c].begin, points});
    few.ends.push_back(end_of(c));
    points += points_of(c);
  }
  few.edges.push_back({chunks.empty() ? edges.back().begin : few.ends.back(), points});
  return few;
}

LazChunks find_laz_chunks(const ReadFile& file, const LasHeader& header, const laz::Schema& schema) {
  try {
    return ChunkFinder(file, header, schema).find();
  } catch (const laz::Damage& e) {
    fail_chunk(file, header.begin, std::string("the last chunk is damaged: ") + e.what() + kAdvice);
  }
}

laz::Schema find_laz_schema(const ReadFile& file, const LasHeader& header) {
  constexpr std::size_t kHead = 54;  // user id at 2, record id at 18, length at 20
  constexpr std::size_t kMax = kHead + 65535;
  ByteWindow window(file, std::min(header.records_at, header.begin), header.begin, std::size_t{1} << 17);
  static_assert(kMax <= std::size_t{1} << 17);
  for (std::uint32_t i = 0; i < header.record_count; ++i) {
    const std::string_view head = window.peek(kHead);
    if (head.size() < kHead) break;
    const std::size_t length = load_scalar<std::uint16_t>(head.data() + 20);
    const std::string_view user = head.substr(2, laz::Schema::kUserId.size());
    if (user == laz::Schema::kUserId &&
        load_scalar<std::uint16_t>(head.data() + 18) == laz::Schema::kRecordId) {
      const std::uint64_t at = window.offset();
      const std::string_view record = window.peek(kHead + length);
      try {
        return laz::parse_schema(record.substr(kHead, std::min(length, record.size() - kHead)),
                                 header.point_format, header.layout.stride);
      } catch (const laz::Damage& e) {
        fail_chunk(file, at, std::string("the record 'laszip encoded' ") + e.what() + kAdvice);
      }
    }
    window.skip(kHead + length);
  }
  fail_chunk(file, header.records_at,
             "the points are compressed, but no record 'laszip encoded' among the " +
                 std::to_string(header.record_count) + " of the header says how" + kAdvice);
}

}  // namespace tessera
