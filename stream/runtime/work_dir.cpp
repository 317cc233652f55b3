#include "stream/runtime/work_dir.h"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdlib>
#include <functional>
#include <thread>  // sleep_for alone
#include <utility>

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/file_lock.h"
#include "stream/files/file_time.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/files/planned_writes.h"
#include "stream/files/read_file.h"
#include "stream/runtime/option_table.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

constexpr const char* kJobFile = "job.json";
constexpr const char* kLockFile = "lock";
constexpr std::uint64_t kSampleBytes = 65536;
constexpr std::uint64_t kSamples = 16;
constexpr int kLockTries = 20;
constexpr auto kLockPause = std::chrono::milliseconds(50);

fs::path job_file(const fs::path& work) {
  return work / kJobFile;
}

/// The folder that remove() empties: never taken for a work directory.
fs::path discarded(const fs::path& work) {
  fs::path path = work;
  path += ".discarded";
  return path;
}

void make_folders(const fs::path& path) {
  std::error_code error;
  fs::create_directories(path, error);
  if (error) throw_write_error(path, error.value());
}

/// True if nothing but what a killed creation leaves is in the folder.
bool barely_begun(const fs::path& work) {
  return std::all_of(fs::directory_iterator(work), fs::directory_iterator(),
                     [](const fs::directory_entry& entry) {
                       const std::string name = entry.path().filename().string();
                       return name == kLockFile || name == output_aside(kJobFile) || name == "journal";
                     });
}

/// \returns a descriptor that holds the lock
int lock_folder(const fs::path& work, int mode) {
  const fs::path path = work / kLockFile;
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
  if (fd < 0) throw_write_error(path, errno);
  int error = try_file_lock(fd, mode);
  // A process that was just killed lets go a moment later.
  for (int wait = 0; error == EWOULDBLOCK && wait < kLockTries; ++wait) {
    std::this_thread::sleep_for(kLockPause);
    error = try_file_lock(fd, mode);
  }
  if (error == 0) {
    // Between open and lock its owner may have removed the directory, and this file with it.
    struct stat opened = {};
    struct stat there = {};
    if (::fstat(fd, &opened) == 0 && ::stat(path.c_str(), &there) == 0 && opened.st_ino == there.st_ino)
      return fd;
    error = EWOULDBLOCK;
  }
  ::close(fd);
  if (error == EWOULDBLOCK) {
    throw UsageError(
        fmt::format("{}: another process works on this job; wait for it or stop it", work.string()));
  }
  throw_write_error(path, error);
}

Json read_job_file(const fs::path& work) {
  const fs::path path = job_file(work);
  try {
    const Json job = parse_json(read_text(path));
    if (job.at("identity").at("schema").is_number()) return job;
  } catch (const JsonError&) {
  }
  throw InputError(fmt::format("{}: damaged: discard the work directory with --force", path.string()));
}

/// Leftovers of killed tasks. Names that are part of nothing committed.
void remove_parts(const fs::path& work) {
  std::vector<fs::path> parts;
  for (const auto& entry : fs::recursive_directory_iterator(work)) {
    const fs::path ending = entry.path().extension();
    if (ending == ".part" || ending == output_aside("x").extension()) parts.push_back(entry.path());
  }
  for (const fs::path& part : parts) fs::remove(part);
}

std::string difference(const Json& was, const Json& is) {
  for (const char* key : {"schema", "version", "command"}) {
    if (was.value(key, Json()) != is.at(key)) {
      return first_difference({{key, was.value(key, Json())}}, {{key, is.at(key)}});
    }
  }
  const std::string options = first_difference(was.value("options", Json()), is.at("options"));
  return options.empty() ? "its input files are others or have changed" : "option " + options;
}

}  // namespace

