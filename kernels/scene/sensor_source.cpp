/// Sensors: fans and grids of rays from known places, with what real ones do to a scene: shadows, density
/// that falls with range and slant, lost grazing returns, flying points where a beam straddles two surfaces.
#include <algorithm>

#include "kernels/scene/sample_source.h"

namespace tessera::synth {
namespace {

enum : std::uint64_t { kFlyingStream = 23 };

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
// A return is lost where the beam grazes: time of flight still sees 4 degrees, a camera with a projector 15.
constexpr double kMinCosineLaser = 0.07;
constexpr double kMinCosineCamera = 0.26;
// Rays of one unit: enough to keep a thread busy for milliseconds, few enough for 100 threads' worth of
// units.
constexpr std::uint64_t kUnitRays = 8192;
constexpr std::uint64_t kCalibrationRays = 24000;

/// One set-up: origin, frame and window of its grid.
struct SetUp {
  Double3 origin{}, right{}, up{}, forward{};
  double u0 = 0.0, u1 = 0.0;  ///< azimuth, tangent or way along the flight line
  double v0 = 0.0, v1 = 0.0;  ///< elevation, tangent or angle across
  double weight = 1.0;        ///< extent of the window in steps of the common unit
};

Double3 centre_of(const Box3& box) {
  return (box.lo + box.hi) * 0.5;
}

SetUp look(const Double3& from, const Double3& at) {
  SetUp s;
  s.origin = from;
  s.forward = unit(at - from);
  Double3 side = cross(s.forward, {0, 0, 1});
  s.right = norm(side) > 1e-6 ? unit(side) : Double3{1, 0, 0};
  s.up = cross(s.right, s.forward);
  return s;
}

class SensorSource final : public SampleSource {
 public:
  SensorSource(const Scene& scene, const SensorOptions& options) : scene_(scene), o_(options) {
    const Box3 box = scene.bounds();
    size_ = norm(box.hi - box.lo);
    switch (o_.kind) {
      case SensorKind::kTerrestrial:
        place_terrestrial(box);
        break;
      case SensorKind::kAirborne:
        place_airborne(box);
        break;
      case SensorKind::kStructuredLight:
        place_cameras(box);
        break;
    }
    calibrate();
  }

  std::uint64_t unit_count() const override { return scans_.back().first_unit + scans_.back().units; }
  const std::vector<ScanInfo>& scans() const override { return scans_; }
  double area() const override { return 0.0; }
  double spacing() const override { return spacing_; }

  void sample(std::uint64_t unit, SampleBatch& out) const override {
    std::size_t scan = 0;
    while (unit >= scans_[scan].first_unit + scans_[scan].units) ++scan;
    const ScanInfo& info = scans_[scan];
    const std::uint64_t per_unit = columns_per_unit(info.rows);
    const std::uint64_t first = (unit - info.first_unit) * per_unit;
    const std::uint64_t last = std::min(info.columns, first + per_unit);
    out.surface.resize(0);
    out.dx.clear(), out.dy.clear(), out.dz.clear(), out.key.clear();
    out.flying = 0;
    std::vector<RayHit> hits(info.rows);
    std::vector<Ray> rays(info.rows);
    for (std::uint64_t column = first; column < last; ++column) {
      for (std::uint64_t row = 0; row < info.rows; ++row) {
        rays[row] = ray(setups_[scan], info, column, row);
        if (!shoot(setups_[scan], rays[row], hits[row])) hits[row].range = kNaN;
      }
      emit(scan, column, rays, hits, out);
    }
  }

 private:
  // ------------------------------------------------------------------------------------------ placing

  void place_terrestrial(const Box3& box) {
    std::vector<Double3> stations = scene_.stations();
    const Double3 centre = centre_of(box);
    const bool inside = !stations.empty();
    if (!inside) {
      const int count = o_.views > 0 ? o_.views : 6;
      for (int k = 0; k < count; ++k) {
        // A ring around the scene, every second one from above.
        const SinCos t = sin_cos(2.0 * kPi * k / count + 0.4);
        const double lift = k % 2 ? 0.55 : 0.15;
        stations.push_back(centre + unit(Double3{t.cos, t.sin, lift}) * (1.1 * size_));
      }
    } else if (o_.views > 0 && static_cast<std::size_t>(o_.views) < stations.size()) {
      stations.resize(static_cast<std::size_t>(o_.views));
    }
    for (const Double3& station : stations) {
      SetUp s;
      if (inside) {
        s.origin = station;
        s.right = {1, 0, 0}, s.forward = {0, 1, 0}, s.up = {0, 0, 1};
        s.u0 = -kPi, s.u1 = kPi;
        s.v0 = -1.1, s.v1 = 0.5 * kPi;  // the tripod hides what is below
      } else {
        s = look(station, centre);
        const double half = 0.5 * size_ / norm(centre - station);
        s.u0 = s.v0 = -1.1 * half, s.u1 = s.v1 = 1.1 * half;
      }
      s.weight = (s.u1 - s.u0) * (s.v1 - s.v0);
      setups_.push_back(s);
    }
  }

