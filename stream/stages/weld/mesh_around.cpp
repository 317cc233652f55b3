#include "stream/stages/weld/mesh_around.h"

#include <algorithm>
#include <cmath>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr std::uint64_t kAroundVertexBytes = std::uint64_t{4} << 20;
constexpr std::uint64_t kAroundFaceBytes = std::uint64_t{8} << 20;
constexpr double kFaceSpan = 4.0;  ///< cells that a face reaches out of its patch's brick, at most

}  // namespace

const std::vector<Float3>& MeshAround::vertices(std::size_t patch) {
  const auto found = vertices_.find(patch);
  if (found != vertices_.end()) return found->second.position;
  drop_first_patches(vertices_, vertex_bytes_, kAroundVertexBytes);
  Vertices& out = vertices_[patch];
  std::vector<std::uint32_t> rgba;
  numbered_.load_kept_vertices(patch, out.position, rgba);
  vertex_bytes_ += out.bytes();
  return out.position;
}

const MeshAround::View& MeshAround::view(std::size_t patch) {
  const auto found = views_.find(patch);
  if (found != views_.end()) return found->second;
  drop_first_patches(views_, view_bytes_, kAroundFaceBytes);
  numbered_.load_faces(patch, read_);
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  const std::size_t own = read_.index.size() - read_.foreign.size();
  std::vector<Double3> position(read_.index.size());
  for (std::size_t v = 0; v < position.size(); ++v) {
    if (read_.index[v] == PatchFaces::kDropped) continue;
    const std::size_t owner = v < own ? patch : read_.foreign[v - own].patch;
    position[v] = wide(vertices(owner)[read_.index[v] - numbering_.patches[owner].first_vertex]);
    const Int3 at = brick_of_key(store_.patches()[owner].key);
    for (std::size_t a = 0; a < 3; ++a) position[v][a] += double{kBrickCells} * (at[a] - brick[a]);
  }
  View& out = views_[patch];
  for (const PatchFace& f : read_.faces) {
    if (!read_.kept(f)) continue;
    const std::array<Double3, 3> corner = {position[f[0]], position[f[1]], position[f[2]]};
    out.faces.push_back({{read_.index[f[0]], read_.index[f[1]], read_.index[f[2]]}, corner});
    Box box{};
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [low, high] = std::minmax({corner[0][a], corner[1][a], corner[2][a]});
      box.low[a] = static_cast<std::int16_t>(std::floor(low));
      box.high[a] = static_cast<std::int16_t>(std::ceil(high));
    }
    out.boxes.push_back(box);
  }
  view_bytes_ += out.bytes();
  return out;
}

template <class Use>
void MeshAround::for_each_face(const Double3& origin, const Double3& low, const Double3& high,
                               const Use& use) {
  Int3 first{}, last{};
  for (std::size_t a = 0; a < 3; ++a) {
    const auto brick = [&](double x) {
      return static_cast<std::int32_t>(std::floor((origin[a] + x) / kBrickCells));
    };
    first[a] = std::max(0, brick(low[a] - kFaceSpan)), last[a] = brick(high[a] + kFaceSpan);
  }
  Int3 at = first;
  const auto next = [&] {
    for (std::size_t a = 0; a < 3; ++a) {
      if (++at[a] <= last[a]) return true;
      at[a] = first[a];
    }
    return false;
  };
  do {
    const std::int64_t patch = store_.find(brick_key(at));
    if (patch < 0 || numbering_.patches[static_cast<std::size_t>(patch)].kept_faces == 0) continue;
    for_each_face_of(static_cast<std::size_t>(patch), origin, low, high, use);
  } while (next());
}

template <class Use>
void MeshAround::for_each_face_of(std::size_t patch, const Double3& origin, const Double3& low,
                                  const Double3& high, const Use& use) {
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  Double3 shift{};  // of what is relative to the brick
  for (std::size_t a = 0; a < 3; ++a) shift[a] = double{kBrickCells} * brick[a] - origin[a];
  Int3 from{}, to{};  // the box in whole cells from the brick
  for (std::size_t a = 0; a < 3; ++a) {
    from[a] = static_cast<std::int32_t>(std::floor(low[a] - shift[a]));
    to[a] = static_cast<std::int32_t>(std::ceil(high[a] - shift[a]));
  }
  const View& there = view(patch);
  for (std::size_t i = 0; i < there.faces.size(); ++i) {
    const Box& box = there.boxes[i];
    bool apart = false;
    for (std::size_t a = 0; a < 3; ++a) apart = apart || box.low[a] > to[a] || from[a] > box.high[a];
    if (apart) continue;
    const Face& f = there.faces[i];
    use(f, std::array<Double3, 3>{f.corner[0] + shift, f.corner[1] + shift, f.corner[2] + shift});
  }
}

void MeshAround::gather_near(const Double3& origin, std::span<const ContactFace> near, double margin,
                             std::vector<ContactFace>& out) {
  if (near.empty()) return;
  std::vector<std::array<Double3, 2>> boxes;
  Double3 low = near.front().corner[0], high = low;
  for (const ContactFace& f : near) {
    Double3 from = f.corner[0], to = from;
    for (const Double3& p : f.corner)
      for (std::size_t a = 0; a < 3; ++a) from[a] = std::min(from[a], p[a]), to[a] = std::max(to[a], p[a]);
    for (std::size_t a = 0; a < 3; ++a) {
      from[a] -= margin, to[a] += margin;
      low[a] = std::min(low[a], from[a]), high[a] = std::max(high[a], to[a]);
    }
    boxes.push_back({from, to});
  }
  BoxMask mask(low, high, 64);
  for (const auto& [from, to] : boxes) mask.mark(from, to);
  gather(origin, low, high, mask, out);
}

void MeshAround::gather(const Double3& origin, const Double3& low, const Double3& high, const BoxMask& near,
                        std::vector<ContactFace>& out) {
  for_each_face(origin, low, high, [&](const Face& f, const std::array<Double3, 3>& at) {
    Double3 from = at[0], to = from;
    for (const Double3& p : at)
      for (std::size_t a = 0; a < 3; ++a) from[a] = std::min(from[a], p[a]), to[a] = std::max(to[a], p[a]);
    if (near.meets(from, to) && !collinear(at[0], at[1], at[2])) out.push_back({at, f.number});
  });
}

std::vector<std::array<std::uint64_t, 2>> MeshAround::edges_between(const Double3& origin, const Double3& low,
                                                                    const Double3& high,
                                                                    std::span<const std::uint64_t> vertices) {
  std::vector<std::array<std::uint64_t, 2>> out;
  for_each_face(origin, low, high, [&](const Face& f, const std::array<Double3, 3>&) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(f.number[k], f.number[(k + 1) % 3]);
      if (std::binary_search(vertices.begin(), vertices.end(), a) &&
          std::binary_search(vertices.begin(), vertices.end(), b))
        out.push_back({a, b});
    }
  });
  std::sort(out.begin(), out.end());
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

std::uint64_t MeshAround::bytes(std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches)
    largest = std::max<std::uint64_t>(
        largest, 44ull * (e.vertices + e.foreign) + (sizeof(Face) + sizeof(Box) + 13) * e.faces);
  return largest + kAroundVertexBytes + kAroundFaceBytes + NumberedPatches::kCacheBytes;
}

}  // namespace tessera
