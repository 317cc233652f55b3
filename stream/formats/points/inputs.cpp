#include <glob.h>

#include <algorithm>
#include <array>
#include <set>
#include <string_view>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/points/point_source.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

/// What a folder gives. Formats that are known but not read are among them, so that their points are not lost
/// in silence; .txt is not, because folders of scans hold readme files.
constexpr std::array<std::string_view, 10> kExtensions = {".ply", ".las", ".laz", ".xyz", ".pts",
                                                          ".ptx", ".csv", ".asc", ".e57", ".pcd"};
/// What may stand before .gz or .zst.
constexpr std::array<std::string_view, 6> kPackedExtensions = {".ply", ".xyz", ".pts",
                                                               ".ptx", ".csv", ".asc"};

bool has_known_extension(const fs::path& path) {
  const auto among = [](const auto& known, const std::string& e) {
    return std::find(known.begin(), known.end(), e) != known.end();
  };
  const std::string e = lower_extension(path);
  return among(kExtensions, e) ||
         ((e == ".gz" || e == ".zst") && among(kPackedExtensions, lower_extension(path.stem())));
}

class Expansion {
 public:
  void argument(const std::string& text, const fs::path& base) {
    const fs::path path = base.empty() ? fs::path(text) : base / text;
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    if (fs::is_directory(status)) {
      if (!folder(path)) {
        throw InputError(
            path.string() +
            ": the folder holds no file of points (ply, las, laz, e57, pcd, xyz, pts, ptx, csv, asc)");
      }
    } else if (fs::exists(status)) {
      add(path);
    } else if (text.find_first_of("*?[") != std::string::npos) {
      pattern(path);
    } else {
      throw InputError(
          path.string() + ": there is no such file or folder" +
          (error && error != std::errc::no_such_file_or_directory ? ": " + error.message() : ""));
    }
  }

  void list(const fs::path& path) {
    if (!fs::is_regular_file(path))
      throw InputError(path.string() + ": the list of inputs is not a readable file");
    const ReadFile file(path);
    const LineLayout layout{0, 1, detect_line_end(file)};
    LineReader reader(file, layout, 0, file.size(), false);
    const std::size_t before = paths_.size() + repeats_;
    std::string_view line;
    while (reader.next(line)) {
      const std::size_t begin = line.find_first_not_of(" \t");
      if (begin == std::string_view::npos || line[begin] == '#') continue;
      const std::string text(line.substr(begin, line.find_last_not_of(" \t") - begin + 1));
      try {
        argument(text, path.parent_path());
      } catch (const InputError& e) {
        throw InputError(reader.where() + ": " + e.what());
      }
    }
    if (paths_.size() + repeats_ == before) throw InputError(path.string() + ": the list names no file");
  }

  std::vector<fs::path> take() { return std::move(paths_); }

 private:
  void add(const fs::path& path) {
    if (seen_.insert(fs::weakly_canonical(path)).second) {
      paths_.push_back(path);
    } else {
      ++repeats_;
    }
  }

  bool folder(const fs::path& path) {
    std::vector<fs::path> found;
    std::error_code error;
    for (fs::directory_iterator i(path, error), end; i != end; i.increment(error)) {
      if (has_known_extension(i->path()) && i->is_regular_file()) found.push_back(i->path());
      if (error) break;
    }
    if (error) throw InputError(path.string() + ": the folder cannot be read: " + error.message());
    std::sort(found.begin(), found.end());
    for (const fs::path& f : found) add(f);
    return !found.empty();
  }

  /// Files that match; folders that match only where no file does.
  void pattern(const fs::path& path) {
    glob_t matches{};
    const int status = ::glob(path.c_str(), GLOB_NOSORT, nullptr, &matches);
    std::vector<fs::path> files;
    std::vector<fs::path> folders;
    for (std::size_t i = 0; status == 0 && i < matches.gl_pathc; ++i) {
      const fs::path match = matches.gl_pathv[i];
      (fs::is_directory(match) ? folders : files).push_back(match);
    }
    ::globfree(&matches);
    std::sort(files.begin(), files.end());
    std::sort(folders.begin(), folders.end());
    for (const fs::path& f : files) add(f);
    bool any = !files.empty();
    if (!any) {
      for (const fs::path& f : folders) any = folder(f) || any;
    }
    if (!any) throw InputError(path.string() + ": no file matches this pattern");
  }

  std::vector<fs::path> paths_;
  std::set<fs::path> seen_;  ///< canonical
  std::size_t repeats_ = 0;
};

}  // namespace

std::vector<fs::path> expand_inputs(const std::vector<std::string>& arguments) {
  Expansion expansion;
  for (const std::string& a : arguments) {
    if (a.size() > 1 && a.front() == '@') {
      expansion.list(a.substr(1));
    } else {
      expansion.argument(a, {});
    }
  }
  return expansion.take();
}

}  // namespace tessera
