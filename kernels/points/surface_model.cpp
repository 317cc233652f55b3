#include "kernels/points/surface_model.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <optional>

#include "kernels/points/column_filters.h"
#include "kernels/points/thin_columns.h"

namespace tessera {
namespace {

constexpr std::int32_t kCell = kQuantaPerCell;

/// Depth of a layer, and how many points it must hold: one in so many of its column, but at least two of several, and no more
/// than a wall leaves in it.
constexpr std::int32_t kLayerDepth = 3 * kCell;
constexpr std::size_t kLayerShare = 8, kFewestInLayer = 2, kMostInLayer = 3;

/// Holes no wider than twice this are filled, columns.
constexpr int kFillRadius = 10;
constexpr int kFillRounds = 12;
/// How much a column that was not seen may stand above the lowest of its neighbours: what hides the ground is not filled
/// at its own height.
constexpr std::int32_t kFillRise = kCell / 2;

/// Steps of diffusion, and the height across which it does not go: a part for the lattice, and times the local noise.
constexpr int kDiffusionSteps = 12;
/// Of the ground, which depends on more columns by then: all together must stay within the halo.
constexpr int kGroundSteps = 2;
constexpr std::int32_t kStepCells = 2 * kCell;
constexpr std::int32_t kStepNoise = 3, kMaxNoise = 2 * kCell;
constexpr int kNoiseRadius = 2;
constexpr int kVoteRadius = 2;  ///< of the majority of strewn points
constexpr int kOpenRadius = 2;  ///< wires, poles and people are thinner
constexpr int kCloseRadius = 2;
constexpr int kActiveMargin = 2;  ///< columns around those that stand that take part in the diffusion
/// Samples go down the steps of the model a cell apart.
constexpr std::int32_t kSampleStep = kCell;
/// Of a skin half as far: no measured wall and no ground below helps them against the points at their foot, which are dense.
constexpr std::int32_t kSkinStep = kCell / 2;
/// A step so high is a wall, measured or bare. The model stands beside bare ones, and hides what is so near behind them.
constexpr std::int32_t kBareStep = 3 * kCell;
constexpr int kBareMargin = 1, kBareColumns = 3;
/// A wall was measured where steep points, one a cell, hold half of its height, or farther away, below eaves, eight tenths.
constexpr int kNearColumns = 4, kWallColumns = 24;
constexpr double kNearWall = 2.0, kFarWall = 1.25;
constexpr int kWallParts = 16;   ///< that the height is looked at in
constexpr int kWallFacing = 38;  ///< of 127, towards the low side
constexpr std::int32_t kWallGap = kCell;
/// Such a wall reaches so far beyond its points.
constexpr std::int32_t kWallMargin = 3 * kCell;
/// A layer so far from the median around it is rough.
constexpr std::int32_t kRoughCells = kCell;
/// A bottom so near the median around it is smooth.
constexpr std::int32_t kSmoothBottom = kCell;
/// Pits in what stands, no wider than twice this, are closed.
constexpr int kPitRadius = 4;

/// Walls that nobody saw: from so far below their upper edge on they have the mean colour of so many columns behind it and to
/// both sides. With that of its own column alone each would be a streak down to the ground.
constexpr std::uint32_t kWallFade = 4 * kQuantaPerCell;
constexpr int kWallColours = 8;

/// Columns within `radius` of those with this flag.
std::vector<std::uint8_t> dilate_flags(ColumnSquare s, const std::vector<std::uint8_t>& flags,
                                       std::uint8_t flag, int radius) {
  std::vector<std::uint8_t> mask(flags.size());
  for (std::size_t i = 0; i < flags.size(); ++i) mask[i] = (flags[i] & flag) != 0;
  return dilate(s, mask, radius);
}
/// Heights and colours of empty columns inside, from the low sides: by rounds, each column from its neighbours of the round
/// before, so that it depends on no more columns than there are rounds.
void fill_empty(ColumnSquare s, const std::vector<std::uint8_t>& inside, std::vector<std::int32_t>& height,
                std::vector<std::uint32_t>& rgba) {
  std::vector<std::size_t> empty;
  for (int v = 1; v + 1 < s.edge; ++v)
    for (int u = 1; u + 1 < s.edge; ++u)
      if (inside[s.at(u, v)] != 0 && height[s.at(u, v)] == kNoHeight) empty.push_back(s.at(u, v));
  const auto row = static_cast<std::ptrdiff_t>(s.edge);
  const std::array<std::ptrdiff_t, 8> around = {-row, -1, 1, row, -row - 1, -row + 1, row - 1, row + 1};
  std::vector<std::pair<std::int32_t, std::uint32_t>> next(empty.size());
  for (int round = 0; round < kFillRounds; ++round) {
    for (std::size_t e = 0; e < empty.size(); ++e) {
      next[e] = {height[empty[e]], rgba[empty[e]]};
      for (const std::ptrdiff_t d : around) {
        const auto n = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(empty[e]) + d);
        if (height[n] == kNoHeight) continue;
        const std::int32_t here = height[n] + kFillRise;
        if (next[e].first == kNoHeight || here < next[e].first) next[e] = {here, rgba[n]};
      }
    }
    for (std::size_t e = 0; e < empty.size(); ++e)
      height[empty[e]] = next[e].first, rgba[empty[e]] = next[e].second;
  }
}

/// Closes pits where it is wanted: the lowest of the highest around.
void close_pits(ColumnSquare s, const std::vector<std::uint8_t>& wanted, std::vector<std::int32_t>& height) {
  const std::vector<std::int32_t> high =
      extreme_around(s, height, dilate(s, wanted, kPitRadius), kPitRadius, true);
  const std::vector<std::int32_t> closed = extreme_around(s, high, wanted, kPitRadius, false);
  for (std::size_t i = 0; i < height.size(); ++i)
    if (wanted[i] != 0 && height[i] != kNoHeight) height[i] = std::max(height[i], closed[i]);
}

/// Steps of diffusion between neighbours no farther apart than the step that the noise allows.
void diffuse(ColumnSquare s, const std::vector<std::uint8_t>& active, const std::vector<std::int32_t>& noise,
             int steps, std::vector<std::int32_t>& height) {
  std::vector<std::size_t> columns;
  for (int v = 1; v + 1 < s.edge; ++v)
    for (int u = 1; u + 1 < s.edge; ++u)
      if (active[s.at(u, v)] != 0 && height[s.at(u, v)] != kNoHeight) columns.push_back(s.at(u, v));
  const auto row = static_cast<std::ptrdiff_t>(s.edge);
  const std::array<std::ptrdiff_t, 8> around = {-row, -1, 1, row, -row - 1, -row + 1, row - 1, row + 1};
  std::vector<std::int32_t> next(columns.size());
  for (int step = 0; step < steps; ++step) {
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const std::size_t i = columns[c];
      std::int64_t flow = 0;
      for (std::size_t k = 0; k < around.size(); ++k) {
        const auto n = static_cast<std::size_t>(static_cast<std::ptrdiff_t>(i) + around[k]);
        if (height[n] == kNoHeight) continue;
        const std::int64_t d = std::int64_t{height[n]} - height[i];
        const std::int64_t limit =
            kStepCells + kStepNoise * (std::min(noise[i], kMaxNoise) + std::min(noise[n], kMaxNoise)) / 2;
        if (std::abs(d) <= limit) flow += k < 4 ? 2 * d : d;
      }
      next[c] = height[i] + static_cast<std::int32_t>((flow + 8) >> 4);
    }
    for (std::size_t c = 0; c < columns.size(); ++c) height[columns[c]] = next[c];
  }
}

