// A line of a journal counts only under its own checksum. Half of the inputs are given the right one, so that what a line
// may say is tried as well: it is a record, whose own line reads back as the same, or it counts as never written.

#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/runtime/journal.h"
#include "tests/fuzz/text_check.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tessera;
  if (size < 2) return 0;
  std::string line(fuzz::text_of(data + 1, size - 1));
  if (data[0] % 2 == 0) line = R"({"xxh3":")" + hex64(hash_text(line)) + R"(","record":)" + line + "}";
  TaskRecord record;
  if (!parse_journal_line(line, record)) return 0;
  TaskRecord again;
  fuzz::require(parse_journal_line(journal_line(record), again), "a record's own line is whole");
  fuzz::require(journal_line(again) == journal_line(record), "and gives the record back");
  return 0;
}
