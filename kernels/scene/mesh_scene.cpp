#include "kernels/scene/mesh_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "kernels/mesh/triangle_foot.h"
#include "octree/box_levels.h"
#include "octree/error.h"
#include "octree/morton.h"
#include "octree/vector.h"

namespace tessera::synth {
namespace {

constexpr std::size_t kLeafFaces = 4;
constexpr std::size_t kChildren = 4;
constexpr double kSamePosition = 1e-12;  ///< of the scene: crossings of faces that share an edge

struct BoxF {
  std::array<float, 3> low, high;
};

/// A ray, turned so that it runs along +z, as watertight tests want it.
struct ShearedRay {
  Double3 origin;
  std::array<std::size_t, 3> axis{};
  double sx, sy, sz;
  Double3 inverse;
  explicit ShearedRay(const Ray& ray) : origin(ray.origin) {
    const Double3& d = ray.direction;
    std::size_t z = 0;
    for (std::size_t k = 1; k < 3; ++k)
      if (std::fabs(d[k]) > std::fabs(d[z])) z = k;
    axis = {(z + 1) % 3, (z + 2) % 3, z};
    if (d[z] < 0.0) std::swap(axis[0], axis[1]);
    sx = d[axis[0]] / d[z];
    sy = d[axis[1]] / d[z];
    sz = 1.0 / d[z];
    for (std::size_t k = 0; k < 3; ++k) inverse[k] = 1.0 / d[k];
  }

  /// Range along the ray; edges and vertices belong to all their faces. Infinity: none.
  double hit(const Double3& a, const Double3& b, const Double3& c) const {
    std::array<double, 3> x, y, z;
    const std::array<const Double3*, 3> corner = {&a, &b, &c};
    for (std::size_t k = 0; k < 3; ++k) {
      const Double3 p = *corner[k] - origin;
      z[k] = p[axis[2]];
      x[k] = p[axis[0]] - sx * z[k];
      y[k] = p[axis[1]] - sy * z[k];
    }
    const double u = x[2] * y[1] - y[2] * x[1], v = x[0] * y[2] - y[0] * x[2], w = x[1] * y[0] - y[1] * x[0];
    constexpr double kNone = std::numeric_limits<double>::infinity();
    if ((u < 0.0 || v < 0.0 || w < 0.0) && (u > 0.0 || v > 0.0 || w > 0.0)) return kNone;
    const double sum = u + v + w;
    if (sum == 0.0) return kNone;
    return (u * z[0] + v * z[1] + w * z[2]) * sz / sum;
  }

  /// Where the ray enters a box; infinity if it passes by. Boxes are wider than what they hold.
  double enter(const BoxF& box) const {
    double from = 0.0, to = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 3; ++k) {
      const double s0 = (double{box.low[k]} - origin[k]) * inverse[k],
                   s1 = (double{box.high[k]} - origin[k]) * inverse[k];
      // A ray within a face of the box: not a number, and no bound.
      from = std::max(from, std::min(s0, s1));
      to = std::min(to, std::max(s0, s1));
    }
    return from <= to * (1.0 + 1e-12) ? from : std::numeric_limits<double>::infinity();
  }
};

class MeshScene final : public Scene {
 public:
  MeshScene(std::string name, std::vector<Double3> vertices, std::vector<std::array<std::uint32_t, 3>> faces)
      : name_(std::move(name)), vertex_(std::move(vertices)), face_(std::move(faces)) {
    const auto flat = [this](const std::array<std::uint32_t, 3>& f) {
      for (const std::uint32_t v : f) {
        if (v >= vertex_.size()) throw InputError(name_ + ": a face names a vertex that is not there");
        for (const double c : vertex_[v])
          if (!std::isfinite(c)) throw InputError(name_ + ": a face has a vertex that is not finite");
      }
      return normal(f) == Double3{0, 0, 0};
    };
    face_.erase(std::remove_if(face_.begin(), face_.end(), flat), face_.end());
    if (face_.empty())
      throw InputError(name_ + ": the mesh has no face with an area, there is nothing to scan");
    bool any = false;
    for (const auto& f : face_)
      for (const std::uint32_t v : f) {
        for (std::size_t a = 0; a < 3; ++a) {
          bounds_.lo[a] = any ? std::min(bounds_.lo[a], vertex_[v][a]) : vertex_[v][a];
          bounds_.hi[a] = any ? std::max(bounds_.hi[a], vertex_[v][a]) : vertex_[v][a];
        }
        any = true;
      }
    size_ = norm(bounds_.hi - bounds_.lo);
    sort_faces();
    build();
  }

  std::string_view name() const override { return name_; }
  Box3 bounds() const override { return bounds_; }

  SurfacePoint closest(const Double3& p) const override {
    double best = std::numeric_limits<double>::infinity();
    SurfacePoint found;
    visit([&](const BoxF& box) { return square_to_box(box, p); },
          [&](std::size_t f) {
            const Double3 at = foot_in_triangle(p, corner(f, 0), corner(f, 1), corner(f, 2)).at;
            const double square = squared_distance(at, p);
            if (square >= best) return best;
            best = square;
            found = {at, normal(face_[f])};
            return best;
          });
    return found;
  }

