// Which room may use which: the table of rooms, and the graph of today's includes held against it.
#include <functional>

#include "tests/house/house.h"

namespace tessera::house {

namespace {

constexpr std::size_t kMaxStems = 25;

/// Rooms of kernels/: what each may use besides itself, octree and solvers.
const std::map<std::string, std::set<std::string>> kKernelFolders = {
    {"mesh", {}},
    {"points", {}},
    {"picture", {}},
    {"field", {"mesh"}},
    {"closing", {"field"}},
    {"solid", {"extract", "field", "mesh"}},
    {"extract", {"field", "mesh"}},
    {"decimate", {"mesh"}},
    {"merge", {"field", "mesh", "holes"}},
    {"remesh", {"mesh", "decimate"}},
    {"certify", {"mesh"}},
    {"coverage", {"mesh"}},
    {"smooth", {"mesh"}},
    {"holes", {"mesh", "smooth"}},
    {"maps", {"mesh"}},
    {"blends", {"mesh", "merge", "certify"}},
    {"edit", {"mesh", "maps", "remesh"}},
    {"scene", {"field", "mesh"}},
    {"survey", {"mesh"}},
    {"change", {}},
    {"boolean", {"mesh"}},
    {"texture", {"mesh", "maps"}},
};

/// Rooms of stream/ by height: an include goes down or stays level, and the rooms of one height form no cycle.
const std::map<std::string, int> kStreamHeights = {
    {"files", 0},          {"runtime", 1},        {"formats", 2},        {"queue", 2},
    {"formats/meshes", 2}, {"formats/points", 2}, {"formats/e57", 2},    {"formats/laz", 2},
    {"points", 3},         {"meshes", 3},         {"import", 4},         {"check", 4},
    {"render", 4},         {"commands", 4},       {"page", 4},           {"survey", 4},
    {"raster", 4},         {"files", 0},          {"runtime", 1},        {"formats", 2},
    {"queue", 2},          {"formats/meshes", 2}, {"formats/points", 2}, {"formats/e57", 2},
    {"formats/laz", 2},    {"points", 3},         {"meshes", 3},         {"import", 4},
    {"check", 4},          {"render", 4},         {"commands", 4},       {"page", 4},
    {"survey", 4},         {"volume", 4},         {"files", 0},          {"runtime", 1},
    {"formats", 2},        {"queue", 2},          {"formats/meshes", 2}, {"formats/points", 2},
    {"formats/e57", 2},    {"formats/laz", 2},    {"points", 3},         {"meshes", 3},
    {"import", 4},         {"check", 4},          {"render", 4},         {"commands", 4},
    {"page", 4},           {"survey", 4},         {"survey/pages", 4},   {"survey", 4},
    {"change", 4},         {"survey", 4},         {"volume", 4},         {"api", 6},
    {"formats/copc", 2},   {"formats/models", 2},
};
constexpr int kStageHeight = 5;  // stages/<job>

/// Height of a room of stream/, -1 for one that is not in the table.
int height(const std::string& folder) {
  if (under(folder, "stream/stages")) return kStageHeight;
  const auto at = kStreamHeights.find(folder.substr(std::string("stream/").size()));
  return at == kStreamHeights.end() ? -1 : at->second;
}

std::string floor_of(const std::string& folder) {
  return folder.substr(0, folder.find('/'));
}

bool allowed(const std::string& from, const std::string& to) {
  static const std::map<std::string, std::set<std::string>> kFloors = {
      {"octree", {"octree"}},
      {"solvers", {"octree", "solvers"}},
      {"kernels", {"octree", "solvers", "kernels"}},
      {"stream", {"octree", "solvers", "kernels", "stream"}},
      {"tools", {"octree", "solvers", "kernels", "stream", "tools"}},
      {"tests", {"octree", "solvers", "kernels", "stream", "tools", "tests"}},
  };
  if (from == "tools/microbench" && to == "tests/helpers") return true;  // sample makers
  const auto floor = kFloors.find(floor_of(from));
  if (floor == kFloors.end() || floor->second.count(floor_of(to)) == 0) return false;
  if (under(from, "kernels") && under(to, "kernels")) {
    const auto entry = kKernelFolders.find(from.substr(std::string("kernels/").size()));
    return entry != kKernelFolders.end() &&
           entry->second.count(to.substr(std::string("kernels/").size())) == 1;
  }
  if (under(from, "stream") && under(to, "stream"))
    return height(from) >= 0 && height(to) >= 0 && height(to) <= height(from);
  return true;
}

bool known(const std::string& folder) {
  if (folder.starts_with("kernels/"))
    return kKernelFolders.count(folder.substr(std::string("kernels/").size())) == 1;
  if (folder.starts_with("stream/")) return height(folder) >= 0;
  return folder != "kernels" && folder != "stream";
}

}  // namespace

Findings check_arrows(const Sources& sources) {
  Findings out;
  std::map<std::string, std::map<std::string, std::string>>
      arrows;  // from -> to -> one include as an example
  std::set<std::string> folders;
  for (const Source& s : sources) {
    if (!s.is_header() && !s.is_cpp()) continue;
    const std::string from = folder_of(s.path);
    if (folders.insert(from).second && !known(from))
      out.push_back(s.path + ": no room of this name in the table");
    for (const std::string& line : s.lines) {
      const std::string target = included(line);
      const std::string to = folder_of(target);
      if (target.empty() || to == from) continue;
      if (!allowed(from, to)) out.push_back(s.path + ": " + from + " may not use " + target);
      if (!under(from, "tests")) arrows[from].emplace(to, s.path + " includes " + target);
    }
  }
  std::map<std::string, int> state;  // 0 not seen, 1 on the way, 2 done
  std::vector<std::string> trail;
  const std::function<void(const std::string&)> walk = [&](const std::string& at) {
    state[at] = 1;
    trail.push_back(at);
    for (const auto& [to, example] : arrows[at]) {
      if (state[to] == 1) {
        std::string cycle = example + ": cycle of folders";
        bool in = false;
        for (const std::string& f : trail)
          if ((in = in || f == to)) cycle += " " + f + " ->";
        out.push_back(cycle + " " + to);
      } else if (state[to] == 0) {
        walk(to);
      }
    }
    trail.pop_back();
    state[at] = 2;
  };
  for (const std::string& f : folders)
    if (state[f] == 0) walk(f);
  return out;
}

Findings check_folder_sizes(const Sources& sources) {
  std::map<std::string, std::set<std::string>> stems;
  for (const Source& s : sources)
    if ((s.is_header() || s.is_cpp()) && !under(s.path, "tests"))
      stems[folder_of(s.path)].insert(stem_of(s.path));
  Findings out;
  for (const auto& [folder, all] : stems)
    if (all.size() > kMaxStems)
      out.push_back(folder + ": " + std::to_string(all.size()) + " stems, at most " +
                    std::to_string(kMaxStems));
  return out;
}

}  // namespace tessera::house