InputFingerprint fingerprint_input(const fs::path& path) {
  const ReadFile file(path);
  InputFingerprint f;
  f.path = fs::absolute(path).lexically_normal().string();
  f.bytes = file.size();
  f.modified_ns = file.modified();
  std::vector<char> buffer;
  std::vector<std::uint64_t> hashes;
  const std::uint64_t last = f.bytes > kSampleBytes ? f.bytes - kSampleBytes : 0;
  std::uint64_t previous = ~std::uint64_t{0};
  for (std::uint64_t s = 0; s < kSamples; ++s) {
    const std::uint64_t at = last / (kSamples - 1) * s + last % (kSamples - 1) * s / (kSamples - 1);
    if (at == previous) continue;
    previous = at;
    buffer.resize(std::min(kSampleBytes, f.bytes - at));
    file.read_at(at, buffer.data(), buffer.size());
    hashes.push_back(hash_bytes(buffer.data(), buffer.size()));
  }
  f.xxh3 = hash_bytes(hashes.data(), hashes.size() * sizeof(std::uint64_t));
  return f;
}

void require_same_inputs(const Json& identity) {
  for (const Json& input : identity.at("inputs")) {
    const std::string path = bytes_of_json_text(input.at("path").get<std::string>());
    struct stat status = {};
    if (::stat(path.c_str(), &status) == 0 &&
        static_cast<std::uint64_t>(status.st_size) == input.at("bytes").get<std::uint64_t>() &&
        modification_ns(status) == input.at("modified_ns").get<std::int64_t>())
      continue;
    throw InputError(path +
                     ": has changed since the job began; inputs must not change while they are read: " +
                     "run it again with --force");
  }
}

Json to_json(const InputFingerprint& f) {
  return {{"path", json_text(f.path)},
          {"bytes", f.bytes},
          {"modified_ns", f.modified_ns},
          {"xxh3_sampled", hex64(f.xxh3)}};
}

Json job_identity(const std::string& command, const JobState& state,
                  const std::vector<InputFingerprint>& inputs) {
  Json list = Json::array();
  for (const InputFingerprint& input : inputs) list.push_back(to_json(input));
  return {{"schema", kWorkSchema},
          {"version", TESSERA_VERSION},
          {"command", command},
          {"options", parse_json(state.settings)},
          {"inputs", std::move(list)}};
}

fs::path work_path(const fs::path& output, const fs::path& temp) {
  const fs::path name = output.filename().string() + ".tessera";
  const fs::path folder = temp.empty() ? fs::absolute(output).parent_path() : fs::absolute(temp);
  return (folder / name).lexically_normal();
}

void require_not_queued(const fs::path& work) {
  if (!fs::exists(work / kQueueMark)) return;
  const Json mark = try_parse_json(read_text(work / kQueueMark));
  const char* token = std::getenv(kQueueToken);
  if (token != nullptr && mark.is_object() && mark.value("token", "") == token) return;
  throw UsageError(
      fmt::format("{}: a batch queue has this job: tessera status tells how far it is, tessera cancel takes "
                  "it out of the queue",
                  work.string()));
}

bool work_in_use(const fs::path& work) {
  const int fd = ::open((work / kLockFile).c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC);
  if (fd < 0) return false;
  const bool used = try_file_lock(fd, LOCK_EX) == EWOULDBLOCK;
  ::close(fd);
  return used;
}

WorkDir WorkDir::open_job(const fs::path& path, const Json& identity, bool force) {
  remove_discarded(path);
  WorkDir dir;
  dir.path_ = path;
  dir.identity_ = identity;
  for (int attempt = 0;; ++attempt) {
    if (fs::exists(path) && !fs::exists(job_file(path)) && !(fs::is_directory(path) && barely_begun(path))) {
      throw UsageError(fmt::format(
          "{}: is there and is no work directory: move it away or choose another --temp", path.string()));
    }
    make_folders(path);
    dir.lock_ = lock_folder(path, LOCK_EX);
    if (!fs::exists(job_file(path))) break;
    std::string why;
    try {
      const Json was = read_job_file(path).at("identity");
      if (was == identity) {
        remove_parts(path);
        make_folders(dir.journal_folder());
        return dir;
      }
      why = difference(was, identity);
    } catch (const InputError&) {
      if (!force) throw;
    }
    if (!force || attempt > 0) {
      throw UsageError(
          fmt::format("{}: this work directory belongs to another job ({}): give --force to discard it, "
                      "or another output or --temp",
                      path.string(), why));
    }
    dir.remove();
  }
  make_folders(dir.journal_folder());
  dir.created_ = true;
  return dir;
}

