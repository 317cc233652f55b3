#include "stream/formats/vdb_file.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <string>
#include <tuple>
#include <vector>

#include "stream/files/output_file.h"

namespace tessera {
namespace {

constexpr std::uint64_t kMagic = 0x56444220;
constexpr std::uint32_t kFileVersion = 224, kLibraryMajor = 10, kLibraryMinor = 0;
constexpr std::uint32_t kActiveValuesOnly = 2;
// What stands for values that are not active.
constexpr std::int8_t kAllPlus = 0, kAllMinus = 1, kMixed = 3;
constexpr int kUpperBits = 5, kLowerBits = 4;         ///< children of a node along an axis
constexpr int kUpperShift = kLeafBits + kLowerBits;   ///< nodes along a lower node: 2^7
constexpr int kRootShift = kUpperShift + kUpperBits;  ///< along an upper one: 2^12
constexpr std::size_t kUpperSize = 1u << (3 * kUpperBits), kLowerSize = 1u << (3 * kLowerBits);

Int3 shifted(const Int3& p, int bits) {
  return {p[0] >> bits, p[1] >> bits, p[2] >> bits};
}

/// Number of a child in its node, as OpenVDB counts.
std::size_t child_of(const Int3& at, int bits) {
  const int mask = (1 << bits) - 1;
  return static_cast<std::size_t>((at[0] & mask) << (2 * bits) | (at[1] & mask) << bits | (at[2] & mask));
}
Int3 child_origin(std::size_t child, int bits) {
  const int c = static_cast<int>(child), mask = (1 << bits) - 1;
  return {c >> (2 * bits) & mask, c >> bits & mask, c & mask};
}

class Writer {
 public:
  Writer(const std::filesystem::path& path, const LevelSetFile& file) : out_(path), file_(file) {}

  std::uint64_t write() {
    order_.resize(file_.origins.size());
    std::iota(order_.begin(), order_.end(), std::uint32_t{0});
    std::sort(order_.begin(), order_.end(), [&](std::uint32_t l, std::uint32_t r) {
      return sort_key(file_.origins[l]) < sort_key(file_.origins[r]);
    });
    const std::uint64_t offsets = head();
    const std::uint64_t grid = out_.size();
    settings();
    topology();
    const std::uint64_t values = out_.size();
    for (const std::uint32_t leaf : order_) buffer(leaf);
    const std::array<std::uint64_t, 3> sections = {grid, values, out_.size()};
    out_.patch(offsets, sections.data(), sizeof sections);
    out_.patch(count_at_, &active_, sizeof active_);
    const std::uint64_t bytes = out_.size();
    out_.finish();
    return bytes;
  }

 private:
  using SortKey = std::tuple<Int3, std::size_t, std::size_t>;
  static SortKey sort_key(const Int3& origin) {
    return {shifted(origin, kRootShift), child_of(shifted(origin, kUpperShift), kUpperBits),
            child_of(shifted(origin, kLeafBits), kLowerBits)};
  }

  template <class T>
  void put(const T& value) {
    out_.append(&value, sizeof value);
  }
  void text(const std::string& s) {
    put(static_cast<std::uint32_t>(s.size()));
    out_.append(s);
  }
  void note(const std::string& name, const std::string& value) {
    text(name);
    text("string");
    text(value);
  }

  /// \returns where the places of the grid's parts belong
  std::uint64_t head() {
    put(kMagic);
    put(kFileVersion);
    put(kLibraryMajor);
    put(kLibraryMinor);
    put(std::int8_t{1});  // places of parts are told
    out_.append(identity());
    put(std::uint32_t{0});  // metadata of the file
    put(std::uint32_t{1});  // grids
    text("distance");
    text("Tree_float_5_4_3");
    text("");  // no instance of another grid
    const std::uint64_t at = out_.size();
    for (int i = 0; i < 3; ++i) put(std::uint64_t{0});
    return at;
  }

  /// Written as a UUID, but a function of the leaves: the same grid, the same bytes.
  std::string identity() const {
    std::array<std::uint64_t, 2> hash = {0x9e3779b97f4a7c15ULL,
                                         std::bit_cast<std::uint64_t>(file_.lattice.h)};
    for (const std::uint32_t leaf : order_)
      for (const std::int32_t c : file_.origins[leaf]) {
        hash[0] = (hash[0] ^ static_cast<std::uint64_t>(c)) * 0x100000001b3ULL;
        hash[1] = std::rotl(hash[1] + hash[0], 23) * 0xff51afd7ed558ccdULL;
      }
    std::string text;
    for (std::size_t digit = 0; digit < 32; ++digit) {
      if (digit == 8 || digit == 12 || digit == 16 || digit == 20) text += '-';
      text += "0123456789abcdef"[hash[digit / 16] >> (4 * (digit % 16)) & 15];
    }
    return text;
  }

  void settings() {
    put(kActiveValuesOnly);
    put(std::uint32_t{4});  // metadata, in order of names
    note("class", "level set");
    note("creator", "tessera");
    text("file_voxel_count");
    text("int64");
    put(std::uint32_t{8});
    count_at_ = out_.size();
    put(std::uint64_t{0});
    note("name", "distance");
    text("UniformScaleTranslateMap");
    const double h = file_.lattice.h;
    for (int a = 0; a < 3; ++a) put(file_.lattice.world(a, 0.0));
    for (const double number : {h, h, 1.0 / h, 1.0 / (h * h), 0.5 / h})  // scale, voxel, and what follows
      for (int a = 0; a < 3; ++a) put(number);
  }

