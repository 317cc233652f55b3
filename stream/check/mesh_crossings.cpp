#include "stream/check/mesh_crossings.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <tuple>
#include <utility>

#include "kernels/mesh/block_contacts.h"
#include "kernels/mesh/orientation_sign.h"
#include "octree/error.h"
#include "stream/files/external_sort.h"
#include "stream/files/spill_buckets.h"
#include "stream/runtime/parallel.h"

namespace tessera {
namespace {

constexpr double kUnbounded = std::numeric_limits<double>::infinity();
constexpr int kMaxCellSplits =
    15;  ///< of an axis in halves: what is together in so small a cell meets, or nearly so
constexpr int kMaxLevel = 5;  ///< of them at once
/// Smaller chunks cost more in calls and in the lists of where they are than dealing twice does.
constexpr std::uint64_t kLeastChunk = 4096;
constexpr std::uint64_t kStopPairs = 1u << 16;

/// Of the memory. What lies in a cell is held once a thread.
struct CrossingShares {
  explicit CrossingShares(std::uint64_t memory)
      : range(memory / 5), dealt(memory / 4), chunks(memory / 12), faces(memory / 16), cells(memory / 3) {}
  std::uint64_t range;   ///< positions at hand while corners are looked up
  std::uint64_t dealt;   ///< faces dealt to ranges or cells, in memory; the rest is spilled
  std::uint64_t chunks;  ///< those being filled
  std::uint64_t faces;   ///< numbers of those that were found
  std::uint64_t cells;
};

/// Of a face in a cell: its corners, its number, twice where it is in a pair, and a mark; the tree over them.
constexpr std::uint64_t kCellFaceBytes =
    sizeof(ContactFace) + 3 * sizeof(std::uint64_t) + 1 + block_contacts_bytes(1024) / 1024;

/// A face that is looked up and dealt. Numbers and positions have the width that the mesh needs.
template <class Index, class Real>
struct DealtFace {
  std::array<Vector3<Real>, 3> corner;
  std::array<Index, 3> vertex;
  std::uint64_t face;
};

/// Planes that cut a cell into 2^level parts along each axis, the outermost as far as the cell goes.
class CellCuts {
 public:
  CellCuts(const ContactCell& cell, Double3 low, const Double3& high, int level)
      : cell_(cell), level_(level) {
    double widest = 0.0;
    for (std::size_t k = 0; k < 3; ++k) widest = std::max(widest, high[k] - low[k]);
    edge_ = std::ldexp(widest, -level);
    low_ = low;
  }
  std::size_t count() const { return std::size_t{1} << 3 * level_; }
  ContactCell part(std::size_t i) const {
    ContactCell c;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t at = i >> (level_ * static_cast<int>(k)) & (per_axis() - 1);
      c.low[k] = at == 0 ? cell_.low[k] : plane(k, at);
      c.high[k] = at + 1 == per_axis() ? cell_.high[k] : plane(k, at + 1);
    }
    return c;
  }
  template <class Use>
  void each_part(const Double3& low, const Double3& high, const Use& use) const {
    std::array<std::size_t, 3> from, to;
    for (std::size_t k = 0; k < 3; ++k) from[k] = at(k, low[k]), to[k] = at(k, high[k]);
    for (std::size_t z = from[2]; z <= to[2]; ++z)
      for (std::size_t y = from[1]; y <= to[1]; ++y)
        for (std::size_t x = from[0]; x <= to[0]; ++x) use(((z << level_ | y) << level_) | x);
  }

 private:
  std::size_t per_axis() const { return std::size_t{1} << level_; }
  double plane(std::size_t axis, std::size_t i) const { return low_[axis] + edge_ * static_cast<double>(i); }
  /// The last part that does not begin beyond x: by the planes themselves, so that it agrees with part().
  std::size_t at(std::size_t axis, double x) const {
    const double last = static_cast<double>(per_axis() - 1);
    std::size_t i =
        edge_ > 0.0 ? static_cast<std::size_t>(std::clamp((x - low_[axis]) / edge_, 0.0, last)) : 0;
    while (i > 0 && x < plane(axis, i)) --i;
    while (i + 1 < per_axis() && x >= plane(axis, i + 1)) ++i;
    return i;
  }

  ContactCell cell_;
  Double3 low_{};
  double edge_ = 0.0;
  int level_;
};

template <class Index, class Real>
class CrossingSearch {
  using Face = DealtFace<Index, Real>;
  using Buckets = SpillBuckets<Face>;
  using Use = std::function<void(const Face&)>;
  using Source = std::function<void(const Use&)>;

