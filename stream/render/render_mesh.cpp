// A mesh as a scene item: vertices in memory or corners in a file, border edges, batches of triangles.
#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "kernels/picture/caption.h"
#include "octree/error.h"
#include "octree/vector.h"
#include "stream/check/mesh_crossings.h"
#include "stream/meshes/border_edges.h"
#include "stream/meshes/corner_file.h"
#include "stream/meshes/mesh_weld.h"
#include "stream/render/doubt.h"
#include "stream/render/mesh_pages.h"
#include "stream/render/render_scene.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

constexpr std::size_t kChunkVertices = 1u << 18;
constexpr std::size_t kDrawnFaces = 8192;          // at once: their corners stay in the cache
constexpr std::size_t kMaxBorderEdges = 2u << 20;  // 2 lists of 16 byte edges and 24 byte ends each
constexpr std::uint64_t kUnlimited = std::uint64_t{1} << 60;
constexpr std::uint64_t kMinTable = std::uint64_t{16} << 20;
constexpr float kBorderPixels = 2.6f;
constexpr float kWirePixels = 0.9f;

/// Arrays that grow without copying, so that growth never needs more than it keeps.
template <typename T>
class Chunked {
 public:
  void push_back(const T& value) {
    if (size_ % kChunkVertices == 0)
      chunks_.push_back(std::make_unique_for_overwrite<std::array<T, kChunkVertices>>());
    (*chunks_.back())[size_++ % kChunkVertices] = value;
  }
  T& operator[](std::uint64_t i) { return (*chunks_[i / kChunkVertices])[i % kChunkVertices]; }
  const T& operator[](std::uint64_t i) const { return (*chunks_[i / kChunkVertices])[i % kChunkVertices]; }
  std::uint64_t size() const { return size_; }
  void clear() {
    chunks_.clear();
    size_ = 0;
  }

 private:
  std::vector<std::unique_ptr<std::array<T, kChunkVertices>>> chunks_;
  std::uint64_t size_ = 0;
};

/// Of the edges whose ends these are.
float median_length(const std::vector<Float3>& ends) {
  std::vector<float> squares;
  for (std::size_t i = 0; i + 1 < ends.size(); i += 2) {
    const Float3 d = ends[i + 1] - ends[i];
    const float square = dot(d, d);
    if (std::isfinite(square)) squares.push_back(square);
  }
  if (squares.empty()) return 0.0f;
  const auto middle = squares.begin() + static_cast<std::ptrdiff_t>(squares.size() / 2);
  std::nth_element(squares.begin(), middle, squares.end());
  return std::sqrt(*middle);
}

