#include "stream/formats/copc/copc_nodes.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <tuple>

#include "octree/error.h"
#include "octree/morton.h"
#include "stream/files/external_sort.h"

namespace tessera {
namespace {

constexpr int kDeepest = 21;  // bits of an axis in a Morton code
constexpr std::size_t kSpillBytes = std::size_t{1} << 18;
constexpr std::size_t kLongestRecord = 256;
constexpr int kPageLevels = 5;

/// A point under its Morton code. Points of one code are told apart by their bytes.
template <std::size_t kBytes>
struct KeyedRecord {
  std::uint64_t key = 0;
  std::array<char, kBytes> bytes{};
  bool operator<(const KeyedRecord& o) const {
    return key != o.key ? key < o.key : std::memcmp(bytes.data(), o.bytes.data(), kBytes) < 0;
  }
};

std::uint64_t prefix(std::uint64_t key, int level) {
  return level >= kDeepest ? key : key >> (3 * (kDeepest - level));
}
/// The deepest level at which both lie in one cube.
int common_level(std::uint64_t a, std::uint64_t b) {
  return a == b ? kDeepest : (std::countl_zero(a ^ b) - 1) / 3;  // a code has 63 bits
}

std::array<std::int32_t, 3> cube_at(std::uint64_t key) {
  std::array<std::int32_t, 3> at{};
  for (int bit = 0; bit < kDeepest; ++bit)
    for (std::size_t a = 0; a < 3; ++a)
      at[a] |= static_cast<std::int32_t>(key >> (3 * bit + static_cast<int>(a)) & 1u) << bit;
  return at;
}

}  // namespace

/// Takes points in Morton order, finds for each the leaf that it lies in and the level that takes it.
class CopcNodes::Dealer {
 public:
  Dealer(CopcNodes& to, std::filesystem::path output) : to_(to), output_(std::move(output)) {
    to_.levels_.clear();
    for (int level = 0; level <= kDeepest; ++level) {
      to_.levels_.push_back(std::make_unique<SpillFile>(to_.temp_));
      taken_[static_cast<std::size_t>(level)] = kNone;
    }
  }

  void add(std::uint64_t key, const char* record) {
    keys_.push_back(key);
    records_.append(record, to_.record_bytes_);
    if (keys_.size() - head_ > kLeafPoints + kAhead) settle(false);
  }

  void finish() {
    settle(true);
    std::uint64_t count = 0;
    for (std::size_t level = 0; level <= kDeepest; ++level) {
      flush(level);
      count += found_[level].size();
    }
    to_.nodes_.clear();
    to_.nodes_.reserve(static_cast<std::size_t>(count));
    for (const auto& level : found_) to_.nodes_.insert(to_.nodes_.end(), level.begin(), level.end());
  }

 private:
  static constexpr std::uint64_t kNone = ~std::uint64_t{0};
  static constexpr std::size_t kAhead = 8192;  ///< points beyond a leaf that wait, so that few are moved

  void settle(bool last) {
    while (head_ < keys_.size()) {
      if (!in_leaf(keys_[head_])) {
        if (!last && keys_.size() - head_ <= kLeafPoints) break;
        open_leaf();
      }
      for (; head_ < keys_.size() && in_leaf(keys_[head_]); ++head_) deal(head_);
    }
    keys_.erase(keys_.begin(), keys_.begin() + static_cast<std::ptrdiff_t>(head_));
    records_.erase(0, head_ * to_.record_bytes_);
    head_ = 0;
  }

  bool in_leaf(std::uint64_t key) const { return leaf_ >= 0 && prefix(key, leaf_) == leaf_prefix_; }

  /// The coarsest cube around the next point that has no point of the leaf before, and few enough in all.
  void open_leaf() {
    const std::uint64_t key = keys_[head_];
    int level = any_ ? common_level(before_, key) + 1 : 0;
    if (keys_.size() - head_ > kLeafPoints)
      level = std::max(level, common_level(key, keys_[head_ + kLeafPoints]) + 1);
    leaf_ = std::min(level, kDeepest);
    leaf_prefix_ = prefix(key, leaf_);
  }