/// Steps of a column towards the next one along an axis.
struct Step {
  int u, v, axis;
  std::int32_t here, there;  ///< heights
};

/// Calls use(columns to there, low, high) for the walls that steep points show at the foot of a step or below its high side, facing back from
/// there: a roof may hang over them, and where it runs across the lattice its edge has jogs, whose wall lies to their side.
/// Ends when it gives true.
template <class Use>
void for_walls_of(const SurfaceModel& model, const Step& step, const Use& use) {
  const bool rises = step.there > step.here, along_u = step.axis == 0;
  const int high_u = step.u + (rises && along_u ? 1 : 0), high_v = step.v + (rises && !along_u ? 1 : 0);
  const int ahead = rises ? 1 : -1;
  const std::array<std::array<int, 2>, 3> ways = {{{along_u ? ahead : 0, along_u ? 0 : ahead},
                                                   {along_u ? 0 : 1, along_u ? 1 : 0},
                                                   {along_u ? 0 : -1, along_u ? -1 : 0}}};
  for (const auto& [du, dv] : ways)
    for (int k = -1; k <= kWallColumns; ++k)
      for (int side = -1; side <= 1; ++side) {
        const int u = high_u + k * du + side * std::abs(dv), v = high_v + k * dv + side * std::abs(du);
        if (u < 0 || v < 0 || u >= model.edge || v >= model.edge) continue;
        const std::size_t i = model.at(u, v);
        if (model.wall_low[i] == model.wall_high[i]) continue;
        const int facing = -(model.wall_u[i] * du + model.wall_v[i] * dv);
        if (facing >= kWallFacing && use(k, model.wall_low[i], model.wall_high[i])) return;
      }
}