bool finite(const Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

class MeshItem final : public SceneItem {
 public:
  MeshItem(const std::filesystem::path& path, const RenderOptions& options, std::uint64_t memory_bytes,
           RenderReport& report)
      : path_(path), memory_bytes_(memory_bytes) {
    if (!options.uncertain.empty()) {
      doubt_.emplace(options.uncertain, memory_bytes_ / 2);
      if (memory_bytes_ != 0) memory_bytes_ -= doubt_->bytes();
    }
    if (options.pages && (options.colour == "auto" || options.colour == "texture"))
      find_pages(options, report);
    survey(options);
    if (sample_.empty())
      throw EmptyError(path.string() + ": no vertex with finite coordinates, nothing to draw");
    if (!resident_) {
      corners_.emplace(render_temp(options));
      corners_->build(path_, vertex_count_, origin_, memory_bytes_);
      face_count_ = corners_->faces();
      report.temp_bytes += corners_->bytes();
    } else if (face_count_ == 0) {
      open_mesh_file(path_)->read_faces(
          [&](std::span<const MeshFace> batch) { face_count_ += batch.size(); });
    }
    if (face_count_ == 0) throw EmptyError(path.string() + ": the mesh has no faces, nothing to draw");
    if (options.smooth) add_normals(report);
    if (options.borders != "off") find_borders(options, report);
    if (options.crossings) find_face_crossings(options, report);
    // What is closed and looks inwards is inside out; only what has openings can be a room.
    cut_backs_ =
        options.backs == "cut" || (options.backs == "auto" && borders_.border_count > 0 && looks_inwards());
    report.vertices += vertex_count_;
    report.faces += face_count_;
    report.border_edges += borders_.border_count;
    report.non_manifold_edges += borders_.non_manifold_count;
  }

  const SceneSample& sample() const override { return sample_; }
  bool is_points() const override { return false; }
  std::string caption() const override {
    return path_.filename().string() + ", " + with_commas(face_count_) + " faces" +
           (pages_ ? ", " + with_commas(pages_->pages()) + (pages_->pages() == 1 ? " page" : " pages") +
                         " of textures"
                   : "") +
           (doubt_ ? ", red where sides of points were in doubt" : "") +
           (cut_backs_ ? ", seen from inside" : "");
  }
  void draw(Picture& picture, const DrawContext& context) override;

 private:
  void find_pages(const RenderOptions& options, RenderReport& report);
  void survey(const RenderOptions& options);
  bool looks_inwards() const;
  template <class Use>
  void each_face(const Use& use) const;
  void add_normals(RenderReport& report);
  void find_borders(const RenderOptions& options, RenderReport& report);
  void find_face_crossings(const RenderOptions& options, RenderReport& report);
  void with_shared_vertices(const RenderOptions& options, const std::function<void(MeshReader&)>& use) const;
  std::vector<Float3> edge_ends(MeshReader& mesh,
                                const std::vector<std::array<std::uint64_t, 2>>& edges) const;
  void draw_edges(Picture& picture, const std::vector<Float3>& ends, std::uint32_t colour) const;
  Float3 local(const Double3& p) const {
    return {static_cast<float>(p[0] - origin_[0]), static_cast<float>(p[1] - origin_[1]),
            static_cast<float>(p[2] - origin_[2])};
  }
  /// Faces that share no vertices, or not along the borders of charts.
  bool soup() const { return soup_; }
  std::uint64_t bytes_per_vertex(bool smooth) const { return 12 + (colour_ ? 4 : 0) + (smooth ? 12 : 0); }
  std::uint64_t vertex_bytes() const { return vertex_count_ * bytes_per_vertex(!normals_empty_); }

  std::filesystem::path path_;
  std::uint64_t memory_bytes_;
  std::string format_;
  bool soup_ = false;
  bool colour_ = false;
  bool resident_ = true;
  bool normals_empty_ = true;
  bool cut_backs_ = false;
  std::uint64_t vertex_count_ = 0, face_count_ = 0;
  Double3 origin_{};  ///< of the floats kept here: the first finite vertex
  Double3 shift_{};   ///< from the frame of the file to that of the scan
  std::optional<Doubt> doubt_;
  std::unique_ptr<MeshPages> pages_;  ///< of textures; none without
  SceneSample sample_;
  Chunked<Float3> positions_, normals_;
  Chunked<std::uint32_t> rgba_;
  std::optional<CornerFile> corners_;
  BorderEdges borders_;
  std::vector<Float3> border_ends_, non_manifold_ends_;
  std::vector<std::uint64_t> crossing_;  ///< faces, ascending
  std::vector<PictureVertex> batch_;
};

/// Pages of textures where the mesh has some; auto does without those that it cannot have, and says so.
void MeshItem::find_pages(const RenderOptions& options, RenderReport& report) {
  const auto without = [&](const std::string& why) {
    report.notices.push_back(why + "; drawn without textures");
  };
  try {
    auto pages = std::make_unique<MeshPages>(path_, render_temp(options),
                                             memory_bytes_ == 0 ? kUnlimited : memory_bytes_ / 2);
    report.notices.insert(report.notices.end(), pages->notices().begin(), pages->notices().end());
    if (pages->pages() > 0) {
      pages_ = std::move(pages);
      report.pages += pages_->pages();
    } else if (options.colour == "texture") {
      without(path_.string() + ": has no pages of textures");
    }
  } catch (const InputError& e) {
    if (options.colour == "texture") throw;
    without(e.what());
  } catch (const ResourceError& e) {
    if (options.colour == "texture") throw;
    without(e.what());
  }
}

/// Bounds, counts, and the vertices while they fit.
void MeshItem::survey(const RenderOptions& options) {
  const auto reader = open_mesh_file(path_);
  format_ = reader->format();
  soup_ = !reader->shared_vertices() || reader->split_vertices();
  colour_ = reader->header().colour;
  shift_ = reader->header().shift;
  face_count_ = reader->header().faces;
  const std::uint64_t per_vertex = bytes_per_vertex(options.smooth);
  const auto fits = [&](std::uint64_t vertices) {
    return memory_bytes_ == 0 || vertices * per_vertex <= memory_bytes_;
  };
  resident_ = fits(reader->header().vertices);
  reader->read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t> rgba) {
    throw_if_stopped();
    for (std::size_t i = 0; i < batch.size(); ++i) {
      const Double3& p = batch[i];
      if (finite(p)) {
        if (sample_.empty()) origin_ = p;
        sample_.add(p);
      }
      if (resident_) {
        positions_.push_back(local(p));
        if (colour_) rgba_.push_back(rgba[i]);
      }
    }
    vertex_count_ += batch.size();
    if (resident_ && !fits(vertex_count_)) {
      resident_ = false;
      positions_.clear();
      rgba_.clear();
    }
  });
}

