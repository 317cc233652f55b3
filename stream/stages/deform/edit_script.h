/// \file edit_script.h
/// What people write of an edit, as JSON (README, "Edits"): regions of a surface, and where its handles go.
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "kernels/edit/edit_regions.h"

namespace tessera {

struct EditScript {
  int order = 2;
  bool anisotropic = false;
  bool volumes = false;      ///< details keep the volumes of their prisms
  bool keep_volume = false;  ///< and make up for what the smooth base loses
  std::vector<EditRegion> regions;
  /// Per region: vertices of the file that it names besides; they become points.
  std::vector<std::vector<std::uint64_t>> vertices;
  std::vector<std::string> handles;  ///< those with a motion
  std::vector<Placement> motions;
};

/// The file as one line of JSON, checked. \throws InputError naming file and place: no JSON, unknown keys, numbers missing
std::string read_edit_text(const std::filesystem::path& file);
/// \param name  for messages \throws InputError as read_edit_text()
EditScript parse_edit(const std::string& text, const std::string& name);

/// An edit with control points as one more handle. Without an edit the whole surface may follow.
/// \param file  a line of x,y,z,X,Y,Z for each; lines that are empty or begin with '#' are left out
/// \throws InputError naming file and line
std::string with_controls(const std::string& edit, const std::filesystem::path& file);

/// Only the motions of a file: {"handles": {...}}, or {"poses": [{"name": ..., "handles": {...}}, ...]}.
struct EditPose {
  std::string name;  ///< empty for a single one
  std::string text;  ///< {"handles": {...}}
};
std::vector<EditPose> read_poses(const std::filesystem::path& file);
/// Maps by handle; handles without a motion stay. \throws InputError for a motion of a handle that there is not
std::vector<Placement> pose_of(const EditScript& script, std::span<const std::string> handles);

}  // namespace tessera
