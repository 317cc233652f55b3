#include "stream/stages/surface/hole_rounding.h"

#include <algorithm>
#include <utility>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/box_mask.h"
#include "kernels/mesh/orientation_sign.h"
#include "kernels/smooth/crease_blunting.h"
#include "octree/edge_faces.h"
#include "stream/files/external_sort.h"
#include "stream/stages/weld/border_moves.h"

namespace tessera {
namespace {

/// How far around a filling faces take part, in cells: those of its rim, and what they may meet.
constexpr double kRoundMargin = 4.0;

std::size_t patch_of_number(const Numbering& numbering, std::uint64_t vertex) {
  const auto after = std::upper_bound(numbering.patches.begin(), numbering.patches.end(), vertex,
                                      [](std::uint64_t v, const PatchSpan& p) { return v < p.first_vertex; });
  return static_cast<std::size_t>(after - numbering.patches.begin()) - 1;
}

/// Faces around the filling, the filling's own behind them; corners by their index in `name`.
struct Surroundings {
  std::vector<ContactFace> faces;
  std::size_t own = 0;  ///< the first of the filling
  std::vector<std::uint64_t> name;
  CreaseMesh mesh;
};

std::vector<ContactFace> filling_faces(const NamedLoop& named, const HoleLoop& loop,
                                       const HoleFilling& filling) {
  const std::size_t n = named.vertex.size();
  std::vector<ContactFace> own;
  for (const auto& f : filling.faces) {
    ContactFace& face = own.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      face.corner[k] = f[k] < n ? loop.position[f[k]] : filling.position[f[k] - n];
      face.vertex[k] = f[k] < n ? named.vertex[f[k]] : HoleFillings::kNew | (f[k] - n);
    }
  }
  return own;
}

/// \param mesh_faces  around the filling; \param own  the filling's
Surroundings surroundings(std::span<const ContactFace> mesh_faces, std::span<const ContactFace> own) {
  Surroundings out;
  out.faces.assign(mesh_faces.begin(), mesh_faces.end());
  out.own = out.faces.size();
  out.faces.insert(out.faces.end(), own.begin(), own.end());
  for (const ContactFace& f : out.faces) out.name.insert(out.name.end(), f.vertex.begin(), f.vertex.end());
  std::sort(out.name.begin(), out.name.end());
  out.name.erase(std::unique(out.name.begin(), out.name.end()), out.name.end());
  CreaseMesh& mesh = out.mesh;
  mesh.position.resize(out.name.size());
  mesh.at_border.assign(out.name.size(), 1);  // stay
  const auto index = [&](std::uint64_t v) {
    return static_cast<std::uint32_t>(std::lower_bound(out.name.begin(), out.name.end(), v) -
                                      out.name.begin());
  };
  for (std::size_t f = 0; f < out.faces.size(); ++f) {
    auto& face = mesh.faces.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) {
      face[k] = index(out.faces[f].vertex[k]);
      mesh.position[face[k]] = out.faces[f].corner[k];
      if (f >= out.own) mesh.at_border[face[k]] = 0;
    }
    mesh.unseen.push_back(f >= out.own);
  }
  return out;
}

/// Whether a face of the mesh that changed has a corner at the border of something else, which may move it as well.
bool is_shared(const Surroundings& here, const std::vector<Double3>& before, const NamedLoop& named) {
  const std::size_t n = here.mesh.position.size();
  std::vector<std::uint8_t> other(n, 0);
  const std::span<const std::array<std::uint32_t, 3>> faces(here.mesh.faces.data(), here.own);
  const std::vector<std::uint32_t> opposite = opposite_half_edges(n, faces);
  for (std::uint32_t h = 0; h < opposite.size(); ++h)
    if (opposite[h] == kNoHalfEdge) other[faces[h / 3][h % 3]] = other[faces[h / 3][(h + 1) % 3]] = 1;
  for (const std::uint64_t v : named.vertex) {
    const auto at = std::lower_bound(here.name.begin(), here.name.end(), v);
    other[static_cast<std::size_t>(at - here.name.begin())] = 0;
  }
  for (const auto& f : faces) {
    bool changed = false, shared = false;
    for (const std::uint32_t v : f) {
      changed = changed || here.mesh.position[v] != before[v];
      shared = shared || other[v];
    }
    if (changed && shared) return true;
  }
  return false;
}

/// Adds those of the others that come near one of the faces.
void add_near(std::span<const ContactFace> others, std::vector<ContactFace>& faces) {
  const auto box = [](const ContactFace& f) {
    std::pair<Double3, Double3> out = {f.corner[0], f.corner[0]};
    for (const Double3& p : f.corner)
      for (std::size_t a = 0; a < 3; ++a) {
        out.first[a] = std::min(out.first[a], p[a]);
        out.second[a] = std::max(out.second[a], p[a]);
      }
    return out;
  };
  if (faces.empty()) return;
  auto [low, high] = box(faces.front());
  for (const ContactFace& f : faces) {
    const auto [from, to] = box(f);
    for (std::size_t a = 0; a < 3; ++a)
      low[a] = std::min(low[a], from[a]), high[a] = std::max(high[a], to[a]);
  }
  BoxMask near(low, high, 32);
  for (const ContactFace& f : faces) {
    const auto [from, to] = box(f);
    near.mark(from, to);
  }
  for (const ContactFace& f : others) {
    const auto [from, to] = box(f);
    if (near.meets(from, to)) faces.push_back(f);
  }
}

}  // namespace

