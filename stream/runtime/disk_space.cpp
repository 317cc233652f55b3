#include "stream/runtime/disk_space.h"

#include <sys/stat.h>

#include <optional>

#include <fmt/format.h>

#include "octree/error.h"
#include "stream/runtime/memory_budget.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

std::optional<dev_t> disk_of(const fs::path& folder) {
  struct stat status = {};
  if (::stat(folder.c_str(), &status) != 0) return std::nullopt;
  return status.st_dev;
}

}  // namespace

void require_disk(std::span<const DiskNeed> needs, const std::string& advice) {
  for (const DiskNeed& first : needs) {
    const std::optional<dev_t> disk = disk_of(first.folder);
    std::error_code unknown;
    const fs::space_info space = fs::space(first.folder, unknown);
    if (!disk || unknown) continue;
    std::uint64_t bytes = 0;
    std::size_t parts = 0;
    std::string what;
    for (const DiskNeed& need : needs) {
      if (need.bytes == 0 || disk_of(need.folder) != disk) continue;
      bytes += need.bytes;
      what += (parts++ == 0 ? "" : " and ") + need.what;
    }
    if (bytes <= space.available) continue;
    throw ResourceError(fmt::format("{} {} about {}, {} are free; free space, or {}", what,
                                    parts > 1 ? "need" : "needs", format_bytes(bytes),
                                    format_bytes(space.available), advice));
  }
}

std::uint64_t bytes_below(const fs::path& folder) {
  std::uint64_t bytes = 0;
  std::error_code gone;  // files may go while they are counted
  for (auto at = fs::recursive_directory_iterator(folder, gone);
       !gone && at != fs::recursive_directory_iterator(); at.increment(gone)) {
    std::error_code none;
    if (!at->is_regular_file(none)) continue;
    const std::uintmax_t size = at->file_size(none);
    if (!none) bytes += size;
  }
  return bytes;
}

}  // namespace tessera
