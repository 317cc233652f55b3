#include "stream/formats/points/laz_records.h"

#include <algorithm>
#include <string>

#include "octree/error.h"

namespace tessera {

void LazRecords::seek(std::size_t chunk) {
  next_ = chunk;
  left_ = 0;
  ended_ = false;
}

std::size_t LazRecords::read(char* records, std::size_t count) {
  if (ended_) return 0;
  std::uint64_t before = 0;
  try {
    while (left_ == 0) open_next();
    if (unit_left_ == 0) begin_unit();
    const auto n = static_cast<std::size_t>(std::min<std::uint64_t>({count, left_, unit_left_}));
    before = decoder_->decoded();
    decoder_->decode(records, n);
    left_ -= n;
    unit_left_ -= n;
    if (left_ == 0 && !chunks_.in_order) decoder_->require_used_up();
    return n;
  } catch (const laz::EndOfBytes& e) {
    if (!chunks_.cut_off || next_ != chunks_.size()) fail(e);
    ended_ = true;
    return decoder_ ? static_cast<std::size_t>(decoder_->decoded() - before) : 0;
  } catch (const laz::Damage& e) {
    fail(e);
  }
}

void LazRecords::open_next() {
  const std::size_t chunk = next_++;
  left_ = chunks_.points_of(chunk);
  unit_left_ = 0;
  decoder_.reset();
  begin_ = chunks_.edges[chunk].begin;
  end_ = chunks_.end_of(chunk);
  if (!schema_.layered()) feed_ = std::make_unique<FileFeed>(file_, begin_, end_, release_);
}

/// What one set of models codes: a chunk, or a run of chunks one after the other.
void LazRecords::begin_unit() {
  decoder_.reset();
  if (schema_.layered()) {
    const laz::OpenBytes open = [&](std::uint64_t from, std::uint64_t to) {
      const std::uint64_t maximum = end_ - begin_;
      return std::make_unique<FileFeed>(file_, begin_ + std::min(from, maximum),
                                        begin_ + std::min(to, maximum), release_);
    };
    if (laz::read_layered_head(schema_, open).points != left_)
      throw laz::Damage("it counts other points than the chunk table gives it");
    decoder_ = laz::decode_layered(schema_, open, layers_);
  } else {
    decoder_ = laz::decode_pointwise(schema_, *feed_);
  }
  unit_left_ = chunks_.in_order && schema_.chunked() ? schema_.chunk_points : left_;
}

void LazRecords::fail(const laz::Damage& e) const {
  throw InputError(file_.path().string() + ": byte " + std::to_string(begin_) + ": chunk " +
                   std::to_string(next_) + " of " + std::to_string(chunks_.size()) +
                   " is damaged: " + e.what() + "; get the file anew, or compress it anew from the original");
}

}  // namespace tessera