/// Did they show half of the step, or farther below eaves nearly all of it? Those of a steep slope show a part of it each.
bool is_measured(const SurfaceModel& model, const Step& step) {
  const std::int64_t low = std::min(step.here, step.there), height = std::max(step.here, step.there) - low;
  unsigned near = 0, all = 0;
  const auto enough = [&] {
    return kNearWall * std::popcount(near) >= kWallParts || kFarWall * std::popcount(all) >= kWallParts;
  };
  for_walls_of(model, step, [&](int columns, std::int64_t wall_low, std::int64_t wall_high) {
    for (int k = 0; k < kWallParts; ++k) {
      const std::int64_t middle = low + (2 * k + 1) * height / (2 * kWallParts);
      if (middle < wall_low - kCell / 2 || middle > wall_high + kCell / 2) continue;
      all |= 1u << k;
      if (columns <= kNearColumns) near |= 1u << k;
    }
    return enough();
  });
  return enough();
}

/// Or this height of it, or nearly so?
bool is_measured_at(const SurfaceModel& model, const Step& step, std::int32_t height) {
  bool found = false;
  for_walls_of(model, step, [&](int, std::int32_t low, std::int32_t high) {
    return found = height >= low - kWallMargin && height <= high + kWallMargin;
  });
  return found;
}

/// Columns on either side of steps whose wall was not measured, of a skin of all steps. \param wanted  looks at these alone
std::vector<std::uint8_t> bare_steps(const SurfaceModel& model, const std::vector<std::uint8_t>& wanted) {
  std::vector<std::uint8_t> out(model.height.size());
  for (int v = 0; v + 1 < model.edge; ++v)
    for (int u = 0; u + 1 < model.edge; ++u) {
      const std::size_t i = model.at(u, v);
      if (wanted[i] == 0 || model.height[i] == kNoHeight) continue;
      for (int axis = 0; axis < 2; ++axis) {
        const std::size_t j = axis == 0 ? model.at(u + 1, v) : model.at(u, v + 1);
        if (wanted[j] == 0 || model.height[j] == kNoHeight) continue;
        if (std::abs(std::int64_t{model.height[i]} - model.height[j]) >= kBareStep &&
            (is_skin(model.use) || !is_measured(model, {u, v, axis, model.height[i], model.height[j]})))
          out[i] = out[j] = 1;
      }
    }
  return out;
}

/// The smaller of both slopes where they agree in sign, 0 where not: no overshoot at steps.
float minmod(float a, float b) {
  return a * b <= 0.0f ? 0.0f : std::fabs(a) < std::fabs(b) ? a : b;
}

