// tessera-vdb: the band of a job as an OpenVDB level set, for people and other programs. A program of its
// own, so that `tessera` does not load libopenvdb. Usage: tessera reconstruct SCAN -o MESH --keep; tessera-vdb
// export MESH.tessera -o BAND.vdb
#include <fmt/format.h>

#include <unistd.h>

#include <fstream>
#include <memory>
#include <utility>

#include "kernels/field/band_vdb.h"
#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/points/reconstruct_options.h"
#include "stream/runtime/stop.h"
#include "stream/stages/surface/surface_stage.h"
#include "tools/frame/cli.h"

namespace {

struct Arguments {
  std::filesystem::path work;
  std::filesystem::path out;
  bool force = false;
  double feature_angle_deg = tessera::ReconstructOptions{}.feature_angle_deg;
  std::uint64_t memory_bytes = std::uint64_t{4} << 30;
};

void run(const Arguments& a) {
  if (a.work.empty()) throw tessera::UsageError("no work directory given");
  tessera::cli::require_output(a.out);
  tessera::cli::require_new_output(a.out, a.force, {a.work / "job.json"});
  tessera::VdbExport grid(tessera::Plan::of_work(a.work).lattice);
  tessera::for_each_band(a.work, a.feature_angle_deg, [&](tessera::DirectedField&& field) {
    tessera::throw_if_stopped();
    grid.add(std::move(field));
    if (grid.bytes() > a.memory_bytes)
      throw tessera::ResourceError("the band does not fit " + std::to_string(a.memory_bytes >> 20) +
                                   " MiB in one OpenVDB grid; give a larger --memory");
  });
  const int fd = tessera::create_aside(a.out);
  const std::filesystem::path part = tessera::output_aside(a.out);
  std::ofstream file(part, std::ios::binary);
  grid.write(file);
  file.close();
  if (!file) {
    std::filesystem::remove(part);
    throw tessera::ResourceError(a.out.string() +
                                 ": could not be written; is the disk full or the folder read-only?");
  }
  std::filesystem::rename(part, a.out);
  ::close(fd);
  fmt::print("{}: {} nodes, {} bytes in memory\n", a.out.string(), grid.node_count(), grid.bytes());
}

}  // namespace

int main(int argc, char** argv) {
  auto a = std::make_shared<Arguments>();
  tessera::OptionTable t;
  t.add("work", &a->work, "work directory of a job whose points are ordered and oriented").positional();
  tessera::cli::add_output(t, a->out, "grid to write, .vdb");
  tessera::cli::add_force(t, a->force);
  t.add("feature-angle", &a->feature_angle_deg, "degrees, as in the job").within(0, 180);
  t.add("memory", &a->memory_bytes, "cap on the grid, which is held in memory").bytes();
  return tessera::cli::run(
      "tessera-vdb", "Writes the band of a kept or unfinished job as an OpenVDB level set.",
      {{"export", "Work directory to .vdb, in scan units.", t, [a] { run(*a); }}}, argc, argv);
}
