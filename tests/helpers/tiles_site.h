/// \file tiles_site.h
/// A site of 3D Tiles as a viewer reads it: the tree over all its tilesets, and tiles decoded by meshoptimizer's decoders.
#pragma once
#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include <meshoptimizer.h>

#include "octree/vector.h"
#include "stream/files/json.h"
#include "tests/helpers/temp_folder.h"

namespace tessera::test {

/// Every file of a site, by its name.
inline std::map<std::string, std::string> site_bytes(const std::filesystem::path& site) {
  std::map<std::string, std::string> all;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(site))
    if (entry.is_regular_file())
      all[entry.path().lexically_relative(site).string()] = file_bytes(entry.path());
  return all;
}

struct SiteTile {
  std::filesystem::path content;  ///< its GLB; empty = none
  Double3 low, high;              ///< of its bounding volume
  double error = 0.0;
  std::size_t parent = 0;  ///< its own number at the root
  std::vector<std::size_t> children;
};

struct Site {
  std::vector<SiteTile> tiles;               ///< the root first, parents before children
  std::vector<std::filesystem::path> files;  ///< everything that was named, with tileset.json
  std::vector<double> transform;             ///< of the root
};

struct DecodedTile {
  std::vector<Double3> points;  ///< in the frame of the tileset, z up
  std::vector<std::array<std::uint32_t, 3>> faces;
  std::vector<std::array<std::uint16_t, 4>> colours;  ///< or empty
  std::vector<Double3> normals;                       ///< z up, or empty
  std::vector<std::uint8_t> synthetic;                ///< or empty
  std::vector<std::array<std::uint16_t, 2>> uv;       ///< or empty
  std::string position_type;                          ///< "short" or "float"
};

/// Follows tilesets in tilesets; throws where one breaks the form that 3D Tiles 1.1 asks for.
class SiteReader {
 public:
  explicit SiteReader(const std::filesystem::path& tileset) { read(tileset, 0, false); }
  Site site;

 private:
  static void need(bool holds, const std::string& what) {
    if (!holds) throw std::runtime_error(what);
  }

  void read(const std::filesystem::path& file, std::size_t parent, bool external) {
    need(std::filesystem::is_regular_file(file), file.string() + " is named and not there");
    site.files.push_back(file.lexically_normal());
    const tessera::Json all = tessera::parse_json(file_bytes(file));
    need(all.at("asset").at("version") == "1.1", "version");
    need(all.at("geometricError").get<double>() >= all.at("root").at("geometricError").get<double>(),
         "the error of a tileset is at least that of its root");
    need(all.at("root").contains("refine"), "a root says how it refines");
    if (external) need(!all.at("root").contains("transform"), "an inner tileset lies where its parent does");
    tile(all.at("root"), file.parent_path(), parent, external);
  }

  /// \param stands  the tile of the outer tileset stands for this root
  void tile(const tessera::Json& j, const std::filesystem::path& folder, std::size_t parent, bool stands) {
    SiteTile t;
    t.parent = parent;
    t.error = j.at("geometricError").get<double>();
    const auto box = j.at("boundingVolume").at("box").get<std::vector<double>>();
    need(box.size() == 12, "a box has twelve numbers");
    for (std::size_t k = 0; k < 3; ++k) {
      need(box[3 + 4 * k] >= 0.0, "half axes");
      t.low[k] = box[k] - box[3 + 4 * k];
      t.high[k] = box[k] + box[3 + 4 * k];
    }
    if (j.contains("transform")) site.transform = j.at("transform").get<std::vector<double>>();
    const std::string uri = j.contains("content") ? j.at("content").at("uri").get<std::string>() : "";
    if (uri.ends_with(".json")) {
      need(!j.contains("children"), "a tile with a tileset for content has no children");
      const std::size_t before = site.tiles.size();
      read(folder / uri, parent, true);
      need(site.tiles[before].low == t.low && site.tiles[before].high == t.high &&
               site.tiles[before].error == t.error,
           "the root of an inner tileset is what its tile says");
      return;
    }
    if (!uri.empty()) {
      t.content = (folder / uri).lexically_normal();
      need(std::filesystem::is_regular_file(t.content), t.content.string() + " is named and not there");
      site.files.push_back(t.content);
    }
    const std::size_t own = site.tiles.size();
    site.tiles.push_back(t);
    if (own > 0) site.tiles[parent].children.push_back(own);
    (void)stands;
    for (const tessera::Json& child : j.value("children", tessera::Json::array()))
      tile(child, folder, own, false);
  }
};

inline Site read_site(const std::filesystem::path& tileset) {
  return SiteReader(tileset).site;
}

