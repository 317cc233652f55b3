#include "stream/formats/points/point_records.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace tessera {

namespace {

/// Records decoded per pass over the columns, so that they stay in the first-level cache.
constexpr std::size_t kBlock = 512;

template <class To, class From, bool kSwap>
void decode(const char* p, std::size_t stride, std::size_t n, To* out) {
  for (std::size_t i = 0; i < n; ++i, p += stride) out[i] = static_cast<To>(load_scalar<From, kSwap>(p));
}

template <class To>
void decode_column(const PointColumn& column, const PointRecordLayout& layout, const char* records,
                   std::size_t n, To* out) {
  const char* p = records + column.offset;
  visit_scalar_type(column.type, [&](auto zero) {
    using From = decltype(zero);
    if (layout.big_endian) {
      decode<To, From, true>(p, layout.stride, n, out);
    } else {
      decode<To, From, false>(p, layout.stride, n, out);
    }
  });
}

void decode_colours(const PointRecordLayout& layout, const char* records, std::size_t n, std::uint32_t* out) {
  double component[3][kBlock];
  for (std::size_t c = 0; c < 3; ++c) decode_column(layout.colour[c], layout, records, n, component[c]);
  for (std::size_t i = 0; i < n; ++i) {
    out[i] = pack_rgb(colour_byte(component[0][i], layout.colour_scale),
                      colour_byte(component[1][i], layout.colour_scale),
                      colour_byte(component[2][i], layout.colour_scale));
  }
}

/// Positions of a fixed sample of records [first, last): 64 runs of 64 at even distances, or all.
template <class F>
void for_sampled_records(const ReadFile& file, std::uint64_t begin, std::uint64_t first, std::uint64_t last,
                         const PointRecordLayout& layout, F&& f) {
  constexpr std::uint64_t kRuns = 64;
  constexpr std::uint64_t kRun = 64;
  PointRecordLayout positions = layout;
  positions.normal = positions.colour = {};
  std::vector<char> records;
  for (std::uint64_t at = first, step = std::max((last - first) / kRuns, kRun); at < last; at += step) {
    const auto n = static_cast<std::size_t>(std::min(kRun, last - at));
    records.resize(n * layout.stride);
    file.read_at(begin + at * layout.stride, records.data(), records.size());
    PointChunk chunk;
    append_records(positions, records.data(), n, chunk);
    for (std::size_t i = 0; i < n; ++i)
      f(Double3{chunk.x[i], chunk.y[i], chunk.z[i]},
        std::string_view(records.data() + i * layout.stride, layout.stride));
  }
}

/// The box of a sample of the declared records, widened by ten times its size: text read as numbers lies far outside.
PointBox sampled_bounds(const ReadFile& file, std::uint64_t begin, std::uint64_t declared,
                        const PointRecordLayout& layout) {
  PointBox box;
  std::swap(box.min, box.max);
  for_sampled_records(file, begin, 0, declared, layout, [&](const Double3& p, std::string_view) {
    if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) return;
    for (std::size_t a = 0; a < 3; ++a) {
      box.min[a] = std::min(box.min[a], p[a]);
      box.max[a] = std::max(box.max[a], p[a]);
    }
  });
  double extent = 0;
  for (std::size_t a = 0; a < 3; ++a) extent = std::max(extent, box.max[a] - box.min[a]);
  for (std::size_t a = 0; a < 3; ++a) box.min[a] -= 10 * extent, box.max[a] += 10 * extent;
  return box;
}

/// Whether a sample of the records beyond the declared ones lies within the bounds, and is not padding for the most part.
bool surplus_fits(const ReadFile& file, std::uint64_t begin, std::uint64_t declared, std::uint64_t found,
                  const PointRecordLayout& layout, const std::optional<PointBox>& bounds) {
  const PointBox box = bounds ? *bounds : sampled_bounds(file, begin, declared, layout);
  bool inside = true;
  std::uint64_t all = 0;
  std::uint64_t filled = 0;  // with one byte, as padding is
  for_sampled_records(file, begin, declared, found, layout, [&](const Double3& p, std::string_view record) {
    for (std::size_t a = 0; a < 3; ++a) {
      // Headers hold rounded numbers.
      const double slack =
          1e-6 * (box.max[a] - box.min[a]) + (layout.scaled ? std::fabs(layout.scale[a]) : 0.0);
      inside = inside && p[a] >= box.min[a] - slack && p[a] <= box.max[a] + slack;
    }
    ++all;
    filled += record.find_first_not_of(record[0]) == std::string_view::npos ? 1 : 0;
  });
  return inside && 2 * filled <= all;
}

}  // namespace

