#include "stream/meshes/patch_coding.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iterator>

#include "kernels/mesh/patch_mesh.h"
#include "stream/meshes/mesh_store.h"

namespace tessera {
namespace {

constexpr int kFractionBytes[] = {2, 3, 4};
/// One in so many vertices may stand elsewhere than on its lattice edge: 12 bytes for it cost less than one more for all,
/// and in the last size less than 12 for all.
constexpr std::size_t kElsewhereOfSmall = 16, kElsewhereOfLast = 2;
constexpr char kPlain = 0;  ///< else the first byte of positions is the size of a fraction

void put_number(std::vector<char>& out, std::uint64_t value) {
  for (; value >= 0x80; value >>= 7) out.push_back(static_cast<char>(value | 0x80));
  out.push_back(static_cast<char>(value));
}

void put_bytes(std::vector<char>& out, const void* from, std::size_t bytes) {
  const auto* first = static_cast<const char*>(from);
  out.insert(out.end(), first, first + bytes);
}

template <class Byte>
void put_runs(std::vector<char>& out, std::span<const Byte> values) {
  for (std::size_t i = 0; i < values.size();) {
    std::size_t end = i + 1;
    while (end < values.size() && values[end] == values[i]) ++end;
    out.push_back(static_cast<char>(values[i]));
    put_number(out, end - i);
    i = end;
  }
}

class Input {
 public:
  explicit Input(std::span<const char> bytes) : at_(bytes.data()), end_(at_ + bytes.size()) {}
  bool good() const { return good_; }
  void fail() { good_ = false; }
  bool ended() const { return good_ && at_ == end_; }

  std::uint64_t number() {
    if (at_ != end_ && static_cast<unsigned char>(*at_) < 0x80)  // most are
      return static_cast<unsigned char>(*at_++);
    std::uint64_t value = 0;
    for (unsigned shift = 0; shift < 64 && at_ != end_; shift += 7) {
      const auto byte = static_cast<unsigned char>(*at_++);
      value |= static_cast<std::uint64_t>(byte & 0x7f) << shift;
      if (byte < 0x80) return value;
    }
    good_ = false;
    return 0;
  }
  bool bytes(void* to, std::size_t count) {
    good_ = good_ && static_cast<std::size_t>(end_ - at_) >= count;
    if (good_ && count > 0) std::memcpy(to, at_, count);
    if (good_) at_ += count;
    return good_;
  }
  /// A number of so many bytes, at most 4; 0 where they are not there.
  std::uint32_t fraction(std::size_t count) {
    std::uint32_t value = 0;
    if (static_cast<std::size_t>(end_ - at_) < sizeof value) {
      bytes(&value, count);
      return value;
    }
    std::memcpy(&value, at_, sizeof value);
    at_ += count;
    return value & ~std::uint32_t{0} >> 8 * (sizeof value - count);
  }
  template <class Byte>
  void runs(std::vector<Byte>& values) {
    for (std::size_t i = 0; i < values.size() && good_;) {
      unsigned char value = 0;
      bytes(&value, 1);
      const std::uint64_t run = number();
      if (run == 0 || run > values.size() - i) good_ = false;
      for (const std::size_t end = i + (good_ ? run : 0); i < end; ++i) values[i] = static_cast<Byte>(value);
    }
  }

