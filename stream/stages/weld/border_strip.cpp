#include "stream/stages/weld/border_strip.h"

#include <algorithm>

namespace tessera {
namespace {

constexpr std::size_t kCachedPatches = 12;
constexpr std::uint64_t kCachedStripBytes = std::uint64_t{12} << 20;

}  // namespace

bool StripReader::has_border(std::size_t patch) const {
  if (numbering_.patches[patch].kept_faces == 0) return false;
  const std::vector<std::uint32_t> border = store_.load_seam(patch).components.border;
  return std::any_of(border.begin(), border.end(), [](std::uint32_t n) { return n > 0; });
}

const StripReader::Strip& StripReader::get(std::size_t patch) {
  const auto bytes_of = [](const Strip& s) { return sizeof(Strip) + s.faces.size() * sizeof(StripFace); };
  const auto found = strips_.find(patch);
  if (found != strips_.end()) return found->second;
  while (strip_bytes_ > kCachedStripBytes && !strips_.empty()) {  // of the smallest brick: it came first
    strip_bytes_ -= bytes_of(strips_.begin()->second);
    strips_.erase(strips_.begin());
  }
  Strip& strip = strips_[patch];
  read(patch, strip);
  strip_bytes_ += bytes_of(strip);
  return strip;
}

const StripReader::Vertices& StripReader::vertices(std::size_t patch) {
  const auto found = vertices_.find(patch);
  if (found != vertices_.end()) return found->second;
  if (vertices_.size() >= kCachedPatches) vertices_.erase(vertices_.begin());
  Vertices& out = vertices_[patch];
  std::vector<std::uint32_t> rgba;
  store_.load_vertices(patch, out.position, rgba, &out.kind);
  return out;
}

void StripReader::read(std::size_t patch, Strip& strip) {
  numbered_.load_faces(patch, faces_);
  const Vertices own = vertices(patch);  // a copy: the cache may drop it
  corner_.clear();
  for (std::uint32_t v = 0; v < own.position.size(); ++v)
    corner_.push_back({{static_cast<std::uint32_t>(patch), v},
                       faces_.index[v],
                       own.position[v],
                       own.kind[v] == VertexClass::kBorder});
  for (const VertexSlot& slot : faces_.foreign) {
    const Vertices& there = vertices(slot.patch);
    corner_.push_back({slot, faces_.index[corner_.size()], there.position[slot.vertex],
                       there.kind[slot.vertex] == VertexClass::kBorder});
  }
  for (const PatchFace& f : faces_.faces) {
    if (!faces_.kept(f)) continue;
    StripFace face;
    for (std::size_t i = 0; i < 3; ++i) {
      const Corner& c = corner_[f[i]];
      face.slot[i] = c.slot;
      face.number[i] = c.number;
      face.at[i] = c.at;
      face.border |= static_cast<std::uint32_t>(c.border) << i;
    }
    if (face.border == 0) continue;
    strip.torn = strip.faces.size() == kMaxStripFaces;
    if (strip.torn) return;
    strip.faces.push_back(face);
  }
}

Double3 StripReader::corner(const StripFace& face, std::size_t i, const Int3& brick) const {
  const Int3 owner = this->brick(face.slot[i].patch);
  Double3 p = wide(face.at[i]);
  for (std::size_t a = 0; a < 3; ++a) p[a] += double{kBrickCells} * (owner[a] - brick[a]);
  return p;
}

bool StripReader::is_near(const StripFace& face, std::size_t i, const Int3& brick, int halo) const {
  const Double3 at = corner(face, i, brick);
  return std::all_of(at.begin(), at.end(),
                     [halo](double x) { return x >= -halo && x <= kBrickCells + halo; });
}

bool StripReader::gather(std::size_t patch, int halo, std::vector<StripFace>& faces) {
  faces.clear();
  const Int3 here = brick(patch);
  for (const std::size_t p : kept_patches_around(store_, numbering_, here)) {
    const Strip& strip = get(p);
    if (strip.torn) return false;
    for (const StripFace& f : strip.faces) {
      bool near = false;
      for (std::size_t i = 0; i < 3 && !near; ++i) near = is_near(f, i, here, halo);
      if (!near) continue;
      if (faces.size() == kMaxStripFaces) return false;
      faces.push_back(f);
    }
  }
  return true;
}

std::uint64_t StripReader::bytes(std::span<const PatchEntry> patches) {
  std::uint64_t vertices = 0, faces = 0;
  for (const PatchEntry& e : patches) {
    vertices = std::max<std::uint64_t>(vertices, 56ull * e.vertices + 56ull * e.foreign);
    faces = std::max<std::uint64_t>(faces, 13ull * e.faces);
  }
  return kCachedPatches * vertices / 3 + 2 * vertices + faces + 2 * kMaxStripFaces * sizeof(StripFace) +
         kCachedStripBytes + NumberedPatches::kCacheBytes;
}

}  // namespace tessera