  void topology() {
    put(std::int32_t{1});
    put(file_.background);
    std::vector<Int3> roots;
    std::vector<std::size_t> first;
    for (std::size_t i = 0; i < order_.size(); ++i) {
      const Int3 root = shifted(file_.origins[order_[i]], kRootShift);
      if (roots.empty() || roots.back() != root) roots.push_back(root), first.push_back(i);
    }
    first.push_back(order_.size());
    const std::vector<Int3> full = full_roots(roots);
    put(static_cast<std::uint32_t>(full.size()));
    put(static_cast<std::uint32_t>(roots.size()));
    for (const Int3& r : full) {
      put(Int3{r[0] << kRootShift, r[1] << kRootShift, r[2] << kRootShift});
      put(-file_.background);
      put(std::int8_t{0});
    }
    for (std::size_t r = 0; r < roots.size(); ++r) {
      put(Int3{roots[r][0] << kRootShift, roots[r][1] << kRootShift, roots[r][2] << kRootShift});
      node(roots[r], first[r], first[r + 1], kUpperBits, kUpperShift);
    }
  }

  /// Places between those with leaves that are inside as a whole.
  std::vector<Int3> full_roots(const std::vector<Int3>& roots) const {
    std::vector<Int3> full;
    if (roots.empty()) return full;
    Int3 low = roots[0], high = roots[0];
    for (const Int3& r : roots)
      for (std::size_t a = 0; a < 3; ++a) low[a] = std::min(low[a], r[a]), high[a] = std::max(high[a], r[a]);
    for (int x = low[0]; x <= high[0]; ++x)
      for (int y = low[1]; y <= high[1]; ++y)
        for (int z = low[2]; z <= high[2]; ++z)
          if (!std::binary_search(roots.begin(), roots.end(), Int3{x, y, z}) &&
              file_.inside({x << kRootShift, y << kRootShift, z << kRootShift}))
            full.push_back({x, y, z});
    return full;
  }

  /// \param at  of the node among those of its size  \param bits  of its children  \param shift  nodes along a child
  void node(const Int3& at, std::size_t first, std::size_t end, int bits, int shift) {
    if (file_.pause) file_.pause();
    const std::size_t size = std::size_t{1} << (3 * bits);
    std::vector<std::uint64_t> children(size / 64, 0), plus(size / 64, 0);
    for (std::size_t i = first; i < end; ++i) {
      const std::size_t c = child_of(shifted(file_.origins[order_[i]], shift), bits);
      children[c / 64] |= std::uint64_t{1} << (c % 64);
    }
    bool any_plus = false, any_minus = false;
    for (std::size_t c = 0; c < size; ++c) {
      if (children[c / 64] >> (c % 64) & 1) continue;
      const Int3 in = child_origin(c, bits);
      Int3 corner;
      for (std::size_t a = 0; a < 3; ++a) corner[a] = ((at[a] << bits) + in[a]) << shift;
      const bool outside = !file_.inside(corner);
      if (outside) plus[c / 64] |= std::uint64_t{1} << (c % 64);
      (outside ? any_plus : any_minus) = true;
    }
    put_words(children);
    put_words(std::vector<std::uint64_t>(size / 64, 0));  // active tiles
    const std::int8_t code = !any_minus ? kAllPlus : !any_plus ? kAllMinus : kMixed;
    put(code);
    if (code == kMixed) put_words(plus);
    for (std::size_t i = first; i < end;) {
      const Int3 child = shifted(file_.origins[order_[i]], shift);
      std::size_t last = i + 1;
      while (last < end && shifted(file_.origins[order_[last]], shift) == child) ++last;
      if (shift == kLeafBits) {
        file_.load(order_[i], leaf_);
        out_.append(leaf_.active.data(), sizeof leaf_.active);
      } else {
        node(child, i, last, kLowerBits, kLeafBits);
      }
      i = last;
    }
  }
  void put_words(const std::vector<std::uint64_t>& words) { out_.append(words.data(), 8 * words.size()); }

  void buffer(std::uint32_t index) {
    if (file_.pause && index % 64 == 0) file_.pause();
    file_.load(index, leaf_);
    out_.append(leaf_.active.data(), sizeof leaf_.active);
    std::array<std::uint64_t, 8> plus;
    bool any_plus = false, any_minus = false;
    for (std::size_t w = 0; w < 8; ++w) {
      plus[w] = ~leaf_.active[w] & leaf_.outside[w];
      any_plus = any_plus || plus[w] != 0;
      any_minus = any_minus || (~leaf_.active[w] & ~leaf_.outside[w]) != 0;
    }
    const std::int8_t code = !any_minus ? kAllPlus : !any_plus ? kAllMinus : kMixed;
    put(code);
    if (code == kMixed) out_.append(plus.data(), sizeof plus);
    for (std::size_t w = 0; w < 8; ++w)
      for (std::uint64_t left = leaf_.active[w]; left; left &= left - 1) {
        put(leaf_.value[64 * w + static_cast<std::size_t>(std::countr_zero(left))]);
        ++active_;
      }
  }

  OutputFile out_;
  const LevelSetFile& file_;
  std::vector<std::uint32_t> order_;  ///< leaves as the tree has them
  LevelSetLeaf leaf_;
  std::uint64_t active_ = 0, count_at_ = 0;
};

}  // namespace

std::uint64_t write_level_set(const std::filesystem::path& path, const LevelSetFile& file) {
  return Writer(path, file).write();
}

std::uint64_t write_level_set_bytes(std::uint64_t leaves) {
  return leaves * (sizeof(Int3) + sizeof(std::uint32_t) + 4) + OutputFile::kBufferBytes +
         (kUpperSize + kLowerSize) / 2 + (std::uint64_t{1} << 20);
}

}  // namespace tessera
