/// \file vertex_store.h
/// Positions by number, under a byte limit: in memory while they fit, otherwise on disk behind a cache of
/// chunks.
#pragma once
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <vector>

#include "octree/lattice.h"
#include "stream/files/spill_file.h"

namespace tessera {

class VertexStore {
 public:
  /// \param doubles       keep all bits; otherwise positions are rounded to float and take half the room
  /// \param memory_bytes  of all chunks in memory; at least a few chunks (kChunkVertices each) are kept
  VertexStore(const std::filesystem::path& temp, bool doubles, std::uint64_t memory_bytes);

  static constexpr std::uint64_t kChunkVertices = 16384;

  void append(std::span<const Double3> positions);
  std::uint64_t size() const { return size_; }
  /// Positions [first, first + out.size()), without touching the cache. \pre all appended
  void read(std::uint64_t first, std::span<Double3> out);
  /// One position. Fast when near accesses are near in number; at worst a chunk is read for each call.
  Double3 at(std::uint64_t i) {
    const std::uint64_t chunk = i / kChunkVertices;
    const std::uint32_t slot = slot_of_[chunk];
    return load(slots_[slot != kNone ? slot : fetch(chunk)], i % kChunkVertices);
  }

 private:
  static constexpr std::uint32_t kNone = 0xffffffffu;
  struct Slot {
    std::vector<char> bytes;
    std::uint64_t chunk = 0;
    std::uint64_t fetched = 0;  ///< tick; the oldest is replaced
  };

  Double3 load(const Slot& slot, std::uint64_t i) const {
    if (doubles_) {
      Double3 p;
      std::memcpy(&p, slot.bytes.data() + i * sizeof p, sizeof p);
      return p;
    }
    Float3 p;
    std::memcpy(&p, slot.bytes.data() + i * sizeof p, sizeof p);
    return {p[0], p[1], p[2]};
  }
  void store(Slot& slot, std::uint64_t i, const Double3& p) const;
  std::uint32_t fetch(std::uint64_t chunk);
  std::uint32_t free_slot();

  SpillFile file_;
  const bool doubles_;
  const std::uint64_t chunk_bytes_;
  const std::size_t max_slots_;
  std::vector<Slot> slots_;
  std::vector<std::uint32_t> slot_of_;  ///< per chunk
  std::vector<std::uint64_t> offset_;   ///< per chunk, in the file; kUnsaved if only in memory
  std::uint64_t size_ = 0;
  std::uint64_t tick_ = 0;
};

}  // namespace tessera
