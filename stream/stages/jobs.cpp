#include "stream/stages/jobs.h"

#include "octree/error.h"
#include "stream/points/reconstruct_options.h"
#include "stream/stages/bake/bake_job.h"
#include "stream/stages/decimate/decimate_job.h"
#include "stream/stages/deform/deform_job.h"
#include "stream/stages/merge/merge_job.h"
#include "stream/stages/reconstruct/reconstruct_job.h"
#include "stream/stages/remesh/remesh_job.h"
#include "stream/stages/resample/resample_job.h"
#include "stream/stages/smooth/smooth_job.h"
#include "stream/stages/solid/csg_job.h"
#include "stream/stages/solid/field_job.h"
#include "stream/stages/solid/resurface_job.h"
#include "stream/stages/tiles/tiles_job.h"

namespace tessera {
namespace {

template <typename Options, JobDescription (*describe)(const Options&)>
JobDescription from_text(const std::string& settings) {
  return describe(from_settings<Options>(settings));
}

struct Entry {
  const char* name;
  JobDescription (*describe)(const std::string& settings);
};
constexpr Entry kJobs[] = {
    // one line per job, alphabetical
    {"bake", from_text<BakeOptions, bake_job>},
    {"csg", from_text<CsgOptions, csg_job>},
    {"decimate", from_text<SimplifyOptions, decimate_job>},
    {"deform", from_text<DeformOptions, deform_job>},
    {"field", from_text<FieldJobOptions, field_job>},
    {"merge", from_text<MergeOptions, merge_job>},
    {"reconstruct", from_text<ReconstructOptions, reconstruct_job>},
    {"remesh", from_text<RemeshJobOptions, remesh_job>},
    {"resample", from_text<ResampleOptions, resample_job>},
    {"resurface", from_text<ResurfaceOptions, resurface_job>},
    {"smooth", from_text<SmoothOptions, smooth_job>},
    {"tiles", from_text<TilesOptions, tiles_job>},
};

}  // namespace

JobDescription find_job(const std::string& command, const std::string& settings) {
  std::string known;
  for (const Entry& job : kJobs) {
    if (command == job.name) return job.describe(settings);
    known += std::string(known.empty() ? "" : ", ") + job.name;
  }
  throw InputError("job.json: no job is called '" + command + "', there are " + known);
}

}  // namespace tessera
