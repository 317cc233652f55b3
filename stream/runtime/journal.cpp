#include "stream/runtime/journal.h"

#include <algorithm>
#include <cerrno>
#include <ctime>
#include <fstream>
#include <stdexcept>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/file_lock.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"

namespace tessera {
namespace {

constexpr std::string_view kHead = "{\"xxh3\":\"";
constexpr std::string_view kMiddle = "\",\"record\":";
constexpr std::size_t kHexDigits = 16;
constexpr int kNameTries = 100;

Json to_json(const TaskRecord& r) {
  Json files = Json::array();
  for (const FileRecord& f : r.files)
    files.push_back({{"name", f.name}, {"bytes", f.bytes}, {"xxh3", hex64(f.xxh3)}});
  Json j = fields_to_json(r);
  j["files"] = std::move(files);
  return j;
}

TaskRecord from_json(const Json& j) {
  auto r = fields_from_json<TaskRecord>(j);
  for (const Json& f : j.at("files")) {
    r.files.push_back({f.at("name").get<std::string>(), f.at("bytes").get<std::uint64_t>(),
                       std::stoull(f.at("xxh3").get<std::string>(), nullptr, 16)});
  }
  return r;
}

}  // namespace

std::string journal_line(const TaskRecord& record) {
  // Names of files may hold any bytes; JSON holds UTF-8 only.
  const std::string text = dump_json(to_json(record));
  return fmt::format("{}{}{}{}}}", kHead, hex64(hash_text(text)), kMiddle, text);
}

bool parse_journal_line(const std::string& line, TaskRecord& record) {
  const std::size_t start = kHead.size() + kHexDigits + kMiddle.size();
  if (line.size() <= start + 1 || line.back() != '}' || line.compare(0, kHead.size(), kHead) != 0 ||
      line.compare(kHead.size() + kHexDigits, kMiddle.size(), kMiddle) != 0) {
    return false;
  }
  const std::string text = line.substr(start, line.size() - start - 1);
  if (hex64(hash_text(text)) != line.substr(kHead.size(), kHexDigits)) return false;
  try {
    record = from_json(parse_json(text));
    // A checksum is easily made: who can write here may say anything.
  } catch (const JsonError&) {
    return false;
  } catch (const std::logic_error&) {  // not a number in hexadecimal digits
    return false;
  }
  return true;
}

JournalWriter::JournalWriter(const std::filesystem::path& file) : path_(file) {
  fd_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (fd_ < 0) throw_write_error(file, errno);
  try {
    if (try_file_lock(fd_, LOCK_EX) != 0) {
      throw UsageError(
          fmt::format("{}: another process is doing this task; wait for it or stop it", file.string()));
    }
    struct stat status = {};
    if (::fstat(fd_, &status) != 0) throw_write_error(file, errno);
    const auto size = static_cast<std::uint64_t>(status.st_size);
    // A kill can tear the last line only: cut it off, else the next line would be glued to it.
    std::uint64_t end = size;
    char last = '\n';
    while (end > 0) {
      if (::pread(fd_, &last, 1, static_cast<off_t>(end - 1)) != 1) throw_write_error(file, errno);
      if (last == '\n') break;
      --end;
    }
    if (end != size && ::ftruncate(fd_, static_cast<off_t>(end)) != 0) throw_write_error(file, errno);
    bytes_ = end;
    sync_folder(file.parent_path());
  } catch (...) {
    ::close(fd_);
    throw;
  }
}

JournalWriter::JournalWriter(const std::filesystem::path& folder, const std::string& prefix) {
  char host[256] = {};
  if (::gethostname(host, sizeof host - 1) != 0) host[0] = '\0';
  for (int attempt = 0;; ++attempt) {
    timespec now = {};
    ::clock_gettime(CLOCK_REALTIME, &now);
    path_ =
        folder / fmt::format("{}-{}-{}-{:x}{:08x}.jsonl", prefix, host, ::getpid(), now.tv_sec, now.tv_nsec);
    fd_ = ::open(path_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0644);
    if (fd_ >= 0) break;
    if (errno != EEXIST || attempt == kNameTries) throw_write_error(path_, errno);
  }
  try {
    sync_folder(folder);
  } catch (...) {
    ::close(fd_);
    throw;
  }
}

JournalWriter::~JournalWriter() {
  ::close(fd_);
}

void JournalWriter::append(const TaskRecord& record, bool durable) {
  const std::string line = journal_line(record) + "\n";
  const std::lock_guard lock(mutex_);
  std::size_t done = 0;
  while (done < line.size()) {
    const ssize_t wrote =
        ::pwrite(fd_, line.data() + done, line.size() - done, static_cast<off_t>(bytes_ + done));
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote < 0) throw_write_error(path_, errno);
    done += static_cast<std::size_t>(wrote);
  }
  if (durable && ::fdatasync(fd_) != 0) throw_write_error(path_, errno);
  bytes_ += line.size();
}

void JournalWriter::sync() {
  if (::fdatasync(fd_) != 0) throw_write_error(path_, errno);
}

std::map<std::int64_t, const TaskRecord*> Journal::find(const std::string& stage, const std::string& basis,
                                                        const std::string& plan) const {
  std::map<std::int64_t, const TaskRecord*> found;
  const auto at = stages.find(stage);
  if (at == stages.end()) return found;
  for (const TaskRecord& record : at->second) {
    if (record.basis == basis && record.plan == plan) found[record.task] = &record;
  }
  return found;
}

namespace {

void read_lines(const std::filesystem::path& file, Journal& journal) {
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(fmt::format("{}: cannot be read", file.string()));
  std::string line;
  while (std::getline(in, line)) {
    TaskRecord record;
    if (parse_journal_line(line, record)) {
      journal.stages[record.stage].push_back(std::move(record));
    } else {
      ++journal.damaged_lines;
    }
  }
}

}  // namespace

Journal read_journal(const std::filesystem::path& folder, const std::string& prefix) {
  Journal journal;
  std::vector<std::filesystem::path> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".jsonl" && entry.path().filename().string().starts_with(prefix))
      files.push_back(entry.path());
  }
  std::sort(files.begin(), files.end());
  for (const std::filesystem::path& file : files) read_lines(file, journal);
  return journal;
}

void refresh_names(const std::filesystem::path& folder) {
  timespec now = {};
  ::clock_gettime(CLOCK_REALTIME, &now);
  const auto probe = folder / fmt::format("look-{}-{:x}.part", ::getpid(), now.tv_nsec);
  const int fd = ::open(probe.c_str(), O_WRONLY | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (fd < 0) return;  // then what is seen may be some seconds old
  ::close(fd);
  ::unlink(probe.c_str());
}

Journal read_journal_file(const std::filesystem::path& file) {
  Journal journal;
  read_lines(file, journal);
  return journal;
}

}  // namespace tessera