/// Calls use(corners of the face, the face or nullptr, synthetic) for all faces in order.
template <class Use>
void MeshItem::each_face(const Use& use) const {
  if (!resident_) {
    corners_->read([&](std::span<const Corner> corners) {
      for (std::size_t i = 0; i < corners.size(); i += 3)
        use(std::array<Corner, 3>{corners[i], corners[i + 1], corners[i + 2]}, nullptr, false);
    });
    return;
  }
  open_mesh_file(path_)->read_flagged_faces(
      [&](std::span<const MeshFace> faces, std::span<const std::uint8_t> synthetic) {
        throw_if_stopped();
        for (std::size_t f = 0; f < faces.size(); ++f) {
          const MeshFace& face = faces[f];
          std::array<Corner, 3> corners;
          for (std::size_t i = 0; i < 3; ++i) {
            const Float3& p = positions_[face[i]];
            corners[i] = {p[0], p[1], p[2], colour_ ? rgba_[face[i]] : 0};
          }
          use(corners, &face, !synthetic.empty() && synthetic[f] != 0);
        }
      });
}

/// Whether the surface shows more front than back to its middle, from all around: a room. Terrain in a basin looks
/// inwards too, but one way more than the other: its normals do not cancel out.
bool MeshItem::looks_inwards() const {
  constexpr double kInwards = 0.05;  // mean cosine to the middle: 0.45 in a hall, 0.07 in furnished rooms
  constexpr double kOneSided = 0.3;  // length of the mean normal: at most 0.2 in rooms, from 0.6 on outdoors
  Float3 middle{};
  for (std::size_t a = 0; a < 3; ++a)
    middle[a] = static_cast<float>(0.5 * (sample_.low()[a] + sample_.high()[a]) - origin_[a]);
  double facing = 0.0;
  double weight = 0.0;
  double area = 0.0;
  Double3 normal{};
  each_face([&](const std::array<Corner, 3>& corners, const MeshFace*, bool) {
    const Float3 p = {corners[0].x, corners[0].y, corners[0].z};
    const Float3 u = Float3{corners[1].x, corners[1].y, corners[1].z} - p;
    const Float3 v = Float3{corners[2].x, corners[2].y, corners[2].z} - p;
    const Float3 n = cross(u, v);
    const Float3 r = p - middle;
    const double size = std::sqrt(double{dot(n, n)});
    const double distance = std::sqrt(double{dot(r, r)});
    if (!std::isfinite(size * distance)) return;
    facing += dot(n, r);
    weight += size * distance;
    area += size;
    for (std::size_t a = 0; a < 3; ++a) normal[a] += n[a];
  });
  return facing < -kInwards * weight && std::sqrt(dot(normal, normal)) < kOneSided * area;
}

/// Area-weighted vertex normals.
void MeshItem::add_normals(RenderReport& report) {
  if (!resident_) {
    report.notices.push_back(path_.string() +
                             ": drawn with one normal per face; --smooth needs its vertices in memory, " +
                             format_bytes(vertex_count_ * bytes_per_vertex(true)) + " of the cap");
    return;
  }
  for (std::uint64_t i = 0; i < vertex_count_; ++i) normals_.push_back({0, 0, 0});
  normals_empty_ = false;
  open_mesh_file(path_)->read_faces([&](std::span<const MeshFace> batch) {
    throw_if_stopped();
    for (const MeshFace& face : batch) {
      const Float3 &a = positions_[face[0]], &b = positions_[face[1]], &c = positions_[face[2]];
      const Float3 u = b - a, v = c - a;
      const Float3 n = cross(u, v);
      if (!std::isfinite(n[0] + n[1] + n[2])) continue;
      for (const std::uint64_t corner : face) {
        for (std::size_t k = 0; k < 3; ++k) normals_[corner][k] += n[k];
      }
    }
  });
}

