#include <fnmatch.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <string_view>

#include "octree/error.h"
#include "stream/files/file_extension.h"
#include "stream/formats/line_reader.h"
#include "stream/formats/points/point_source.h"
#include "stream/formats/points/scan_folder.h"
#include "stream/formats/points/virtual_cloud.h"

namespace tessera {

namespace {

namespace fs = std::filesystem;

/// What a folder gives. Formats that are known but not read are among them, so that their points are not lost
/// in silence; .txt, .dat and .neu are not, because folders of scans hold readme files and lists of control points.
constexpr std::array<std::string_view, 12> kExtensions = {".ply", ".las", ".laz", ".xyz", ".pts",    ".ptx",
                                                          ".csv", ".asc", ".e57", ".pcd", ".xyzrgb", ".xyzn"};
/// What may stand before .gz or .zst.
constexpr std::array<std::string_view, 8> kPackedExtensions = {".ply", ".xyz", ".pts",    ".ptx",
                                                               ".csv", ".asc", ".xyzrgb", ".xyzn"};
constexpr std::string_view kWorkExtension = ".tessera";  ///< of folders with what jobs keep

bool has_known_extension(const fs::path& path) {
  const auto among = [](const auto& known, const std::string& e) {
    return std::find(known.begin(), known.end(), e) != known.end();
  };
  const std::string e = lower_extension(path);
  return among(kExtensions, e) ||
         ((e == ".gz" || e == ".zst") && among(kPackedExtensions, lower_extension(path.stem())));
}

bool is_hidden(const fs::path& path) {
  const std::string name = path.filename().string();
  return !name.empty() && name[0] == '.';
}

/// "3 laz, 1 ply": the most frequent first.
std::string kinds_text(const std::map<std::string, std::size_t>& kinds) {
  std::vector<std::pair<std::string, std::size_t>> sorted(kinds.begin(), kinds.end());
  std::stable_sort(sorted.begin(), sorted.end(),
                   [](const auto& a, const auto& b) { return a.second > b.second; });
  constexpr std::size_t kMax = 8;
  std::string text;
  for (std::size_t i = 0; i < std::min(kMax, sorted.size()); ++i)
    text += (i > 0 ? ", " : "") + std::to_string(sorted[i].second) + " " + sorted[i].first;
  return text + (sorted.size() > kMax ? ", ..." : "");
}

/// What was found below a folder.
struct Found {
  std::map<std::string, std::size_t> taken, skipped;  ///< by kind
  std::size_t hidden = 0, folders = 0;