 public:
  CrossingSearch(MeshReader& mesh, VertexStore& positions, const MeshCrossingOptions& options)
      : mesh_(mesh),
        positions_(positions),
        options_(options),
        shares_(options.memory_bytes),
        cell_faces_(std::max<std::uint64_t>(
            64, shares_.cells / kCellFaceBytes / static_cast<std::uint64_t>(std::max(1, options.threads)))),
        found_(options.temp, shares_.faces) {}

  MeshCrossings run() {
    survey();
    const ContactCell all{{-kUnbounded, -kUnbounded, -kUnbounded}, {kUnbounded, kUnbounded, kUnbounded}};
    WorkerPool pool(options_.threads);
    pool.run_here([&] { search(all, low_, high_, face_count_, 0, [&](const Use& use) { look_up(use); }); });
    std::uint64_t last = 0;
    std::vector<std::uint64_t> batch;
    found_.drain([&](std::span<const std::uint64_t> faces) {
      batch.clear();
      for (const std::uint64_t f : faces) {
        if (out_.faces == 0 || f != last) batch.push_back(f), ++out_.faces;
        last = f;
      }
      if (options_.faces) options_.faces(batch);
    });
    return std::move(out_);
  }

 private:
  void stop_point() const {
    if (options_.check_stop) options_.check_stop();
  }

  /// Bounds and counts.
  void survey() {
    low_.fill(kUnbounded);
    high_.fill(-kUnbounded);
    std::vector<Double3> some(VertexStore::kChunkVertices);
    for (std::uint64_t first = 0; first < positions_.size(); first += some.size()) {
      stop_point();
      const std::uint64_t count = std::min<std::uint64_t>(some.size(), positions_.size() - first);
      positions_.read(first, std::span(some).first(count));
      for (std::size_t v = 0; v < count; ++v)
        for (std::size_t k = 0; k < 3; ++k)
          if (std::isfinite(some[v][k])) {
            low_[k] = std::min(low_[k], some[v][k]);
            high_[k] = std::max(high_[k], some[v][k]);
          }
    }
    // Two vertices stand for four faces; what no face names does no harm.
    face_count_ = mesh_.header().faces > 0 ? mesh_.header().faces : 2 * positions_.size();
  }

  /// Hands out every face with its corners: range by range of vertices, those of one in memory.
  void look_up(const Use& use) {
    constexpr std::uint64_t kCornerBytes = sizeof(Double3);
    const std::uint64_t vertices = positions_.size();
    const std::uint64_t per_range =
        std::max<std::uint64_t>(VertexStore::kChunkVertices, shares_.range / kCornerBytes);
    const std::size_t ranges = static_cast<std::size_t>((vertices + per_range - 1) / per_range);
    SpillPool pool(options_.temp, shares_.dealt / 2);
    Buckets waiting(
        pool, ranges,
        std::clamp<std::uint64_t>(shares_.chunks / (2 * std::max<std::size_t>(1, ranges)), 4096, 1u << 18));
    std::vector<Double3> at_hand;
    std::uint64_t begin = 0;
    const auto load = [&](std::size_t range) {
      begin = range * per_range;
      at_hand.resize(static_cast<std::size_t>(std::min(per_range, vertices - begin)));
      positions_.read(begin, at_hand);
    };
    const auto fill = [&](Face& f) {
      for (std::size_t c = 0; c < 3; ++c)
        if (const std::uint64_t v = f.vertex[c]; v >= begin && v - begin < at_hand.size())
          for (std::size_t k = 0; k < 3; ++k) f.corner[c][k] = static_cast<Real>(at_hand[v - begin][k]);
    };
    if (ranges == 1) load(0);
    std::uint64_t number = 0;
    mesh_.read_faces([&](std::span<const MeshFace> faces) {
      stop_point();
      for (const MeshFace& face : faces) {
        const std::uint64_t f = number++;
        const auto [a, b, c] = face;
        if (a == b || b == c || c == a || std::max({a, b, c}) >= vertices) {
          ++out_.left_out;
          continue;
        }
        Face record{{}, {static_cast<Index>(a), static_cast<Index>(b), static_cast<Index>(c)}, f};
        if (ranges == 1) {
          fill(record);
          use_sound(record, use);
        } else {
          waiting.add(static_cast<std::size_t>(std::min({a, b, c}) / per_range), record);
        }
      }
    });
    if (ranges == 1) return;
    for (std::size_t range = 0; range < ranges; ++range) {
      load(range);
      waiting.for_each(range, [&](std::span<const Face> faces) {
        stop_point();
        for (Face f : faces) {
          fill(f);
          std::size_t next = ranges;
          for (const std::uint64_t v : f.vertex)
            if (const std::size_t r = static_cast<std::size_t>(v / per_range); r > range)
              next = std::min(next, r);
          if (next < ranges) {
            waiting.add(next, f);
          } else {
            use_sound(f, use);
          }
        }
      });
      waiting.release(range);
    }
  }