void MeshItem::find_borders(const RenderOptions& options, RenderReport& report) {
  const std::uint64_t resident = resident_ ? vertex_bytes() : 0;
  const std::uint64_t budget =
      memory_bytes_ == 0 ? kUnlimited : memory_bytes_ - std::min(memory_bytes_, resident);
  // Half for joining vertices where the format does not share them, the other half for the edges then.
  const std::uint64_t table_budget = soup() ? budget / 2 : budget;
  const std::uint64_t table = edge_table_bytes(vertex_count_, face_count_);
  if (options.borders != "on" && table > table_budget) {
    report.notices.push_back(path_.string() + ": border edges are not drawn; their table takes " +
                             format_bytes(table) +
                             "; raise --memory, or give --borders on for several passes");
    return;
  }
  with_shared_vertices(options, [&](MeshReader& mesh) {
    const std::uint64_t vertices = soup() ? mesh.header().vertices : vertex_count_;
    const FaceStream faces = [&](const std::function<void(std::span<const MeshFace>)>& sink) {
      mesh.read_faces([&](std::span<const MeshFace> batch) {
        throw_if_stopped();
        sink(batch);
      });
    };
    borders_ =
        find_border_edges(faces, vertices, face_count_, std::max(table_budget, kMinTable), kMaxBorderEdges);
    border_ends_ = edge_ends(mesh, borders_.border);
    non_manifold_ends_ = edge_ends(mesh, borders_.non_manifold);
  });
  if (std::max(borders_.border_count, borders_.non_manifold_count) > kMaxBorderEdges) {
    report.notices.push_back(path_.string() + ": " + with_commas(borders_.border_count) + " border and " +
                             with_commas(borders_.non_manifold_count) + " non-manifold edges, only " +
                             with_commas(kMaxBorderEdges) + " of each are drawn");
  }
}

void MeshItem::find_face_crossings(const RenderOptions& options, RenderReport& report) {
  std::uint64_t memory = std::uint64_t{1} << 30;
  if (memory_bytes_ != 0)
    memory = std::max((memory_bytes_ - std::min(memory_bytes_, vertex_bytes())) / 2, kMinTable);
  with_shared_vertices(options, [&](MeshReader& mesh) {
    VertexStore positions(render_temp(options), mesh.header().double_positions, memory / 4);
    mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
      throw_if_stopped();
      positions.append(batch);
    });
    find_crossings(mesh, positions,
                   {memory / 4 * 3, render_temp(options), 1, throw_if_stopped,
                    [&](std::span<const std::uint64_t> faces) {
                      crossing_.insert(crossing_.end(), faces.begin(), faces.end());
                    }});
  });
  report.crossing_faces += crossing_.size();
}

/// The file as a mesh whose faces share vertices.
void MeshItem::with_shared_vertices(const RenderOptions& options,
                                    const std::function<void(MeshReader&)>& use) const {
  const auto reader = open_mesh_file(path_);
  if (!soup()) {
    use(*reader);
    return;
  }
  WeldOptions weld;
  if (memory_bytes_ != 0)
    weld.memory_bytes = std::max((memory_bytes_ - std::min(memory_bytes_, vertex_bytes())) / 2, kMinTable);
  weld.temp = render_temp(options);
  weld.check_stop = throw_if_stopped;
  WeldedMesh welded(*reader, weld);
  use(welded);
}

/// Both ends of every edge, by one pass over the vertices.
std::vector<Float3> MeshItem::edge_ends(MeshReader& mesh,
                                        const std::vector<std::array<std::uint64_t, 2>>& edges) const {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> wanted(2 * edges.size());
  for (std::size_t i = 0; i < wanted.size(); ++i)
    wanted[i] = {edges[i / 2][i % 2], static_cast<std::uint32_t>(i)};
  std::sort(wanted.begin(), wanted.end());
  std::vector<Float3> ends(wanted.size());
  if (edges.empty()) return ends;
  std::size_t next = 0;
  std::uint64_t index = 0;
  mesh.read_vertices([&](std::span<const Double3> batch, std::span<const std::uint32_t>) {
    for (const Double3& p : batch) {
      for (; next < wanted.size() && wanted[next].first == index; ++next)
        ends[wanted[next].second] = local(p);
      ++index;
    }
  });
  return ends;
}

void MeshItem::draw_edges(Picture& picture, const std::vector<Float3>& ends, std::uint32_t colour) const {
  const float length = median_length(ends);
  std::vector<PictureVertex> batch;
  for (std::size_t begin = 0; begin < ends.size(); begin += 2 * kDrawnFaces) {
    batch.clear();
    for (std::size_t i = begin; i < std::min(begin + 2 * kDrawnFaces, ends.size()); ++i) {
      PictureVertex v;
      v.x = ends[i][0], v.y = ends[i][1], v.z = ends[i][2];
      v.rgba = colour;
      batch.push_back(v);
    }
    picture.lines(batch, kBorderPixels, length);
  }
}

