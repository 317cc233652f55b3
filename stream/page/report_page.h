/// \file report_page.h
/// OUT.report.html beside OUT.report.json: draws and measures the result once more, and writes the page.
/// Of a result of more than kMaxWholeFaces faces the pictures are drawn from the copy of the preview, and its topology
/// is left to `tessera check`, so that a page costs seconds, and little beside the job where the mesh is large. The map of
/// distances to the reference is left out where it would take longer than the job did.
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>

#include "stream/files/json.h"
#include "stream/page/page_text.h"
#include "stream/runtime/job.h"

namespace tessera {

inline constexpr std::uint64_t kMaxWholeFaces = 2'000'000;

struct PageRequest {
  std::filesystem::path mesh;      ///< the result; need not be there
  std::filesystem::path scratch;   ///< folder for files that go again
  std::uint64_t memory_bytes = 0;  ///< cap on the peak resident memory of the process
  /// What the map of distances may take; none: as long as the job, and 3 s at least.
  std::optional<double> map_seconds = {};
};

/// Report of "OUT.report.json" to page "OUT.report.html"; ".html" behind any other name.
std::filesystem::path page_path(const std::filesystem::path& report);

/// Never fails for what cannot be drawn or does not fit: the part stays empty and its note says why.
/// \throws StoppedError
PageParts make_page_parts(const Json& report, const PageRequest& request);

/// The page of jobs.
JobPage job_page();

/// \throws ResourceError when the disk is full
void write_page(const std::filesystem::path& path, const Json& report, const PageParts& parts);

}  // namespace tessera
