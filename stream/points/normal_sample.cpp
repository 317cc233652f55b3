#include "stream/points/normal_sample.h"

#include <algorithm>
#include <bit>
#include <iterator>
#include <numeric>
#include <tuple>

#include "octree/error.h"
#include "octree/points.h"
#include "octree/portable_math.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/json_fields.h"
#include "stream/files/packed_file.h"
#include "stream/files/read_file.h"

namespace tessera {
namespace {

constexpr PackedKind kNormalSampleKind = {"TSNSAMP3", "a sample of normals"};
constexpr int kCountBits = 12;   ///< for counting what a sampler holds
constexpr int kSectionBits = 6;  ///< of a file

/// Hashes up to the last one by their first bits.
class HashBuckets {
 public:
  HashBuckets(std::uint64_t last, int bits)
      : last_(last), shift_(std::max(0, static_cast<int>(std::bit_width(last)) - bits)) {}
  std::size_t count() const { return static_cast<std::size_t>(last_ >> shift_) + 1; }
  std::size_t of(std::uint64_t hash) const { return static_cast<std::size_t>(hash >> shift_); }
  std::uint64_t least(std::size_t bucket) const { return static_cast<std::uint64_t>(bucket) << shift_; }

 private:
  std::uint64_t last_;
  int shift_;
};

std::uint64_t bits_of_double(double v) {
  return std::bit_cast<std::uint64_t>(v + 0.0);
}

}  // namespace

std::uint64_t NormalSampler::add(const std::array<std::span<const double>, 3>& p,
                                 const std::array<std::span<const float>, 3>& n) {
  static_assert(kCell == 3.0 * kQuantaPerCell);
  constexpr std::size_t kMost = RotatedPoints::kMost;
  RotatedPoints rotated;
  std::uint64_t sum = 0;
  for (std::size_t first = 0; first < p[0].size(); first += kMost) {
    const std::size_t size = std::min(kMost, p[0].size() - first);
    rotated.take(p[0].subspan(first, size), p[1].subspan(first, size), p[2].subspan(first, size));
    rotated.find_cells(1.0 / kCell);
    rotated.hash_wider();  // cells of these share a class
    for (std::size_t i = 0; i < size; ++i) {
      const Float3 normal = {n[0][first + i], n[1][first + i], n[2][first + i]};
      const float length = std::fabs(normal[0]) + std::fabs(normal[1]) + std::fabs(normal[2]);
      if (!(length > 0.0f && length - length == 0.0f)) continue;
      ++sum;
      const std::uint64_t of_class = CellSampler::class_of(rotated.wider_hash[i]);
      if (of_class > CellSampler::class_of(threshold_)) continue;
      const auto cell = cell_of({rotated.p[0][i], rotated.p[1][i], rotated.p[2][i]}, 1.0 / kCell);
      if (cell != cell_) {
        constexpr int kClassShift = 64 - CellSampler::kClassBits;
        cell_ = cell;
        hash_ = of_class << kClassShift | CellSampler::hash_of(cell) >> CellSampler::kClassBits;
      }
      if (hash_ <= threshold_) push({p[0][first + i], p[1][first + i], p[2][first + i]}, normal);
    }
  }
  return sum;
}

void NormalSampler::push(const Double3& p, const Float3& n) {
  if (entries_.empty()) entries_.reserve(2 * kLimit);
  entries_.push_back({hash_,
                      mix(bits_of_double(p[0]) ^ mix(bits_of_double(p[1]) ^ mix(bits_of_double(p[2])))), p,
                      unit(n), 0});
  if (entries_.size() >= 2 * kLimit) shrink();
}

void NormalSampler::shrink() {
  // Hashes are spread evenly: where the limit is reached is told by counts, never too early, as a bucket has a cell or more.
  const HashBuckets buckets(threshold_, kCountBits);
  std::vector<std::size_t> counts(buckets.count());
  for (const Entry& e : entries_)
    if (e.cell <= threshold_) ++counts[buckets.of(e.cell)];
  std::size_t sum = 0;
  for (std::size_t b = 0; b + 1 < counts.size() && sum <= kLimit; ++b) {
    sum += std::min(counts[b], kOfCell);
    if (sum > kLimit) threshold_ = buckets.least(b + 1) - 1;
  }
  std::erase_if(entries_, [&](const Entry& e) { return e.cell > threshold_; });
  if (entries_.size() > kLimit + kLimit / 2) sort();
}

void NormalSampler::sort() {
  const auto less = [](const Entry& a, const Entry& b) {
    if (a.cell != b.cell) return a.cell < b.cell;
    return std::tie(a.point, a.p, a.n) < std::tie(b.point, b.p, b.n);
  };
  // Hashes are spread evenly: of a bucket few are left to be compared.
  const HashBuckets buckets(threshold_, kCountBits);
  std::vector<std::size_t> next(buckets.count() + 1);
  for (const Entry& e : entries_)
    if (e.cell <= threshold_) ++next[buckets.of(e.cell) + 1];
  std::partial_sum(next.begin(), next.end(), next.begin());
  std::vector<Entry> from(next.back());
  for (const Entry& e : entries_)
    if (e.cell <= threshold_) from[next[buckets.of(e.cell)]++] = e;  // now where the bucket ends
  std::size_t out = 0;
  for (std::size_t b = 0, begin = 0; b < buckets.count(); begin = next[b++]) {
    std::sort(from.begin() + static_cast<std::ptrdiff_t>(begin),
              from.begin() + static_cast<std::ptrdiff_t>(next[b]), less);
    for (std::size_t i = begin, end = begin; i < next[b]; i = end) {
      const std::uint64_t cell = from[i].cell;
      while (end < next[b] && from[end].cell == cell) ++end;
      const std::size_t take = std::min(end - i, kOfCell);
      if (out + take > kLimit) {
        threshold_ = std::min(threshold_, cell - 1);
        entries_.resize(out);
        return;
      }
      std::copy_n(from.begin() + static_cast<std::ptrdiff_t>(i), take,
                  entries_.begin() + static_cast<std::ptrdiff_t>(out));
      out += take;
    }
  }
  entries_.resize(out);
}

NormalAgreement NormalSampler::measure() {
  sort();
  NormalAgreement sum;
  std::vector<NormalSample> cell;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    cell.push_back({entries_[i].p, entries_[i].n});
    if (i + 1 < entries_.size() && entries_[i + 1].cell == entries_[i].cell) continue;
    sum.add(compare_neighbours(cell));
    cell.clear();
  }
  entries_.clear();
  return sum;
}

