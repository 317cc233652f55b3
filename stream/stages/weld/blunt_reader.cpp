#include "stream/stages/weld/blunt_reader.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

namespace tessera {
namespace {

/// Faces of a piece: beyond, a brick is torn to shreds and stays as it is.
constexpr std::size_t kMaxBluntFaces = 80'000;
/// Of one face in the kernel: itself, three half-edges, half a vertex, and the names of its corners.
constexpr std::uint64_t kBluntFaceBytes = 220;
/// How far from a face that nobody saw faces take part, in cells: its rings, and one more.
constexpr double kBluntMargin = 6.0;
constexpr std::uint32_t kForeign = std::uint32_t{1} << 31, kUsed = 0, kUnused = ~std::uint32_t{0};
constexpr double kEnd = kBrickCells + kBluntHalo;
constexpr Double3 kLow = {-kBluntHalo, -kBluntHalo, -kBluntHalo};
constexpr Double3 kHigh = {kEnd, kEnd, kEnd};

bool apart(const Double3& from, const Double3& to, const Double3& low, const Double3& high) {
  bool out = false;
  for (std::size_t a = 0; a < 3; ++a) out = out || from[a] > high[a] || low[a] > to[a];
  return out;
}

}  // namespace

bool BluntReader::gather(std::size_t patch, CreaseMesh& mesh, std::vector<std::uint64_t>& name) {
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  const std::vector<std::size_t> around = kept_patches_around(store_, numbering_, brick);
  BoxMask near(kLow, kHigh, 64);
  bool any = false;
  for (const std::size_t p : around) {
    const View& there = view(p);
    const Double3 shift = offset(p, brick);
    for (const std::uint32_t f : there.wanted) {
      auto [from, to] = there.box(f, shift);
      if (apart(from, to, kLow, kHigh)) continue;
      for (double& x : from) x -= kBluntMargin;
      for (double& x : to) x += kBluntMargin;
      near.mark(from, to);
      any = true;
    }
  }
  if (!any) return false;
  mesh = {};
  own_.clear(), foreign_.clear();
  for (const std::size_t p : around)
    if (!add_faces(p, offset(p, brick), near, mesh)) return false;
  join(mesh, name);
  return true;
}

std::uint64_t BluntReader::bytes(std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches)
    largest = std::max<std::uint64_t>(largest, 80ull * e.vertices + 60ull * e.foreign + 40ull * e.faces);
  return kVertexCacheBytes + kViewCacheBytes + 2 * largest + kMaxBluntFaces * kBluntFaceBytes +
         NumberedPatches::kCacheBytes;
}

BluntReader::Box BluntReader::View::box(std::uint32_t f, const Double3& shift) const {
  const PatchFace& c = faces[f];
  const Double3 p = position(c[0]), q = position(c[1]), r = position(c[2]);
  Box out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.first[a] = std::min({p[a], q[a], r[a]}) + shift[a];
    out.second[a] = std::max({p[a], q[a], r[a]}) + shift[a];
  }
  return out;
}

bool BluntReader::add_faces(std::size_t patch, const Double3& shift, const BoxMask& near, CreaseMesh& mesh) {
  const View& there = view(patch);
  const std::size_t begin = mesh.faces.size();
  place_.assign(there.border.size(), kUnused);
  for (std::size_t run = 0; run < there.runs.size(); ++run) {
    Double3 low, high;
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = there.runs[run].low[a] + shift[a];
      high[a] = there.runs[run].high[a] + shift[a];
    }
    if (apart(low, high, kLow, kHigh) || !near.meets(low, high)) continue;
    const std::size_t end = std::min(there.faces.size(), (run + 1) * kFaceRun);
    for (std::size_t f = run * kFaceRun; f < end; ++f) {
      const auto [from, to] = there.box(static_cast<std::uint32_t>(f), shift);
      if (apart(from, to, kLow, kHigh) || !near.meets(from, to)) continue;
      if (mesh.faces.size() == kMaxBluntFaces) return false;
      mesh.unseen.push_back(there.synthetic[f]);
      mesh.faces.push_back(there.faces[f]);
      for (const std::uint32_t v : there.faces[f]) place_[v] = kUsed;
    }
  }
  if (mesh.faces.size() == begin) return true;
  const auto own = static_cast<std::uint32_t>(there.own.size());
  for (std::uint32_t v = 0; v < place_.size(); ++v) {
    if (place_[v] == kUnused) continue;
    const Double3 at = there.position(v) + shift;
    place_[v] = v < own ? own_.add(patch_vertex(patch, v), at, there.border[v])
                        : kForeign | foreign_.add(there.foreign_name[v - own], at, there.border[v]);
  }
  for (std::size_t f = begin; f < mesh.faces.size(); ++f)
    for (std::uint32_t& v : mesh.faces[f]) v = place_[v];
  return true;
}

