/// \file folder_watch.h
/// A folder into which scans come, and what has become of each: a mesh beside its report in another folder.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace tessera {

struct WatchOptions {
  std::filesystem::path in, out;
  std::filesystem::path job;        ///< options of every job, as --job takes them
  std::string run = "reconstruct";  ///< the command
  double settle = 30.0;             ///< seconds without a change after which a scan counts as complete
  double every = 10.0;              ///< seconds between looks
  bool once = false;                ///< end when nothing is left to do

  /// \throws UsageError for folders that are one or in each other, and commands that are no jobs of one scan; InputError for a
  /// folder that is not there
  void validate() const;
};

enum class ScanState {
  kGrowing,  ///< changed within the time to settle
  kBusy,     ///< another process works on it: the job of a watch that was killed
  kReady,    ///< to be worked on, or gone on with
  kFailed,   ///< as it stands, for a reason that another try does not cure
  kDone,
};

struct WatchedScan {
  std::filesystem::path scan;
  std::filesystem::path output;  ///< in the other folder: flight/a.laz becomes flight/a.laz.ply
  ScanState state = ScanState::kReady;
};

/// Every scan of the folder, at any depth, by name.
std::vector<WatchedScan> look_at_folder(const WatchOptions& options);

/// The words of the program for a scan.
std::vector<std::string> watch_words(const WatchOptions& options, const WatchedScan& scan);

/// Leaves `<output>.failed`, with the sentence and what the scan was; it holds until the scan changes or the file is removed.
void note_failed_scan(const WatchedScan& scan, const std::string& sentence);

}  // namespace tessera