/// \param points  of a column, from above
void measure_walls(std::span<const ColumnPoint> points, ColumnLayers& out) {
  std::int64_t steep = 0, normal_u = 0, normal_v = 0;
  for (const ColumnPoint& p : points) {
    if (!p.steep) continue;
    if (steep++ == 0) out.wall_high = p.height;
    out.wall_low = p.height;
    normal_u += p.normal_u, normal_v += p.normal_v;
  }
  if (steep == 0) return;
  out.wall_u = static_cast<std::int8_t>(normal_u / steep);
  out.wall_v = static_cast<std::int8_t>(normal_v / steep);
  if (steep * kWallGap < out.wall_high - out.wall_low) out.wall_low = out.wall_high;
}

/// Where what stands hides a smooth bottom whose points are called strewn, for the scatter above them: the ground below crowns.
void find_ground(ColumnSquare s, std::span<const ColumnLayers> layers,
                 const std::vector<std::uint8_t>& measured, SurfaceModel& model) {
  const std::size_t n = layers.size();
  std::vector<std::int32_t> bottom(n);
  for (std::size_t i = 0; i < n; ++i) bottom[i] = layers[i].bottom.height;
  const std::vector<std::int32_t> smooth = median5(s, bottom, dilate_flags(s, model.flags, kModelStands, 3));
  std::vector<std::int32_t> near(n), all(n);
  for (std::size_t i = 0; i < n; ++i) {
    all[i] = measured[i];
    near[i] = measured[i] != 0 && std::abs(std::int64_t{bottom[i]} - smooth[i]) <= kSmoothBottom;
  }
  const std::vector<std::int32_t> near_around = box_sums(s, near, 2), all_around = box_sums(s, all, 2);
  std::vector<std::uint8_t> wanted(n);
  for (std::size_t i = 0; i < n; ++i) {
    if (near[i] == 0 || (model.flags[i] & kModelStands) == 0) continue;
    const PointLayer& layer = layers[i].bottom;
    const bool apart = model.height[i] - smooth[i] > kLevelReach + kCell;
    const bool behind = (model.flags[i] & kModelStep) != 0 && smooth[i] > model.foot[i] - kBareStep;
    wanted[i] =
        apart && !behind && 2 * layer.volumetric > layer.points && 10 * near_around[i] >= 7 * all_around[i];
  }
  std::vector<std::int32_t> fitted = median5(s, smooth, wanted);
  diffuse(s, wanted, std::vector<std::int32_t>(n), kGroundSteps, fitted);
  for (std::size_t i = 0; i < n; ++i)
    if (wanted[i] != 0) model.ground[i] = fitted[i], model.ground_rgba[i] = layers[i].bottom.rgba;
}

/// Of a skin, samples stand too in columns of which no measured point will be kept, or it would have holes; the others have the
/// height of their own layer, not of the smooth surface around, so that the samples beside them go down to their points.
void settle_skin(ColumnSquare s, std::span<const ColumnLayers> layers, SurfaceModel& model) {
  for (int v = 1; v + 1 < s.edge; ++v)
    for (int u = 1; u + 1 < s.edge; ++u) {
      const std::size_t i = s.at(u, v);
      const PointLayer& top = layers[i].top;
      if (top.height == kNoHeight || model.height[i] == kNoHeight) continue;
      const bool off = std::abs(std::int64_t{top.height} - model.height[i]) > model.reach(i);
      if (off || 2 * top.volumetric > top.points) model.flags[i] |= kModelStands;
    }
  for (std::size_t i = 0; i < layers.size(); ++i)
    if (layers[i].top.height != kNoHeight && (model.flags[i] & kModelStands) == 0)
      model.height[i] = layers[i].top.height;
}

}  // namespace

