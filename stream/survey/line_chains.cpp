#include "stream/survey/line_chains.h"

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

#include "stream/runtime/stop.h"

namespace tessera {
namespace {

/// Crossings of faces and levels that are chained at a time, and what one of them takes meanwhile.
constexpr std::uint64_t kStepsAtATime = std::uint64_t{1} << 16, kBytesPerStep = 160;
constexpr std::size_t kNone = std::numeric_limits<std::size_t>::max();

}  // namespace

void ChainFile::add(const std::vector<ContourChain>& chains) {
  const std::lock_guard lock(mutex_);
  for (const ContourChain& c : chains) {
    ChainRecord r{c.level,       c.begin,           c.end,
                  c.smallest,    point_count_,      static_cast<std::uint32_t>(c.points.size()),
                  c.smallest_at, c.closed ? 1u : 0u};
    points_.append(c.points.data(), c.points.size() * sizeof(Double2));
    records_.append(&r, sizeof r);
    point_count_ += c.points.size(), ++count_;
  }
}

std::vector<ChainRecord> ChainFile::records() const {
  std::vector<ChainRecord> all(count_);
  if (!all.empty()) records_.read_at(0, all.data(), count_ * sizeof(ChainRecord));
  return all;
}

void ChainFile::read_points(const ChainRecord& r, Double2* to, std::size_t count) const {
  if (count > 0) points_.read_at(r.first_point * sizeof(Double2), to, count * sizeof(Double2));
}

void chain_levels(const MeshBlock& block, const ContourLevels& levels, std::int64_t first, std::int64_t end,
                  std::int64_t shift, ChainFile& file) {
  const auto at_a_time = static_cast<std::int64_t>(
      std::max<std::uint64_t>(1, kStepsAtATime / std::max<std::size_t>(1, block.faces.size())));
  for (; first < end; first += at_a_time) {
    throw_if_stopped();
    std::vector<ContourChain> chains = contour_chains(block, levels, first, std::min(end, first + at_a_time));
    for (ContourChain& c : chains) c.level += shift;
    file.add(chains);
  }
}

std::uint64_t chain_bytes(const MeshPatchEntry& entry) {
  return MeshStore::block_bytes(entry.vertices, entry.faces) +
         kBytesPerStep * std::max<std::uint64_t>(kStepsAtATime, entry.faces);
}

void chain_patches(const MeshStore& store, WorkerPool& pool, MemoryBudget& budget,
                   const std::function<std::uint64_t(const MeshPatchEntry&)>& bytes,
                   const std::function<void(std::size_t)>& chain) {
  pool.run_tasks(
      store.patches().size(), [&](std::size_t p) { return bytes(store.patches()[p]); }, budget,
      [&](std::size_t p) {
        throw_if_stopped();
        chain(p);
      });
  trim_allocator();
}

ChainGraph::ChainGraph(const ChainFile& file, const MemoryBudget& budget, std::string who)
    : file_(file), budget_(budget), who_(std::move(who)) {
  budget_.require(file.count() * kBytes, who_ + ": the ends of lines");
  chains_ = file.records();
  std::sort(chains_.begin(), chains_.end(), [](const ChainRecord& a, const ChainRecord& b) {
    return std::tie(a.level, a.begin, a.end) < std::tie(b.level, b.begin, b.end);
  });
  next_.assign(chains_.size(), kNone);
  std::vector<std::uint8_t> has_previous(chains_.size()), done(chains_.size());
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    if (chains_[c].closed) continue;
    const auto found = std::lower_bound(chains_.begin(), chains_.end(), chains_[c],
                                        [](const ChainRecord& a, const ChainRecord& b) {
                                          return std::tie(a.level, a.begin) < std::tie(b.level, b.end);
                                        });
    if (found == chains_.end() || found->level != chains_[c].level || found->begin != chains_[c].end)
      continue;
    next_[c] = static_cast<std::size_t>(found - chains_.begin());
    has_previous[next_[c]] = 1;
  }
  for (std::size_t c = 0; c < chains_.size(); ++c)
    if (!has_previous[c] && !chains_[c].closed) {
      lines_.push_back({chains_[c].level, chains_[c].begin, c, false});
      for (std::size_t k = c; k != kNone; k = next_[k]) done[k] = 1;
    }
  for (std::size_t c = 0; c < chains_.size(); ++c) {
    if (done[c]) continue;
    std::size_t first = c;
    for (std::size_t k = c; k != kNone && !done[k]; k = next_[k]) {
      done[k] = 1;
      if (chains_[k].smallest < chains_[first].smallest) first = k;
    }
    lines_.push_back({chains_[c].level, chains_[first].smallest, first, true});
  }
  std::sort(lines_.begin(), lines_.end(), [](const ChainedLine& a, const ChainedLine& b) {
    return std::tie(a.level, a.name) < std::tie(b.level, b.name);
  });
}

std::uint64_t ChainGraph::point_count(const ChainedLine& line) const {
  std::uint64_t count = 0;
  for_chains(line, [&](const ChainRecord& c) { count += c.count; });
  return count;
}

std::vector<Double2> ChainGraph::points(const ChainedLine& line, std::uint64_t times) const {
  budget_.require(file_.count() * kBytes + times * sizeof(Double2) * point_count(line),
                  who_ + ": the longest line");
  std::vector<Double2> all;
  all.reserve(point_count(line));
  for_chains(line, [&](const ChainRecord& c) {
    // Where one chain ends the next one begins.
    const bool joins = !c.closed && (line.closed || next_[index_of(c)] != kNone);
    const std::size_t count = c.count - (joins ? 1 : 0), at = all.size();
    all.resize(at + count);
    file_.read_points(c, all.data() + at, count);
  });
  if (line.closed) {
    const std::size_t turn = chains_[line.chain].smallest_at % all.size();
    std::rotate(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(turn), all.end());
  }
  remove_spikes(all, line.closed);
  return all;
}

template <class Use>
void ChainGraph::for_chains(const ChainedLine& line, const Use& use) const {
  std::size_t k = line.chain;
  do {
    use(chains_[k]);
    k = next_[k];
  } while (k != kNone && k != line.chain);
}

}  // namespace tessera