void MeshItem::draw(Picture& picture, const DrawContext& context) {
  const RenderOptions& options = *context.options;
  const bool by_vertex =
      colour_ && (options.colour == "auto" || options.colour == "vertex" || options.colour == "texture");
  const bool by_height = options.colour == "height";
  const float wire = options.wire ? kWirePixels : 0.0f;
  picture.set_offset(origin_ - context.origin);
  picture.cut_backs(cut_backs_);
  std::vector<PictureVertex>& batch = batch_;  // of every drawing
  batch.clear();
  batch.reserve(3 * kDrawnFaces);
  const bool by_origin = !by_vertex && !by_height;
  std::uint64_t number = 0;
  auto crossing = crossing_.begin();
  std::vector<Float3> crossing_ends;
  if (pages_) pages_->begin();
  const auto emit = [&](const std::array<Corner, 3>& corners, const MeshFace* face, bool synthetic) {
    const auto& [a, b, c] = corners;
    const bool crosses = crossing != crossing_.end() && *crossing == number;
    ++number;
    if (crosses) {
      ++crossing;
      for (const auto& [from, to] : {std::pair(a, b), std::pair(b, c), std::pair(c, a)})
        crossing_ends.insert(crossing_ends.end(), {{from.x, from.y, from.z}, {to.x, to.y, to.z}});
    }
    const Float3 u = {b.x - a.x, b.y - a.y, b.z - a.z}, v = {c.x - a.x, c.y - a.y, c.z - a.z};
    const Float3 n = cross(u, v);
    if (!std::isfinite(n[0] + n[1] + n[2])) {  // a corner that is not a number: nothing to see
      if (pages_) pages_->skip();
      return;
    }
    std::array<PictureVertex, 3> drawn;
    bool marked = crosses || (options.synthetic && synthetic);  // in a colour that says something
    PictureVertex flat;
    // Scaled first: squares of tiny faces would underflow.
    const float largest = std::max({std::abs(n[0]), std::abs(n[1]), std::abs(n[2])});
    if (largest > 0.0f) set_normal(flat, n[0] / largest, n[1] / largest, n[2] / largest);
    for (std::size_t i = 0; i < 3; ++i) {
      PictureVertex out = flat;
      const Corner& corner = corners[i];
      out.x = corner.x, out.y = corner.y, out.z = corner.z;
      if (by_vertex) out.rgba = corner.rgba;
      if ((by_origin || options.synthetic) && synthetic) out.rgba = kSyntheticFace;
      const Double3 p = {static_cast<double>(corner.x) + origin_[0],
                         static_cast<double>(corner.y) + origin_[1],
                         static_cast<double>(corner.z) + origin_[2]};
      if (by_height) out.rgba = ramp_colour(height_share(p, context));
      if (doubt_ && doubt_->at(p + shift_)) out.rgba = kDoubtfulPoint, marked = true;
      if (crosses) out.rgba = kCrossingFace;
      if (face != nullptr && !normals_empty_) {
        const Float3& m = normals_[(*face)[i]];
        const float maximum = std::max({std::abs(m[0]), std::abs(m[1]), std::abs(m[2])});
        if (maximum > 0.0f) set_normal(out, m[0] / maximum, m[1] / maximum, m[2] / maximum);
      }
      drawn[i] = out;
    }
    if (pages_) {
      if (marked)
        pages_->skip();
      else if (pages_->take(drawn))
        return;
    }
    batch.insert(batch.end(), drawn.begin(), drawn.end());
    if (batch.size() >= 3 * kDrawnFaces) {
      throw_if_stopped();
      picture.triangles(batch, wire);
      batch.clear();
    }
  };
  each_face(emit);
  if (!batch.empty()) picture.triangles(batch, wire);
  if (pages_) pages_->draw(picture, wire);
  // Where red says doubt, it says nothing else unless asked.
  if (!doubt_ || options.borders == "on") draw_edges(picture, border_ends_, kBorderEdge);
  draw_edges(picture, non_manifold_ends_, kNonManifoldEdge);
  draw_edges(picture, crossing_ends, kCrossingFace);
}

}  // namespace

std::unique_ptr<SceneItem> make_mesh_item(const std::filesystem::path& path, const RenderOptions& options,
                                          std::uint64_t memory_bytes, RenderReport& report) {
  return std::make_unique<MeshItem>(path, options, memory_bytes, report);
}

}  // namespace tessera