bool round_rim(const NamedLoop& named, HoleLoop& loop, const Double3& origin, const PatchStore& store,
               const Numbering& numbering, MeshAround& around, std::span<const ContactFace> touching,
               HoleFilling& filling, std::vector<MovedRim>& moves) {
  const std::vector<ContactFace> own_faces = filling_faces(named, loop, filling);
  // What moves, and by how much, is up to the faces at the vertices of the filling; most often nothing does.
  CreaseMesh nearest = surroundings(touching, own_faces).mesh;
  if (blunt_creases(nearest) == 0) return false;
  std::vector<ContactFace> mesh_faces;
  around.gather_near(origin, own_faces, kRoundMargin, mesh_faces);
  Surroundings here = surroundings(mesh_faces, own_faces);
  const std::vector<Double3> before = here.mesh.position;
  if (blunt_creases(here.mesh) == 0 || is_shared(here, before, named)) return false;
  std::vector<MovedRim> moved;
  for (std::size_t v = 0; v < before.size(); ++v) {
    Double3& p = here.mesh.position[v];
    if (p == before[v] || (here.name[v] & HoleFillings::kNew) != 0) continue;
    // As it will be read again.
    const Int3 brick = brick_of_key(store.patches()[patch_of_number(numbering, here.name[v])].key);
    Double3 offset{};
    for (std::size_t a = 0; a < 3; ++a) offset[a] = double{kBrickCells} * brick[a] - origin[a];
    moved.push_back({here.name[v], narrow(p - offset)});
    p = wide(moved.back().to) + offset;
  }
  // Faces that changed come first: pairs of others are none of its business.
  std::vector<ContactFace> faces, others;
  for (std::size_t f = 0; f < here.faces.size(); ++f) {
    ContactFace face = here.faces[f];
    bool changed = f >= here.own;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = here.mesh.faces[f][k];
      changed = changed || here.mesh.position[v] != before[v];
      face.corner[k] = here.mesh.position[v];
    }
    if (collinear(face.corner[0], face.corner[1], face.corner[2])) {
      if (changed) return false;
      continue;
    }
    (changed ? faces : others).push_back(face);
  }
  const std::size_t own = faces.size();
  add_near(others, faces);
  bool crosses = false;
  block_contacts(faces, kAllSpace,
                 [&](std::uint32_t i, std::uint32_t, FaceContact) { crosses = crosses || i < own; });
  if (crosses) return false;
  for (std::size_t v = 0; v < before.size(); ++v)
    if ((here.name[v] & HoleFillings::kNew) != 0)
      filling.position[here.name[v] & ~HoleFillings::kNew] = here.mesh.position[v];
  for (std::size_t i = 0; i < named.vertex.size(); ++i) {
    const auto v = std::lower_bound(here.name.begin(), here.name.end(), named.vertex[i]) - here.name.begin();
    loop.position[i] = here.mesh.position[static_cast<std::size_t>(v)];
  }
  moves.insert(moves.end(), moved.begin(), moved.end());
  return true;
}

std::uint64_t save_rim_moves(const std::filesystem::path& work, const PatchStore& store,
                             const Numbering& numbering, std::uint64_t sort_bytes, TaskContext& context) {
  ExternalSort<MovedRim> sort(work, sort_bytes);
  for (const auto& file : list_all_filling_files(work)) {
    context.check_stop();
    for (const MovedRim& m : load_rim_moves(file)) sort.add(m);
  }
  BorderMovesWriter writer(context.create(border_moves_file_name(0, kRimFolder)));
  const NumberedPatches numbered(work, store, numbering);
  std::vector<MovedVertex> moves;
  std::vector<std::uint32_t> own;  // number in the patch per kept vertex, empty if it kept all
  std::size_t patch = 0;
  std::uint64_t count = 0;
  const auto flush = [&] {
    writer.add(store.patches()[patch].key, moves);
    count += moves.size();
    moves.clear();
  };
  sort.drain([&](std::span<const MovedRim> batch) {
    context.check_stop();
    for (const MovedRim& m : batch) {
      const std::size_t p = patch_of_number(numbering, m.number);
      if (p != patch || own.empty()) {
        flush();
        patch = p;
        own = numbered.kept_vertices(p);
      }
      moves.push_back({own[m.number - numbering.patches[p].first_vertex], m.to});
    }
  });
  if (!moves.empty()) flush();
  context.count_written(writer.finish());
  return count;
}

}  // namespace tessera