  static ContactFace contact_face(const Face& f) {
    ContactFace out;
    for (std::size_t c = 0; c < 3; ++c) {
      for (std::size_t k = 0; k < 3; ++k) out.corner[c][k] = static_cast<double>(f.corner[c][k]);
      out.vertex[c] = f.vertex[c];
    }
    return out;
  }

  void use_sound(const Face& f, const Use& use) {
    const ContactFace face = contact_face(f);
    bool finite = true;
    for (const Double3& p : face.corner)
      for (const double x : p) finite = finite && std::isfinite(x);
    if (!finite || collinear(face.corner[0], face.corner[1], face.corner[2])) {
      ++out_.left_out;
    } else {
      use(f);
    }
  }

  /// Into how many parts, 8^level, a cell with so many faces is cut, at least 8 where it is cut again. A surface passes about
  /// 4^level cells; some are fuller than others. Parts have room for chunks worth a call.
  int level_of(std::uint64_t faces, std::uint64_t chunks, bool again) const {
    int level = again ? 1 : 0;
    while (level < kMaxLevel && faces >> 2 * level > cell_faces_ / 3 &&
           kLeastChunk << 3 * (level + 1) <= chunks)
      ++level;
    return level;
  }

  /// Deals the faces of a cell to its parts and looks for pairs in each; parts that are too full are dealt again.
  /// \param low,high  around the places that the faces may share \param splits  of an axis so far, in halves
  void search(const ContactCell& cell, const Double3& low, const Double3& high, std::uint64_t count,
              int splits, const Source& source) {
    const std::uint64_t nested = splits == 0 ? 2 : 8, chunks = shares_.chunks / nested;
    const int level = level_of(count, chunks, splits > 0);
    const CellCuts cuts(cell, low, high, level);
    SpillPool pool(options_.temp, shares_.dealt / nested);
    Buckets parts(pool, cuts.count(), std::clamp<std::uint64_t>(chunks / cuts.count(), 512, 1u << 18));
    source([&](const Face& f) {
      Double3 from, to;
      for (std::size_t k = 0; k < 3; ++k) {
        from[k] = static_cast<double>(std::min({f.corner[0][k], f.corner[1][k], f.corner[2][k]}));
        to[k] = static_cast<double>(std::max({f.corner[0][k], f.corner[1][k], f.corner[2][k]}));
        from[k] = std::max(from[k], cell.low[k]);
        to[k] = std::min(to[k], cell.high[k]);
      }
      cuts.each_part(from, to, [&](std::size_t part) { parts.add(part, f); });
    });
    std::vector<std::size_t> some, full;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (parts.count(i) > cell_faces_) {
        full.push_back(i);
      } else if (parts.count(i) > 1) {
        some.push_back(i);
      } else {
        parts.release(i);
      }
    }
    const std::size_t window = static_cast<std::size_t>(std::max(1, options_.threads)) + 2;
    std::vector<MeshCrossings> found(window);
    std::vector<std::vector<std::uint64_t>> faces(window);
    parallel_in_order(
        some.size(), window,
        [&](std::size_t i) {
          found[i % window] = {};
          faces[i % window].clear();
          pairs_of(parts, some[i], cuts.part(some[i]), found[i % window], faces[i % window]);
        },
        [&](std::size_t i) {
          stop_point();
          add(found[i % window], faces[i % window]);
          parts.release(some[i]);
        });
    for (const std::size_t i : full) {
      const ContactCell part = cuts.part(i);
      if (splits >= kMaxCellSplits) too_full(parts.count(i), part);
      Double3 from, to;
      for (std::size_t k = 0; k < 3; ++k)
        from[k] = std::max(part.low[k], low[k]), to[k] = std::min(part.high[k], high[k]);
      search(part, from, to, parts.count(i), splits + std::max(1, level), [&](const Use& use) {
        parts.for_each(i, [&](std::span<const Face> some_faces) {
          for (const Face& f : some_faces) use(f);
        });
        parts.release(i);
      });
    }
  }