void append_records(const PointRecordLayout& layout, const char* records, std::size_t count,
                    PointChunk& chunk) {
  const std::size_t first = chunk.size();
  std::array<std::vector<double>*, 3> position = {&chunk.x, &chunk.y, &chunk.z};
  std::array<std::vector<float>*, 3> normal = {&chunk.nx, &chunk.ny, &chunk.nz};
  const bool normals = layout.normal[0].there();
  const bool colours = layout.colour[0].there();
  for (auto* v : position) v->resize(first + count);
  if (normals) {
    for (auto* v : normal) v->resize(first + count);
  }
  if (colours) chunk.rgba.resize(first + count);
  for (std::size_t done = 0; done < count; done += kBlock) {
    const std::size_t n = std::min(kBlock, count - done);
    const char* block = records + done * layout.stride;
    for (std::size_t a = 0; a < 3; ++a) {
      double* out = position[a]->data() + first + done;
      decode_column(layout.position[a], layout, block, n, out);
      if (layout.scaled) {
        for (std::size_t i = 0; i < n; ++i) out[i] = out[i] * layout.scale[a] + layout.shift[a];
      }
      if (normals) decode_column(layout.normal[a], layout, block, n, normal[a]->data() + first + done);
    }
    if (colours) decode_colours(layout, block, n, chunk.rgba.data() + first + done);
  }
}

void append_values(const PointValues& values, const PointAttributes& has, ColourScale scale,
                   PointChunk& chunk) {
  chunk.x.push_back(values[0]), chunk.y.push_back(values[1]), chunk.z.push_back(values[2]);
  if (has.normals) {
    chunk.nx.push_back(static_cast<float>(values[3]));
    chunk.ny.push_back(static_cast<float>(values[4]));
    chunk.nz.push_back(static_cast<float>(values[5]));
  }
  if (has.colour) {
    chunk.rgba.push_back(pack_rgb(colour_byte(values[6], scale), colour_byte(values[7], scale),
                                  colour_byte(values[8], scale)));
  }
}

ColourScale sample_colour_scale(
    std::uint64_t count, const PointRecordLayout& layout,
    const std::function<std::string_view(std::uint64_t first, std::size_t number)>& read) {
  constexpr std::uint64_t kRuns = 64;
  constexpr std::uint64_t kRun = 256;
  const ScalarType type = layout.colour[0].type;
  if (scalar_bytes(type) == 1 || count == 0) return colour_scale_for(type, 0);
  const std::uint64_t step = std::max<std::uint64_t>(count / kRuns, kRun);
  const double enough = scalar_is_float(type) ? 256 : 255;  // nothing further changes the answer
  double largest = 0;
  for (std::uint64_t at = 0; at < count && largest <= enough; at += step) {
    const std::string_view records = read(at, static_cast<std::size_t>(std::min(kRun, count - at)));
    const std::size_t n = records.size() / layout.stride;
    double values[kRun];
    for (const PointColumn& column : layout.colour) {
      decode_column(column, layout, records.data(), n, values);
      for (std::size_t i = 0; i < n; ++i) {
        if (values[i] > largest) largest = values[i];
      }
    }
  }
  return colour_scale_for(type, largest);
}

ColourScale sample_colour_scale(const ReadFile& file, std::uint64_t begin, std::uint64_t count,
                                const PointRecordLayout& layout) {
  const std::uint64_t end = begin + count * layout.stride;
  std::optional<ByteWindow> window;
  return sample_colour_scale(count, layout, [&](std::uint64_t first, std::size_t number) {
    const std::size_t bytes = number * layout.stride;
    window.emplace(file, begin + first * layout.stride, end, bytes);
    return window->peek(bytes).substr(0, bytes);
  });
}

std::vector<InputSlice> even_slices(std::uint32_t file, std::uint64_t begin, std::uint64_t end,
                                    std::uint64_t unit_bytes, std::uint64_t target_bytes) {
  const std::uint64_t units = end - begin;
  // At most a million slices, whatever is asked for: their list must stay small.
  const std::uint64_t step =
      std::max<std::uint64_t>({1, target_bytes / std::max<std::uint64_t>(1, unit_bytes), units >> 20});
  std::vector<InputSlice> slices;
  std::uint64_t at = begin;
  do {
    const std::uint64_t n = std::min(step, end - at);
    slices.push_back({file, at, at + n, n * unit_bytes});
    at += n;
  } while (at < begin + units);
  return slices;
}

RecordCount verified_count(const ReadFile& file, std::uint64_t begin, std::uint64_t end,
                           std::uint64_t declared, const PointRecordLayout& layout, bool closing,
                           const std::optional<PointBox>& bounds) {
  const std::uint64_t space = end - begin;
  const std::uint64_t found = space / layout.stride;
  const auto sentence = [&](const std::string& rest) {
    return "the header declares " + std::to_string(declared) + " points, the file has room for " +
           std::to_string(found) + rest;
  };
  RecordCount result;
  result.usable = std::min(declared, found);
  if (found < declared) {
    result.missing = declared - found;
    result.warning = sentence(": it is truncated, or the count is wrong");
  } else if (closing && found > declared) {
    const bool fills = declared == 0 || space % layout.stride == 0;
    const bool all = fills && (declared == 0 || surplus_fits(file, begin, declared, found, layout, bounds));
    if (all) result.usable = found;
    result.warning =
        sentence(all     ? ": all of them are read"
                 : fills ? ": what follows the declared ones lies outside the bounds and is no point"
                         : " and more bytes: the declared ones are read");
  }
  return result;
}

}  // namespace tessera
