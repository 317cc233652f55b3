// Along one axis, in units of pixels:
//
//      y ^  .---.---.---.         a face is drawn row by row: its extent in x within the strip of a row, corners and
//        |  |  /|\__|   |         crossings, gives the pixels that it touches, no more and no fewer
//        |  |_/_|___\___|
//        |  |/__|___|_\_|         a layer begins with the face over a pixel's centre, whose plane it takes; then all
//        |  .---.---.---.  > x    faces that touch the pixel widen its range, and boundary edges close it
//
#include "kernels/certify/raster_filter.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

#include "kernels/certify/overlay_outline.h"
#include "octree/union_find.h"
#include "octree/vector.h"

namespace tessera {
namespace {

constexpr std::uint32_t kNoLayer = kNoPair;
constexpr double kPixelOfArea = 1.0;        // of the root of a face's area: two thirds of an edge
constexpr double kPixelOfTolerance = 0.25;  // finer shows nothing that the tolerance would ask for
constexpr std::size_t kAreaSampling = 16;
constexpr double kSteepest = 5.25;  // square of a slope: faces of a sheet look within 66 degrees of the axis
constexpr double kMinAngle = 0x1p-20;
constexpr double kGrown = 0x1p-20;           // pixels
constexpr double kFarthest = 0x1p28;         // pixels: farther corners would be off by more than kGrown
constexpr double kHeightRounding = 0x1p-26;  // of the largest extent
constexpr double kFloatShare = 0x1p-10;      // of the tolerance
constexpr std::size_t kPixelsPerFace = 8, kLayersPerFace = 4, kMinPixels = 4096;
constexpr int kMaxPixels = 1 << 13;  // a side
/// Pixels that faces may touch, each in the mean: soups of large faces over each other are left to the search.
constexpr double kTouchedPerFace = 64.0;
constexpr float kClosed = std::numeric_limits<float>::infinity();

/// What one sheet has over one pixel. Heights are z + gx dx + gy dy + [low, high], dx and dy from the pixel's centre.
struct Layer {
  double z;
  float gx, gy;
  float low, high;  ///< high = kClosed: a boundary edge touches the pixel
  std::uint32_t sheet, next;
};

/// A plane over the image.
struct Slope {
  double gx = 0.0, gy = 0.0;
  double square = 0.0;  ///< of the slope, in scan units
  bool up = false;
};

/// The frame of an image: x and y in pixels from the core's corner, z along the axis from the origin.
struct Frame {
  std::size_t axis = 2, u = 0, v = 1;
  Double3 low{}, per_pixel{1, 1, 1};  ///< of x, y, z; per_pixel[2] = 1
  int nx = 1, ny = 1;

