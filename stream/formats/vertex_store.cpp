#include "stream/formats/vertex_store.h"

#include <algorithm>
#include <cstring>

namespace tessera {
namespace {

constexpr std::uint64_t kUnsaved = ~std::uint64_t{0};
constexpr std::uint64_t kMinSlots = 4;  // the corners of a face may lie in three chunks

}  // namespace

VertexStore::VertexStore(const std::filesystem::path& temp, bool doubles, std::uint64_t memory_bytes)
    : file_(temp),
      doubles_(doubles),
      chunk_bytes_(kChunkVertices * (doubles ? sizeof(Double3) : sizeof(Float3))),
      max_slots_(std::max(kMinSlots, memory_bytes / chunk_bytes_)) {}

void VertexStore::store(Slot& slot, std::uint64_t i, const Double3& p) const {
  if (doubles_) {
    std::memcpy(slot.bytes.data() + i * sizeof p, &p, sizeof p);
    return;
  }
  const Float3 f = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
  std::memcpy(slot.bytes.data() + i * sizeof f, &f, sizeof f);
}

std::uint32_t VertexStore::free_slot() {
  if (slots_.size() < max_slots_) {
    slots_.emplace_back();
    slots_.back().bytes.resize(chunk_bytes_);
    return static_cast<std::uint32_t>(slots_.size() - 1);
  }
  const auto oldest = std::min_element(slots_.begin(), slots_.end(),
                                       [](const Slot& a, const Slot& b) { return a.fetched < b.fetched; });
  if (offset_[oldest->chunk] == kUnsaved) {
    offset_[oldest->chunk] = file_.append(oldest->bytes.data(), chunk_bytes_);
  }
  slot_of_[oldest->chunk] = kNone;
  return static_cast<std::uint32_t>(oldest - slots_.begin());
}

std::uint32_t VertexStore::fetch(std::uint64_t chunk) {
  const std::uint32_t slot = free_slot();
  file_.read_at(offset_[chunk], slots_[slot].bytes.data(), chunk_bytes_);
  slots_[slot].chunk = chunk;
  slots_[slot].fetched = ++tick_;
  slot_of_[chunk] = slot;
  return slot;
}

void VertexStore::append(std::span<const Double3> positions) {
  for (const Double3& p : positions) {
    const std::uint64_t in_chunk = size_ % kChunkVertices;
    if (in_chunk == 0) {
      const std::uint32_t slot = free_slot();
      slots_[slot].chunk = slot_of_.size();
      slots_[slot].fetched = ++tick_;
      slot_of_.push_back(slot);
      offset_.push_back(kUnsaved);
    }
    store(slots_[slot_of_.back()], in_chunk, p);
    ++size_;
  }
}

void VertexStore::read(std::uint64_t first, std::span<Double3> out) {
  Slot passing;
  std::size_t done = 0;
  while (done < out.size()) {
    const std::uint64_t chunk = (first + done) / kChunkVertices;
    const std::uint64_t begin = (first + done) % kChunkVertices;
    const std::size_t count = std::min<std::uint64_t>(kChunkVertices - begin, out.size() - done);
    const Slot* slot = &passing;
    if (slot_of_[chunk] != kNone) {
      slot = &slots_[slot_of_[chunk]];
    } else {
      passing.bytes.resize(chunk_bytes_);
      file_.read_at(offset_[chunk], passing.bytes.data(), chunk_bytes_);
    }
    for (std::size_t i = 0; i < count; ++i) out[done + i] = load(*slot, begin + i);
    done += count;
  }
}

}  // namespace tessera
