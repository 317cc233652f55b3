#include "stream/stages/tiles/tileset.h"

#include <algorithm>
#include <limits>

#include "stream/files/json.h"

namespace tessera {
namespace {

/// Errors of levels that tell nothing apart still rise, by this much.
constexpr double kRise = 1.0 + 0x1p-20;

MeshBox united(const MeshBox& a, const MeshBox& b) {
  MeshBox out;
  for (std::size_t k = 0; k < 3; ++k) {
    out.low[k] = std::min(a.low[k], b.low[k]);
    out.high[k] = std::max(a.high[k], b.high[k]);
  }
  return out;
}

/// Middle and half axes. Coordinates are a few bits of steps of a power of two, so the halves are exact.
Json box_json(const MeshBox& box) {
  Double3 middle, half;
  for (std::size_t k = 0; k < 3; ++k) {
    middle[k] = 0.5 * (box.low[k] + box.high[k]);
    half[k] = 0.5 * (box.high[k] - box.low[k]);
  }
  return {{"box", {middle[0], middle[1], middle[2], half[0], 0, 0, 0, half[1], 0, 0, 0, half[2]}}};
}

std::string tileset_file(int level, std::size_t tile) {
  std::string name = tile_file(level, tile);
  return name.replace(name.rfind('.'), std::string::npos, ".json");
}

class Writer {
 public:
  Writer(const TileTree& tree, double whole_error,
         const std::function<void(const std::string&, const std::string&)>& sink)
      : tree_(tree), whole_error_(whole_error), sink_(sink) {}

  /// \param up  from the folder of the JSON at hand to that of the site
  Json tile(int level, std::size_t index, const std::string& up) const {
    const TileNode& node = tree_.levels[static_cast<std::size_t>(level)][index];
    Json out = {{"boundingVolume", box_json(node.box)},
                {"geometricError", tree_.error[static_cast<std::size_t>(level)]},
                {"content", {{"uri", up + tile_file(level, index)}}}};
    for (std::size_t c = node.first_child; c < node.last_child; ++c) {
      const TileNode& child = tree_.levels[static_cast<std::size_t>(level - 1)][c];
      if (!child.own_file) {
        out["children"].push_back(tile(level - 1, c, up));
        continue;
      }
      const double error = tree_.error[static_cast<std::size_t>(level - 1)];
      out["children"].push_back({{"boundingVolume", box_json(child.box)},
                                 {"geometricError", error},
                                 {"content", {{"uri", up + tileset_file(level - 1, c)}}}});
      Json root = tile(level - 1, c, "../../");
      root["refine"] = "REPLACE";
      write(tileset_file(level - 1, c), error, std::move(root));
    }
    return out;
  }

  void write(const std::string& name, double error, Json root) const {
    const Json all = {{"asset", {{"version", "1.1"}, {"generator", "Tessera"}}},
                      {"geometricError", error},
                      {"root", std::move(root)}};
    sink_(name, dump_json(all));
  }

  void write_whole(const std::vector<double>& transform) const {
    const auto top = static_cast<int>(tree_.levels.size()) - 1;
    const std::vector<TileNode>& nodes = tree_.levels.back();
    Json root;
    if (nodes.size() == 1) {
      root = tile(top, 0, "");
    } else {  // nothing shrinks any more: all that is left, together
      MeshBox box = nodes[0].box;
      for (const TileNode& node : nodes) box = united(box, node.box);
      root = {{"boundingVolume", box_json(box)}, {"geometricError", whole_error_}};
      for (std::size_t c = 0; c < nodes.size(); ++c) root["children"].push_back(tile(top, c, ""));
    }
    root["refine"] = "REPLACE";
    root["transform"] = transform;
    write("", whole_error_, std::move(root));
  }

 private:
  const TileTree& tree_;
  double whole_error_;
  const std::function<void(const std::string&, const std::string&)>& sink_;
};

}  // namespace

TileTree make_tile_tree(const std::vector<TileLevel>& levels, std::size_t maximum) {
  TileTree tree;
  std::vector<std::size_t> inside;  // tiles of the file that a tile stands in, from it on downwards
  double sum = 0.0, before = 0.0;
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const TileLevel& level = levels[l];
    std::vector<TileNode> nodes;
    std::vector<std::size_t> now;
    std::size_t child = 0;
    for (const TileRecord& record : level.tiles) {
      TileNode node;
      for (std::size_t k = 0; k < 3; ++k) {
        node.box.low[k] = static_cast<double>(record.low[k]) * level.grid.step;
        node.box.high[k] = static_cast<double>(record.high[k]) * level.grid.step;
      }
      std::size_t count = 1;
      node.first_child = child;
      if (l > 0) {
        std::vector<TileNode>& below = tree.levels[l - 1];
        for (; child < below.size() && levels[l - 1].tiles[child].cell.first < record.cell.last; ++child) {
          node.box = united(node.box, below[child].box);
          count += inside[child];
        }
        if (count > maximum) {
          count = 1 + child - node.first_child;
          for (std::size_t c = node.first_child; c < child; ++c)
            below[c].own_file = below[c].last_child > below[c].first_child;
        }
      }
      node.last_child = child;
      nodes.push_back(node);
      now.push_back(count);
    }
    tree.levels.push_back(std::move(nodes));
    inside.swap(now);

    sum += level.step_bound;
    const double bound = sum + level.grid.error();
    const double error = l == 0 ? bound : bound + before;
    tree.error.push_back(l == 0 ? error : std::max(error, kRise * tree.error.back()));
    before = bound;
  }
  return tree;
}

void write_tilesets(const TileTree& tree, const std::vector<double>& transform, double whole_error,
                    const std::function<void(const std::string& name, const std::string& text)>& sink) {
  Writer(tree, std::max(whole_error, kRise * tree.error.back()), sink).write_whole(transform);
}

}  // namespace tessera