PointLayer layer_of(std::span<const ColumnPoint> points) {
  PointLayer layer;
  layer.height = points[points.size() / 2].height;
  std::uint64_t volumetric = 0, coloured = 0;
  std::array<std::uint64_t, 3> colour{};
  for (const ColumnPoint& p : points) {
    volumetric += p.volumetric;
    if ((p.rgba >> 24) == 0) continue;
    ++coloured;
    for (unsigned k = 0; k < 3; ++k) colour[k] += p.rgba >> (8 * k) & 0xff;
  }
  // Where there are more than can be told, a share of them, as they are.
  const std::size_t count = std::min<std::size_t>(points.size(), 0xffff);
  layer.points = static_cast<std::uint16_t>(count);
  layer.volumetric = static_cast<std::uint16_t>(volumetric * count / points.size());
  if (coloured > 0) {
    layer.rgba = 0xff000000u;
    for (unsigned k = 0; k < 3; ++k)
      layer.rgba |= static_cast<std::uint32_t>((colour[k] + coloured / 2) / coloured) << (8 * k);
  }
  return layer;
}

void find_column_layers(std::span<const ColumnPoint> points, std::span<ColumnLayers> layers) {
  // Gathered by column first: what is left to sort are a few points each.
  std::vector<std::uint32_t> place(layers.size() + 1, 0);
  for (const ColumnPoint& p : points) ++place[std::size_t{p.column} + 1];
  std::partial_sum(place.begin(), place.end(), place.begin());
  std::vector<ColumnPoint> gathered(points.size());
  for (const ColumnPoint& p : points) gathered[place[p.column]++] = p;
  for (std::size_t c = 0, first = 0; c < layers.size(); ++c) {
    const std::size_t end = place[c];
    if (end == first) continue;
    const std::span<ColumnPoint> column(gathered.data() + first, end - first);
    std::sort(column.begin(), column.end(),
              [](const ColumnPoint& a, const ColumnPoint& b) { return a.height > b.height; });
    ColumnLayers& out = layers[c];
    const std::size_t n = column.size(),
                      wanted = std::min(n, std::clamp(n / kLayerShare, kFewestInLayer, kMostInLayer));
    // Windows of so many points, from above and from below, until one is no deeper than a layer.
    std::size_t top = 0, bottom = n;
    while (top + wanted < n && column[top].height - column[top + wanted - 1].height > kLayerDepth) ++top;
    while (bottom > wanted && column[bottom - wanted].height - column[bottom - 1].height > kLayerDepth)
      --bottom;
    std::size_t below = top, above = bottom;
    while (below < n && column[top].height - column[below].height <= kLayerDepth) ++below;
    while (above > 0 && column[above - 1].height - column[bottom - 1].height <= kLayerDepth) --above;
    out.top = layer_of(column.subspan(top, below - top));
    out.bottom = layer_of(column.subspan(above, bottom - above));
    out.between =
        static_cast<std::uint16_t>(std::min<std::size_t>(above > below ? above - below : 0, 0xffff));
    measure_walls(column, out);
    first = end;
  }
}

std::int32_t SurfaceModel::reach(std::size_t column) const {
  const std::int32_t level = 2 * kCell + 2 * noise[column];
  if (!is_skin(use) || height[column] == kNoHeight) return level;
  // Within the column the skin rises by no more than this from its middle; beyond a step samples stand anyway.
  std::int32_t rise = 0;
  const auto row = static_cast<std::size_t>(edge);
  for (const std::size_t n : {column - row, column - 1, column + 1, column + row})
    if (height[n] != kNoHeight) rise = std::max(rise, std::abs(height[n] - height[column]));
  return level + std::min(rise, kBareStep) / 2;
}