  void deal(std::size_t point) {
    const std::uint64_t key = keys_[point];
    before_ = key, any_ = true;
    int level = 0;
    for (; level < leaf_; ++level) {
      const std::uint64_t cell = prefix(key, std::min(level + kCellLevels, kDeepest));
      std::uint64_t& taken = taken_[static_cast<std::size_t>(level)];
      if (cell == taken) continue;
      taken = cell;
      break;
    }
    put(static_cast<std::size_t>(level), key, records_.data() + point * to_.record_bytes_);
  }

  void put(std::size_t level, std::uint64_t key, const char* record) {
    const std::uint64_t node = prefix(key, static_cast<int>(level));
    if (found_[level].empty() || node_[level] != node) {
      node_[level] = node;
      const std::uint64_t offset =
          found_[level].empty() ? 0 : found_[level].back().offset + found_[level].back().points;
      found_[level].push_back({static_cast<std::int32_t>(level), cube_at(node), 0, offset});
    }
    if (++found_[level].back().points > kMostPoints)
      throw ResourceError(
          output_.string() + ": more than " + std::to_string(kMostPoints) +
          " points lie in one node of its octree, too near to each other for finer ones; thin the "
          "scan (--thin) or write .laz");
    buffer_[level].append(record, to_.record_bytes_);
    if (buffer_[level].size() >= kSpillBytes) flush(level);
  }
  void flush(std::size_t level) {
    if (!buffer_[level].empty()) to_.levels_[level]->append(buffer_[level].data(), buffer_[level].size());
    buffer_[level].clear();
  }

  CopcNodes& to_;
  const std::filesystem::path output_;
  std::vector<std::uint64_t> keys_;
  std::string records_;
  std::size_t head_ = 0;
  int leaf_ = -1;
  std::uint64_t leaf_prefix_ = 0, before_ = 0;
  bool any_ = false;
  std::array<std::uint64_t, kDeepest + 1> taken_{}, node_{};  ///< by level: the last cell, the last node
  std::array<std::vector<CopcNode>, kDeepest + 1> found_;
  std::array<std::string, kDeepest + 1> buffer_;
};

CopcNodes::CopcNodes(const std::filesystem::path& temp, std::size_t record_bytes, std::uint64_t memory_bytes)
    : temp_(temp), record_bytes_(record_bytes), memory_bytes_(memory_bytes), given_(temp) {
  if (record_bytes > kLongestRecord)
    throw UsageError("COPC is written of points of up to " + std::to_string(kLongestRecord) +
                     " bytes, and these have " + std::to_string(record_bytes) + "; write .laz");
}
CopcNodes::~CopcNodes() = default;

void CopcNodes::add(std::string_view records) {
  for (std::size_t at = 0; at < records.size(); at += record_bytes_) {
    std::array<std::int32_t, 3> p;
    std::memcpy(p.data(), records.data() + at, sizeof p);
    for (std::size_t a = 0; a < 3; ++a) {
      low_[a] = any_ ? std::min(low_[a], p[a]) : p[a];
      high_[a] = any_ ? std::max(high_[a], p[a]) : p[a];
    }
    any_ = true;
  }
  pending_ += records;
  if (pending_.size() < kSpillBytes) return;
  given_.append(pending_.data(), pending_.size());
  pending_.clear();
}

/// Half a step wider than the points, so that none lies on its sides.
void CopcNodes::find_cube(const Double3& scale, const Double3& offset) {
  cube_.edge = 0.0;
  for (std::size_t a = 0; a < 3; ++a) {
    cube_.min[a] = (low_[a] - 0.5) * scale[a] + offset[a];
    cube_.edge = std::max(cube_.edge, (double{1} * high_[a] - low_[a] + 1.0) * scale[a]);
  }
}

template <std::size_t kBytes>
void CopcNodes::sort_and_deal(const Double3& scale, const Double3& offset, Dealer& dealer) {
  ExternalSort<KeyedRecord<kBytes>> sort(temp_, memory_bytes_);
  const auto take = [&](std::string_view records) {
    for (std::size_t at = 0; at < records.size(); at += record_bytes_) {
      std::array<std::int32_t, 3> p;
      std::memcpy(p.data(), records.data() + at, sizeof p);
      std::array<std::uint32_t, 3> cell;
      for (std::size_t a = 0; a < 3; ++a) {
        const double part = (p[a] * scale[a] + offset[a] - cube_.min[a]) / cube_.edge * (1 << kDeepest);
        cell[a] = static_cast<std::uint32_t>(std::clamp(part, 0.0, (1 << kDeepest) - 1.0));
      }
      KeyedRecord<kBytes> keyed;
      keyed.key = morton_encode(cell[0], cell[1], cell[2]);
      std::memcpy(keyed.bytes.data(), records.data() + at, record_bytes_);
      sort.add(keyed);
    }
  };
  std::string bytes(kSpillBytes / record_bytes_ * record_bytes_, '\0');
  for (std::uint64_t at = 0; at < given_.size(); at += bytes.size()) {
    const auto n = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), given_.size() - at));
    given_.read_at(at, bytes.data(), n);
    take({bytes.data(), n});
  }
  take(pending_);
  std::string().swap(pending_);
  sort.drain([&](std::span<const KeyedRecord<kBytes>> batch) {
    for (const KeyedRecord<kBytes>& r : batch) dealer.add(r.key, r.bytes.data());
  });
}

