#include "stream/change/change_cells.h"

#include <algorithm>
#include <cmath>

namespace tessera {
namespace {

constexpr std::size_t kWorst = 10;

/// Larger change first, then the cell of lower y, then x.
bool is_worse(const ChangeCell& a, const ChangeCell& b) {
  const double l = std::abs(a.mean), r = std::abs(b.mean);
  if (l != r) return l > r;
  return a.y != b.y ? a.y < b.y : a.x < b.x;
}

}  // namespace

ChangeCells::ChangeCells(double size, double max_distance, const std::filesystem::path& temp,
                         std::uint64_t memory_bytes)
    : size_(size), max_distance_(max_distance), sort_(temp, memory_bytes) {}

void ChangeCells::add(std::span<const PlacedChange> points) {
  std::vector<Part> parts;
  parts.reserve(points.size());
  for (const PlacedChange& p : points) {
    Part part;
    part.x = static_cast<std::int64_t>(std::floor(p.position[0] / size_));
    part.y = static_cast<std::int64_t>(std::floor(p.position[1] / size_));
    part.count = 1, part.significant = p.significant ? 1 : 0;
    part.sum = FixedSum(max_distance_);
    part.sum.add(p.distance);
    // Neighbours come one after the other: most are joined here.
    if (!parts.empty() && parts.back().x == part.x && parts.back().y == part.y) {
      Part& last = parts.back();
      last.count += 1, last.significant += part.significant, last.sum.add(part.sum);
    } else {
      parts.push_back(part);
    }
  }
  std::sort(parts.begin(), parts.end());  // sums are whole numbers: the order of equal ones does not matter
  for (std::size_t i = 0; i < parts.size();) {
    Part joined = parts[i++];
    for (; i < parts.size() && parts[i].x == joined.x && parts[i].y == joined.y; ++i)
      joined.count += parts[i].count, joined.significant += parts[i].significant,
          joined.sum.add(parts[i].sum);
    const std::array<std::int64_t, 2> at = {joined.x, joined.y};
    for (std::size_t a = 0; a < 2; ++a) {
      low_[a] = any_ ? std::min(low_[a], at[a]) : at[a];
      high_[a] = any_ ? std::max(high_[a], at[a]) : at[a];
    }
    any_ = true;
    sort_.add(joined);
  }
}

void ChangeCells::drain(const std::function<void(const ChangeCell&)>& sink) {
  Part open;
  const auto close = [&] {
    if (open.count == 0) return;
    sink({open.x, open.y, open.count, open.significant, open.sum.value() / static_cast<double>(open.count)});
  };
  sort_.drain([&](std::span<const Part> some) {
    for (const Part& p : some) {
      if (open.count > 0 && p.x == open.x && p.y == open.y) {
        open.count += p.count, open.significant += p.significant, open.sum.add(p.sum);
        continue;
      }
      close();
      open = p;
    }
  });
  close();
}

ChangeArea change_area(ChangeCells& cells, const std::function<void(const ChangeCell&)>& each) {
  ChangeArea out;
  out.cell = cells.size();
  std::uint64_t compared = 0, significant = 0;
  cells.drain([&](const ChangeCell& c) {
    ++compared;
    if (each) each(c);
    if (2 * c.significant <= c.count) return;
    ++significant;
    if (out.worst.size() == kWorst && !is_worse(c, out.worst.back())) return;
    out.worst.insert(std::upper_bound(out.worst.begin(), out.worst.end(), c, is_worse), c);
    if (out.worst.size() > kWorst) out.worst.pop_back();
  });
  out.compared = static_cast<double>(compared) * out.cell * out.cell;
  out.significant = static_cast<double>(significant) * out.cell * out.cell;
  return out;
}

}  // namespace tessera
