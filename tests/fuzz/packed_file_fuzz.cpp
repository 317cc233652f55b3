// The files between stages: bytes as they come, and the same with right checksums of table and footer, so that the
// claims behind them are tried: a table that lies, sections that reach out of the file.
#include <cstring>

#include "stream/files/durable_file.h"
#include "stream/files/packed_file.h"
#include "tests/fuzz/text_check.h"

namespace {

using namespace tessera;

struct Entry {
  std::uint64_t key = 0;
  Section section;
};
constexpr PackedKind kKind = {"TSFUZZ01", "a file of the fuzzer"};

// As packed_file.cpp has the footer: 8 words.
constexpr std::size_t kFooterBytes = 64;
enum Word { kTableOffset, kEntries, kEntryBytes, kInfoBytes, kTableHash, kReserved, kHash, kMagic };

void right_checksums(std::string& bytes) {
  if (bytes.size() < kFooterBytes + 8) return;
  std::memcpy(bytes.data(), kKind.magic, 8);
  const std::size_t end = bytes.size() - kFooterBytes;
  std::uint64_t word[8];
  std::memcpy(word, bytes.data() + end, kFooterBytes);
  std::memcpy(&word[kMagic], kKind.magic, 8);
  word[kEntryBytes] = sizeof(Entry);
  word[kInfoBytes] = 0;
  word[kEntries] %= end / sizeof(Entry) + 1;
  word[kTableOffset] = end - word[kEntries] * sizeof(Entry);
  word[kTableHash] = hash_bytes(bytes.data() + word[kTableOffset], word[kEntries] * sizeof(Entry));
  word[kHash] = hash_bytes(word, kHash * sizeof(std::uint64_t));
  std::memcpy(bytes.data() + end, word, kFooterBytes);
}

void read_all(const std::string& bytes) {
  const fuzz::MemoryFile file(bytes);
  fuzz::accepted([&] {
    const PackedTables<Entry> tables({file.path()}, kKind);
    for (const Entry& entry : tables.entries()) {
      if (entry.section.bytes > bytes.size())
        continue;  // stores allocate by the counts of their tables: asked below
      fuzz::accepted([&] { tables.file_of(entry).load<char>(entry.section); });
      fuzz::accepted([&] {
        SectionReader reader(tables.file_of(entry), entry.section);
        char part[7];
        while (reader.left() > 0) reader.next(part, std::min<std::uint64_t>(sizeof part, reader.left()));
      });
    }
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::string bytes(fuzz::text_of(data, size));
  read_all(bytes);
  right_checksums(bytes);
  read_all(bytes);
  return 0;
}
