#include "stream/render/doubt.h"

#include <array>
#include <limits>

#include "octree/error.h"
#include "stream/formats/points/point_source.h"
#include "stream/runtime/memory_budget.h"
#include "stream/runtime/stop.h"

namespace tessera {
namespace {

/// Of a point in the index, with what it is made of while it is built.
constexpr std::uint64_t kPointBytes =
    ClosestFaces::bytes_per_face() + sizeof(Double3) + sizeof(std::array<std::uint32_t, 3>) + 1;
constexpr std::uint64_t kMaxPoints = std::numeric_limits<std::uint32_t>::max() - 1;

}  // namespace

Doubt::Doubt(const std::filesystem::path& points, std::uint64_t memory_bytes) {
  const auto file = open_point_file(points, {});
  const InputError foreign(points.string() +
                           ": holds no doubts of a reconstruction: name its OUT.uncertain.ply");
  if (!file->info().attributes.colour) throw foreign;
  std::vector<Double3> position;
  std::vector<std::array<std::uint32_t, 3>> face;
  for (const InputSlice& slice : file->slices(0, std::uint64_t{32} << 20))
    file->read(slice, [&](const PointChunk& chunk) {
      throw_if_stopped();
      const std::uint64_t count = position.size() + chunk.size();
      bytes_ = count * kPointBytes;
      if (count > kMaxPoints || (memory_bytes != 0 && bytes_ > memory_bytes))
        throw ResourceError(points.string() + ": its points take " +
                            format_bytes(file->info().declared_points * kPointBytes) +
                            " of memory, and the cap leaves " + format_bytes(memory_bytes) +
                            ": raise --memory");
      for (std::size_t i = 0; i < chunk.size(); ++i) {
        if (chunk.rgba[i] != kDoubtfulPoint && chunk.rgba[i] != kDecidedPoint) throw foreign;
        const auto n = static_cast<std::uint32_t>(position.size());
        position.push_back({chunk.x[i], chunk.y[i], chunk.z[i]});
        face.push_back({n, n, n});
        doubtful_.push_back(chunk.rgba[i] == kDoubtfulPoint ? 1 : 0);
      }
    });
  if (position.empty()) throw foreign;
  index_ = ClosestFaces(position, face, position.front());
}

bool Doubt::at(const Double3& p) const {
  const ClosestFaces::Hit hit =
      index_.closest(p - index_.origin(), std::numeric_limits<double>::infinity(), ClosestFaces::kNone);
  return hit.slot != ClosestFaces::kNone && doubtful_[index_.face(hit.slot)] != 0;
}

}  // namespace tessera
