#include "stream/queue/folder_watch.h"

#include <algorithm>
#include <chrono>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/path_text.h"
#include "stream/formats/points/point_source.h"
#include "stream/runtime/work_dir.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

fs::path failure_file(const fs::path& output) {
  return output.string() + ".failed";
}

/// What tells a scan from the same name with other bytes.
Json mark_of(const fs::path& scan) {
  return {{"bytes", static_cast<std::uint64_t>(fs::file_size(scan))},
          {"modified", static_cast<std::int64_t>(fs::last_write_time(scan).time_since_epoch().count())}};
}

bool failed_before(const WatchedScan& scan) {
  const fs::path file = failure_file(scan.output);
  if (!fs::exists(file)) return false;
  try {
    return parse_json(read_text(file)).at("scan") == mark_of(scan.scan);
  } catch (const JsonError&) {
    return false;
  }
}

/// Where jobs keep what they have done; empty: beside their outputs.
fs::path work_folder(const WatchOptions& options) {
  if (options.job.empty()) return {};
  const Json job = parse_json(read_text(options.job), options.job.string());
  return job.contains("temp") && job.at("temp").is_string() ? job.at("temp").get<std::string>() : "";
}

ScanState state_of(const WatchOptions& options, const fs::path& temp, const WatchedScan& scan) {
  // A job whose mesh is there may still write its report.
  if (work_in_use(work_path(scan.output, temp))) return ScanState::kBusy;
  if (fs::exists(scan.output)) return ScanState::kDone;
  const std::chrono::duration<double> age = fs::file_time_type::clock::now() - fs::last_write_time(scan.scan);
  if (age.count() < options.settle) return ScanState::kGrowing;
  return failed_before(scan) ? ScanState::kFailed : ScanState::kReady;
}

bool lies_in(const fs::path& inner, const fs::path& outer) {
  const auto [at, rest] = std::mismatch(outer.begin(), outer.end(), inner.begin(), inner.end());
  return at == outer.end();
}

}  // namespace

void WatchOptions::validate() const {
  if (in.empty() || out.empty())
    throw UsageError("name the folder of scans and the one for meshes: tessera watch IN OUT --job FILE");
  if (!fs::is_directory(in)) throw InputError(in.string() + ": there is no such folder");
  const fs::path from = fs::weakly_canonical(in), to = fs::weakly_canonical(out);
  if (lies_in(to, from) || lies_in(from, to))
    throw UsageError(out.string() + ": what is made would be taken for scans; name a folder beside " +
                     in.string());
  if (run != "reconstruct") throw UsageError("--run " + run + ": scans are worked on by reconstruct");
}

std::vector<WatchedScan> look_at_folder(const WatchOptions& options) {
  std::vector<fs::path> files;
  try {
    files = expand_inputs({options.in.string()});
  } catch (const InputError&) {
    if (fs::is_directory(options.in)) return {};  // no scan yet
    throw;
  }
  std::sort(files.begin(), files.end());
  const fs::path temp = work_folder(options);
  std::vector<WatchedScan> scans;
  for (const fs::path& file : files) {
    WatchedScan scan{file, options.out / file.lexically_relative(options.in)};
    scan.output += ".ply";
    std::error_code gone;
    if (!fs::exists(file, gone)) continue;
    scan.state = state_of(options, temp, scan);
    scans.push_back(std::move(scan));
  }
  return scans;
}

std::vector<std::string> watch_words(const WatchOptions& options, const WatchedScan& scan) {
  std::vector<std::string> words = {options.run, scan.scan.string(), "-o", scan.output.string(), "--quiet"};
  if (!options.job.empty()) words.insert(words.end(), {"--job", options.job.string()});
  return words;
}

void note_failed_scan(const WatchedScan& scan, const std::string& sentence) {
  const Json note = {{"error", sentence}, {"scan", mark_of(scan.scan)}};
  fs::create_directories(scan.output.parent_path());
  write_durably(failure_file(scan.output), dump_json(note, 1) + "\n");
}

}  // namespace tessera