  [[noreturn]] void too_full(std::uint64_t faces, const ContactCell& cell) const {
    const double wanted = static_cast<double>(options_.memory_bytes) * static_cast<double>(faces) /
                          static_cast<double>(cell_faces_);
    throw ResourceError("the search for crossings cannot hold the " + std::to_string(faces) +
                        " faces that meet at " + std::to_string(cell.low[0]) + " " +
                        std::to_string(cell.low[1]) + " " + std::to_string(cell.low[2]) +
                        " at once; raise --memory to " +
                        std::to_string((static_cast<std::uint64_t>(1.5 * wanted) >> 20) + 64) + "M");
  }

  void pairs_of(const Buckets& parts, std::size_t part, const ContactCell& cell, MeshCrossings& found,
                std::vector<std::uint64_t>& in_pairs) const {
    std::vector<ContactFace> faces;
    std::vector<std::uint64_t> numbers;
    faces.reserve(parts.count(part));
    numbers.reserve(parts.count(part));
    parts.for_each(part, [&](std::span<const Face> some) {
      for (const Face& f : some) {
        faces.push_back(contact_face(f));
        numbers.push_back(f.face);
      }
    });
    std::vector<std::uint8_t> in_pair(faces.size(), 0);
    const auto use = [&](std::uint32_t i, std::uint32_t j, FaceContact contact) {
      in_pair[i] = in_pair[j] = 1;
      ++(contact == FaceContact::kCross     ? found.crossing
         : contact == FaceContact::kOverlap ? found.overlapping
                                            : found.touching);
      if (found.pairs() % kStopPairs == 0) stop_point();
      FaceCrossing pair{contact, {}, {std::min(numbers[i], numbers[j]), std::max(numbers[i], numbers[j])}};
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [a, b] =
            std::minmax({faces[i].corner[0][k], faces[i].corner[1][k], faces[i].corner[2][k]});
        const auto [c, d] =
            std::minmax({faces[j].corner[0][k], faces[j].corner[1][k], faces[j].corner[2][k]});
        pair.place[k] = 0.5 * std::max(a, c) + 0.5 * std::min(b, d);
      }
      list(found.listed, pair);
    };
    block_contacts(faces, cell, use, ContactOrder::kAny);
    for (std::size_t f = 0; f < faces.size(); ++f)
      if (in_pair[f]) in_pairs.push_back(numbers[f]);
  }

  /// A heap of the first ones, the last of them on top.
  static void list(std::vector<FaceCrossing>& heap, const FaceCrossing& pair) {
    if (heap.size() == kListedCrossings) {
      if (!(pair < heap.front())) return;
      std::pop_heap(heap.begin(), heap.end());
      heap.pop_back();
    }
    heap.push_back(pair);
    std::push_heap(heap.begin(), heap.end());
  }

  void add(const MeshCrossings& found, const std::vector<std::uint64_t>& faces) {
    out_.crossing += found.crossing;
    out_.overlapping += found.overlapping;
    out_.touching += found.touching;
    for (const FaceCrossing& pair : found.listed) list(out_.listed, pair);
    for (const std::uint64_t f : faces) found_.add(f);
  }

  MeshReader& mesh_;
  VertexStore& positions_;
  const MeshCrossingOptions& options_;
  const CrossingShares shares_;
  const std::uint64_t cell_faces_;  ///< at most, in a cell
  ExternalSort<std::uint64_t> found_;
  Double3 low_{}, high_{};
  std::uint64_t face_count_ = 0;
  MeshCrossings out_;
};

}  // namespace

bool operator<(const FaceCrossing& a, const FaceCrossing& b) {
  if (a.contact != b.contact) return a.contact > b.contact;
  return std::tie(a.place, a.faces) < std::tie(b.place, b.faces);
}

MeshCrossings find_crossings(MeshReader& mesh, VertexStore& positions, const MeshCrossingOptions& options) {
  const auto search = [&](auto index, auto real) {
    MeshCrossings found = CrossingSearch<decltype(index), decltype(real)>(mesh, positions, options).run();
    std::sort(found.listed.begin(), found.listed.end());
    return found;
  };
  if (positions.size() > 0xffffffffULL || mesh.header().double_positions)
    return search(std::uint64_t{}, double{});
  return search(std::uint32_t{}, float{});
}

}  // namespace tessera
