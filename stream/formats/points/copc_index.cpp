#include "stream/formats/points/copc_index.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "octree/error.h"
#include "stream/formats/laz/chunk_table.h"
#include "stream/formats/scalar.h"

namespace tessera {
namespace {

constexpr std::size_t kRecordHead = 54;  // user id at 2, record id at 18, length at 20
constexpr std::size_t kInfoBytes = 160;
constexpr std::size_t kEntryBytes = 32;
constexpr std::int32_t kMaxLevel = 31;
constexpr const char* kIndexAdvice =
    "; get the file anew, or read it without its octree: tessera convert IN -o OUT.las";

[[noreturn]] void fail_index(const ReadFile& file, std::uint64_t byte, const std::string& what) {
  throw InputError(file.path().string() + ": byte " + std::to_string(byte) + ": the octree of COPC " + what +
                   kIndexAdvice);
}

/// Walks the pages of a hierarchy.
class Hierarchy {
 public:
  Hierarchy(const ReadFile& file, const CopcInfo& copc, const LazChunks& chunks,
            const std::optional<PointBox>& box, double resolution, double slack)
      : file_(file), copc_(copc), chunks_(chunks), box_(box), slack_(slack) {
    if (resolution <= 0.0) return;
    deepest_ = 0;
    for (double s = copc.spacing; s > resolution && deepest_ < kMaxLevel; s /= 2) ++deepest_;
  }

  std::vector<CopcChunk> wanted() {
    pages_.push_back({copc_.root_at, copc_.root_bytes});
    while (!pages_.empty()) {
      const Page page = pages_.back();
      pages_.pop_back();
      read(page);
    }
    std::sort(found_.begin(), found_.end(),
              [](const CopcChunk& a, const CopcChunk& b) { return a.chunk < b.chunk; });
    for (std::size_t i = 1; i < found_.size(); ++i)
      if (found_[i - 1].chunk == found_[i].chunk)
        fail_index(file_, copc_.root_at,
                   "gives one chunk to two nodes, " + found_[i - 1].name + " and " + found_[i].name);
    return std::move(found_);
  }

 private:
  struct Page {
    std::uint64_t at = 0, bytes = 0;
  };

  void read(const Page& page) {
    if (page.at > file_.size() || page.bytes > file_.size() - page.at || page.bytes % kEntryBytes != 0 ||
        page.bytes == 0)
      fail_index(file_, page.at,
                 "has no page of " + std::to_string(page.bytes) + " bytes there: the file has " +
                     std::to_string(file_.size()));
    if (!seen_.insert(page.at).second)
      fail_index(file_, page.at, "comes back to a page that was read before");
    entries_ += page.bytes / kEntryBytes;
    if (entries_ > laz::kMaxChunks)
      fail_index(file_, page.at, "has more than " + std::to_string(laz::kMaxChunks) + " nodes");
    char bytes[kEntryBytes * 512];
    for (std::uint64_t done = 0; done < page.bytes;) {
      const std::uint64_t n = std::min<std::uint64_t>(sizeof bytes, page.bytes - done);
      file_.read_at(page.at + done, bytes, n);
      for (std::size_t i = 0; i < n; i += kEntryBytes) entry(bytes + i, page.at + done + i);
      done += n;
    }
  }

  void entry(const char* bytes, std::uint64_t at) {
    const auto level = load_scalar<std::int32_t>(bytes);
    const auto offset = load_scalar<std::uint64_t>(bytes + 16);
    const auto size = load_scalar<std::int32_t>(bytes + 24);
    const auto points = load_scalar<std::int32_t>(bytes + 28);
    CopcChunk node;
    node.name = std::to_string(level);
    bool in_cube = level >= 0 && level <= kMaxLevel;
    const double edge = std::ldexp(2.0 * copc_.half_size, -std::clamp(level, 0, kMaxLevel));
    for (std::size_t a = 0; a < 3; ++a) {
      const auto k = load_scalar<std::int32_t>(bytes + 4 + 4 * a);
      in_cube = in_cube && k >= 0 && std::int64_t{k} < std::int64_t{1} << level;
      node.min[a] = copc_.centre[a] - copc_.half_size + k * edge - slack_;
      node.max[a] = copc_.centre[a] - copc_.half_size + (k + 1.0) * edge + slack_;
      node.name += "-" + std::to_string(k);
    }
    if (!in_cube || points < -1 || (points != 0 && size <= 0))
      fail_index(file_, at,
                 "has a node " + node.name + " of " + std::to_string(points) + " points in " +
                     std::to_string(size) + " bytes, which cannot be");
    if (level > deepest_ || points == 0 || !meets(node)) return;
    if (points == -1)
      pages_.push_back({offset, static_cast<std::uint64_t>(size)});
    else
      add(std::move(node), at, {offset, static_cast<std::uint64_t>(size)},
          static_cast<std::uint64_t>(points));
  }

