#include "stream/formats/laz/chunk_decoder.h"

#include <catch2/catch.hpp>

#include <set>

#include "tests/helpers/laz_file.h"

namespace tessera::laz::chunk_decoder_test {
namespace {

using test::LazSample;

OpenBytes in_memory(std::string_view chunk) {
  return [chunk](std::uint64_t begin, std::uint64_t end) {
    const std::size_t to = std::min<std::size_t>(end, chunk.size());
    const std::size_t from = std::min<std::size_t>(begin, to);
    return std::make_unique<ByteFeed>(chunk.substr(from, to - from));
  };
}

/// Hands its bytes out in pieces of a few.
class Trickle final : public ByteFeed {
 public:
  explicit Trickle(std::string_view bytes) : rest_(bytes) {}

 private:
  std::string_view refill() override {
    const std::string_view piece = rest_.substr(0, 1 + at_++ % 5);
    rest_.remove_prefix(piece.size());
    return piece;
  }
  std::string_view rest_;
  std::size_t at_ = 0;
};

struct Decoded {
  std::string records;  ///< whole ones, until bytes ended or made no sense
  std::string failure;
  bool ended = false;  ///< the bytes did, before the points
};

Decoded decode(const Schema& schema, std::string_view chunk, std::size_t points, Layers layers = Layers::kAll,
               bool trickle = false) {
  const std::size_t bytes = schema.record_bytes();
  Decoded out;
  std::unique_ptr<ByteFeed> feed;
  std::unique_ptr<ChunkDecoder> decoder;
  std::string records(points * bytes, '\0');
  try {
    if (schema.layered()) {
      decoder = decode_layered(schema, in_memory(chunk), layers);
    } else {
      if (trickle)
        feed = std::make_unique<Trickle>(chunk);
      else
        feed = std::make_unique<ByteFeed>(chunk);
      decoder = decode_pointwise(schema, *feed);
    }
    for (std::size_t done = 0; done < points;) {
      const std::size_t n = std::min<std::size_t>(7, points - done);
      decoder->decode(records.data() + done * bytes, n);
      done += n;
    }
    decoder->require_used_up();
  } catch (const EndOfBytes& e) {
    out.failure = e.what();
    out.ended = true;
  } catch (const Damage& e) {
    out.failure = e.what();
  }
  out.records = records.substr(0, (decoder ? decoder->decoded() : 0) * bytes);
  return out;
}

std::string encoded(const LazSample& s, const std::string& records) {
  const std::vector<char> chunk = encode_chunk(test::schema_of(s), records);
  return std::string(chunk.begin(), chunk.end());
}

std::vector<LazSample> samples() {
  std::vector<LazSample> all;
  for (int format = 0; format <= 10; ++format)
    for (int version = format >= 6 ? 3 : 1; version <= (format >= 6 ? 4 : 2); ++version)
      for (const std::size_t extra : {0, 3})
        for (const bool wild : {false, true})
          all.push_back({.minor = 4,
                         .format = format,
                         .extra = extra,
                         .version = static_cast<std::uint16_t>(version),
                         .wild = wild,
                         .seed = static_cast<unsigned>(format + version)});
  return all;
}

TEST_CASE("laz chunks: what was coded comes back bit for bit, and no byte is left", "[property]") {
  for (LazSample s : samples()) {
    for (const std::size_t points : {1, 2, 3, 50, 3000}) {
      s.points = points;
      CAPTURE(s.format, s.version, s.extra, s.wild, points);
      const std::string records = test::las_records(s);
      const std::string chunk = encoded(s, records);
      const Schema schema = test::schema_of(s);
      const Decoded back = decode(schema, chunk, points);
      REQUIRE(back.failure.empty());
      REQUIRE(back.records == records);
      if (!schema.layered()) {
        REQUIRE(decode(schema, chunk, points, Layers::kAll, true).records == records);
      } else {
        const LayeredHead head = read_layered_head(schema, in_memory(chunk + "more"));
        REQUIRE(head.points == points);
        REQUIRE(head.bytes == chunk.size());
      }
      // Scans shrink, chance does not: models were learnt.
      if (points == 3000 && !s.wild) CHECK(chunk.size() * 3 < records.size() * 2);
    }
  }
}

TEST_CASE("laz chunks: without the layers nobody wants the others are the same", "[property]") {
  for (LazSample s : samples()) {
    if (s.format < 6) continue;
    s.points = 500;
    CAPTURE(s.format, s.version, s.wild);
    const std::string records = test::las_records(s);
    const Schema schema = test::schema_of(s);
    const Decoded back = decode(schema, encoded(s, records), s.points, Layers::kNeeded);
    REQUIRE(back.failure.empty());
    const bool colour = s.format == 7 || s.format == 8 || s.format == 10;
    for (std::size_t i = 0; i < s.points; ++i) {
      const std::string_view was = std::string_view(records).substr(i * schema.record_bytes());
      const std::string_view is = std::string_view(back.records).substr(i * schema.record_bytes());
      REQUIRE(is.substr(0, 12) == was.substr(0, 12));  // position
      REQUIRE(is.substr(14, 3) == was.substr(14, 3));  // returns, flags, class
      if (colour) REQUIRE(is.substr(30, 6) == was.substr(30, 6));
      REQUIRE(is.substr(12, 2) == std::string_view(records).substr(12, 2));  // intensity: of the first point
    }
  }
}

TEST_CASE("laz chunks: cut anywhere, the points before the cut are right, and the end is told", "[fault]") {
  for (LazSample s : samples()) {
    s.points = 120;
    CAPTURE(s.format, s.version, s.extra, s.wild);
    const std::string records = test::las_records(s);
    const std::string chunk = encoded(s, records);
    for (std::size_t i = 0; i < 40; ++i) {
      const Decoded back =
          decode(test::schema_of(s), std::string_view(chunk).substr(0, i * chunk.size() / 40), s.points);
      REQUIRE(back.ended);
      REQUIRE(records.starts_with(back.records));
    }
    const Decoded longer = decode(test::schema_of(s), chunk + "x", s.points);
    CHECK(longer.records == records);
    if (s.format < 6) CHECK(longer.failure.find("left over") != std::string::npos);
  }
}

TEST_CASE("laz chunks: changed bytes give points or damage, never anything else", "[fault]") {
  std::mt19937 random(7);
  std::size_t detected = 0;
  std::size_t tried = 0;
  for (LazSample s : samples()) {
    s.points = 200;
    const std::string records = test::las_records(s);
    const std::string chunk = encoded(s, records);
    for (int i = 0; i < 50; ++i) {
      std::string bad = chunk;
      for (int k = 0; k < 1 + i % 3; ++k) bad[random() % bad.size()] = static_cast<char>(random());
      const Decoded back = decode(test::schema_of(s), bad, s.points);
      REQUIRE(back.records.size() <= records.size());
      detected += back.failure.empty() ? 0 : 1;
      ++tried;
    }
  }
  CHECK(detected * 2 > tried);  // most damage shows: streams end early or late
}

TEST_CASE("laz schema: records survive, and what they cannot mean is refused", "[unit]") {
  for (int format = 0; format <= 10; ++format) {
    const Schema schema = schema_for(format, 4, 1234);
    const std::vector<char> bytes = schema_record(schema);
    const std::string record(bytes.begin(), bytes.end());
    const std::size_t length = schema.record_bytes();
    const Schema back = parse_schema(record, format, length);
    CHECK(back.layered() == (format >= 6));
    CHECK(back.chunk_points == 1234);
    CHECK(back.items.size() == schema.items.size());
    CHECK_THROWS_AS(parse_schema(record, format, length + 1), Damage);
    CHECK_THROWS_AS(parse_schema(record, (format + 6) % 11, length), Damage);
    CHECK_THROWS_AS(parse_schema(record.substr(0, record.size() - 1), format, length), Damage);
    CHECK_THROWS_AS(parse_schema(record.substr(0, 20), format, length), Damage);
    for (const auto& [at, value] : {std::pair{0, 0}, {0, 4}, {2, 1}, {38, 0}, {38, 9}}) {
      std::string bad = record;
      bad[static_cast<std::size_t>(at)] = static_cast<char>(value);
      CHECK_THROWS_AS(parse_schema(bad, format, length), Damage);
    }
  }
  CHECK_THROWS_AS(parse_schema(std::string(40, '\0'), 0, 60000), Damage);
}

TEST_CASE("laz chunk table: comes back, and lies of it are refused", "[unit]") {
  std::vector<ChunkSize> sizes;
  std::uint64_t sum = 0;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    sizes.push_back({50000 + i % 7, 1 + i * i * 4000});
    sum += sizes.back().bytes;
  }
  for (const bool variable : {false, true}) {
    const std::vector<char> bytes = chunk_table(sizes, variable);
    const std::string_view table(bytes.data(), bytes.size());
    ByteFeed feed(table);
    const std::vector<ChunkSize> back = read_chunk_table(feed, variable, sum);
    REQUIRE(back.size() == sizes.size());
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      REQUIRE(back[i].bytes == sizes[i].bytes);
      REQUIRE(back[i].points == (variable ? sizes[i].points : 0));
    }
    ByteFeed again(table);
    CHECK_THROWS_AS(read_chunk_table(again, variable, sum - 1), Damage);
    ByteFeed cut(table.substr(0, table.size() / 2));
    CHECK_THROWS_AS(read_chunk_table(cut, variable, sum), EndOfBytes);
    for (const std::uint32_t count : {1001u, kMaxChunks + 1, 0xffffffffu}) {
      std::string lie(table);
      test::set_bytes(lie, 4, count);
      ByteFeed lies(lie);
      CHECK_THROWS_AS(read_chunk_table(lies, variable, ~std::uint64_t{0}), Damage);
    }
    std::string version(table);
    version[0] = 1;
    ByteFeed other(version);
    CHECK_THROWS_AS(read_chunk_table(other, variable, sum), Damage);
  }
  const std::vector<char> none = chunk_table({}, false);
  ByteFeed feed(std::string_view(none.data(), none.size()));
  CHECK(read_chunk_table(feed, false, 0).empty());
}

}  // namespace
}  // namespace tessera::laz::chunk_decoder_test