  Double3 project(const Double3& p) const {
    return {(p[u] - low[0]) * per_pixel[0], (p[v] - low[1]) * per_pixel[1], p[axis] - low[2]};
  }
};

Frame make_frame(std::size_t axis, const Box3& core, const Double3& origin, double pixel,
                 std::size_t max_pixels) {
  Frame f;
  f.axis = axis;
  f.u = (axis + 1) % 3;
  f.v = (axis + 2) % 3;
  f.low = {core.low[f.u], core.low[f.v], origin[axis]};
  const double wide = core.high[f.u] - core.low[f.u], high = core.high[f.v] - core.low[f.v];
  // Too many pixels make the image coarser; a strip of one row needs no fewer columns.
  const double minimum = std::sqrt(wide * high / static_cast<double>(max_pixels));
  const double side = std::max(pixel, minimum);
  const auto count = [&](double extent) {
    return static_cast<int>(std::clamp(std::ceil(extent / side), 1.0, 1.0 * kMaxPixels));
  };
  f.nx = count(wide);
  f.ny = count(high);
  f.per_pixel = {f.nx / wide, f.ny / high, 1.0};
  return f;
}

/// A pixel, and a rectangle in it that holds all that a triangle has over it.
struct Part {
  int i, j;
  double x, y;        ///< its middle
  double half, tall;  ///< half of its extents
};

/// Pixels that a triangle touches. \return false as soon as visit(part) does
template <class Visit>
bool each_pixel(const Frame& f, const Double3* p, const Visit& visit) {
  const double bottom = std::min({p[0][1], p[1][1], p[2][1]}), top = std::max({p[0][1], p[1][1], p[2][1]});
  const double left = std::min({p[0][0], p[1][0], p[2][0]}), right = std::max({p[0][0], p[1][0], p[2][0]});
  if (right < -kGrown || left > f.nx + kGrown || top < -kGrown || bottom > f.ny + kGrown) return true;
  const int first = static_cast<int>(std::max(0.0, std::floor(bottom - kGrown)));
  const int last = static_cast<int>(std::min(f.ny - 1.0, std::floor(top + kGrown)));
  struct Side {
    double x, y, to_x, to_y, per_y;
  } side[3];
  for (std::size_t i = 0; i < 3; ++i) {
    const Double3 &a = p[i], &b = p[i == 2 ? 0 : i + 1];
    side[i] = a[1] <= b[1] ? Side{a[0], a[1], b[0], b[1], 0.0} : Side{b[0], b[1], a[0], a[1], 0.0};
    const double rise = side[i].to_y - side[i].y;
    if (rise > 0.0) side[i].per_y = (side[i].to_x - side[i].x) / rise;
  }
  for (int j = first; j <= last; ++j) {
    const double from = j - kGrown, to = j + 1 + kGrown;
    double low = right, high = left;
    for (const Side& s : side) {
      if (s.to_y < from || s.y > to) continue;
      const double a = s.y >= from ? s.x : s.x + (from - s.y) * s.per_y;
      const double b = s.to_y <= to ? s.to_x : s.x + (to - s.y) * s.per_y;
      low = std::min({low, a, b});
      high = std::max({high, a, b});
    }
    const int i0 = static_cast<int>(std::max(0.0, std::floor(low - kGrown)));
    const int i1 = static_cast<int>(std::min(f.nx - 1.0, std::floor(high + kGrown)));
    const double y0 = std::max(from, bottom), y1 = std::min(to, top);
    for (int i = i0; i <= i1; ++i) {
      const double x0 = std::max(i - kGrown, low), x1 = std::min(i + 1 + kGrown, high);
      if (!visit(Part{i, j, 0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.5 * (x1 - x0) + kGrown,
                      0.5 * (y1 - y0) + kGrown}))
        return false;
    }
  }
  return true;
}

/// About as many pixels as a triangle touches, and rows that it has.
double touched(const Frame& f, const Double3* p) {
  double extent[2];
  for (std::size_t k = 0; k < 2; ++k) {
    const double end = k == 0 ? f.nx : f.ny;
    extent[k] = std::clamp(std::max({p[0][k], p[1][k], p[2][k]}), 0.0, end) -
                std::clamp(std::min({p[0][k], p[1][k], p[2][k]}), 0.0, end);
  }
  const double area =
      0.5 * std::abs((p[1][0] - p[0][0]) * (p[2][1] - p[0][1]) - (p[2][0] - p[0][0]) * (p[1][1] - p[0][1]));
  return std::min(area, extent[0] * extent[1]) + 2.0 * (extent[0] + extent[1]) + 4.0;
}

/// Pixels whose centre a triangle covers, but for rounding.
template <class Visit>
void each_centre(const Frame& f, const Double3* p, const Visit& visit) {
  const double bottom = std::min({p[0][1], p[1][1], p[2][1]}), top = std::max({p[0][1], p[1][1], p[2][1]});
  const int first = static_cast<int>(std::clamp(std::ceil(bottom - 0.5), 0.0, 1.0 * f.ny));
  const int last = static_cast<int>(std::clamp(std::floor(top - 0.5), -1.0, f.ny - 1.0));
  for (int j = first; j <= last; ++j) {
    const double y = j + 0.5;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (std::size_t i = 0; i < 3; ++i) {
      const Double3 &a = p[i], &b = p[i == 2 ? 0 : i + 1];
      if ((a[1] <= y) == (b[1] <= y)) continue;
      const double x = a[0] + (y - a[1]) * (b[0] - a[0]) / (b[1] - a[1]);
      low = std::min(low, x);
      high = std::max(high, x);
    }
    if (!(low <= high)) continue;
    const int i0 = static_cast<int>(std::clamp(std::ceil(low - 0.5), 0.0, 1.0 * f.nx));
    const int i1 = static_cast<int>(std::clamp(std::floor(high - 0.5), -1.0, f.nx - 1.0));
    for (int i = i0; i <= i1; ++i) visit(i, j);
  }
}

/// The plane of a face; false where it is a needle, or upright, as seen along the axis.
bool slope_of(const Frame& f, const Double3* p, Slope& out) {
  const double ux = p[1][0] - p[0][0], uy = p[1][1] - p[0][1], uz = p[1][2] - p[0][2];
  const double vx = p[2][0] - p[0][0], vy = p[2][1] - p[0][1], vz = p[2][2] - p[0][2];
  const double area = ux * vy - vx * uy;
  if (!(std::abs(area) > kMinAngle * (ux * ux + uy * uy + vx * vx + vy * vy))) return false;
  const double per = 1.0 / area;
  out.gx = (uz * vy - vz * uy) * per;
  out.gy = (ux * vz - vx * uz) * per;
  const double sx = out.gx * f.per_pixel[0], sy = out.gy * f.per_pixel[1];
  out.square = sx * sx + sy * sy;
  out.up = area > 0.0;
  return true;
}

/// The reference along one axis.
class Image {
 public:
  Image(const Frame& frame, const SurfaceFaces& reference, const std::vector<Across>& across,
        std::size_t max_layers, double max_touched, std::vector<Double3>& at,
        std::vector<std::uint32_t>& sheet)
      : frame_(frame),
        reference_(reference),
        at_(at),
        sheet_(sheet),
        first_(static_cast<std::size_t>(frame.nx) * static_cast<std::size_t>(frame.ny), kNoLayer),
        max_layers_(max_layers) {
    at_.resize(reference.position.size());
    for (std::size_t i = 0; i < at_.size(); ++i) at_[i] = frame.project(reference.position[i]);
    find_sheets(across);
    double work = 0.0;
    for (std::uint32_t f = 0; f < sheet_.size(); ++f)
      if (sheet_[f] != kNoLayer) work += touched(frame_, corners(f).data());
    if (work > max_touched) return;  // nothing is settled then
    layers_.reserve(max_layers);     // pages that are not used cost no memory
    for (std::uint32_t f = 0; f < sheet_.size(); ++f)
      if (sheet_[f] != kNoLayer) begin_layers(f);
    for (std::uint32_t f = 0; f < sheet_.size(); ++f)
      if (sheet_[f] != kNoLayer) widen_layers(f, across[f]);
  }

