#include "stream/runtime/task_notes.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <fstream>
#include <span>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "stream/files/file_time.h"
#include "stream/files/json.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;
constexpr const char* kEnding = ".notes";

double wall_clock() {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

std::int64_t steady_seconds() {
  return std::chrono::duration_cast<std::chrono::seconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

std::string host_name() {
  char name[256] = {};
  if (::gethostname(name, sizeof name - 1) != 0) return "?";
  // Several node daemons on one machine are several machines to their user.
  const char* node = std::getenv("SLURMD_NODENAME");
  return node != nullptr ? node : name;
}

double modified(const fs::path& path) {
  struct stat status = {};
  return ::stat(path.c_str(), &status) == 0 ? 1e-9 * static_cast<double>(modification_ns(status)) : -1.0;
}

/// Now, by the clock that stamps the files of this folder; by our own where nothing can be written.
double folder_clock(const fs::path& folder) {
  const fs::path probe = folder / fmt::format("clock-{}.part", ::getpid());
  const int fd = ::open(probe.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (fd < 0) return wall_clock();
  const bool wrote = ::write(fd, "x", 1) == 1;
  ::close(fd);
  const double now = wrote ? modified(probe) : -1.0;
  ::unlink(probe.c_str());
  return now < 0.0 ? wall_clock() : now;
}

void read_file(const fs::path& path, double now, Notes& notes) {
  std::ifstream in(path, std::ios::binary);
  const double silent = std::max(0.0, now - modified(path));
  const std::size_t first = notes.tasks.size();
  const auto own = [&] { return std::span(notes.tasks).subspan(first); };
  std::string host;
  for (std::string line; std::getline(in, line);) {
    const Json j = try_parse_json(line);
    if (!j.is_object()) continue;
    try {
      if (j.contains("host")) {
        host = j.at("host").get<std::string>();
        for (NotedTask& noted : own()) noted.ended = true;  // the run before this one is over
      } else if (j.contains("tasks")) {
        const double begun = j.at("t").get<double>();
        NotedStage& stage = notes.stages[j.at("stage").get<std::string>()];
        stage = {j.at("tasks").get<std::uint64_t>(), j.at("units").get<std::uint64_t>(),
                 j.at("unit").get<std::string>(), stage.begun > 0.0 ? std::min(stage.begun, begun) : begun};
      } else if (j.contains("start")) {
        notes.tasks.push_back({j.at("stage").get<std::string>(), j.at("start").get<std::int64_t>(), host,
                               j.at("t").get<double>(), silent, false, ""});
      } else if (j.contains("failed")) {
        const auto stage = j.at("stage").get<std::string>();
        const auto task = j.at("failed").get<std::int64_t>();
        for (NotedTask& noted : own())
          if (noted.stage == stage && noted.task == task && !noted.ended) {
            noted.ended = true;
            noted.failure = j.at("why").get<std::string>();
          }
      }
    } catch (const JsonError&) {  // a line of another version tells nothing
    }
  }
}

std::string dumped(const Json& line) {
  return dump_json(line) + "\n";
}

}  // namespace

TaskNotes::TaskNotes(const fs::path& journal_folder, const std::string& writer) {
  const fs::path path = journal_folder / (writer + kEnding);
  fd_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0644);
  write(dumped({{"host", host_name()}, {"pid", ::getpid()}, {"t", wall_clock()}}));
}

TaskNotes::~TaskNotes() {
  if (fd_ >= 0) ::close(fd_);
}

void TaskNotes::write(const std::string& line) {
  const std::lock_guard lock(mutex_);
  last_.store(steady_seconds());
  // What cannot be noted is not known: the work does not stop for it.
  if (fd_ >= 0 && ::write(fd_, line.data(), line.size()) < 0 && errno != EINTR) {
    ::close(fd_);
    fd_ = -1;
  }
}

void TaskNotes::stage(const std::string& stage, std::uint64_t tasks, std::uint64_t units,
                      const std::string& unit) {
  write(dumped({{"stage", stage}, {"tasks", tasks}, {"units", units}, {"unit", unit}, {"t", wall_clock()}}));
}

void TaskNotes::started(const std::string& stage, std::int64_t task) {
  write(dumped({{"stage", stage}, {"start", task}, {"t", wall_clock()}}));
}

void TaskNotes::failed(const std::string& stage, std::int64_t task, const std::string& why) {
  write(dumped({{"stage", stage}, {"failed", task}, {"why", why}, {"t", wall_clock()}}));
}

void TaskNotes::alive() {
  std::int64_t last = last_.load(std::memory_order_relaxed);
  const std::int64_t now = steady_seconds();
  if (now - last < kAliveSeconds || !last_.compare_exchange_strong(last, now)) return;
  write("{}\n");
}

Notes read_notes(const fs::path& journal_folder) {
  Notes notes;
  const double now = folder_clock(journal_folder);
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(journal_folder))
    if (entry.path().extension() == kEnding) files.push_back(entry.path());
  std::sort(files.begin(), files.end());
  for (const fs::path& file : files) read_file(file, now, notes);
  return notes;
}

}  // namespace tessera
