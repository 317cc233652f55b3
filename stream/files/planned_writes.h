/// \file planned_writes.h
/// What a command may write: one function decides for every path of every command, before anything else happens.
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace tessera {

struct PlannedWrite {
  enum class Existing {
    kRefuse,   ///< what is there stays
    kReplace,  ///< --force, or what is there is known to be this command's own
    kAppend    ///< a log: appended to if it is one of ours, or empty
  };
  std::filesystem::path path;
  std::string option;  ///< as the user knows it: "-o", "--report", "beside -o"
  Existing existing = Existing::kRefuse;
};

/// kReplace with --force, else kRefuse.
inline PlannedWrite::Existing existing_by(bool force) {
  return force ? PlannedWrite::Existing::kReplace : PlannedWrite::Existing::kRefuse;
}

/// \param reads   every file that the command reads, whoever named it
/// \param writes  every file that it writes; no name, no write
/// \param emptied  a folder of its own that it deletes in the end; may be empty
/// \throws UsageError  a write is an input (by name, link or hard link), another write, a folder or no regular file, is
///   there and may not be replaced, or has no folder that can be written to; or something of the user's lies in `emptied`
void check_writes(std::span<const std::filesystem::path> reads, std::span<const PlannedWrite> writes,
                  const std::filesystem::path& emptied = {});

/// Where an output is written until it is complete: no other program has a file of this name, so what is left there by a
/// killed run may go.
std::filesystem::path output_aside(const std::filesystem::path& path);

}  // namespace tessera
