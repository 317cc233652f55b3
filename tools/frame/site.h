/// \file site.h
/// Sites of 3D Tiles as commands write them: of a mesh that is there (`tiles`), or of one that is being made
/// (`reconstruct --tiles`).
#pragma once
#include <cstdint>
#include <filesystem>

#include "stream/files/json.h"
#include "stream/runtime/job.h"
#include "stream/stages/tiles/tiles_options.h"

namespace tessera::cli {

/// A folder for tiles.
class Site {
 public:
  /// \param option  that names the folder: "-o", "--tiles"
  Site(const std::filesystem::path& folder, std::string option);
  std::filesystem::path tileset() const { return folder_ / "tileset.json"; }
  std::filesystem::path report() const { return std::filesystem::path(folder_) += ".report.json"; }

  /// Writes nothing. \param state  of the job of tiles, or of the job that makes its mesh: inputs and how it runs
  /// \throws UsageError  the folder cannot be made, is a file, holds something that no site of ours is, or an input lies
  ///   among its tiles
  void check(const JobState& state) const;
  /// Also of a site whose mesh is still to be made. \param state  of the job that makes it
  /// \throws UsageError  mesh or work directory lie in the folder or the other way round, or it holds an older site
  void check_before_mesh(const JobState& state) const;

  /// Runs the job, in the folder, which is made. A site that is done stays as it is.
  /// \param state  inputs: the mesh, with how to run  \param checked  by check_before_mesh(), before the mesh was there
  /// \returns its report, with "resumed_done": true where nothing was left to do
  /// \throws as run_job(); UsageError where files of a site that is done are not there any more
  Json make(const TilesOptions& options, JobState state, bool checked) const;

 private:
  JobState tiles_state(const JobState& state) const;
  void check_folder(const JobState& state) const;
  std::filesystem::path folder_;
  std::string option_;
};

/// --tiles of a job that makes a mesh.
void add_tiles(OptionTable& table, std::filesystem::path& folder);

/// Two lines on stdout. \param report  of Site::make()
void print_site(const Site& site, const Json& report);

}  // namespace tessera::cli
