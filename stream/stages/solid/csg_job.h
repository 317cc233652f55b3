/// \file csg_job.h
/// Constructive solid geometry over meshes and shapes: one closed mesh whose new edges are sharp.
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "stream/runtime/job.h"
#include "stream/runtime/option_table.h"
#include "stream/stages/solid/resurface_job.h"
#include "stream/stages/solid/solid_stages.h"

namespace tessera {

struct CsgOptions : SolidSurfaceOptions {
  /// The tree as a postfix list, which csg_scene.h makes: what is part of the job, whatever file it came from.
  std::string program;
  bool exact = false;  ///< cut the faces of the meshes along each other instead (exact_csg.h)

  CsgOptions() { min_component = 0; }
  void validate() const {}
};
OptionTable option_table(CsgOptions& options);

JobDescription csg_job(const CsgOptions& options);

/// A scan of a scene: a mesh of it that a job of its own makes first.
struct CsgScan {
  std::vector<std::filesystem::path> files;
  std::string
      options;  ///< of `reconstruct`, as JobState::settings has them; holes are closed unless the scene says else
  bool operator==(const CsgScan&) const = default;
};
/// A tree and the files that it names, in order: meshes, then tool paths.
struct CsgScene {
  std::vector<std::filesystem::path> meshes, paths;
  std::vector<CsgScan> scans;                  ///< each once
  std::map<std::size_t, std::size_t> scan_of;  ///< mesh -> scan that it is to be made of; its path is empty
  std::string program;
};

/// From words: files, `+` (union), `-` (difference), `*` or `&` (intersection), parentheses; from left to right.
/// \throws UsageError naming the word that makes no sense
CsgScene parse_csg_words(const std::vector<std::string>& words);
/// From a file (README, "Scenes"). Meshes and other scenes are looked for beside it.
/// \throws InputError naming file and place: no JSON, unknown keys or shapes, numbers missing, no solid at all, a scene
///         that holds itself
CsgScene read_csg_scene(const std::filesystem::path& file);

/// The model of a program. \throws InputError when it has no bound, names too many solids, or is none
SolidModel csg_model(const CsgOptions& options);

}  // namespace tessera
