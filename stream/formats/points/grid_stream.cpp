#include "stream/formats/points/grid_stream.h"

#include <array>
#include <cmath>

namespace tessera {

void GridStream::next(std::int64_t line) {
  if (lines_.empty() || lines_.back().index != line) {
    if (lines_.size() > emitted_ + kGridRadius) emit(emitted_);
    drop_old();
    lines_.emplace_back();
    lines_.back().index = line;
    lines_.back().whole = !cut_;
    cut_ = false;
  }
  Line& now = lines_.back();
  if (++now.records > max_) now.whole = false;
}

void GridStream::add(std::int64_t cell, const PointChunk& from, std::size_t i, bool wanted) {
  Line& now = lines_.back();
  const Double3 sample = {from.x[i] - scanner_[0], from.y[i] - scanner_[1], from.z[i] - scanner_[2]};
  if (now.whole && std::isfinite(sample[0]) && std::isfinite(sample[1]) && std::isfinite(sample[2]))
    now.grid.put(cell, sample);
  if (!wanted) return;
  now.points.append(from, i);
  now.cells.push_back(cell);
}

void GridStream::finish(bool ends) {
  if (!lines_.empty() && !ends) lines_.back().whole = false;
  while (emitted_ < lines_.size()) emit(emitted_);
}

/// Lines that no point asks for any more.
void GridStream::drop_old() {
  while (emitted_ > kGridRadius) {
    lines_.pop_front();
    --emitted_;
  }
}

void GridStream::emit(std::size_t at) {
  Line& line = lines_[at];
  std::array<const GridLine*, kGridLines> window{};
  const std::size_t first = at < kGridRadius ? 0 : at - kGridRadius;
  for (std::size_t l = first; l < lines_.size() && l <= at + kGridRadius; ++l) {
    const std::int64_t off = lines_[l].index - line.index;
    if (!lines_[l].whole || off < -kGridRadius || off > kGridRadius) continue;
    const GridLine*& slot = window[static_cast<std::size_t>(off + kGridRadius)];
    if (!slot || l == at) slot = &lines_[l].grid;
  }
  for (std::size_t i = 0; i < line.points.size(); ++i) {
    PointChunk& to = out_.chunk();
    to.append(line.points, i);
    Float3 n = {0, 0, 0};
    if (line.whole && line.grid.find(line.cells[i])) n = grid_normal(window, line.cells[i]);
    to.nx.push_back(n[0]), to.ny.push_back(n[1]), to.nz.push_back(n[2]);
    out_.added();
  }
  line.points.clear();
  line.cells.clear();
  ++emitted_;
}

}  // namespace tessera
