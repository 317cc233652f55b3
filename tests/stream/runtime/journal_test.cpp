#include "stream/runtime/journal.h"
#include "stream/files/json.h"

#include <catch2/catch.hpp>
#include <chrono>
#include <fstream>
#include <thread>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/runtime/commit.h"
#include "tests/helpers/shell.h"

namespace journal_test {

using namespace tessera;
using test::file_bytes;
using test::spill;
using test::TempFolder;

namespace fs = std::filesystem;

namespace {

TaskRecord record(std::int64_t task) {
  TaskRecord r;
  r.stage = "order";
  r.task = task;
  r.basis = "00aa";
  r.plan = "11bb";
  r.files = {{"points/000001.pts", 12345, 0xfedcba9876543210ull}, {"points/x y\"z.pts", 0, 1}};
  r.seconds = 0.1;
  r.cpu_seconds = 1.0 / 3.0;
  r.peak_bytes = 1ull << 40;
  r.bytes_read = 7;
  r.bytes_written = 8;
  r.units = 9;
  r.summary = {{"points", 42}, {"h", 0.1}};
  if (task == kFinishTask) {
    r.tasks = 3;
    r.obsolete = {"distribute/"};
    r.stage_stats = {{"wall_s", 1.5}};
  }
  return r;
}

}  // namespace

TEST_CASE("journal: a line gives back the record", "[unit]") {
  for (const std::int64_t task : {std::int64_t{0}, std::int64_t{17}, kFinishTask}) {
    const TaskRecord in = record(task);
    TaskRecord out;
    REQUIRE(parse_journal_line(journal_line(in), out));
    CHECK(out.stage == in.stage);
    CHECK(out.task == in.task);
    CHECK(out.basis == in.basis);
    CHECK(out.plan == in.plan);
    CHECK(out.files == in.files);
    CHECK(out.cpu_seconds == in.cpu_seconds);
    CHECK(out.peak_bytes == in.peak_bytes);
    CHECK(out.units == in.units);
    CHECK(out.summary == in.summary);
    CHECK(out.tasks == in.tasks);
    CHECK(out.obsolete == in.obsolete);
    CHECK(out.stage_stats == in.stage_stats);
  }
}

TEST_CASE("journal: what a task was told to need is read where a line says it", "[unit]") {
  TaskRecord in = record(4), out;
  REQUIRE(parse_journal_line(journal_line(in), out));
  CHECK_FALSE(out.need_bytes.has_value());
  in.need_bytes = 1ull << 33;
  REQUIRE(parse_journal_line(journal_line(in), out));
  CHECK(out.need_bytes == in.need_bytes);
}

TEST_CASE("journal: every line is one line of JSON", "[unit]") {
  TaskRecord r = record(1);
  r.summary = {{"text", "two\nlines \xff"}};
  const std::string line = journal_line(r);
  CHECK(line.find('\n') == std::string::npos);
  CHECK(parse_json(line).at("record").at("stage") == "order");
}

TEST_CASE("journal: a line torn anywhere counts as never written", "[property]") {
  const std::string line = journal_line(record(3));
  for (std::size_t cut = 0; cut < line.size(); ++cut) {
    TaskRecord out;
    CAPTURE(cut);
    REQUIRE_FALSE(parse_journal_line(line.substr(0, cut), out));
  }
}

TEST_CASE("journal: a flipped bit anywhere counts as never written", "[property]") {
  const std::string line = journal_line(record(3));
  for (std::size_t at = 0; at < line.size(); ++at) {
    std::string bad = line;
    bad[at] = static_cast<char>(bad[at] ^ (1 << (at % 7)));
    TaskRecord out;
    CAPTURE(at);
    REQUIRE_FALSE(parse_journal_line(bad, out));
  }
}

TEST_CASE("journal: a record of wrong shape counts as never written, whatever its checksum says", "[fault]") {
  const auto line = [](const Json& text) {
    return R"({"xxh3":")" + hex64(hash_text(dump_json(text))) + R"(","record":)" + dump_json(text) + "}";
  };
  const Json whole = parse_json(journal_line(record(3))).at("record");
  TaskRecord out;
  REQUIRE(parse_journal_line(line(whole), out));
  for (const auto& [key, value] : whole.items()) {
    CAPTURE(key);
    Json bad = whole;
    bad.erase(key);
    CHECK_FALSE(parse_journal_line(line(bad), out));
    if (key == "summary") continue;  // holds what the stage likes
    bad = whole;
    bad[key] = Json::array({Json::object()});
    CHECK_FALSE(parse_journal_line(line(bad), out));
  }
  Json bad = whole;
  bad["files"] = {{{"name", "a"}, {"bytes", 1}, {"xxh3", "no digits"}}};
  CHECK_FALSE(parse_journal_line(line(bad), out));
  CHECK_FALSE(parse_journal_line(line("text"), out));
}

TEST_CASE("journal: a writer goes on after a torn line", "[fault]") {
  const TempFolder scratch;
  const auto file = scratch / "main.jsonl";
  const std::string first = journal_line(record(0)) + "\n";
  const std::string second = journal_line(record(1)) + "\n";
  for (const std::size_t cut : {std::size_t{0}, std::size_t{1}, second.size() / 2, second.size() - 1}) {
    spill(file, first + second.substr(0, cut));
    {
      JournalWriter writer(file);
      writer.append(record(2));
    }
    const Journal journal = read_journal(scratch.path());
    CAPTURE(cut);
    CHECK(journal.damaged_lines == 0);
    const auto found = journal.find("order", "00aa", "11bb");
    CHECK(found.size() == 2);
    CHECK(found.count(0) == 1);
    CHECK(found.count(2) == 1);
  }
}

TEST_CASE("journal: a line that is not synced is there for whoever reads, and for the next line", "[unit]") {
  const TempFolder scratch;
  JournalWriter writer(scratch / "main.jsonl");
  writer.append(record(0), false);
  CHECK(read_journal(scratch.path()).find("order", "00aa", "11bb").size() == 1);
  writer.append(record(1));
  const Journal journal = read_journal(scratch.path());
  CHECK(journal.damaged_lines == 0);
  CHECK(journal.find("order", "00aa", "11bb").size() == 2);
}

TEST_CASE("group commit: what has gone is not missed, a failure is told, and takes its files along",
          "[unit]") {
  using std::chrono::milliseconds;
  const TempFolder scratch;
  const fs::path file = scratch / "committed", gone = scratch / "gone", device = "/dev/null";  // has no sync
  JournalWriter journal(scratch / "main.jsonl");
  const auto waits = GENERATE(milliseconds(0), milliseconds(std::chrono::hours(1)));
  spill(file, "text");
  {
    GroupCommit group(journal, {waits, waits});
    CHECK_NOTHROW(group.add({file, gone, scratch.path()}));
    CHECK_NOTHROW(group.settle());
    CHECK(fs::exists(file));
    group.add({file, device});
    CHECK_THROWS_AS(group.settle(), Error);
    CHECK_THROWS_AS(group.add({}), Error);  // nothing is committed on top of it
  }
  CHECK_FALSE(fs::exists(file));  // it would read well until memory forgets it
  spill(file, "text");
  {
    GroupCommit group(journal, {waits, waits});
    CHECK_NOTHROW(group.settle_later());
    CHECK_NOTHROW(group.add({file, device}));
    if (waits > milliseconds(0)) {
      CHECK_NOTHROW(group.settle_later());  // not in its first moments
      CHECK_NOTHROW(group.add({}));
      return;
    }
    // The thread syncs though nobody settles.
    const auto fails = [&] {
      try {
        group.add({});
      } catch (const Error&) {
        return true;
      }
      return false;
    };
    const auto start = std::chrono::steady_clock::now();
    while (!fails() && std::chrono::steady_clock::now() - start < std::chrono::minutes(1))
      std::this_thread::sleep_for(milliseconds(1));
    CHECK(fails());
    CHECK(fs::exists(file));  // tasks may read it still
  }
  CHECK_FALSE(fs::exists(file));
}

TEST_CASE("journal: a damaged line in the middle costs only its task", "[fault]") {
  const TempFolder scratch;
  std::string bad = journal_line(record(1));
  bad[bad.size() / 2] ^= 1;
  spill(scratch / "main.jsonl",
        journal_line(record(0)) + "\n" + bad + "\n" + journal_line(record(2)) + "\n\n");
  spill(scratch / "notes.txt", "not a journal\n");
  const Journal journal = read_journal(scratch.path());
  CHECK(journal.damaged_lines == 2);
  CHECK(journal.find("order", "00aa", "11bb").size() == 2);
}

TEST_CASE("journal: records of other jobs and plans are not found", "[unit]") {
  const TempFolder scratch;
  {
    JournalWriter a(scratch / "a.jsonl");
    JournalWriter b(scratch / "b.jsonl");
    a.append(record(0));
    b.append(record(1));
  }
  const Journal journal = read_journal(scratch.path());
  CHECK(journal.find("order", "00aa", "11bb").size() == 2);
  CHECK(journal.find("order", "00ab", "11bb").empty());
  CHECK(journal.find("order", "00aa", "11bc").empty());
  CHECK(journal.find("orient", "00aa", "11bb").empty());
}

TEST_CASE("journal: one file has one writer", "[unit]") {
  const TempFolder scratch;
  const JournalWriter writer(scratch / "a.jsonl");
  CHECK_THROWS_AS(JournalWriter(scratch / "a.jsonl"), UsageError);
  JournalWriter other(scratch / "b.jsonl");
}

TEST_CASE("durable files: written whole, hashed by content", "[unit]") {
  const TempFolder scratch;
  const auto path = scratch / "f";
  write_durably(path, "one");
  write_durably(path, "two");
  CHECK(file_bytes(path) == "two");
  CHECK(read_text(path) == "two");
  CHECK_FALSE(std::filesystem::exists(scratch / "f.part"));
  CHECK(hash_file(path) == hash_text("two"));
  std::string large(1 << 20, 'x');
  large[700000] = 'y';
  spill(path, large);
  CHECK(hash_file(path) == hash_text(large));
  CHECK_THROWS_AS(hash_file(scratch / "none"), InputError);
  CHECK_THROWS_AS(write_durably(scratch / "no/folder", "x"), UsageError);
}

}  // namespace journal_test
