#include "stream/meshes/mesh_weld.h"

#include <algorithm>
#include <bit>
#include <tuple>

#include "octree/error.h"
#include "stream/files/external_sort.h"
#include "stream/files/spill_buckets.h"

namespace tessera {
namespace {

/// Unsigned integers in the order of the floating-point numbers they stand for; -0 and 0 are the same.
template <class Bits>
Bits ordered_bits(double value) {
  constexpr Bits kSign = Bits{1} << (8 * sizeof(Bits) - 1);
  Bits bits;
  if constexpr (sizeof(Bits) == 4) {
    bits = std::bit_cast<Bits>(static_cast<float>(value) + 0.0f);
  } else {
    bits = std::bit_cast<Bits>(value + 0.0);
  }
  return (bits & kSign) != 0 ? static_cast<Bits>(~bits) : static_cast<Bits>(bits | kSign);
}

template <class Bits>
double from_ordered(Bits ordered) {
  constexpr Bits kSign = Bits{1} << (8 * sizeof(Bits) - 1);
  const Bits bits = (ordered & kSign) != 0 ? static_cast<Bits>(ordered ^ kSign) : static_cast<Bits>(~ordered);
  if constexpr (sizeof(Bits) == 4) {
    return std::bit_cast<float>(bits);
  } else {
    return std::bit_cast<double>(bits);
  }
}

template <class Bits, class Index>
struct PlacedVertex {
  Bits x, y, z;
  Index vertex;
  auto position() const { return std::tie(x, y, z); }
  bool operator<(const PlacedVertex& o) const {
    return std::tie(x, y, z, vertex) < std::tie(o.x, o.y, o.z, o.vertex);
  }
};

constexpr std::size_t kBatch = 16384;

}  // namespace

WeldedMesh::WeldedMesh(MeshReader& source, const WeldOptions& options)
    : source_(&source),
      header_(source.header()),
      positions_(options.temp, header_.double_positions, options.memory_bytes / 8),
      numbers_(options.temp) {
  source.read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t>) {
    if (options.check_stop) options.check_stop();
    source_vertices_ += positions.size();
  });
  page_.resize(static_cast<std::size_t>(std::min(
      source_vertices_, std::max<std::uint64_t>(options.memory_bytes / 8 / sizeof(std::uint64_t), 4096))));
  if (source.shared_vertices() && page_.size() < source_vertices_) {
    throw ResourceError(
        "merging " + std::to_string(source_vertices_) +
        " vertices that faces already share needs 64 bytes of memory for each; raise --memory to " +
        std::to_string((source_vertices_ * 64 >> 20) + 1) + "M");
  }
  if (header_.double_positions) {
    weld<std::uint64_t, std::uint64_t>(options);
  } else if (source_vertices_ > 0xffffffffULL) {
    weld<std::uint32_t, std::uint64_t>(options);
  } else {
    weld<std::uint32_t, std::uint32_t>(options);
  }
  header_.vertices = positions_.size();
  header_.colour = false;
  if (source_vertices_ > 0) numbers_.read_at(0, page_.data(), page_.size() * sizeof(std::uint64_t));
}

template <class Bits, class Index>
void WeldedMesh::weld(const WeldOptions& options) {
  using Placed = PlacedVertex<Bits, Index>;
  struct Numbered {
    Index vertex, number;
  };
  ExternalSort<Placed> sort(options.temp, options.memory_bytes / 2);
  Index next = 0;
  source_->read_vertices([&](std::span<const Double3> positions, std::span<const std::uint32_t>) {
    if (options.check_stop) options.check_stop();
    for (const Double3& p : positions) {
      sort.add({ordered_bits<Bits>(p[0]), ordered_bits<Bits>(p[1]), ordered_bits<Bits>(p[2]), next++});
    }
  });

  // New numbers appear in the order of positions; buckets of old numbers bring them back into the order of
  // the file.
  const std::uint64_t per_bucket = std::max<std::uint64_t>(page_.size(), 1);
  const std::size_t buckets = static_cast<std::size_t>((source_vertices_ + per_bucket - 1) / per_bucket);
  SpillPool pool(options.temp, options.memory_bytes / 16);
  SpillBuckets<Numbered> numbered(
      pool, buckets,
      std::clamp<std::size_t>(options.memory_bytes / 16 / std::max<std::size_t>(1, buckets), 512, 1u << 18));
  Placed last{};
  std::vector<Double3> fresh;
  sort.drain([&](std::span<const Placed> batch) {
    if (options.check_stop) options.check_stop();
    for (const Placed& placed : batch) {
      if (positions_.size() + fresh.size() == 0 || placed.position() != last.position()) {
        fresh.push_back({from_ordered(placed.x), from_ordered(placed.y), from_ordered(placed.z)});
        last = placed;
        if (fresh.size() == kBatch) {
          positions_.append(fresh);
          fresh.clear();
        }
      }
      const std::uint64_t number = positions_.size() + fresh.size() - 1;
      numbered.add(placed.vertex / per_bucket, {placed.vertex, static_cast<Index>(number)});
    }
  });
  positions_.append(fresh);
  for (std::size_t bucket = 0; bucket < buckets; ++bucket) {
    const std::uint64_t begin = bucket * per_bucket;
    numbered.for_each(bucket, [&](std::span<const Numbered> batch) {
      for (const Numbered& n : batch) page_[n.vertex - begin] = n.number;
    });
    numbers_.append(page_.data(), std::min(per_bucket, source_vertices_ - begin) * sizeof(std::uint64_t));
    numbered.release(bucket);
  }
}

std::uint64_t WeldedMesh::new_number(std::uint64_t vertex) {
  if (vertex < page_begin_ || vertex >= page_begin_ + page_.size()) {
    page_begin_ = std::min(vertex, source_vertices_ - page_.size());
    numbers_.read_at(page_begin_ * sizeof(std::uint64_t), page_.data(), page_.size() * sizeof(std::uint64_t));
  }
  return page_[vertex - page_begin_];
}

void WeldedMesh::read_vertices(
    const std::function<void(std::span<const Double3>, std::span<const std::uint32_t>)>& sink) {
  std::vector<Double3> batch;
  for (std::uint64_t first = 0; first < positions_.size(); first += batch.size()) {
    batch.resize(static_cast<std::size_t>(std::min<std::uint64_t>(kBatch, positions_.size() - first)));
    positions_.read(first, batch);
    sink(batch, {});
  }
}

void WeldedMesh::read_faces(const std::function<void(std::span<const MeshFace>)>& sink) {
  std::vector<MeshFace> renamed;
  source_->read_faces([&](std::span<const MeshFace> faces) {
    renamed.assign(faces.begin(), faces.end());
    for (MeshFace& face : renamed) {
      for (std::uint64_t& v : face) {
        // An unknown vertex stays unknown: the check counts such faces.
        v = v < source_vertices_ ? new_number(v) : header_.vertices;
      }
    }
    sink(renamed);
  });
}

}  // namespace tessera
