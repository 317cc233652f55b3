// The job `decimate` as a typed call, with progress, a way to cancel it, and failures as exceptions.
//   usage: run_job MESH OUTPUT TOLERANCE
#include <tessera/stream.h>

#include <csignal>
#include <iostream>
#include <string>

namespace {

volatile std::sig_atomic_t cancelled = 0;

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  std::signal(SIGINT, [](int) { cancelled = 1; });
  tessera::configure_allocator(2);
  tessera::DecimateJob job{{argv[1]}, argv[2]};
  job.options.tolerance = std::stod(argv[3]);
  job.how.memory_bytes = std::uint64_t{512} << 20;
  try {
    const tessera::Json report = job.run([](const tessera::JobProgress& p) {
      if (p.stage_done) std::cout << p.stage << ": " << p.done << " " << p.unit << "\n";
      return cancelled == 0;
    });
    std::cout << report.at("mesh").at("faces").get<std::uint64_t>() << " faces\n";
  } catch (const tessera::StoppedError& e) {
    std::cerr << e.what() << "; the same call goes on\n";
    return 1;
  } catch (const tessera::Error& e) {
    std::cerr << e.what() << "\n";
    return static_cast<int>(e.code());
  }
  return 0;
}