  std::size_t layers() const { return layers_.size(); }

  /// Is what the triangle has over the core within `limit` of the reference? \param p  its corners in the frame
  bool decides(const Double3* p, double limit, double core_low, double core_high) const {
    Slope s;
    if (!slope_of(frame_, p, s)) return false;
    return each_pixel(frame_, p, [&](const Part& part) {
      const double z = height(p[0], s, part.x, part.y);
      const double rise = std::abs(s.gx) * part.half + std::abs(s.gy) * part.tall;
      if (z - rise > core_high || z + rise < core_low) return true;  // not in the core
      for (std::uint32_t n = first_[pixel(part.i, part.j)]; n != kNoLayer; n = layers_[n].next)
        if (within(layers_[n], part, z, s, limit)) return true;
      return false;
    });
  }

 private:
  std::size_t pixel(int i, int j) const {
    return static_cast<std::size_t>(j) * static_cast<std::size_t>(frame_.nx) + static_cast<std::size_t>(i);
  }
  static double height(const Double3& a, const Slope& s, double x, double y) {
    return a[2] + s.gx * (x - a[0]) + s.gy * (y - a[1]);
  }
  static double height(const Layer& layer, const Part& part) {
    return layer.z + static_cast<double>(layer.gx) * (part.x - part.i - 0.5) +
           static_cast<double>(layer.gy) * (part.y - part.j - 0.5);
  }
  std::array<Double3, 3> corners(std::uint32_t f) const {
    const auto& v = reference_.faces[f];
    return {at_[v[0]], at_[v[1]], at_[v[2]]};
  }

