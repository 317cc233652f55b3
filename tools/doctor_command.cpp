#include <link.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <optional>
#include <set>

#include <fmt/format.h>

#include "kernels/picture/rasterizer.h"
#include "octree/error.h"
#include "stream/files/direct_file.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/read_file.h"
#include "stream/files/scratch_folder.h"
#include "stream/runtime/log.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/parallel.h"
#include "stream/runtime/stop.h"
#include "stream/survey/gdal_program.h"
#include "tools/commands.h"
#include "tools/frame/cli.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

struct DoctorArguments {
  fs::path temp = ".";
  std::uint64_t memory_bytes = 0;
};

constexpr std::uint64_t kMinMemory = std::uint64_t{64}
                                     << 20;  // every stage runs in so much, on scans that are not huge
constexpr std::uint64_t kMaxMeasured = std::uint64_t{256} << 20;
constexpr double kMaxSeconds = 1.0;  // of writing, and of reading

void line(const char* name, const std::string& text) {
  fmt::print("{:<12} {}\n", name, text);
}

/// Shared libraries as this process has loaded them: their files bear the versions.
std::string libraries() {
  std::set<std::string> names;
  dl_iterate_phdr(
      [](dl_phdr_info* info, std::size_t, void* out) {
        std::error_code error;
        const fs::path file = fs::canonical(info->dlpi_name, error);
        if (!error && info->dlpi_name[0] == '/')
          static_cast<std::set<std::string>*>(out)->insert(file.filename());
        return 0;
      },
      &names);
  std::string text;
  std::size_t column = 0;
  for (const std::string& name : names) {
    const bool wraps = column + name.size() > 90;
    text += text.empty() ? "" : wraps ? ",\n             " : ", ";
    column = wraps ? name.size() : column + name.size() + 2;
    text += name;
  }
  return text;
}

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string rate(std::uint64_t bytes, double seconds) {
  return format_bytes(static_cast<std::uint64_t>(static_cast<double>(bytes) / std::max(seconds, 1e-6))) +
         "/s";
}

/// Writes, syncs and reads as a job does, for a moment. \throws what the disk refuses
std::string disk_text(const fs::path& folder) {
  const fs::space_info space = fs::space(folder);
  const ScratchFolder scratch(folder, "doctor");
  const fs::path path = scratch.path() / "speed";
  const std::uint64_t maximum = std::min<std::uint64_t>(kMaxMeasured, space.available / 4);
  std::vector<char> block(std::size_t{4} << 20);
  for (std::size_t i = 0; i < block.size(); ++i) block[i] = static_cast<char>(i * 2654435761u >> 13);
  auto start = std::chrono::steady_clock::now();
  DirectFile file(path);
  while (file.offset() + block.size() <= maximum && seconds_since(start) < kMaxSeconds) {
    throw_if_stopped();
    file.write(block.data(), block.size());
  }
  const std::uint64_t bytes = file.finish();
  sync_file(path);
  const std::string writes = rate(bytes, seconds_since(start));
  start = std::chrono::steady_clock::now();
  const ReadFile back(path);
  std::uint64_t read = 0;
  for (; read + block.size() <= bytes && seconds_since(start) < kMaxSeconds; read += block.size()) {
    throw_if_stopped();
    back.read_at(read, block.data(), block.size());
  }
  return fmt::format("{}: {} free, writes {}, reads {} ({} tried)",
                     fs::absolute(folder).lexically_normal().string(), format_bytes(space.available), writes,
                     rate(read, seconds_since(start)), format_bytes(bytes));
}

void run_doctor(const DoctorArguments& a) {
  std::string missing;
  fmt::print("tessera {}\n", TESSERA_VERSION);
  const Json machine = machine_description();
  line("system", machine.value("system", "") + ", " + machine.value("host", ""));
#ifdef TESSERA_PORTABLE
  const char* const instructions = "this is the portable build, many times slower than the one for AVX2";
#else
  // Without these the program ends before it comes here (cpu_guard.cpp).
  const char* const instructions = "has AVX2, FMA and BMI2 (x86-64-v3), which the program needs";
#endif
  line("processor",
       fmt::format("{}, {} cores; {}", machine.value("processor", ""), core_count(), instructions));
  const MemoryCap cap = detect_memory_cap();
  const std::uint64_t memory = a.memory_bytes > 0 ? a.memory_bytes : cap.bytes;
  line("memory cap", a.memory_bytes > 0
                         ? fmt::format("{} (--memory; without it {}: 0.8 of {}, {})", format_bytes(memory),
                                       format_bytes(cap.bytes), format_bytes(cap.limit), cap.source)
                         : fmt::format("{}: 0.8 of {}, {}; --memory gives another", format_bytes(memory),
                                       format_bytes(cap.limit), cap.source));
  if (memory < kMinMemory) missing = fmt::format("a memory cap of {} or more", format_bytes(kMinMemory));
  try {
    line("work folder", disk_text(a.temp));
  } catch (const StoppedError&) {
    throw;
  } catch (const std::exception& e) {
    line("work folder", e.what());
    missing += (missing.empty() ? "" : ", ") + std::string("a work folder that can be written to (--temp)");
  }
  try {
    line("OpenGL", create_gl_context()->description() + " draws: pictures and pages can be made");
  } catch (const ResourceError& e) {
    line("OpenGL", std::string(e.what()) + "; only render and the pictures of reports need it");
  }
  try {
    line("GDAL", gdal_program().string() + " is there: rasters and lines can be written");
  } catch (const ResourceError& e) {
    line("GDAL", std::string(e.what()) + "; only raster, contours and section need it");
  }
  line("GPU", "not used");
  line("libraries", libraries());
  if (!missing.empty()) throw ResourceError("no job can run here: it needs " + missing);
  line("verdict", "jobs can run here");
}

}  // namespace

cli::Command doctor_command() {
  auto arguments = std::make_shared<DoctorArguments>();
  DoctorArguments& a = *arguments;
  OptionTable t;
  t.add("temp", &a.temp, "folder whose disk is measured, as a job would use it: at most 256 MiB, 2 s");
  t.add("memory", &a.memory_bytes, "cap that a job would be given").bytes();
  return {"doctor",
          "What this machine offers to jobs: processor, memory and what limits it, disk, OpenGL, libraries. "
          "Exit code 0: "
          "jobs can run here; 4: something that they need is missing.",
          t, [arguments] { run_doctor(*arguments); }};
}

}  // namespace tessera