inline DecodedTile decode_tile(const std::string& glb) {
  const auto word = [&](std::size_t at) {
    std::uint32_t w = 0;
    std::memcpy(&w, glb.data() + at, 4);
    return w;
  };
  if (word(0) != 0x46546c67 || word(4) != 2 || word(8) != glb.size()) throw std::runtime_error("not a GLB");
  const std::size_t text = word(12), bin = 20 + text + 8;
  const tessera::Json all = tessera::parse_json(glb.substr(20, text));
  if (bin + word(20 + text) != glb.size()) throw std::runtime_error("chunks do not fill the GLB");
  const auto bytes_of = [&](std::size_t accessor, std::size_t& count, std::size_t& stride) {
    const tessera::Json& view =
        all.at("bufferViews").at(all.at("accessors").at(accessor).at("bufferView").get<std::size_t>());
    const tessera::Json& packed = view.at("extensions").at("EXT_meshopt_compression");
    count = packed.at("count").get<std::size_t>();
    stride = packed.at("byteStride").get<std::size_t>();
    if (all.at("accessors").at(accessor).at("count") != count) throw std::runtime_error("counts differ");
    const auto* from =
        reinterpret_cast<const unsigned char*>(glb.data()) + bin + packed.at("byteOffset").get<std::size_t>();
    const auto size = packed.at("byteLength").get<std::size_t>();
    std::vector<unsigned char> out(count * stride);
    const int failed = packed.at("mode") == "TRIANGLES"
                           ? meshopt_decodeIndexBuffer(out.data(), count, stride, from, size)
                           : meshopt_decodeVertexBuffer(out.data(), count, stride, from, size);
    if (failed != 0) throw std::runtime_error("a stream does not decode");
    if (packed.value("filter", "") == "OCTAHEDRAL") meshopt_decodeFilterOct(out.data(), count, stride);
    return out;
  };
  DecodedTile tile;
  const tessera::Json& node = all.at("nodes").at(0);
  const auto shift = node.at("translation").get<Double3>(), scale = node.at("scale").get<Double3>();
  const tessera::Json& primitive = all.at("meshes").at(0).at("primitives").at(0);
  const tessera::Json& attributes = primitive.at("attributes");
  std::size_t count = 0, stride = 0;
  const auto position = attributes.at("POSITION").get<std::size_t>();
  const auto maximum = all.at("accessors").at(position).at("max").get<Double3>();
  const std::vector<unsigned char> points = bytes_of(position, count, stride);
  tile.position_type = all.at("accessors").at(position).at("componentType") == 5126 ? "float" : "short";
  Double3 found = {0, 0, 0};
  for (std::size_t v = 0; v < count; ++v) {
    Double3 p;
    for (std::size_t k = 0; k < 3; ++k) {
      if (tile.position_type == "float") {
        float value = 0;
        std::memcpy(&value, points.data() + v * stride + 4 * k, 4);
        p[k] = static_cast<double>(value);
      } else {
        std::uint16_t value = 0;
        std::memcpy(&value, points.data() + v * stride + 2 * k, 2);
        p[k] = value;
      }
      found[k] = std::max(found[k], p[k]);
      p[k] = p[k] * scale[k] + shift[k];
    }
    tile.points.push_back({p[0], -p[2], p[1]});
  }
  if (found != maximum) throw std::runtime_error("the bounds of positions are not theirs");
  if (attributes.contains("COLOR_0")) {
    const auto colours = bytes_of(attributes.at("COLOR_0").get<std::size_t>(), count, stride);
    tile.colours.resize(count);
    std::memcpy(tile.colours.data(), colours.data(), colours.size());
  }
  if (attributes.contains("TEXCOORD_0")) {
    const auto uv = bytes_of(attributes.at("TEXCOORD_0").get<std::size_t>(), count, stride);
    tile.uv.resize(count);
    std::memcpy(tile.uv.data(), uv.data(), uv.size());
  }
  if (attributes.contains("_SYNTHETIC")) {
    const auto marks = bytes_of(attributes.at("_SYNTHETIC").get<std::size_t>(), count, stride);
    for (std::size_t v = 0; v < count; ++v)
      tile.synthetic.push_back(static_cast<std::uint8_t>(marks[v * stride]));
  }
  if (attributes.contains("NORMAL")) {
    const auto normals = bytes_of(attributes.at("NORMAL").get<std::size_t>(), count, stride);
    for (std::size_t v = 0; v < count; ++v) {
      const auto c = [&](std::size_t k) {
        return static_cast<double>(static_cast<signed char>(normals[v * stride + k])) / 127.0;
      };
      tile.normals.push_back({c(0), -c(2), c(1)});
    }
  }
  if (!primitive.contains("indices")) {
    if (primitive.at("mode") != 0) throw std::runtime_error("neither points nor faces");
    return tile;
  }
  const std::vector<unsigned char> corners =
      bytes_of(primitive.at("indices").get<std::size_t>(), count, stride);
  tile.faces.resize(count / 3);
  for (std::size_t i = 0; i < count; ++i) {
    std::uint32_t index = 0;
    std::memcpy(&index, corners.data() + i * stride, stride);
    if (index >= tile.points.size()) throw std::runtime_error("an index leads nowhere");
    tile.faces[i / 3][i % 3] = index;
  }
  return tile;
}

}  // namespace tessera::test