  void find_sheets(const std::vector<Across>& across) {
    const std::size_t m = reference_.faces.size();
    // Bit 0: looks along the axis, bit 1: upwards.
    std::vector<std::uint8_t> looks(m);
    DisjointSets<std::uint32_t> sets(m);
    for (std::uint32_t f = 0; f < m; ++f) {
      const auto p = corners(f);
      Slope s;
      if (!slope_of(frame_, p.data(), s) || s.square > kSteepest) continue;
      looks[f] = s.up ? 3 : 1;
      for (const std::uint32_t other : across[f])
        if (other != kNoLayer && other >> 2 < f && looks[other >> 2] == looks[f]) sets.unite(f, other >> 2);
    }
    sheet_.resize(m);
    for (std::uint32_t f = 0; f < m; ++f) sheet_[f] = looks[f] != 0 ? sets.find(f) : kNoLayer;
  }

  Layer* find(int i, int j, std::uint32_t sheet) {
    for (std::uint32_t n = first_[pixel(i, j)]; n != kNoLayer; n = layers_[n].next)
      if (layers_[n].sheet == sheet) return &layers_[n];
    return nullptr;
  }

  void begin_layers(std::uint32_t f) {
    const auto p = corners(f);
    Slope s;
    bool known = false;
    each_centre(frame_, p.data(), [&](int i, int j) {
      if (find(i, j, sheet_[f]) != nullptr || layers_.size() == max_layers_) return;
      if (!known) slope_of(frame_, p.data(), s), known = true;
      std::uint32_t& first = first_[pixel(i, j)];
      layers_.push_back({height(p[0], s, i + 0.5, j + 0.5), static_cast<float>(s.gx),
                         static_cast<float>(s.gy), 0.0f, 0.0f, sheet_[f], first});
      first = static_cast<std::uint32_t>(layers_.size() - 1);
    });
  }

  void widen_layers(std::uint32_t f, const Across& across) {
    const auto p = corners(f);
    Slope s;
    slope_of(frame_, p.data(), s);
    each_pixel(frame_, p.data(), [&](const Part& part) {
      Layer* const layer = find(part.i, part.j, sheet_[f]);
      if (layer == nullptr) return true;
      const double apart = height(p[0], s, part.x, part.y) - height(*layer, part);
      const double rise = rise_between(s, *layer, part);
      layer->low = std::min(layer->low, static_cast<float>(apart - rise));
      layer->high = std::max(layer->high, static_cast<float>(apart + rise));
      return true;
    });
    for (std::size_t e = 0; e < 3; ++e) {
      if (across[e] != kNoLayer && sheet_[across[e] >> 2] == sheet_[f]) continue;
      const Double3 &a = p[e], &b = p[e == 2 ? 0 : e + 1];
      const Double3 segment[3] = {a, b, b};
      each_pixel(frame_, segment, [&](const Part& part) {
        if (Layer* const layer = find(part.i, part.j, sheet_[f])) layer->high = kClosed;
        return true;
      });
    }
  }

  /// The most that two planes come apart between the middle of a part and its corners.
  static double rise_between(const Slope& s, const Layer& layer, const Part& part) {
    return std::abs(s.gx - static_cast<double>(layer.gx)) * part.half +
           std::abs(s.gy - static_cast<double>(layer.gy)) * part.tall;
  }