  std::size_t taken_count() const {
    std::size_t sum = 0;
    for (const auto& [kind, n] : taken) sum += n;
    return sum;
  }
  std::string text() const {
    const std::size_t n = taken_count();
    std::string t =
        std::to_string(n) + (n == 1 ? " file" : " files") + " of points (" + kinds_text(taken) + ")";
    if (folders > 1) t += " in " + std::to_string(folders) + " folders";
    if (!skipped.empty()) t += "; passed over: " + kinds_text(skipped);
    if (hidden > 0) t += (skipped.empty() ? "; passed over: " : ", ") + std::to_string(hidden) + " hidden";
    const auto is_text = [&](const char* kind) { return skipped.count(kind) > 0; };
    if (is_text("txt") || is_text("dat") || is_text("neu")) t += " (text is read where its file is named)";
    return t;
  }
};

std::string kind_of(const fs::path& path) {
  const std::string e = lower_extension(path);
  if (e.size() < 2) return "without extension";
  const std::string packed = e == ".gz" || e == ".zst" ? lower_extension(path.stem()) + e : e;
  return packed.substr(1);
}

/// What is directly in a folder, by name. \throws InputError where it cannot be read, if that matters
std::vector<fs::directory_entry> entries_of(const fs::path& folder, bool must = true) {
  std::vector<fs::directory_entry> entries;
  std::error_code error;
  for (fs::directory_iterator i(folder, error), end; !error && i != end; i.increment(error))
    entries.push_back(*i);
  if (error && must) throw InputError(folder.string() + ": the folder cannot be read: " + error.message());
  std::sort(entries.begin(), entries.end());
  return entries;
}

/// Folders at any depth below this one, itself first, hidden ones and work directories left out.
/// \param seen  canonical: links may run in circles
void folders_below(const fs::path& folder, std::set<fs::path>& seen, std::vector<fs::path>& out) {
  const fs::path here = folder.empty() ? fs::path(".") : folder;
  if (!seen.insert(fs::weakly_canonical(here)).second) return;
  out.push_back(folder);
  for (const fs::directory_entry& e : entries_of(here, false)) {
    std::error_code error;
    if (e.is_directory(error) && !is_hidden(e.path()) && e.path().extension() != kWorkExtension)
      folders_below(folder.empty() ? e.path().filename() : e.path(), seen, out);
  }
}

/// All that match a pattern whose part ** stands for any number of folders.
std::vector<fs::path> matches_of(const fs::path& pattern) {
  std::vector<fs::path> heads = {pattern.root_path()};
  const fs::path relative = pattern.relative_path();
  std::vector<fs::path> parts(relative.begin(), relative.end());
  for (const fs::path& part : parts) {
    std::vector<fs::path> next;
    const std::string name = part.string();
    for (const fs::path& head : heads) {
      std::error_code error;
      if (!head.empty() && !fs::is_directory(head, error)) continue;
      if (name == "**") {
        std::set<fs::path> seen;
        folders_below(head, seen, next);
      } else if (name.find_first_of("*?[") == std::string::npos) {
        if (name.empty() || fs::exists(head / part, error)) next.push_back(name.empty() ? head : head / part);
      } else {
        for (const fs::directory_entry& e : entries_of(head.empty() ? fs::path(".") : head, false)) {
          const fs::path file = e.path().filename();
          if (::fnmatch(name.c_str(), file.c_str(), FNM_PERIOD) == 0) next.push_back(head / file);
        }
      }
    }
    std::sort(next.begin(), next.end());
    next.erase(std::unique(next.begin(), next.end()), next.end());
    heads = std::move(next);
  }
  return heads;
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
            ": the folder and those below it hold no file of points (ply, las, laz, e57, pcd, xyz, pts, "
            "ptx, csv, asc)" +
            (last_.skipped.empty() ? "" : "; there are " + kinds_text(last_.skipped)));
      }
    } else if (fs::exists(status) && describes_scan_folder(path)) {
      folder(path.parent_path().empty() ? fs::path(".") : path.parent_path());
    } else if (fs::exists(status) && is_virtual_cloud(path)) {
      virtual_cloud(path);
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

  InputList take() { return {std::move(paths_), std::move(notes_)}; }

 private:
  void add(const fs::path& path) {
    if (seen_.insert(fs::weakly_canonical(path)).second) {
      paths_.push_back(path);
    } else {
      ++repeats_;
    }
  }

  void virtual_cloud(const fs::path& path) {
    const std::vector<fs::path> files = virtual_cloud_files(path);
    Found found;
    for (const fs::path& f : files) {
      add(f);
      ++found.taken[kind_of(f)];
    }
    notes_.push_back(path.string() + ": " + found.text());
  }

  /// The folder and all below it. Tells what it holds.
  bool folder(const fs::path& path) {
    last_ = {};
    std::set<fs::path> open;
    walk(path, open, last_);
    const bool any = last_.taken_count() > 0;
    if (any) notes_.push_back(path.string() + ": " + last_.text());
    return any;
  }

  /// \param open  folders that were entered, canonical: links to them are not followed again
  void walk(const fs::path& folder, std::set<fs::path>& open, Found& found) {
    if (!open.insert(fs::weakly_canonical(folder)).second) return;
    if (const std::optional<ScanFolder> scan = open_scan_folder(folder)) {
      for (const fs::path& node : scan->nodes) add(node);
      found.taken["nodes of " + scan->kind] += scan->nodes.size();
      ++found.folders;
      for (const std::string& w : scan->warnings) notes_.push_back(w);
      for (const fs::directory_entry& e : entries_of(folder))  // a scan beside its octree would count twice
        if (e.is_regular_file() && has_known_extension(e.path()))
          ++found.skipped[kind_of(e.path()) + " beside it"];
      return;
    }
    std::vector<fs::path> inner;
    std::size_t taken = 0;
    for (const fs::directory_entry& e : entries_of(folder)) {
      std::error_code error;
      if (is_hidden(e.path())) {
        ++found.hidden;
      } else if (e.is_directory(error)) {
        if (e.path().extension() != kWorkExtension)
          inner.push_back(e.path());  // else the work directory of a job
      } else if (has_known_extension(e.path()) && e.is_regular_file(error)) {
        add(e.path());
        ++found.taken[kind_of(e.path())];
        ++taken;
      } else {
        ++found.skipped[kind_of(e.path())];
      }
    }
    found.folders += taken > 0 ? 1 : 0;
    for (const fs::path& f : inner) walk(f, open, found);
  }

  /// Files that match; folders that match only where no file does, or where ** ends the pattern.
  void pattern(const fs::path& path) {
    const bool deep = path.string().find("**") != std::string::npos;
    const bool open_end = path.filename() == "**";
    const fs::path root = path.parent_path().empty() ? fs::path(".") : path.parent_path();
    std::vector<fs::path> files;
    std::vector<fs::path> folders;
    for (const fs::path& match : matches_of(open_end ? root : path))
      (fs::is_directory(match) ? folders : files).push_back(match);
    if (open_end) files.clear();
    Found found;
    for (const fs::path& f : files) {
      if (is_virtual_cloud(f)) {
        virtual_cloud(f);
        continue;
      }
      add(f);
      ++found.taken[kind_of(f)];
    }
    if (deep && !files.empty()) notes_.push_back(path.string() + ": " + found.text());
    bool any = !files.empty();
    if (!any) {
      for (const fs::path& f : folders) any = (fs::is_directory(f) && folder(f)) || any;
    }
    if (!any) throw InputError(path.string() + ": no file matches this pattern");
  }

  std::vector<fs::path> paths_;
  std::vector<std::string> notes_;
  std::set<fs::path> seen_;  ///< canonical
  std::size_t repeats_ = 0;
  Found last_;  ///< of the last folder
};

}  // namespace

InputList list_inputs(const std::vector<std::string>& arguments) {
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

std::vector<fs::path> expand_inputs(const std::vector<std::string>& arguments) {
  return list_inputs(arguments).files;
}

}  // namespace tessera