  void place_cameras(const Box3& box) {
    const Double3 centre = centre_of(box);
    const int count = o_.views > 0 ? o_.views : 14;
    for (int k = 0; k < count; ++k) {
      // Golden-angle spiral over the sphere of directions, a little more from above than from below.
      const double z = 0.92 - 1.5 * (k + 0.5) / count;
      const double r = std::sqrt(1.0 - z * z);
      const SinCos t = sin_cos(2.39996322972865332 * k);
      SetUp s = look(centre + Double3{r * t.cos, r * t.sin, z} * (1.4 * size_), centre);
      const double half = 0.5 / 1.4 * 1.05;
      s.u0 = s.v0 = -half, s.u1 = s.v1 = half;
      s.weight = (s.u1 - s.u0) * (s.v1 - s.v0);
      setups_.push_back(s);
    }
  }

  void place_airborne(const Box3& box) {
    const double width = box.hi[1] - box.lo[1], along = box.hi[0] - box.lo[0];
    const int lines = o_.views > 0 ? o_.views : 5;
    const double height = 0.7 * width;  // above the highest ground
    for (int k = 0; k < lines; ++k) {
      SetUp s;
      s.origin = {box.lo[0], box.lo[1] + width * (k + 0.5) / lines, box.hi[2] + height};
      // Every second line is flown back.
      s.forward = {k % 2 ? -1.0 : 1.0, 0, 0};
      if (k % 2) s.origin[0] = box.hi[0];
      s.right = {0, 1, 0}, s.up = {0, 0, 1};
      s.u0 = 0.0, s.u1 = along;
      const double half = 0.5 * width / lines * 1.5 / height;  // half a strip of overlap
      s.v0 = -half, s.v1 = half;
      s.weight = (s.u1 - s.u0) * (s.v1 - s.v0) * height;
      setups_.push_back(s);
    }
    flight_ = height;
  }

  // ------------------------------------------------------------------------------------------ rays

  Ray ray(const SetUp& s, const ScanInfo& info, std::uint64_t column, std::uint64_t row) const {
    const double u =
        s.u0 + (s.u1 - s.u0) * (static_cast<double>(column) + 0.5) / static_cast<double>(info.columns);
    const double v = s.v0 + (s.v1 - s.v0) * (static_cast<double>(row) + 0.5) / static_cast<double>(info.rows);
    switch (o_.kind) {
      case SensorKind::kTerrestrial: {
        const SinCos a = sin_cos(u), e = sin_cos(v);
        return {s.origin, unit((s.right * a.sin + s.forward * a.cos) * e.cos + s.up * e.sin)};
      }
      case SensorKind::kAirborne: {
        const SinCos a = sin_cos(v);
        return {s.origin + s.forward * u, s.right * a.sin - s.up * a.cos};
      }
      default:
        return {s.origin, unit(s.forward + s.right * u + s.up * v)};
    }
  }

  bool shoot(const SetUp& s, const Ray& r, RayHit& hit) const {
    if (!scene_.intersect(r, 4.0 * size_, hit)) return false;
    const double facing = -dot(hit.point.normal, r.direction);
    if (o_.kind != SensorKind::kStructuredLight) return facing > kMinCosineLaser;
    if (facing < kMinCosineCamera) return false;
    // The projector stands beside the camera: what it does not light has no depth.
    const Double3 projector = s.origin + s.right * (0.25 * 1.4 * size_);
    const Double3 delta = projector - hit.point.position;
    const double range = norm(delta);
    const Double3 to = delta * (1.0 / range);
    if (dot(hit.point.normal, to) < kMinCosineCamera) return false;
    RayHit blocked;
    return !scene_.intersect({hit.point.position + hit.point.normal * (2e-5 * size_), to}, range, blocked);
  }

  /// Area across the ray that one ray stands for at the hit, per squared step of the grid.
  double footprint(const SetUp& s, const ScanInfo& info, const Ray& r, const RayHit& hit) const {
    const double du = (s.u1 - s.u0) / static_cast<double>(info.columns);
    const double dv = (s.v1 - s.v0) / static_cast<double>(info.rows);
    const double cosine = dot(r.direction, s.forward);
    switch (o_.kind) {
      case SensorKind::kTerrestrial: {
        const double rise = dot(r.direction, s.up);
        return hit.range * hit.range * du * dv * std::sqrt(std::max(0.0, 1.0 - rise * rise));
      }
      case SensorKind::kAirborne:
        return hit.range * dv * du;
      default:
        return hit.range * hit.range * cosine * cosine * cosine * du * dv;
    }
  }