  bool within(const Layer& layer, const Part& part, double z, const Slope& s, double limit) const {
    if (layer.high == kClosed) return false;
    const double apart = z - height(layer, part), rise = rise_between(s, layer, part);
    if (apart + rise - static_cast<double>(layer.low) <= limit &&
        static_cast<double>(layer.high) - (apart - rise) <= limit)
      return true;
    return within_across(layer, part.i, part.j, std::abs(apart) + rise, limit);
  }

  /// \param apart  the most that a point over the pixel is over or under the layer's plane
  bool within_across(const Layer& layer, int i, int j, double apart, double limit) const {
    const double sx = static_cast<double>(layer.gx) * frame_.per_pixel[0],
                 sy = static_cast<double>(layer.gy) * frame_.per_pixel[1];
    const double square = sx * sx + sy * sy, cosine = 1.0 / std::sqrt(1.0 + square);
    const double distance = apart * cosine;
    if (!(distance <= limit)) return false;
    // How far the foot moves, in pixels: it must stay over the neighbours.
    const double foot = apart * cosine * cosine;
    if (!(std::abs(sx) * foot * frame_.per_pixel[0] < 1.0 - kGrown &&
          std::abs(sy) * foot * frame_.per_pixel[1] < 1.0 - kGrown))
      return false;
    if (i == 0 || j == 0 || i + 1 == frame_.nx || j + 1 == frame_.ny) return false;
    double range = 0.0;
    for (int dj = -1; dj <= 1; ++dj)
      for (int di = -1; di <= 1; ++di) {
        std::uint32_t n = first_[pixel(i + di, j + dj)];
        while (n != kNoLayer && layers_[n].sheet != layer.sheet) n = layers_[n].next;
        if (n == kNoLayer || layers_[n].high == kClosed) return false;
        const Layer& other = layers_[n];
        const double gx = static_cast<double>(layer.gx), gy = static_cast<double>(layer.gy);
        const double off = other.z - (layer.z + gx * di + gy * dj);
        const double rise = 0.5 * (std::abs(static_cast<double>(other.gx) - gx) +
                                   std::abs(static_cast<double>(other.gy) - gy));
        range = std::max({range, off + rise + static_cast<double>(other.high),
                          rise - off - static_cast<double>(other.low)});
        if (distance + range > limit) return false;
      }
    return true;
  }

