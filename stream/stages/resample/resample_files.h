/// \file resample_files.h
/// What the stages of resampling hand on.
#pragma once
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "kernels/blends/resample_blend.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {

inline const std::string kResampleImport = "mesh";

/// Of the whole mesh.
struct MeshScale {
  double edge = 0.0;       ///< median
  double tolerance = 0.0;  ///< as asked for, or by default
  void save(const std::filesystem::path& path) const;
  static MeshScale of_work(const std::filesystem::path& work);
  static constexpr const char* kFile = "scale.json";
};

/// Vertices in bands, and edges between two of them by keys, of one task.
struct BandPart {
  std::vector<BandVertex> vertices;
  std::vector<std::pair<std::uint64_t, std::uint64_t>> links;
  std::uint64_t save(const std::filesystem::path& path) const;  ///< returns bytes written
  static BandPart load(const std::filesystem::path& path);
  /// Vertices and links of a file, without reading them.
  static std::pair<std::uint64_t, std::uint64_t> count(const std::filesystem::path& path);
};

struct FoundCurve {
  std::string name;
  BlendCurve curve;
  bool by_hand = false;  ///< whether it is convex or not is to be found out, its normals too
};
void save_blend_curves(const std::filesystem::path& path, const std::vector<FoundCurve>& curves);
std::vector<FoundCurve> load_blend_curves(const std::filesystem::path& work);
inline constexpr const char* kCurvesFile = "tracks.json";

/// What a blend changes.
std::uint64_t save_blend(const std::filesystem::path& path, const ResampledBlend& blend);
/// Without report.
ResampledBlend load_blend(const std::filesystem::path& path);
std::string blend_file(std::size_t blend);  ///< name in the work directory

}  // namespace tessera