namespace {

SurfaceModel fit_layers(std::span<const ColumnLayers> layers, int edge, ModelUse use) {
  const ColumnSquare s{edge};
  SurfaceModel model;
  model.edge = edge;
  model.use = use;
  // A layer of the ground follows the layers around: opening it and closing its pits would go beyond the halo.
  const bool skin = is_skin(use), ground = use == ModelUse::kGround || use == ModelUse::kCleared;
  const std::size_t n = layers.size();
  model.wall_low.resize(n), model.wall_high.resize(n), model.wall_u.resize(n), model.wall_v.resize(n);
  model.height.resize(n), model.noise.resize(n), model.rgba.resize(n), model.flags.assign(n, 0);
  model.ground.assign(n, kNoHeight), model.ground_rgba.resize(n);
  std::vector<std::uint8_t> measured(n), hole(n);
  for (std::size_t i = 0; i < n; ++i) {
    model.height[i] = layers[i].top.height, model.rgba[i] = layers[i].top.rgba;
    measured[i] = layers[i].top.height != kNoHeight;
    hole[i] = measured[i] == 0 || layers[i].synthetic;
    model.wall_low[i] = layers[i].wall_low, model.wall_high[i] = layers[i].wall_high;
    model.wall_u[i] = layers[i].wall_u, model.wall_v[i] = layers[i].wall_v;
  }
  // Columns between samples are no holes: those with nothing all around are.
  const std::vector<std::uint8_t> closed =
      dilate_round(s, dilate_round(s, measured, kFillRadius), kFillRadius, false);
  hole = dilate(s, erode(s, hole, 1), 1);

  // Strewn points and rough layers against the others.
  const std::vector<std::int32_t> smooth = median5(s, model.height, measured);
  std::vector<std::int32_t> votes(n);
  for (std::size_t i = 0; i < n; ++i) {
    const bool rough =
        measured[i] != 0 && std::abs(std::int64_t{layers[i].top.height} - smooth[i]) > kRoughCells;
    votes[i] =
        rough ? layers[i].top.points : 2 * std::int32_t{layers[i].top.volumetric} - layers[i].top.points;
  }
  const std::vector<std::int32_t> majority = box_sums(s, votes, kVoteRadius);
  std::vector<std::uint8_t> strewn(n);
  for (std::size_t i = 0; i < n; ++i) strewn[i] = closed[i] != 0 && majority[i] > 0;
  // What is thin hangs over points of its own that stay; a skin has nothing else there.
  if (!skin && !ground) strewn = dilate(s, erode(s, strewn, kOpenRadius), kOpenRadius);
  strewn = erode(s, dilate(s, strewn, kCloseRadius), kCloseRadius);
  model.height = smooth;
  const std::vector<std::uint8_t> beside = dilate(s, bare_steps(model, measured), kBareMargin);
  std::vector<std::uint8_t> stands(n), unsure(n);
  for (std::size_t i = 0; i < n; ++i) {
    const bool filled = (layers[i].synthetic || measured[i] == 0) && closed[i] != 0 && hole[i] != 0;
    if (filled) model.flags[i] |= kModelFilled;
    unsure[i] = filled || layers[i].synthetic || (strewn[i] != 0 && closed[i] != 0);
    stands[i] = unsure[i] != 0 || (beside[i] != 0 && closed[i] != 0);
  }

  // The fit, where the scan tells no surface or the fit depends on it: its fill, its noise, its diffusion.
  const std::vector<std::uint8_t> near = dilate(s, unsure, kActiveMargin + kFillRounds);
  fill_empty(s, closed, model.height, model.rgba);
  model.height = median5(s, model.height, near);
  if (!ground) close_pits(s, unsure, model.height);
  std::vector<std::int64_t> off(n);
  std::vector<std::int32_t> counted(n);
  for (std::size_t i = 0; i < n; ++i)
    if (measured[i] != 0 && near[i] != 0 && !layers[i].synthetic)
      off[i] = std::abs(std::int64_t{layers[i].top.height} - model.height[i]), counted[i] = 1;
  off = box_sums(s, off, kNoiseRadius), counted = box_sums(s, counted, kNoiseRadius);
  for (std::size_t i = 0; i < n; ++i)
    model.noise[i] = counted[i] > 0 ? static_cast<std::int32_t>(off[i] / counted[i]) : 0;
  diffuse(s, dilate(s, unsure, kActiveMargin), model.noise, kDiffusionSteps, model.height);

  const std::vector<std::uint8_t> bare = dilate(s, bare_steps(model, closed), kBareMargin);
  const std::vector<std::uint8_t> by_step = dilate(s, bare, kBareColumns);
  model.foot = extreme_around(s, model.height, by_step, kBareColumns, false);
  for (std::size_t i = 0; i < n; ++i) {
    if (model.height[i] == kNoHeight) {
      model.flags[i] = 0;
      continue;
    }
    if (stands[i] != 0) model.flags[i] |= kModelStands;
    if (layers[i].cleared) model.flags[i] |= kModelCleared;
    if (by_step[i] != 0) model.flags[i] |= kModelStep;
    if (skin) model.flags[i] |= use == ModelUse::kGround ? kModelSkin | kModelGround : kModelSkin;
  }
  if (skin)
    settle_skin(s, layers, model);
  else if (!ground)
    find_ground(s, layers, measured, model);
  return model;
}

}  // namespace