std::uint64_t NormalSampler::save(const std::filesystem::path& file) {
  sort();
  PackedWriter out(file, kNormalSampleKind, std::size_t{1} << 20);
  std::vector<std::uint64_t> threshold = {threshold_};
  std::vector<Section> table = {out.append(bytes_of(threshold))};
  // A section each, so that whoever merges reads those alone that may be of the whole sample.
  const HashBuckets buckets(threshold_, kSectionBits);
  const std::span<const Entry> all(entries_);
  std::size_t first = 0;
  for (std::size_t b = 0; b < buckets.count(); ++b) {
    std::size_t end = first;
    while (end < all.size() && buckets.of(all[end].cell) == b) ++end;
    table.push_back(out.append(std::as_bytes(all.subspan(first, end - first))));
    first = end;
  }
  return out.finish(table);
}

void NormalSampler::merge(const std::filesystem::path& file) {
  const PackedFile in(file, kNormalSampleKind, sizeof(Section));
  const auto table = in.table<Section>();
  const std::uint64_t saved = in.load<std::uint64_t>(table.at(0)).at(0);
  threshold_ = std::min(threshold_, saved);
  const HashBuckets buckets(saved, kSectionBits);
  if (entries_.empty()) entries_.reserve(2 * kLimit);
  for (std::size_t b = 0; b < buckets.count() && buckets.least(b) <= threshold_; ++b) {
    const auto more = in.load<Entry>(table.at(b + 1));
    if (entries_.size() + more.size() > 2 * kLimit) shrink();  // what is reserved is enough
    if (entries_.size() + more.size() > 2 * kLimit) sort();
    std::copy_if(more.begin(), more.end(), std::back_inserter(entries_),
                 [&](const Entry& e) { return e.cell <= threshold_; });
  }
}

void save_agreement(const std::filesystem::path& file, const NormalAgreement& agreement) {
  write_text(file, dump_json(fields_to_json(agreement), 1) + "\n");
}

NormalAgreement agreement_of_work(const std::filesystem::path& work) {
  const std::filesystem::path file = work / kAgreementFile;
  if (!std::filesystem::exists(file))
    throw InputError(file.string() + ": cannot be opened: the survey has not written it");
  try {
    return fields_from_json<NormalAgreement>(parse_json(read_text(file)));
  } catch (const JsonError& e) {
    throw InputError(file.string() + ": damaged (" + e.what() + "); run again with --force");
  }
}

NormalAgreement agreement_where_measured(const std::filesystem::path& work) {
  return std::filesystem::exists(work / kAgreementFile) ? agreement_of_work(work) : NormalAgreement{};
}

}  // namespace tessera