  const Frame frame_;
  const SurfaceFaces& reference_;
  std::vector<Double3>& at_;           ///< of the reference's vertices
  std::vector<std::uint32_t>& sheet_;  ///< per face of it
  std::vector<std::uint32_t> first_;   ///< per pixel: its first layer
  std::vector<Layer> layers_;
  std::size_t max_layers_;
};

double mean_area(const SurfaceFaces& s) {
  double sum = 0.0, count = 0.0;
  for (std::size_t f = 0; f < s.faces.size(); f += kAreaSampling) {
    const Double3& a = s.position[s.faces[f][0]];
    sum += 0.5 * norm(cross(s.position[s.faces[f][1]] - a, s.position[s.faces[f][2]] - a));
    count += 1.0;
  }
  return count > 0.0 ? sum / count : std::numeric_limits<double>::infinity();
}

bool meets(const Double3* p, const Box3& box) {
  bool yes = true;
  for (std::size_t k = 0; k < 3; ++k)
    yes = yes && std::min({p[0][k], p[1][k], p[2][k]}) <= box.high[k] &&
          std::max({p[0][k], p[1][k], p[2][k]}) >= box.low[k];
  return yes;
}

double largest_extent(const SurfaceFaces& s, const Box3& core) {
  double maximum = 0.0;
  for (const Double3& p : s.position)
    for (std::size_t k = 0; k < 3; ++k)
      maximum = std::max({maximum, p[k] - core.low[k], core.high[k] - p[k]});
  return maximum;
}

}  // namespace

double raster_pixel(const SurfaceFaces& a, const SurfaceFaces& b, double tolerance) {
  return std::max(kPixelOfArea * std::sqrt(std::min(mean_area(a), mean_area(b))),
                  kPixelOfTolerance * tolerance);
}

std::uint64_t raster_filter_bytes(std::uint64_t faces) {
  // Pairs of edges and how they are found; corners, sheets and sets; pixels and layers.
  return faces * (24 + 4 + 12 + 24 + 9 + 1 + 4 + 4 * kPixelsPerFace + sizeof(Layer) * kLayersPerFace) +
         kMinPixels * (4 + sizeof(Layer));
}

std::vector<std::uint32_t> raster_doubts(const SurfaceFaces& surface, const Box3& core,
                                         const SurfaceFaces& reference, const Double3& origin,
                                         double tolerance, double pixel, RasterFilterReport* report) {
  assert(tolerance > 0.0 && pixel > 0.0);
  RasterFilterReport counts;
  std::vector<std::uint32_t> doubts;
  const double extent = std::max(largest_extent(surface, core), largest_extent(reference, core));
  const double limit = tolerance * (1.0 - kFloatShare) - kHeightRounding * extent;
  // Along which axis each face is drawn; 3: it has none, 4: it is not in the core.
  std::vector<std::uint8_t> axis(surface.faces.size(), 4);
  bool wanted[3] = {false, false, false};
  for (std::size_t f = 0; f < surface.faces.size(); ++f) {
    const auto& v = surface.faces[f];
    const Double3 p[3] = {surface.position[v[0]], surface.position[v[1]], surface.position[v[2]]};
    if (!meets(p, core)) continue;
    ++counts.faces;
    const Double3 n = cross(p[1] - p[0], p[2] - p[0]);
    std::size_t maximum = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (std::abs(n[k]) > std::abs(n[maximum])) maximum = k;
    axis[f] = std::abs(n[maximum]) > 0.0 ? static_cast<std::uint8_t>(maximum) : std::uint8_t{3};
    if (axis[f] < 3) wanted[maximum] = true;
  }
  const std::size_t faces = surface.faces.size() + reference.faces.size();
  std::vector<std::uint8_t> decided(surface.faces.size());
  if (limit > 0.0 && !reference.faces.empty()) {
    const std::vector<Across> across = pair_edges(reference);
    std::vector<Double3> at;
    std::vector<std::uint32_t> sheet;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!wanted[k]) continue;
      const Frame frame = make_frame(k, core, origin, pixel, kPixelsPerFace * faces + kMinPixels);
      const double maximum = std::max(frame.per_pixel[0], frame.per_pixel[1]) * extent;
      if (!(maximum < kFarthest)) continue;  // stays in doubt
      const double max_touched = kTouchedPerFace * static_cast<double>(faces) + kMinPixels;
      const Image image(frame, reference, across, kLayersPerFace * faces + kMinPixels, max_touched, at,
                        sheet);
      counts.layers += image.layers();
      const double low = core.low[k] - origin[k] - kHeightRounding * extent,
                   high = core.high[k] - origin[k] + kHeightRounding * extent;
      double work = 0.0;
      for (std::size_t f = 0; f < surface.faces.size(); ++f) {
        if (axis[f] != k) continue;
        const auto& v = surface.faces[f];
        const Double3 p[3] = {frame.project(surface.position[v[0]]), frame.project(surface.position[v[1]]),
                              frame.project(surface.position[v[2]])};
        work += touched(frame, p);
        if (work > max_touched) break;  // the others stay in doubt
        decided[f] = image.decides(p, limit, low, high);
      }
    }
  }
  for (std::uint32_t f = 0; f < surface.faces.size(); ++f) {
    if (axis[f] == 4) continue;
    if (decided[f] != 0)
      ++counts.decided;
    else
      doubts.push_back(f);
  }
  if (report != nullptr) *report = counts;
  return doubts;
}

}  // namespace tessera