void CopcNodes::build(const Double3& scale, const Double3& offset, const std::filesystem::path& output) {
  find_cube(scale, offset);
  Dealer dealer(*this, output);
  if (record_bytes_ <= 30)
    sort_and_deal<30>(scale, offset, dealer);
  else if (record_bytes_ <= 38)
    sort_and_deal<38>(scale, offset, dealer);
  else if (record_bytes_ <= 64)
    sort_and_deal<64>(scale, offset, dealer);
  else if (record_bytes_ <= 128)
    sort_and_deal<128>(scale, offset, dealer);
  else
    sort_and_deal<kLongestRecord>(scale, offset, dealer);
  dealer.finish();
}

std::string CopcNodes::records(const CopcNode& node) const {
  std::string bytes(static_cast<std::size_t>(node.points) * record_bytes_, '\0');
  levels_[static_cast<std::size_t>(node.level)]->read_at(node.offset * record_bytes_, bytes.data(),
                                                         bytes.size());
  return bytes;
}

CopcPages copc_pages(const std::vector<CopcNode>& nodes, const std::vector<CopcChunkAt>& chunks,
                     std::uint64_t begin, std::size_t single_page_nodes) {
  constexpr std::size_t kEntry = 32;
  using Key = std::tuple<std::int32_t, std::int32_t, std::int32_t, std::int32_t>;  // level, x, y, z
  const auto above = [](const CopcNode& n, std::int32_t level) {
    const int by = n.level - level;
    return Key{level, n.at[0] >> by, n.at[1] >> by, n.at[2] >> by};
  };
  // Pages by the node that they begin with; the root page is first, as nothing lies above it.
  std::map<Key, std::vector<std::size_t>> pages;
  const bool single = nodes.size() <= single_page_nodes;
  for (std::size_t i = 0; i < nodes.size(); ++i)
    pages[above(nodes[i], single ? 0 : nodes[i].level / kPageLevels * kPageLevels)].push_back(i);
  std::map<Key, std::vector<Key>> links;  // from a page to those below it
  for (const auto& [key, members] : pages)
    if (std::get<0>(key) > 0)
      links[above(nodes[members.front()], std::get<0>(key) - kPageLevels)].push_back(key);
  std::map<Key, std::pair<std::uint64_t, std::uint64_t>> place;  // of a page: offset, bytes
  std::uint64_t at = begin;
  for (const auto& [key, members] : pages) {
    const std::uint64_t bytes = kEntry * (members.size() + links[key].size());
    place[key] = {at, bytes};
    at += bytes;
  }
  CopcPages out;
  const auto put = [&](const auto& value) {
    out.bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
  };
  for (const auto& [key, members] : pages) {
    for (const std::size_t i : members) {
      put(nodes[i].level), put(nodes[i].at), put(chunks[i].offset), put(chunks[i].bytes);
      put(static_cast<std::int32_t>(nodes[i].points));
    }
    for (const Key& link : links[key]) {
      const auto& [level, x, y, z] = link;
      put(level), put(x), put(y), put(z), put(place[link].first);
      put(static_cast<std::int32_t>(place[link].second)), put(std::int32_t{-1});
    }
    if (out.root_bytes == 0) out.root_bytes = out.bytes.size();
  }
  return out;
}

}  // namespace tessera
