#include "stream/stages/weld/blunt_reader.h"

#include <algorithm>
#include <cmath>
#include <limits>
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
/// Where a brick's own vertices lie: passes before moved them by a cell at most.
constexpr Double3 kOwnLow = {-2.0, -2.0, -2.0};
constexpr Double3 kOwnHigh = {kBrickCells + 2.0, kBrickCells + 2.0, kBrickCells + 2.0};
/// Parts of a cell that boxes have. What lies farther away than they reach, 255 cells, is far from every brick around.
constexpr double kBoxParts = 128.0;
/// Faces beside each other are marked together up to this length of their box, in parts.
constexpr int kSmallParts = 3 * 128;

/// Whether faces in this box are marked together.
bool is_small(const std::array<std::int16_t, 3>& low, const std::array<std::int16_t, 3>& high) {
  bool small = true;
  for (std::size_t a = 0; a < 3; ++a) small = small && high[a] - low[a] <= kSmallParts;
  return small;
}

bool apart(const Double3& from, const Double3& to, const Double3& low, const Double3& high) {
  bool out = false;
  for (std::size_t a = 0; a < 3; ++a) out = out || from[a] > high[a] || low[a] > to[a];
  return out;
}

bool within(const Double3& from, const Double3& to, const Double3& low, const Double3& high) {
  bool in = true;
  for (std::size_t a = 0; a < 3; ++a) in = in && from[a] >= low[a] && to[a] <= high[a];
  return in;
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
    for (const FaceBox& box : there.wanted) {
      auto [from, to] = box.shifted(shift);
      if (apart(from, to, kLow, kHigh)) continue;
      for (double& x : from) x -= kBluntMargin;
      for (double& x : to) x += kBluntMargin;
      near.mark(from, to);
      // None of the brick's own vertices moves for what it lies beyond the rings of.
      any = any || !apart(from, to, kOwnLow, kOwnHigh);
    }
  }
  if (!any) return false;
  mesh.position.clear(), mesh.faces.clear(), mesh.unseen.clear(), mesh.at_border.clear();
  own_.clear(), foreign_.clear();
  for (const std::size_t p : around)
    if (!add_faces(p, offset(p, brick), near, mesh)) return false;
  join(mesh, name);
  return true;
}

std::uint64_t BluntReader::bytes(std::span<const PatchEntry> patches) {
  std::uint64_t largest = 0;
  for (const PatchEntry& e : patches)
    largest = std::max<std::uint64_t>(largest, 92ull * e.vertices + 72ull * e.foreign + 53ull * e.faces);
  return kVertexCacheBytes + kViewCacheBytes + 2 * largest + kMaxBluntFaces * kBluntFaceBytes +
         NumberedPatches::kCacheBytes;
}

BluntReader::Box BluntReader::FaceBox::shifted(const Double3& shift) const {
  Box out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.first[a] = low[a] * (1.0 / kBoxParts) + shift[a];
    out.second[a] = high[a] * (1.0 / kBoxParts) + shift[a];
  }
  return out;
}

BluntReader::FaceBox BluntReader::FaceBox::around(const Double3& point) {
  const auto part = [](double x) {
    return static_cast<std::int16_t>(std::clamp<double>(x, std::numeric_limits<std::int16_t>::min(),
                                                        std::numeric_limits<std::int16_t>::max()));
  };
  FaceBox out;
  for (std::size_t a = 0; a < 3; ++a) {
    out.low[a] = part(std::floor(point[a] * kBoxParts));
    out.high[a] = part(std::ceil(point[a] * kBoxParts));
  }
  return out;
}

bool BluntReader::add_faces(std::size_t patch, const Double3& shift, const BoxMask& near, CreaseMesh& mesh) {
  const View& there = view(patch);
  make_boxes(there);
  const std::size_t begin = mesh.faces.size();
  place_.assign(there.border.size(), kUnused);
  for (std::size_t run = 0; run < there.runs.size(); ++run) {
    const auto [low, high] = there.runs[run].shifted(shift);
    if (apart(low, high, kLow, kHigh) || !near.meets(low, high)) continue;
    const std::size_t end = std::min(there.faces.size(), (run + 1) * kFaceRun);
    const bool all = within(low, high, kLow, kHigh) && near.covers(low, high);
    for (std::size_t f = run * kFaceRun; f < end; ++f) {
      if (!all) {
        const auto [from, to] = there.boxes[f].shifted(shift);
        if (apart(from, to, kLow, kHigh) || !near.meets(from, to)) continue;
      }
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
  wanted_.clear();
  for (std::size_t f = 0; f < read_.faces.size(); ++f) {
    const PatchFace& face = read_.faces[f];
    if (!read_.kept(face)) continue;
    const bool unseen = sparse_ || (!read_.synthetic.empty() && read_.synthetic[f] != 0);
    if (unseen || out.border[face[0]] || out.border[face[1]] || out.border[face[2]])
      wanted_.push_back(static_cast<std::uint32_t>(out.faces.size()));
    out.faces.push_back(face);
    out.synthetic.push_back(unseen ? std::uint8_t{1} : std::uint8_t{0});
  }
  if (wanted_.empty()) return;
  make_boxes(out);
  FaceBox box = out.boxes[wanted_.front()];
  for (const std::uint32_t f : wanted_) {
    FaceBox both = box;
    both.extend(out.boxes[f]);
    if (!is_small(both.low, both.high)) {
      out.wanted.push_back(box);
      both = out.boxes[f];
    }
    box = both;
  }
  out.wanted.push_back(box);
}

void BluntReader::make_boxes(const View& view) {
  if (!view.boxes.empty()) return;
  point_box_.clear();
  for (std::uint32_t v = 0; v < view.border.size(); ++v)
    point_box_.push_back(FaceBox::around(view.position(v)));
  view.boxes.reserve(view.faces.size());
  for (const PatchFace& face : view.faces) {
    FaceBox one = point_box_[face[0]];
    one.extend(point_box_[face[1]]);
    one.extend(point_box_[face[2]]);
    if (view.boxes.size() % kFaceRun == 0) view.runs.push_back(one);
    view.runs.back().extend(one);
    view.boxes.push_back(one);
  }
}

}  // namespace tessera