 private:
  const char* at_;
  const char* end_;
  bool good_ = true;
};

/// Coordinate of `cells` beyond the brick's corner as make_mesh_block computes it.
double coordinate(const MeshStoreInfo& info, int axis, int brick, double cells) {
  const double world = info.lattice.world(axis, brick * double{kBrickCells} + cells);
  return info.double_positions ? world : double{static_cast<float>(world)};
}

void put_plain(const Double3& p, const MeshStoreInfo& info, std::vector<char>& out) {
  if (info.double_positions) {
    put_bytes(out, &p, sizeof p);
    return;
  }
  const Float3 f = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  put_bytes(out, &f, sizeof f);
}

/// What follows from a vertex's name and its fractions, in `bytes` bytes each; false where it is not its position.
bool put_fractions_of(const MeshBlock& block, std::size_t v, const MeshStoreInfo& info, int bytes,
                      MeshNames& names, std::vector<char>& out) {
  const double scale = std::ldexp(1.0, 8 * bytes);
  const MeshName name = names(block.key[v]);
  for (std::size_t a = 0; a < 3; ++a) {
    const int axis = static_cast<int>(a);
    const double node = name.in_brick[a];
    if (name.axis != MeshName::kCentre && name.axis != axis) {
      if (coordinate(info, axis, name.brick[a], node) != block.position[v][a]) return false;
      continue;
    }
    const double cells = block.position[v][a] / info.lattice.h -
                         static_cast<double>(info.lattice.origin_brick[a] + name.brick[a]) * kBrickCells -
                         node;
    const double quanta = std::floor(cells * scale + 0.5);
    if (!(quanta >= 0.0 && quanta < scale)) return false;
    if (coordinate(info, axis, name.brick[a], node + quanta / scale) != block.position[v][a]) return false;
    const auto value = static_cast<std::uint64_t>(quanta);
    for (int b = 0; b < bytes; ++b) out.push_back(static_cast<char>(value >> 8 * b));
  }
  return true;
}

/// Fractions of the vertices in so many bytes each, after those that stand elsewhere: these are few, or it is false.
bool put_fractions(const MeshBlock& block, const MeshStoreInfo& info, int bytes, std::vector<char>& out) {
  const std::size_t one_in = bytes == kFractionBytes[2] ? kElsewhereOfLast : kElsewhereOfSmall;
  const std::size_t maximum = block.key.size() / one_in;
  std::vector<char> fractions;
  std::vector<std::size_t> elsewhere;
  MeshNames names;
  for (std::size_t v = 0; v < block.key.size(); ++v) {
    const std::size_t before = fractions.size();
    if (put_fractions_of(block, v, info, bytes, names, fractions)) continue;
    fractions.resize(before);
    elsewhere.push_back(v);
    if (elsewhere.size() > maximum) return false;
  }
  put_number(out, elsewhere.size());
  std::size_t last = 0;
  for (const std::size_t v : elsewhere) {
    put_number(out, v - last);
    last = v;
    put_plain(block.position[v], info, out);
  }
  out.insert(out.end(), fractions.begin(), fractions.end());
  return true;
}

void put_positions(const MeshBlock& block, const MeshStoreInfo& info, std::vector<char>& out) {
  const std::size_t start = out.size();
  for (const int bytes : kFractionBytes) {
    if (info.shift != Double3{0, 0, 0}) break;
    out.push_back(static_cast<char>(bytes));
    if (put_fractions(block, info, bytes, out)) return;
    out.resize(start);
  }
  out.push_back(kPlain);
  for (const Double3& p : block.position) put_plain(p, info, out);
}

void take_plain(Input& in, const MeshStoreInfo& info, Double3& p) {
  if (info.double_positions) {
    in.bytes(&p, sizeof p);
    return;
  }
  Float3 f{};
  in.bytes(&f, sizeof f);
  p = {f[0], f[1], f[2]};
}

void take_positions(Input& in, const MeshStoreInfo& info, MeshBlock& block) {
  char kind = kPlain;
  in.bytes(&kind, 1);
  if (kind == kPlain) {
    for (Double3& p : block.position) take_plain(in, info, p);
    return;
  }
  if (std::find(std::begin(kFractionBytes), std::end(kFractionBytes), kind) == std::end(kFractionBytes))
    return in.fail();
  std::vector<std::uint8_t> elsewhere(block.position.size(), 0);
  std::size_t at = 0;
  for (std::uint64_t left = in.number(); left > 0 && in.good(); --left) {
    const std::uint64_t step = in.number();
    if (!in.good() || step >= block.position.size() - at) return in.fail();
    at += step;
    elsewhere[at] = 1;
    take_plain(in, info, block.position[at]);
  }
  // coordinate() of all three, what is the same in a brick computed once.
  const double scale = std::ldexp(1.0, -8 * kind);
  const auto count = static_cast<std::size_t>(kind);
  Double3 corner{}, first{};
  for (std::size_t a = 0; a < 3; ++a)
    first[a] = static_cast<double>(info.lattice.origin_brick[a] * kBrickCells);
  Int3 brick{};
  MeshNames names;
  for (std::size_t v = 0; v < block.position.size(); ++v) {
    if (elsewhere[v]) continue;
    const MeshName name = names(block.key[v]);
    if (name.brick != brick) {
      brick = name.brick;
      for (std::size_t a = 0; a < 3; ++a) corner[a] = brick[a] * double{kBrickCells};
    }
    std::uint32_t fraction[4] = {0, 0, 0, 0};
    if (name.axis != MeshName::kCentre)
      fraction[name.axis] = in.fraction(count);
    else
      for (std::size_t a = 0; a < 3; ++a) fraction[a] = in.fraction(count);
    for (std::size_t a = 0; a < 3; ++a) {
      const double cells = name.in_brick[a] + fraction[a] * scale;
      const double world = info.lattice.h * (first[a] + (corner[a] + cells));
      block.position[v][a] = info.double_positions ? world : double{static_cast<float>(world)};
    }
  }
}

}  // namespace

void encode_vertices(const MeshBlock& block, const MeshStoreInfo& info, std::vector<char>& out) {
  std::uint64_t last = 0;
  for (const std::uint64_t key : block.key) {
    put_number(out, key - last);
    last = key;
  }
  put_positions(block, info, out);
  put_runs<VertexClass>(out, block.vertex_class);
  if (info.colour) put_bytes(out, block.rgba.data(), 4 * block.rgba.size());
}

void encode_faces(const MeshBlock& block, std::vector<char>& out) {
  std::uint32_t last = 0;
  for (const auto& f : block.faces) {
    put_number(out, f[0] - last);
    put_number(out, f[1] - f[0]);
    put_number(out, f[2] - f[0]);
    last = f[0];
  }
  put_runs<std::uint8_t>(out, block.face_flags);
  put_bytes(out, block.face_bound.data(), 4 * block.face_bound.size());
}

bool decode_vertices(std::span<const char> bytes, std::size_t vertices, const MeshStoreInfo& info,
                     MeshBlock& block) {
  Input in(bytes);
  block.key.resize(vertices);
  std::uint64_t last = 0;
  for (std::uint64_t& key : block.key) key = last += in.number();
  block.position.resize(vertices);
  take_positions(in, info, block);
  block.vertex_class.resize(vertices);
  in.runs(block.vertex_class);
  if (info.colour) {
    block.rgba.resize(vertices);
    in.bytes(block.rgba.data(), 4 * vertices);
  }
  return in.ended();
}

bool decode_faces(std::span<const char> bytes, std::size_t faces, bool bounds, MeshBlock& block) {
  Input in(bytes);
  block.faces.resize(faces);
  const std::uint64_t vertices = block.key.size();
  std::uint64_t last = 0;
  bool known = true;
  for (auto& f : block.faces) {
    last += in.number();
    const std::uint64_t corners[3] = {last, last + in.number(), last + in.number()};
    for (std::size_t c = 0; c < 3; ++c) {
      known &= corners[c] < vertices;
      f[c] = static_cast<std::uint32_t>(corners[c]);
    }
  }
  block.face_flags.resize(faces);
  in.runs(block.face_flags);
  if (bounds) {
    block.face_bound.resize(faces);
    in.bytes(block.face_bound.data(), 4 * faces);
  }
  return known && in.ended();
}

}  // namespace tessera
