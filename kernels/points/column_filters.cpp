#include "kernels/points/column_filters.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>

#include "octree/lanes.h"

// Loops run along rows and over many columns at once: down a row of columns every step would be a line of cache of its own.

namespace tessera {
namespace {

template <class Number>
std::vector<Number> sums_around(ColumnSquare s, const std::vector<Number>& in, int radius) {
  const auto edge = static_cast<std::size_t>(s.edge);
  std::vector<Number> out(in.size()), down(edge);
  const auto add = [&](int v, Number sign) {
    const Number* row = in.data() + s.at(0, v);
    for (std::size_t u = 0; u < edge; ++u) down[u] += sign * row[u];
  };
  for (int v = 0; v < std::min(radius, s.edge); ++v) add(v, 1);
  for (int v = 0; v < s.edge; ++v) {
    if (v + radius < s.edge) add(v + radius, 1);
    if (v - radius - 1 >= 0) add(v - radius - 1, -1);
    Number* row = out.data() + s.at(0, v);
    Number sum = 0;
    for (int u = 0; u < std::min(radius, s.edge); ++u) sum += down[static_cast<std::size_t>(u)];
    for (int u = 0; u < s.edge; ++u) {
      if (u + radius < s.edge) sum += down[static_cast<std::size_t>(u + radius)];
      if (u - radius - 1 >= 0) sum -= down[static_cast<std::size_t>(u - radius - 1)];
      row[u] = sum;
    }
  }
  return out;
}

/// Of every run of `width` values the combination, in place; the last ones are of what is left. Windows grow by doubling.
template <class Value, class Combine>
void combine_runs(std::vector<Value>& row, std::size_t width, const Combine& combine) {
  for (std::size_t have = 1; have < width;) {
    const std::size_t step = std::min(have, width - have);
    Value* values = row.data();
    const std::size_t n = row.size() - std::min(step, row.size());
#pragma GCC ivdep
    for (std::size_t i = 0; i < n; ++i) values[i] = combine(values[i], values[i + step]);
    have += step;
  }
}

/// Over squares of this radius, cut off at the rim. \param none  combined with a value gives that
template <class Value, class Combine>
std::vector<Value> combine_around(ColumnSquare s, const std::vector<Value>& in, int radius, Value none,
                                  const Combine& combine) {
  const auto edge = static_cast<std::size_t>(s.edge);
  const auto width = 2 * static_cast<std::size_t>(radius) + 1;
  // Along rows, with what lies beyond their ends.
  std::vector<Value> out(in.size()), row(edge + 2 * static_cast<std::size_t>(radius));
  for (int v = 0; v < s.edge; ++v) {
    std::fill(row.begin(), row.end(), none);
    std::copy_n(in.begin() + static_cast<std::ptrdiff_t>(s.at(0, v)), edge, row.begin() + radius);
    combine_runs(row, width, combine);
    std::copy_n(row.begin(), edge, out.begin() + static_cast<std::ptrdiff_t>(s.at(0, v)));
  }
  // Down, by doubling too: first the windows that begin at a row, then they are moved to the middle of theirs.
  const auto rows = [&](Value* to, const Value* other) {
#pragma GCC ivdep
    for (std::size_t u = 0; u < edge; ++u) to[u] = combine(to[u], other[u]);
  };
  // Windows of radius + 1 rows, of which one that begins at a row and one that ends at it are all around it.
  const std::size_t half = static_cast<std::size_t>(radius) + 1;
  for (std::size_t have = 1; have < half;) {
    const std::size_t step = std::min(have, half - have);
    for (int v = 0; v + static_cast<int>(step) < s.edge; ++v)
      rows(out.data() + s.at(0, v), out.data() + s.at(0, v + static_cast<int>(step)));
    have += step;
  }
  for (int v = s.edge - 1; v > 0; --v)  // windows that begin before the first row are cut off
    rows(out.data() + s.at(0, v), out.data() + s.at(0, std::max(0, v - radius)));
  return out;
}

/// What a mask holds, or where `set` is false what it does not: 1, else 0.
std::vector<std::uint8_t> members(const std::vector<std::uint8_t>& mask, bool set) {
  std::vector<std::uint8_t> out(mask.size());
  for (std::size_t i = 0; i < mask.size(); ++i) out[i] = (mask[i] != 0) == set;
  return out;
}

void turn_over(std::vector<std::uint8_t>& mask) {
  for (std::uint8_t& m : mask) m ^= 1;
}

constexpr auto kUnite = [](std::uint8_t a, std::uint8_t b) { return static_cast<std::uint8_t>(a | b); };

void put_in_order(Int8& low, Int8& high) {
  const Int8 a = low;
  low = a < high ? a : high;
  high = a < high ? high : a;
}

/// The lowest of the first n values comes to the front, the highest to the end.
template <std::size_t n, std::size_t size>
void part_extremes(std::array<Int8, size>& value) {
  for (std::size_t i = 0; i < n / 2; ++i) put_in_order(value[i], value[n - 1 - i]);
  for (std::size_t i = 1; i < (n + 1) / 2; ++i) put_in_order(value[0], value[i]);
  for (std::size_t i = n / 2; i < n - 1; ++i) put_in_order(value[i], value[n - 1]);
}

constexpr int kMedianRadius = 2;
constexpr std::size_t kMedianColumns = 25;
/// Values from which on the lowest and the highest are not the median of 25, whatever the others are.
constexpr std::size_t kKept = kMedianColumns / 2 + 2;

/// Forgets the lowest and the highest of the kept values, takes in the next one, until three are left.
template <std::size_t n, class Next>
void forget_extremes(std::array<Int8, kKept>& kept, const Next& next) {
  part_extremes<n>(kept);
  if constexpr (n > 3) {
    next(kept[0]);
    forget_extremes<n - 1>(kept, next);
  }
}

/// Lower medians of 25 heights each. Of n that there are it is the one in place (n - 1) / 2, and so in place 12 of 25 once what
/// is missing counts as lowest and as highest by turns. \param next  gives the next height of each column
template <class Next>
Int8 lower_medians(const Next& next) {
  Int8 turn = {};
  const auto take = [&](Int8& to) {
    to = next();
    const Int8 missing = to == kNoHeight;
    to ^= missing & turn;  // kNoHeight is the lowest of all, and all its bits turned over the highest
    turn ^= missing;
  };
  std::array<Int8, kKept> kept;
  for (Int8& lanes : kept) take(lanes);
  forget_extremes<kKept>(kept, take);
  return kept[1];
}
static_assert(~kNoHeight == std::numeric_limits<std::int32_t>::max());

}  // namespace

std::vector<std::int64_t> box_sums(ColumnSquare s, const std::vector<std::int64_t>& in, int radius) {
  return sums_around(s, in, radius);
}
std::vector<std::int32_t> box_sums(ColumnSquare s, const std::vector<std::int32_t>& in, int radius) {
  return sums_around(s, in, radius);
}

std::vector<std::uint8_t> dilate(ColumnSquare s, const std::vector<std::uint8_t>& mask, int radius,
                                 bool set) {
  std::vector<std::uint8_t> out = combine_around(s, members(mask, set), radius, std::uint8_t{0}, kUnite);
  if (!set) turn_over(out);
  return out;
}

std::vector<std::uint8_t> dilate_round(ColumnSquare s, const std::vector<std::uint8_t>& mask, int radius,
                                       bool set) {
  const int square = (2 * radius + 2) / 5;
  std::vector<std::uint8_t> out = combine_around(s, members(mask, set), square, std::uint8_t{0}, kUnite),
                            before;
  const auto edge = static_cast<std::size_t>(s.edge);
  const auto spread = [](std::uint8_t* to, const std::uint8_t* from, std::size_t n) {
    for (std::size_t u = 0; u < n; ++u) to[u] |= from[u];
  };
  for (int step = square; step < radius; ++step) {
    before = out;
    for (int v = 0; v < s.edge; ++v) {
      std::uint8_t* to = out.data() + s.at(0, v);
      const std::uint8_t* here = before.data() + s.at(0, v);
      spread(to + 1, here, edge - 1);
      spread(to, here + 1, edge - 1);
      if (v > 0) spread(to, here - edge, edge);
      if (v + 1 < s.edge) spread(to, here + edge, edge);
    }
  }
  if (!set) turn_over(out);
  return out;
}

std::vector<std::int32_t> median5(ColumnSquare s, const std::vector<std::int32_t>& height,
                                  const std::vector<std::uint8_t>& wanted) {
  std::vector<std::int32_t> out = height;
  // The rows around one, with what lies beyond their ends, so that lanes may read there.
  constexpr std::size_t kRows = 2 * kMedianRadius + 1;
  const std::size_t edge = static_cast<std::size_t>(s.edge), stride = edge + 2 * kMedianRadius + kLanes;
  std::array<std::vector<std::int32_t>, kRows> rows;
  for (std::vector<std::int32_t>& row : rows) row.assign(stride, kNoHeight);
  const auto row_of = [&](int v) -> std::vector<std::int32_t>& {
    return rows[static_cast<std::size_t>(v + static_cast<int>(kRows)) % kRows];
  };
  const auto load = [&](int v) {
    std::vector<std::int32_t>& row = row_of(v);
    if (v >= s.edge)
      std::fill(row.begin(), row.end(), kNoHeight);
    else
      std::copy_n(height.begin() + static_cast<std::ptrdiff_t>(s.at(0, v)), edge,
                  row.begin() + kMedianRadius);
  };
  for (int v = 0; v < kMedianRadius; ++v) load(v);
  for (int v = 0; v < s.edge; ++v) {
    load(v + kMedianRadius);
    const std::uint8_t* want = wanted.data() + s.at(0, v);
    std::int32_t* to = out.data() + s.at(0, v);
    for (std::size_t u = 0; u < edge; u += kLanes) {
      const std::size_t end = std::min(kLanes, edge - u);
      bool any = false;
      for (std::size_t l = 0; l < end; ++l) any = any || (want[u + l] != 0 && to[u + l] != kNoHeight);
      if (!any) continue;
      int dv = -kMedianRadius;
      std::size_t du = 0;
      const Int8 median = lower_medians([&] {
        Int8 lanes;
        std::memcpy(&lanes, row_of(v + dv).data() + u + du, sizeof(lanes));
        if (++du == kRows) du = 0, ++dv;
        return lanes;
      });
      for (std::size_t l = 0; l < end; ++l)
        if (want[u + l] != 0 && to[u + l] != kNoHeight) to[u + l] = median[l];
    }
  }
  return out;
}

std::vector<std::int32_t> extreme_around(ColumnSquare s, const std::vector<std::int32_t>& height,
                                         const std::vector<std::uint8_t>& wanted, int radius, bool highest) {
  // kNoHeight is the lowest of all; to look for the lowest that there is, all bits of the heights are turned over.
  const std::int32_t turn = highest ? 0 : -1;
  std::vector<std::int32_t> out(height.size());
  for (std::size_t i = 0; i < height.size(); ++i)
    out[i] = height[i] == kNoHeight ? kNoHeight : height[i] ^ turn;
  out =
      combine_around(s, out, radius, kNoHeight, [](std::int32_t a, std::int32_t b) { return a < b ? b : a; });
  for (std::size_t i = 0; i < height.size(); ++i)
    out[i] = wanted[i] == 0 || out[i] == kNoHeight ? kNoHeight : out[i] ^ turn;
  return out;
}

}  // namespace tessera
