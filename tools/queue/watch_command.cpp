#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/file_lock.h"
#include "stream/files/json.h"
#include "stream/queue/folder_watch.h"
#include "stream/runtime/child_process.h"
#include "stream/runtime/log.h"
#include "stream/runtime/stop.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

struct WatchArguments {
  WatchOptions options;
  std::vector<std::string> rest;
};

/// One line on stdout and in OUT/watch.log, while no other watch writes there.
class WatchLog {
 public:
  explicit WatchLog(const fs::path& folder) {
    const fs::path path = folder / "watch.log";
    file_ = ::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
    if (file_ < 0) throw ResourceError(path.string() + ": cannot be written");
    if (try_file_lock(file_, LOCK_EX) != 0)
      throw UsageError(folder.string() + ": another watch writes there; stop it, or name another folder");
  }
  ~WatchLog() { ::close(file_); }
  WatchLog(const WatchLog&) = delete;
  WatchLog& operator=(const WatchLog&) = delete;

  void say(const std::string& text) {
    const std::string line = utc_now() + " " + text + "\n";
    fmt::print("{}", line);
    std::fflush(stdout);
    // A full disk takes the line from the file, not the watch.
    if (::write(file_, line.data(), line.size()) < 0)
      fmt::print(stderr, "tessera: watch.log cannot be written\n");
  }

 private:
  int file_ = -1;
};

std::string done_text(const WatchedScan& scan, double seconds) {
  const fs::path report = scan.output.string() + ".report.json";
  std::uint64_t faces = 0;
  if (fs::exists(report))
    faces = parse_json(read_text(report)).value("mesh", Json::object()).value("faces", std::uint64_t{0});
  return fmt::format("{}: done in {:.1f} s, {} faces: {}", scan.scan.string(), seconds, faces,
                     scan.output.string());
}

/// Runs the job of one scan. \returns what failed in a way that another try may cure, else nothing
std::string work_on(const WatchOptions& options, const WatchedScan& scan, WatchLog& log) {
  fs::create_directories(scan.output.parent_path());
  log.say(scan.scan.string() + ": begins");
  const auto start = std::chrono::steady_clock::now();
  const ChildResult result = run_program("/proc/self/exe", watch_words(options, scan));
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  if (result.exit_code == 0) {
    log.say(done_text(scan, seconds));
    return {};
  }
  try {
    throw_child_failure(result, scan.scan.string());
  } catch (const StoppedError&) {
    log.say(scan.scan.string() + ": stopped, goes on with the next watch");
    throw;
  } catch (const Error& e) {
    if (e.code() == ExitCode::kStopped) throw;
    if (e.code() == ExitCode::kResources) {
      log.say(scan.scan.string() + ": waits: " + e.what());
      return e.what();
    }
    log.say(scan.scan.string() + ": failed: " + e.what());
    note_failed_scan(scan, e.what());
  } catch (const std::exception& e) {
    log.say(scan.scan.string() + ": failed: " + e.what());
    note_failed_scan(scan, e.what());
  }
  return {};
}

void sleep_for(double seconds) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (std::chrono::steady_clock::now() < end) {
    throw_if_stopped();
    ::poll(nullptr, 0, 100);
  }
}

void run_watch(const WatchArguments& arguments) {
  if (!arguments.rest.empty())
    throw UsageError("watch: unexpected argument '" + arguments.rest.front() + "'");
  const WatchOptions& options = arguments.options;
  options.validate();
  if (!options.job.empty() && !fs::is_regular_file(options.job))
    throw InputError(options.job.string() + ": cannot read the job file; name a file of JSON");
  fs::create_directories(options.out);
  WatchLog log(options.out);
  fs::path told_busy;
  for (;;) {
    std::string waits;
    bool more = false;  // comes without a try of ours
    for (const WatchedScan& scan : look_at_folder(options)) {
      throw_if_stopped();
      more = more || scan.state == ScanState::kGrowing || scan.state == ScanState::kBusy;
      if (scan.state == ScanState::kBusy && std::exchange(told_busy, scan.scan) != scan.scan)
        log.say(scan.scan.string() + ": waits: another process works on it");
      if (scan.state != ScanState::kReady) continue;
      if (const std::string reason = work_on(options, scan, log); !reason.empty()) waits = reason;
    }
    if (options.once && !more) {
      if (!waits.empty()) throw ResourceError(waits);
      return;
    }
    sleep_for(options.every);
  }
}

}  // namespace

cli::Command watch_command() {
  auto arguments = std::make_shared<WatchArguments>();
  WatchOptions& o = arguments->options;
  OptionTable t;
  t.add("in", &o.in, "folder into which scans come, at any depth").positional();
  t.add("out", &o.out, "folder for meshes, reports, pages and watch.log").positional();
  t.add("job", &o.job, "JSON file with the options of every job, as its command takes it").shown_as("FILE");
  t.add("run", &o.run, "the command that works on each scan").one_of({"reconstruct"});
  t.add("settle", &o.settle, "seconds without a change after which a scan counts as complete").at_least(0);
  t.add("every", &o.every, "seconds between looks into the folder").within(0.1, 86400);
  t.add("once", &o.once, "end when nothing is left to do");
  cli::Command command = {
      "watch",
      "Every scan that comes into a folder becomes a mesh, one after another: watch in/ out/ --job "
      "nightly.json. What was stopped or found no disk goes on; what failed waits until its scan changes.",
      t, [arguments] { run_watch(*arguments); }};
  command.rest = &arguments->rest;
  return command;
}

}  // namespace tessera