void BluntReader::join(CreaseMesh& mesh, std::vector<std::uint64_t>& name) {
  std::vector<std::uint32_t> order(foreign_.name.size()), own_index(own_.name.size()),
      foreign_index(foreign_.name.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tie(foreign_.name[a], a) < std::tie(foreign_.name[b], b);
  });
  name.clear();
  const auto put = [&](const Chosen& from, std::size_t i) {
    if (name.empty() || name.back() != from.name[i]) {
      name.push_back(from.name[i]);
      mesh.position.push_back(from.at[i]);
      mesh.at_border.push_back(from.border[i]);
    }
    return static_cast<std::uint32_t>(name.size() - 1);
  };
  std::size_t next = 0;
  for (std::size_t i = 0; i < own_.name.size(); ++i) {
    for (; next < order.size() && foreign_.name[order[next]] < own_.name[i]; ++next)
      foreign_index[order[next]] = put(foreign_, order[next]);
    own_index[i] = put(own_, i);
  }
  for (; next < order.size(); ++next) foreign_index[order[next]] = put(foreign_, order[next]);
  for (auto& face : mesh.faces)
    for (std::uint32_t& v : face) v = (v & kForeign) != 0 ? foreign_index[v & ~kForeign] : own_index[v];
}

Double3 BluntReader::offset(std::size_t patch, const Int3& brick) const {
  const Int3 at = brick_of_key(store_.patches()[patch].key);
  return {double{kBrickCells} * (at[0] - brick[0]), double{kBrickCells} * (at[1] - brick[1]),
          double{kBrickCells} * (at[2] - brick[2])};
}

const BluntReader::Vertices& BluntReader::vertices(std::size_t patch) {
  return vertices_.get(patch, [&](Vertices& out) {
    std::vector<std::uint32_t> rgba;
    store_.load_vertices(patch, out.position, rgba, &out.kind);
    positions_.load(patch, out.position, rgba);
  });
}

const BluntReader::View& BluntReader::view(std::size_t patch) {
  return views_.get(patch, [&](View& out) { load_view(patch, out); });
}

void BluntReader::load_view(std::size_t patch, View& out) {
  numbered_.load_faces(patch, read_);
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  {
    const Vertices& here = vertices(patch);
    out.own = here.position;
    for (const VertexClass kind : here.kind) out.border.push_back(kind == VertexClass::kBorder);
  }
  for (const VertexSlot& slot : read_.foreign) {
    const Vertices& there = vertices(slot.patch);
    out.foreign.push_back(wide(there.position[slot.vertex]) + offset(slot.patch, brick));
    out.foreign_name.push_back(patch_vertex(slot.patch, slot.vertex));
    out.border.push_back(there.kind[slot.vertex] == VertexClass::kBorder);
  }
  for (std::size_t f = 0; f < read_.faces.size(); ++f) {
    const PatchFace& face = read_.faces[f];
    if (!read_.kept(face)) continue;
    out.faces.push_back(face);
    const bool unseen = sparse_ || (!read_.synthetic.empty() && read_.synthetic[f] != 0);
    out.synthetic.push_back(unseen ? std::uint8_t{1} : std::uint8_t{0});
    if (out.synthetic.back() || out.border[face[0]] || out.border[face[1]] || out.border[face[2]])
      out.wanted.push_back(static_cast<std::uint32_t>(out.faces.size() - 1));
  }
  for (std::size_t first = 0; first < out.faces.size(); first += kFaceRun) {
    Box all = out.box(static_cast<std::uint32_t>(first), {});
    for (std::size_t f = first + 1; f < std::min(out.faces.size(), first + kFaceRun); ++f) {
      const Box one = out.box(static_cast<std::uint32_t>(f), {});
      for (std::size_t a = 0; a < 3; ++a) {
        all.first[a] = std::min(all.first[a], one.first[a]);
        all.second[a] = std::max(all.second[a], one.second[a]);
      }
    }
    WholeBox& run = out.runs.emplace_back();
    for (std::size_t a = 0; a < 3; ++a) {
      run.low[a] = static_cast<std::int16_t>(std::floor(all.first[a]));
      run.high[a] = static_cast<std::int16_t>(std::ceil(all.second[a]));
    }
  }
}

}  // namespace tessera