  bool intersect(const Ray& ray, double limit, RayHit& hit) const override {
    const ShearedRay sheared(ray);
    double best = std::nextafter(limit, std::numeric_limits<double>::infinity());
    std::size_t face = face_.size();
    visit([&](const BoxF& box) { return sheared.enter(box); },
          [&](std::size_t f) {
            const double range = sheared.hit(corner(f, 0), corner(f, 1), corner(f, 2));
            if (range > 0.0 && range < best) best = range, face = f;
            return best;
          },
          best);
    if (face == face_.size()) return false;
    hit.range = best;
    hit.point.position = ray.origin + ray.direction * best;
    hit.point.normal = normal(face_[face]);
    if (dot(hit.point.normal, ray.direction) > 0.0) hit.point.normal = -hit.point.normal;
    return true;
  }

  void crossings(const Ray& ray, double limit, std::vector<SurfacePoint>& out) const override {
    const ShearedRay sheared(ray);
    std::vector<std::pair<double, std::size_t>> found;
    visit([&](const BoxF& box) { return sheared.enter(box); },
          [&](std::size_t f) {
            const double range = sheared.hit(corner(f, 0), corner(f, 1), corner(f, 2));
            if (range > 0.0 && range <= limit) found.emplace_back(range, f);
            return limit;
          },
          limit);
    std::sort(found.begin(), found.end());
    out.clear();
    double last = -1.0;
    for (const auto& [range, f] : found) {
      const SurfacePoint point = {ray.origin + ray.direction * range, normal(face_[f])};
      // At an edge both faces are met: once is enough where they go on from each other.
      if (!out.empty() && range - last <= kSamePosition * size_ && dot(out.back().normal, point.normal) > 0.0)
        continue;
      out.push_back(point);
      last = range;
    }
  }

 private:
  const Double3& corner(std::size_t face, std::size_t k) const { return vertex_[face_[face][k]]; }
  Double3 normal(const std::array<std::uint32_t, 3>& f) const {
    return unit_or_zero(triangle_normal(vertex_[f[0]], vertex_[f[1]], vertex_[f[2]]));
  }

  void sort_faces() {
    struct Keyed {
      std::uint64_t key;
      std::uint32_t face;
    };
    std::vector<Keyed> order(face_.size());
    const double scale = 2097151.0 / std::max({bounds_.hi[0] - bounds_.lo[0], bounds_.hi[1] - bounds_.lo[1],
                                               bounds_.hi[2] - bounds_.lo[2], 1e-300});
    for (std::uint32_t f = 0; f < face_.size(); ++f) {
      const Double3 middle = (corner(f, 0) + corner(f, 1) + corner(f, 2)) / 3.0 - bounds_.lo;
      std::array<std::uint32_t, 3> at;
      for (std::size_t a = 0; a < 3; ++a)
        at[a] = static_cast<std::uint32_t>(std::clamp(middle[a] * scale, 0.0, 2097151.0));
      order[f] = {morton_encode(at[0], at[1], at[2]), f};
    }
    std::sort(order.begin(), order.end(), [](const Keyed& l, const Keyed& r) {
      return l.key != r.key ? l.key < r.key : l.face < r.face;
    });
    std::vector<std::array<std::uint32_t, 3>> sorted(face_.size());
    for (std::size_t i = 0; i < order.size(); ++i) sorted[i] = face_[order[i].face];
    face_ = std::move(sorted);
  }

  void build() {
    std::vector<BoxF> boxes((face_.size() + kLeafFaces - 1) / kLeafFaces);
    for (std::size_t f = 0; f < face_.size(); ++f) {
      BoxF& box = boxes[f / kLeafFaces];
      for (std::size_t c = 0; c < 3; ++c)
        for (std::size_t a = 0; a < 3; ++a) {
          // Wider by more than what rounding takes from ranges.
          const double here = corner(f, c)[a], margin = 1e-9 * size_;
          const float low =
              std::nextafter(static_cast<float>(here - margin), -std::numeric_limits<float>::infinity());
          const float high =
              std::nextafter(static_cast<float>(here + margin), std::numeric_limits<float>::infinity());
          const bool first = f % kLeafFaces == 0 && c == 0;
          box.low[a] = first ? low : std::min(box.low[a], low);
          box.high[a] = first ? high : std::max(box.high[a], high);
        }
    }
    levels_ = box_levels(std::move(boxes), kChildren);
  }

  /// Asks the faces of boxes in whose bound there is something to win, nearest first.
  /// \param bound  of a box  \param query  a face; returns the bound from which there is nothing to win any more
  template <class Bound, class Query>
  void visit(const Bound& bound, const Query& query,
             double maximum = std::numeric_limits<double>::infinity()) const {
    visit_nearest_boxes(
        levels_, kChildren, bound, [&](double nearest) { return nearest <= maximum && !std::isinf(nearest); },
        [&](std::size_t leaf) {
          const std::size_t end = std::min(face_.size(), (leaf + 1) * kLeafFaces);
          for (std::size_t f = leaf * kLeafFaces; f < end; ++f) maximum = std::min(maximum, query(f));
        });
  }

  std::string name_;
  std::vector<Double3> vertex_;
  std::vector<std::array<std::uint32_t, 3>> face_;
  Box3 bounds_;
  double size_ = 0.0;
  std::vector<std::vector<BoxF>> levels_;  ///< levels_[0] of kLeafFaces each; the last has one box
};

}  // namespace

std::unique_ptr<Scene> make_mesh_scene(std::string name, std::vector<Double3> vertices,
                                       std::vector<std::array<std::uint32_t, 3>> faces) {
  return std::make_unique<MeshScene>(std::move(name), std::move(vertices), std::move(faces));
}

}  // namespace tessera::synth
