#include "stream/stages/weld/mesh_around.h"

#include <algorithm>
#include <cmath>

#include "kernels/mesh/orientation_sign.h"

namespace tessera {
namespace {

constexpr double kFaceSpan = 4.0;  ///< cells that a face reaches out of its patch's brick, at most

}  // namespace

const std::vector<Float3>& MeshAround::vertices(std::size_t patch) {
  const auto load = [&](Vertices& out) {
    std::vector<std::uint32_t> rgba;
    numbered_.load_kept_vertices(patch, out.position, rgba);
  };
  return vertices_.get(patch, load).position;
}

const MeshAround::View& MeshAround::view(std::size_t patch) {
  return views_.get(patch, [&](View& out) { load_view(patch, out); });
}

void MeshAround::load_view(std::size_t patch, View& out) {
  numbered_.load_faces(patch, read_);
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  const std::size_t own = read_.index.size() - read_.foreign.size();
  out.first = numbering_.patches[patch].first_vertex;
  out.own = vertices(patch);
  const auto kept = static_cast<std::uint32_t>(out.own.size());
  for (std::size_t i = 0; i < read_.foreign.size(); ++i) {
    Double3& at = out.foreign.emplace_back();
    out.foreign_number.push_back(read_.index[own + i]);
    if (out.foreign_number.back() == PatchFaces::kDropped) continue;
    const std::size_t owner = read_.foreign[i].patch;
    at = wide(vertices(owner)[out.foreign_number.back() - numbering_.patches[owner].first_vertex]);
    const Int3 there = brick_of_key(store_.patches()[owner].key);
    for (std::size_t a = 0; a < 3; ++a) at[a] += double{kBrickCells} * (there[a] - brick[a]);
  }
  for (PatchFace f : read_.faces) {
    if (!read_.kept(f)) continue;
    for (std::uint32_t& v : f)
      v = v < own ? static_cast<std::uint32_t>(read_.index[v] - out.first)
                  : kept + static_cast<std::uint32_t>(v - own);
    const std::array<Double3, 3> corner = {out.position(f[0]), out.position(f[1]), out.position(f[2])};
    const bool fresh = out.faces.size() % kFaceRun == 0;
    Box& run = fresh ? out.runs.emplace_back() : out.runs.back();
    for (std::size_t a = 0; a < 3; ++a) {
      const auto [min, max] = std::minmax({corner[0][a], corner[1][a], corner[2][a]});
      const auto low = static_cast<std::int16_t>(std::floor(min)),
                 high = static_cast<std::int16_t>(std::ceil(max));
      run.low[a] = fresh ? low : std::min(run.low[a], low);
      run.high[a] = fresh ? high : std::max(run.high[a], high);
    }
    out.faces.push_back(f);
  }
}

template <class Run, class Use>
void MeshAround::for_each_face(const Double3& origin, const Double3& low, const Double3& high, const Run& run,
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
    for_each_face_of(static_cast<std::size_t>(patch), origin, low, high, run, use);
  } while (next());
}

template <class Run, class Use>
void MeshAround::for_each_face_of(std::size_t patch, const Double3& origin, const Double3& low,
                                  const Double3& high, const Run& run, const Use& use) {
  const Int3 brick = brick_of_key(store_.patches()[patch].key);
  Double3 shift{};  // of what is relative to the brick
  for (std::size_t a = 0; a < 3; ++a) shift[a] = double{kBrickCells} * brick[a] - origin[a];
  Double3 from{}, to{};  // the box in whole cells from the brick
  for (std::size_t a = 0; a < 3; ++a) {
    from[a] = std::floor(low[a] - shift[a]);
    to[a] = std::ceil(high[a] - shift[a]);
  }
  const View& there = view(patch);
  for (std::size_t r = 0; r < there.runs.size(); ++r) {
    Double3 first{}, last{};
    bool apart = false;
    for (std::size_t a = 0; a < 3; ++a) {
      first[a] = there.runs[r].low[a], last[a] = there.runs[r].high[a];
      apart = apart || first[a] > to[a] || from[a] > last[a];
    }
    if (apart || !run(first + shift, last + shift)) continue;
    const std::size_t end = std::min(there.faces.size(), (r + 1) * kFaceRun);
    for (std::size_t i = r * kFaceRun; i < end; ++i) {
      const PatchFace& f = there.faces[i];
      const std::array<Double3, 3> at = {there.position(f[0]), there.position(f[1]), there.position(f[2])};
      bool out = false;  // by whole cells
      for (std::size_t a = 0; a < 3; ++a) {
        const auto [min, max] = std::minmax({at[0][a], at[1][a], at[2][a]});
        out = out || min >= to[a] + 1.0 || max <= from[a] - 1.0;
      }
      if (!out)
        use(ContactFace{{at[0] + shift, at[1] + shift, at[2] + shift},
                        {there.number(f[0]), there.number(f[1]), there.number(f[2])}});
    }
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
  for_each_face(
      origin, low, high, [&](const Double3& from, const Double3& to) { return near.meets(from, to); },
      [&](const ContactFace& f) {
        Double3 from = f.corner[0], to = from;
        for (const Double3& p : f.corner)
          for (std::size_t a = 0; a < 3; ++a)
            from[a] = std::min(from[a], p[a]), to[a] = std::max(to[a], p[a]);
        if (near.meets(from, to) && !collinear(f.corner[0], f.corner[1], f.corner[2])) out.push_back(f);
      });
}

std::vector<std::array<std::uint64_t, 2>> MeshAround::edges_between(const Double3& origin, const Double3& low,
                                                                    const Double3& high,
                                                                    std::span<const std::uint64_t> vertices) {
  std::vector<std::array<std::uint64_t, 2>> out;
  const auto all = [](const Double3&, const Double3&) { return true; };
  for_each_face(origin, low, high, all, [&](const ContactFace& f) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto [a, b] = std::minmax(f.vertex[k], f.vertex[(k + 1) % 3]);
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
    largest = std::max<std::uint64_t>(largest,
                                      44ull * (e.vertices + e.foreign) + (sizeof(PatchFace) + 14) * e.faces);
  return largest + kVertexCacheBytes + kViewCacheBytes + NumberedPatches::kCacheBytes;
}

}  // namespace tessera
