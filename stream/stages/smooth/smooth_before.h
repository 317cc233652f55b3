/// \file smooth_before.h
/// Smoothing inside a job that decimates: the mesh of full resolution is smoothed before the first pass, so that the passes
/// need not spend faces on its noise, and the fits of `denoise` see every sample.
///
/// Vertices move by at most half of the tolerance. Every face of the smoothed mesh bears how far its corners moved: the
/// passes begin with that as its bound, so they have the whole tolerance where little moved and stay near where much did,
/// and the certificate against the given mesh holds by the same sum.
///
///   reach, smooth-K  smooth_stages.h
///   noise-look       a first look for a tolerance alone, at a fifth of what `noise` measures: where it tells that the noise is far
///                    from a fifth of an edge, below which no tolerance asks for it, `noise` measures no more
///   noise            how noisy the given mesh is: decides `auto`, and how strong the plate of `implicit` is
///   noise-left       the same of the smoothed mesh, at the same vertices
#pragma once
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "kernels/smooth/smooth.h"
#include "stream/files/json.h"
#include "stream/meshes/mesh_store.h"
#include "stream/runtime/stage.h"

namespace tessera {

struct SmoothBefore {
  std::string method = "off";                        ///< or implicit, denoise, auto
  std::function<MeshStore(const JobState&)> mesh;    ///< as given; it stays
  std::function<double(const JobState&)> tolerance;  ///< of smoothing and decimation together; 0 = no limit
  bool keep_crossings = false;                       ///< as SmoothPlan's
};

std::vector<StageEntry> smooth_before_stages(const SmoothBefore& before);
/// reach, noise-look and noise alone, for who takes a tolerance from it (auto_tolerance.h).
std::vector<StageEntry> noise_stages(const std::function<MeshStore(const JobState&)>& mesh);
/// What `noise` found, scan units.
struct MeshNoise {
  double noise = 0.0;  ///< standard deviation along the normal
  double edge = 0.0;   ///< root mean square
};
/// Nothing before the stage is done.
std::optional<MeshNoise> measured_noise(const std::filesystem::path& work);
/// The smoothed mesh. \pre its stages are done
MeshStore open_smoothed_before(const JobState& state, const SmoothBefore& before);
/// The largest rounds that the job may run.
std::vector<SmoothRound> smooth_before_rounds(const std::string& method);
/// The report's `smoothing`: {method, lambda (of a plate), noise {before, after, edge, vertices}, largest_move, rms_move,
/// limited}; null where nothing was smoothed.
Json smoothing_of(const Json& report);

// Between its parts.

inline constexpr const char *kNoiseLook = "noise-look", *kNoise = "noise", *kNoiseLeft = "noise-left";
/// Left by `noise`: {"noise", "edge"}, scan units.
inline constexpr const char* kNoiseFile = "noise.json";
/// Left by `noise-look`: {"counts", "enough"}.
inline constexpr const char* kLookFile = "noise-look.json";
/// Of a task that looks at so many vertices and faces at once.
std::uint64_t noise_task_bytes(std::uint64_t vertices, std::uint64_t faces);
/// The stage of this name measures the mesh. \pre the stage `range` is done
std::unique_ptr<Stage> make_noise_stage(const JobState& state, const std::string& name, MeshStore mesh);

}  // namespace tessera