  void emit(std::size_t scan, std::uint64_t column, const std::vector<Ray>& rays,
            const std::vector<RayHit>& hits, SampleBatch& out) const {
    const std::uint64_t rows = rays.size();
    const double jump = 12.0 * spacing_;
    for (std::uint64_t row = 0; row < rows; ++row) {
      const RayHit& hit = hits[row];
      const std::uint64_t name = mix(static_cast<std::uint64_t>(scan) << 56 ^ column << 28 ^ row);
      if (!(hit.range > 0.0)) {
        if (!o_.gaps) continue;
        out.surface.push_back({{kNaN, kNaN, kNaN}, {0, 0, 0}});
      } else {
        SurfacePoint point = hit.point;
        const RayHit* next = row + 1 < rows ? &hits[row + 1] : nullptr;
        if (o_.flying > 0.0 && next && std::fabs(next->range - hit.range) > jump) {
          const std::uint64_t bits = random_bits(o_.seed, kFlyingStream, name);
          if (to_unit(bits) < o_.flying) {
            const double range = hit.range + (next->range - hit.range) * to_unit(mix(bits));
            point.position = rays[row].origin + rays[row].direction * range;
            ++out.flying;
          }
        }
        out.surface.push_back(point);
      }
      out.dx.push_back(rays[row].direction[0]);
      out.dy.push_back(rays[row].direction[1]);
      out.dz.push_back(rays[row].direction[2]);
      out.key.push_back(name);
    }
  }

  // ------------------------------------------------------------------------------------------ density

  static std::uint64_t columns_per_unit(std::uint64_t rows) {
    return std::max<std::uint64_t>(1, kUnitRays / rows);
  }

  /// Grids with square cells of `step` in all set-ups.
  void set_step(double step) {
    scans_.clear();
    std::uint64_t unit = 0;
    for (const SetUp& s : setups_) {
      ScanInfo info;
      info.origin = s.origin;
      const double across = o_.kind == SensorKind::kAirborne ? flight_ : 1.0;
      const auto count = [step](double extent) {
        return static_cast<std::uint64_t>(std::max(1.0, std::floor(extent / step + 0.5)));
      };
      info.columns = count(s.u1 - s.u0);
      info.rows = count((s.v1 - s.v0) * across);
      if (o_.kind == SensorKind::kAirborne) info.origin = s.origin + s.forward * (0.5 * s.u1);
      info.first_unit = unit;
      const std::uint64_t per_unit = columns_per_unit(info.rows);
      info.units = (info.columns + per_unit - 1) / per_unit;
      unit += info.units;
      scans_.push_back(info);
    }
  }

  /// A coarse run over all set-ups: how many rays return, and how far apart they lie on the surface.
  void calibrate() {
    double weight = 0.0;
    for (const SetUp& s : setups_) weight += s.weight;
    double step = std::sqrt(weight / static_cast<double>(kCalibrationRays));
    set_step(step);
    std::vector<double> sides;
    for (std::size_t k = 0; k < setups_.size(); ++k) {
      for (std::uint64_t column = 0; column < scans_[k].columns; ++column) {
        for (std::uint64_t row = 0; row < scans_[k].rows; ++row) {
          const Ray r = ray(setups_[k], scans_[k], column, row);
          RayHit hit;
          if (!shoot(setups_[k], r, hit)) continue;
          const double facing = -dot(hit.point.normal, r.direction);
          sides.push_back(std::sqrt(footprint(setups_[k], scans_[k], r, hit) / facing));
        }
      }
    }
    if (sides.empty()) {
      spacing_ = 0.0;
      return;
    }
    std::sort(sides.begin(), sides.end());
    const double median = sides[sides.size() / 2];
    const double factor = o_.spacing > 0.0
                              ? o_.spacing / median
                              : std::sqrt(static_cast<double>(sides.size()) / static_cast<double>(o_.points));
    set_step(step * factor);
    spacing_ = median * factor;
  }

  const Scene& scene_;
  SensorOptions o_;
  double size_ = 0.0, flight_ = 1.0, spacing_ = 0.0;
  std::vector<SetUp> setups_;
  std::vector<ScanInfo> scans_;
};

}  // namespace

std::unique_ptr<SampleSource> sample_by_sensor(const Scene& scene, const SensorOptions& options) {
  return std::make_unique<SensorSource>(scene, options);
}

}  // namespace tessera::synth