SurfaceModel fit_surface_model(std::span<const ColumnLayers> layers, int edge, ModelUse use) {
  std::vector<std::int32_t> ground;
  std::vector<std::uint8_t> thin;
  if (use != ModelUse::kGround) thin = find_thin_columns(layers, edge, ground);
  if (std::find(thin.begin(), thin.end(), 1) == thin.end()) return fit_layers(layers, edge, use);
  std::vector<ColumnLayers> below(layers.begin(), layers.end());
  for (std::size_t i = 0; i < below.size(); ++i) {
    if (thin[i] == 0) continue;
    ColumnLayers& c = below[i];
    if (c.bottom.height - ground[i] > kThinRise) c.bottom.height = ground[i];  // a column of wires alone
    c.top = c.bottom;
    c.wall_low = c.wall_high = c.bottom.height;
  }
  SurfaceModel model = fit_layers(below, edge, use);
  for (std::size_t i = 0; i < thin.size(); ++i)
    if (thin[i] != 0 && model.height[i] != kNoHeight) model.flags[i] |= kModelThin;
  return model;
}

namespace {

/// Slope of a raster at a column along one axis, cells a cell.
float slope(const std::vector<std::int32_t>& height, std::size_t before, std::size_t here,
            std::size_t after) {
  constexpr float kPerCell = 1.0f / kQuantaPerCell;
  const auto step = [&](std::size_t a, std::size_t b) {
    return static_cast<float>(height[b] - height[a]) * kPerCell;
  };
  const bool left = height[before] != kNoHeight, right = height[after] != kNoHeight;
  if (left && right) return minmod(step(before, here), step(here, after));
  return left ? step(before, here) : right ? step(here, after) : 0.0f;
}

/// Mean colour of the columns behind the upper edge of a step. \param high  the column at it, on the side `to` along the axis
std::uint32_t wall_colour(const SurfaceModel& model, int high_u, int high_v, int axis, int to) {
  std::array<std::uint32_t, 3> sum{};
  std::uint32_t coloured = 0;
  for (int back = 0; back < kWallColours; ++back)
    for (int side = -kWallColours; side <= kWallColours; ++side) {
      const int u = high_u + (axis == 0 ? to * back : side), v = high_v + (axis == 0 ? side : to * back);
      const std::uint32_t rgba = model.rgba[model.at(u, v)];
      if ((rgba >> 24) == 0) continue;
      ++coloured;
      for (std::size_t c = 0; c < 3; ++c) sum[c] += rgba >> (8 * c) & 0xffu;
    }
  if (coloured == 0) return 0;
  std::uint32_t mean = 0xff000000u;
  for (std::size_t c = 0; c < 3; ++c) mean |= (sum[c] + coloured / 2) / coloured << (8 * c);
  return mean;
}

/// From the colour of the upper edge to that of the wall. \param below  quanta below the edge, >= 0
std::uint32_t faded(std::uint32_t edge, std::uint32_t wall, std::int64_t below) {
  if ((edge >> 24) == 0 || (wall >> 24) == 0) return edge;
  const auto part = static_cast<std::uint32_t>(std::min<std::int64_t>(below, kWallFade));
  std::uint32_t out = 0xff000000u;
  for (std::size_t c = 0; c < 3; ++c)
    out |=
        ((edge >> (8 * c) & 0xffu) * (kWallFade - part) + (wall >> (8 * c) & 0xffu) * part + kWallFade / 2) /
            kWallFade
        << (8 * c);
  return out;
}

/// On the raster at a column.
ModelSample level_sample(const SurfaceModel& model, const std::vector<std::int32_t>& height, int u, int v,
                         std::uint32_t rgba) {
  const std::size_t i = model.at(u, v);
  const float su = slope(height, model.at(u - 1, v), i, model.at(u + 1, v));
  const float sv = slope(height, model.at(u, v - 1), i, model.at(u, v + 1));
  return {u * kCell + kCell / 2,
          v * kCell + kCell / 2,
          height[i],
          unit(Float3{-su, -sv, 1.0f}),
          rgba,
          false,
          (model.flags[i] & kModelFilled) != 0};
}

}  // namespace

