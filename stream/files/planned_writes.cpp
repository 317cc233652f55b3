#include "stream/files/planned_writes.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <optional>

#include <fmt/format.h>

#include "octree/error.h"

namespace tessera {
namespace {

namespace fs = std::filesystem;

/// What a path names: the file behind it if there is one (hard links and other spellings are the same), else the
/// name it would get in its folder.
struct Target {
  fs::path name;                     ///< folder without links, then the last word
  std::optional<struct stat> there;  ///< of what the path leads to
  bool is_link = false;

  explicit Target(const fs::path& path) {
    const fs::path whole = fs::absolute(path).lexically_normal();
    std::error_code ignored;
    fs::path folder = fs::weakly_canonical(whole.parent_path(), ignored);
    name = (ignored ? whole.parent_path() : folder) / whole.filename();
    struct stat status = {};
    if (::stat(whole.c_str(), &status) == 0) there = status;
    is_link = ::lstat(whole.c_str(), &status) == 0 && S_ISLNK(status.st_mode);
  }
  bool same_as(const Target& other) const {
    if (name == other.name) return true;
    return there && other.there && there->st_dev == other.there->st_dev &&
           there->st_ino == other.there->st_ino;
  }
  bool lies_in(const fs::path& folder) const {
    const fs::path relative = name.lexically_relative(folder);
    return !relative.empty() && *relative.begin() != "..";
  }
};

/// "2026-11-20 12:00:00.000 I tessera ..."
bool is_log(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string start(34, '\0');
  file.read(start.data(), static_cast<std::streamsize>(start.size()));
  start.resize(static_cast<std::size_t>(file.gcount()));
  return start.empty() || (start.size() == 34 && start.compare(23, 11, " I tessera ") == 0);
}

void require_folder(const PlannedWrite& write) {
  const fs::path folder = fs::absolute(write.path).lexically_normal().parent_path();
  const std::string what = fmt::format("{} {}", write.option, write.path.string());
  if (!fs::is_directory(folder))
    throw UsageError(fmt::format("{}: there is no such folder: make it first", what));
  if (::access(folder.c_str(), W_OK) != 0)
    throw UsageError(fmt::format("{}: its folder cannot be written to: {}", what, std::strerror(errno)));
}

void require_free_name(const PlannedWrite& write, const Target& target) {
  const std::string what = fmt::format("{} {}", write.option, write.path.string());
  if (!write.path.has_filename() || (target.there && S_ISDIR(target.there->st_mode)))
    throw UsageError(what + ": is a folder: name a file in it");
  if (!target.there && !target.is_link) return;
  if (target.there && !S_ISREG(target.there->st_mode))
    throw UsageError(what + ": is a device or pipe, where nothing can be put in place: name a file");
  using Existing = PlannedWrite::Existing;
  if (write.existing == Existing::kRefuse)
    throw UsageError(what + ": is there already: give --force to overwrite it, or another name");
  if (write.existing == Existing::kAppend && !is_log(write.path))
    throw UsageError(what + ": is there already and no log of Tessera: give another name");
}

}  // namespace

fs::path output_aside(const fs::path& path) {
  fs::path aside = path;
  aside += ".tessera-part";
  return aside;
}

void check_writes(std::span<const fs::path> reads, std::span<const PlannedWrite> writes,
                  const fs::path& emptied) {
  const fs::path own = emptied.empty() ? emptied : Target(emptied).name;
  const auto refuse_own = [&](const fs::path& path, const Target& target) {
    if (!own.empty() && target.lies_in(own))
      throw UsageError(fmt::format(
          "{}: lies in the work directory {}, which goes when the job is done: name another place",
          path.string(), emptied.string()));
  };
  std::vector<std::pair<fs::path, Target>> inputs;
  for (const fs::path& path : reads) {
    if (path.empty()) continue;
    refuse_own(path, inputs.emplace_back(path, path).second);
  }
  std::vector<std::pair<const PlannedWrite*, Target>> before;
  for (const PlannedWrite& write : writes) {
    if (write.path.empty()) continue;
    const Target target(write.path), aside(output_aside(write.path));
    const std::string what = fmt::format("{} {}", write.option, write.path.string());
    for (const auto& [path, input] : inputs) {
      if (target.same_as(input))
        throw UsageError(fmt::format("{}: is the input {} itself, which would be lost: name another file",
                                     what, path.string()));
      if (aside.same_as(input))
        throw UsageError(fmt::format("{}: the input {} bears the name of its unfinished copy: rename one",
                                     what, path.string()));
    }
    for (const auto& [other, there] : before)
      if (target.same_as(there) || aside.same_as(there) || target.same_as(Target(output_aside(other->path))))
        throw UsageError(
            fmt::format("{}: is what {} writes to as well: name another file", what, other->option));
    require_folder(write);
    require_free_name(write, target);
    refuse_own(write.path, target);
    before.emplace_back(&write, target);
  }
}

}  // namespace tessera