bool WorkDir::holds(const fs::path& path, const Json& identity) {
  try {
    return fs::exists(job_file(path)) && read_job_file(path).at("identity") == identity;
  } catch (const InputError&) {
    return false;
  }
}

WorkDir WorkDir::open_existing(const fs::path& path, bool locked) {
  if (!fs::exists(job_file(path))) {
    throw InputError(fmt::format("{}: is no work directory of Tessera (it has no job.json)", path.string()));
  }
  WorkDir dir;
  dir.path_ = fs::absolute(path).lexically_normal();
  if (locked) dir.lock_ = lock_folder(path, LOCK_SH);
  dir.identity_ = read_job_file(path).at("identity");
  if (dir.identity_.at("schema") != kWorkSchema || dir.identity_.value("version", "") != TESSERA_VERSION) {
    throw InputError(fmt::format("{}: was made by version {} of Tessera, this is {}", path.string(),
                                 dir.identity_.value("version", "?"), TESSERA_VERSION));
  }
  return dir;
}

WorkDir::~WorkDir() {
  if (lock_ >= 0) ::close(lock_);
}

WorkDir::WorkDir(WorkDir&& other) noexcept
    : path_(std::move(other.path_)),
      identity_(std::move(other.identity_)),
      created_(other.created_),
      lock_(std::exchange(other.lock_, -1)) {}

std::string WorkDir::job_hash() const {
  return hex64(hash_text(dump_json(identity_)));
}

void WorkDir::write_run(const JobState& state) {
  Json run = plan_to_json(state.run);
  run["keep"] = state.run.keep;
  const Json job = {{"identity", identity_},
                    {"job", job_hash()},
                    {"output", json_text(fs::absolute(state.output).lexically_normal())},
                    {"run", std::move(run)}};
  write_durably(job_file(path_), dump_json(job, 1) + "\n");
}

JobState WorkDir::read_state() const {
  const Json job = read_job_file(path_);
  JobState state;
  state.work = path_;
  state.output = bytes_of_json_text(job.at("output").get<std::string>());
  for (const Json& input : identity_.at("inputs"))
    state.inputs.emplace_back(bytes_of_json_text(input.at("path").get<std::string>()));
  state.settings = dump_json(identity_.at("options"));
  option_table(state.run).from_json(job.at("run"));
  return state;
}

std::vector<std::string> WorkDir::unknown_files(const std::set<std::string>& known) const {
  std::vector<std::string> unknown;
  for (const auto& entry : fs::recursive_directory_iterator(path_)) {
    if (entry.is_directory()) continue;
    const fs::path name = entry.path().lexically_relative(path_);
    const std::string root = name.begin()->string();
    const bool own = root == "journal" || root == kJobFile || root == kLockFile || root == "log.txt" ||
                     root == "report.json" || root == kQueueFolder;
    if (!own && known.count(name.string()) == 0) unknown.push_back(name.string());
  }
  std::sort(unknown.begin(), unknown.end());
  return unknown;
}

void WorkDir::remove_empty_folders() const {
  std::vector<fs::path> folders;
  for (const auto& entry : fs::recursive_directory_iterator(path_)) {
    if (entry.is_directory() && entry.path() != journal_folder() && entry.path() != path_ / kQueueFolder)
      folders.push_back(entry.path());
  }
  // Longer paths first: a folder comes after those in it.
  std::sort(folders.begin(), folders.end(), std::greater<>());
  for (const fs::path& folder : folders) {
    if (fs::is_empty(folder)) fs::remove(folder);
  }
}

void WorkDir::remove_discarded(const fs::path& path) {
  fs::remove_all(discarded(path));
}

void WorkDir::remove() {
  const fs::path aside = discarded(path_);
  remove_discarded(path_);
  rename_durably(path_, aside);
  if (lock_ >= 0) ::close(std::exchange(lock_, -1));
  fs::remove_all(aside);
}

}  // namespace tessera