  bool meets(const CopcChunk& node) const {
    if (!box_) return true;
    bool meet = true;
    for (std::size_t a = 0; a < 3; ++a)
      meet = meet && node.min[a] <= box_->max[a] && node.max[a] >= box_->min[a];
    return meet;
  }

  void add(CopcChunk node, std::uint64_t at, const Page& page, std::uint64_t points) {
    const auto edge =
        std::lower_bound(chunks_.edges.begin(), chunks_.edges.end() - 1, page.at,
                         [](const LazChunk& c, std::uint64_t begin) { return c.begin < begin; });
    node.chunk = static_cast<std::size_t>(edge - chunks_.edges.begin());
    if (node.chunk == chunks_.size() || edge->begin != page.at || (edge + 1)->begin - page.at != page.bytes ||
        chunks_.points_of(node.chunk) != points)
      fail_index(file_, at,
                 "says that node " + node.name + " has " + std::to_string(points) + " points in " +
                     std::to_string(page.bytes) + " bytes from byte " + std::to_string(page.at) +
                     " on, the chunk table says otherwise");
    found_.push_back(std::move(node));
  }

  const ReadFile& file_;
  const CopcInfo& copc_;
  const LazChunks& chunks_;
  const std::optional<PointBox>& box_;
  double slack_;
  std::int32_t deepest_ = kMaxLevel;
  std::vector<Page> pages_;
  std::set<std::uint64_t> seen_;
  std::uint64_t entries_ = 0;
  std::vector<CopcChunk> found_;
};

}  // namespace

std::optional<CopcInfo> find_copc(const ReadFile& file, const LasHeader& header) {
  if (header.record_count == 0 || header.begin < header.records_at + kRecordHead + kInfoBytes) return {};
  char bytes[kRecordHead + kInfoBytes];
  file.read_at(header.records_at, bytes, sizeof bytes);
  constexpr char kUser[16] = "copc";
  if (!std::equal(kUser, kUser + sizeof kUser, bytes + 2) || load_scalar<std::uint16_t>(bytes + 18) != 1 ||
      load_scalar<std::uint16_t>(bytes + 20) != kInfoBytes)
    return {};
  const char* info = bytes + kRecordHead;
  CopcInfo copc;
  copc.at = header.records_at + kRecordHead;
  for (std::size_t a = 0; a < 3; ++a) copc.centre[a] = load_scalar<double>(info + 8 * a);
  copc.half_size = load_scalar<double>(info + 24);
  copc.spacing = load_scalar<double>(info + 32);
  copc.root_at = load_scalar<std::uint64_t>(info + 40);
  copc.root_bytes = load_scalar<std::uint64_t>(info + 48);
  for (const double v : {copc.centre[0], copc.centre[1], copc.centre[2], copc.half_size, copc.spacing})
    if (!std::isfinite(v)) fail_index(file, copc.at, "has a cube or a spacing that is no number");
  if (!(copc.half_size > 0.0) || !(copc.spacing > 0.0))
    fail_index(file, copc.at, "has a cube or a spacing that is not above zero");
  return copc;
}

std::vector<CopcChunk> copc_chunks(const ReadFile& file, const CopcInfo& copc, const LazChunks& chunks,
                                   const std::optional<PointBox>& box, double resolution, double slack) {
  return Hierarchy(file, copc, chunks, box, resolution, slack).wanted();
}

}  // namespace tessera