void sample_surface_model(const SurfaceModel& model, int first, int last,
                          const std::function<void(const ModelSample&)>& use) {
  const std::int32_t low = first * kCell, high = last * kCell;
  const auto inside = [&](const ModelSample& m) {
    return m.u >= low && m.v >= low && m.u < high && m.v < high;
  };
  const auto stands = [&](std::size_t i) { return (model.flags[i] & kModelStands) != 0; };
  // One beyond the range on the low side: the line to a neighbour may end inside.
  for (int v = first - 1; v < last; ++v)
    for (int u = first - 1; u < last; ++u) {
      const std::size_t i = model.at(u, v);
      if (model.height[i] == kNoHeight) continue;
      if (model.ground[i] != kNoHeight) {
        const ModelSample m = level_sample(model, model.ground, u, v, model.ground_rgba[i]);
        if (inside(m)) use(m);
      }
      if (stands(i)) {
        const ModelSample m = level_sample(model, model.height, u, v, model.rgba[i]);
        if (inside(m)) use(m);
      }
      for (int axis = 0; axis < 2; ++axis) {
        const std::size_t j = axis == 0 ? model.at(u + 1, v) : model.at(u, v + 1);
        if (model.height[j] == kNoHeight) continue;
        const std::int64_t rise = std::int64_t{model.height[j]} - model.height[i];
        const Step step = {u, v, axis, model.height[i], model.height[j]};
        const bool tall = std::abs(rise) >= kBareStep, measured = tall && is_measured(model, step);
        const bool skin = is_skin(model.use);
        const bool filled = (model.use == ModelUse::kGround || model.use == ModelUse::kCleared) &&
                            (model.flags[i] & model.flags[j] & kModelFilled) != 0;
        if (!tall && !stands(i) && !stands(j)) continue;
        const std::int64_t lines = std::abs(rise) / (skin ? kSkinStep : kSampleStep);
        const float steep = static_cast<float>(rise) / kQuantaPerCell;
        Float3 normal = {0.0f, 0.0f, 1.0f};
        normal[static_cast<std::size_t>(axis)] = -steep;
        normal = unit(normal);
        const bool rises = rise > 0;
        std::optional<std::uint32_t> wall;  // asked for where any of it was not seen
        for (std::int64_t k = 1; k <= lines; ++k) {
          const auto along = static_cast<std::int32_t>(k * kCell / (lines + 1));
          ModelSample m = {u * kCell + kCell / 2,
                           v * kCell + kCell / 2,
                           model.height[i] + static_cast<std::int32_t>(k * rise / (lines + 1)),
                           normal,
                           model.rgba[rises ? j : i],
                           true,
                           tall};
          (axis == 0 ? m.u : m.v) += along;
          if (!inside(m)) continue;
          const bool seen = measured && is_measured_at(model, step, m.height);
          if (seen && !skin) continue;
          m.unseen = filled || (tall && !seen);
          if (tall && !seen) {
            if (!wall)
              wall = wall_colour(model, u + (rises && axis == 0), v + (rises && axis == 1), axis,
                                 rises ? 1 : -1);
            m.rgba = faded(m.rgba, *wall, std::int64_t{model.height[rises ? j : i]} - m.height);
          }
          use(m);
        }
      }
    }
}

}  // namespace tessera
